"""Graphs: their topology, their poses and noise, and the actions that would extend them."""
