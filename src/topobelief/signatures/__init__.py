"""Topological signatures: quantities of the graph and of its noise, blind to where the poses are."""
