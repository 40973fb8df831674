"""Everything that factors sparse matrices: log-determinants of quadratic forms on graphs, with error estimates."""

from topobelief.linalg.edge_form import EdgeForm, laplacian_form
from topobelief.linalg.estimate import Estimate
from topobelief.linalg.log_det import LogDetSolver

__all__ = ["EdgeForm", "Estimate", "LogDetSolver", "laplacian_form"]
