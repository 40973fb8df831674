"""Topological signatures: quantities of the graph and of its noise, which do not depend on the poses."""
