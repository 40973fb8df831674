"""Trees of one graph of which topology and noise are known, from scratch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.forms.protocol import Part, TreeForms, TreeName
from topobelief.graph.information import isotropic_weights, scalar_weights
from topobelief.graph.topology import Topology
from topobelief.linalg import Estimate, LogDetSolver, laplacian_form


class TopologyForms(TreeForms[float]):
    """Trees of one graph.

    Parameters
    ----------
    topology
        Connected.
    information : shape (num_edges, kappa, kappa)
    """

    def __init__(self, topology: Topology, information: FloatArray) -> None:
        self._topology, self._information, self._weights = topology, information, weights_of(information)
        self._solver = LogDetSolver(topology.edges, topology.num_nodes, 0)

    @property
    def tangent_dim(self) -> int:
        return int(self._information.shape[-1])

    @property
    def num_existing(self) -> int:
        return self._topology.num_nodes

    @property
    def num_new(self) -> float:
        return 0.0

    def of_topology(self, quantity: Callable[[Topology], float]) -> float:
        return quantity(self._topology)

    def degree_sum(self) -> float:
        return self._topology.degree_sum

    def mean_log_noise(self) -> float:
        return mean_log_noise(self._information)

    @property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        return self._weights

    def log_det(self, form: TreeName, *, shift: float = 0.0, part: Part = "all") -> Estimate[float]:
        if part == "new":
            return Estimate(0.0, 0.0)
        rows = laplacian_form(self._topology.edges, self.weights[form == "trees_r"])
        return self._solver.log_det(rows, shift=shift)


def weights_of(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(w_p, w_r) of edges, as spanning-tree signatures take them; block-isotropic noise has its own."""
    return isotropic_weights(information) or scalar_weights(information)


def mean_log_noise(information: FloatArray) -> float:
    """Mean over the edges of ln |Omega|; 0 without edges."""
    return float(np.linalg.slogdet(information)[1].mean()) if len(information) else 0.0
