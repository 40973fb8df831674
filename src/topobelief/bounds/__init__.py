"""Bounds of the joint entropy: the paper's and Fischer's, as bounds of ln det I and of J."""

from topobelief.bounds.entropy_bounds import Bounds, LogDetBounds, entropy_bounds, log_det_bounds

__all__ = ["Bounds", "LogDetBounds", "entropy_bounds", "log_det_bounds"]
