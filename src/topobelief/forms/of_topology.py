"""Trees of one graph of which topology and noise are known, from scratch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.forms.protocol import Part, TreeForms, TreeName
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, centring, sample_of
from topobelief.graph.information import isotropic_weights, log_dets_of_noise, scalar_weights
from topobelief.graph.topology import Topology
from topobelief.graph.variable_kinds import first_edges_of
from topobelief.linalg import EdgeForm, Estimate, LogDetSolver, laplacian_form
from topobelief.linalg.inverse_traces import inverse_traces


class TopologyForms(TreeForms[float]):
    """Trees of one graph.

    Parameters
    ----------
    topology
        Connected.
    information : shape (num_edges, kappa, kappa)
    existing
        Nodes, the first ones, that existed before an action. Default: all.
    landmarks : shape (num_nodes,)
        Which nodes are landmarks, second ends of their edges. Default: none.
    sample_size
        How many of them traces are taken over at most.
    """

    def __init__(
        self,
        topology: Topology,
        information: FloatArray,
        *,
        existing: int | None = None,
        landmarks: BoolArray | None = None,
        sample_size: int = DEFAULT_SAMPLE_SIZE,
    ) -> None:
        self._existing = topology.num_nodes if existing is None else existing
        self._landmarks = np.zeros(topology.num_nodes, dtype=np.bool_) if landmarks is None else landmarks
        self._sample_size = sample_size
        self._topology, self._information, self._weights = topology, information, weights_of(information)
        self._solver = LogDetSolver(topology.edges, topology.num_nodes, int(np.argmin(self._landmarks)))

    @property
    def tangent_dim(self) -> int:
        return int(self._information.shape[-1])

    @property
    def num_existing(self) -> int:
        return self._existing

    @property
    def landmarks(self) -> BoolArray:
        return self._landmarks[: self._existing]

    @property
    def num_new(self) -> float:
        return float(self._topology.num_nodes - self._existing)

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
        rows = laplacian_form(self._topology.edges, self.weights[form == "trees_r"])
        if form == "trees_r" and self._landmarks.any():
            targets = self._topology.edges[:, 1]
            rows = rows.padded(self._landmarks[targets], first_edges_of(self._landmarks, targets), 1)
        if part == "new":
            held = np.arange(self._existing)
            return LogDetSolver(self._topology.edges, self._topology.num_nodes, held).log_det(rows)
        return self._solver.log_det(rows, shift=shift)

    def mean_resistance(self) -> Estimate[float]:
        rows = laplacian_form(self._topology.edges, self.weights[0])
        return mean_resistance(rows, self._topology.num_nodes, sample_of(self._existing, self._sample_size))


def mean_resistance(laplacian: EdgeForm, num_nodes: int, sample: IntArray) -> Estimate[float]:
    """1/|S| tr(Pi_n L^-1 Pi_n) over a sample S of the nodes, from scratch."""
    [trace] = inverse_traces(laplacian, num_nodes, [centring(sample)])
    return 1 / len(sample) * trace


def weights_of(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(w_p, w_r) of edges, as spanning-tree signatures take them; block-isotropic noise has its own."""
    return isotropic_weights(information) or scalar_weights(information)


def mean_log_noise(information: FloatArray) -> float:
    """Mean over the edges of ln |Omega|; 0 without edges."""
    return float(log_dets_of_noise(information).mean()) if len(information) else 0.0
