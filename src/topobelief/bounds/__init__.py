"""Bounds of ln det I, and so of the entropy: one file per family, each written in terms of forms."""

from topobelief.bounds.entropy_bounds import Bounds, entropy_bounds

__all__ = ["Bounds", "entropy_bounds"]
