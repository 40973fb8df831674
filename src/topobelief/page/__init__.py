"""A page for decisions: the map, the ways, and why; served while questions are asked, or saved as one file."""
