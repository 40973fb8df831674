"""Decisions: objectives, Algorithm 1 of the paper and its proof, and how good a signature's choices are."""
