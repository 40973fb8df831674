"""The best walk of a whole roadmap, and how much better any other could be."""
