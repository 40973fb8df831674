"""Candidate actions: a roadmap, diverse paths on it, and the factors that driving them would add to the graph."""
