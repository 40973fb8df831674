"""The only door to sparse factorisation: log-determinants of quadratic forms on graphs, with error estimates."""

from topobelief.linalg.edge_form import EdgeForm, laplacian_form
from topobelief.linalg.log_det import LogDet, LogDetSolver

__all__ = ["EdgeForm", "LogDet", "LogDetSolver", "laplacian_form"]
