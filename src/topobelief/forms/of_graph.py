"""The forms after one action, from scratch: the reference for the faster engine."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.forms.of_topology import mean_log_noise, mean_resistance, weights_of
from topobelief.forms.protocol import FormName, Forms, Part, PositionsName, RotationsName
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, Alignment, sample_of
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology
from topobelief.linalg import EdgeForm, Estimate, LogDetSolver
from topobelief.linalg.inverse import InverseSolver, Solutions
from topobelief.linalg.inverse_traces import inverse_traces, is_compiled
from topobelief.linalg.shear import moved_rotations, sheared_log_det

_RATIO_SAFETY = 4.0  # the directions that were looked at may not contain the worst one


class GraphForms(Forms[float]):
    """The forms of one graph; each is factored when it is first needed and kept.

    Parameters
    ----------
    graph
        Connected; after the action.
    anchor
        The pose that is held.
    prior
        The graph before the action, whose poses and edges come first. Default: the graph itself.
    prior_rows
        Its whitened rows, where they are known.
    sample_size
        Over how many of its poses traces are taken at most.
    """

    def __init__(
        self,
        graph: PoseGraph,
        *,
        anchor: int,
        prior: PoseGraph | None = None,
        prior_rows: FisherRows | None = None,
        sample_size: int = DEFAULT_SAMPLE_SIZE,
    ) -> None:
        self.graph, self.anchor, self._sample_size = graph, anchor, sample_size
        self._prior, self._prior_rows = graph if prior is None else prior, prior_rows
        self._solvers: dict[int, LogDetSolver] = {}
        self._known: dict[tuple[FormName, float, Part], Estimate[float]] = {}
        self._traces: dict[PositionsName, Estimate[float]] = {}

    @property
    def tangent_dim(self) -> int:
        return self.graph.tangent_dim

    @property
    def num_existing(self) -> int:
        return self._prior.num_nodes

    @property
    def landmarks(self) -> BoolArray:
        return self._prior.is_landmark

    @property
    def num_new(self) -> float:
        return float(self.graph.num_nodes - self._prior.num_nodes)

    def of_topology(self, quantity: Callable[[Topology], float]) -> float:
        return quantity(self.graph.topology)

    def degree_sum(self) -> float:
        return self.graph.topology.degree_sum

    def mean_log_noise(self) -> float:
        return mean_log_noise(self.graph.information)

    @property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        return self._weights

    @property
    def isotropic(self) -> bool:
        return self._rows.weights is not None

    def largest_lever_sum(self) -> float:
        sums = np.bincount(self.graph.edges[:, 0], weights=self.weights[0] * self._rows.squared_lengths())
        return float(sums.max(initial=0.0))

    def log_det(self, form: FormName, *, shift: float = 0.0, part: Part = "all") -> Estimate[float]:
        key = form, shift, part
        if key not in self._known:
            if part == "new":
                self._known[key] = self._of_new_poses(form)
            else:
                self._known[key] = self._of_all_poses(form, shift) if part == "all" else self._with_held(form, part)
        return self._known[key]

    def hadamard(self, form: FormName, *, shift: float = 0.0) -> Estimate[float]:
        return self._solver(self.anchor).hadamard(self._form(form, self._rows), shift=shift)

    def sheared_rotations(self, step: float, *, hadamard: bool) -> Estimate[float]:
        return sheared_log_det(self._rows.joint(), self.split[0], self.graph.num_nodes, self.anchor, step, hadamard=hadamard)

    def mean_resistance(self) -> Estimate[float]:
        laplacian = self._form("trees_p", self._rows)
        return mean_resistance(laplacian, self.graph.num_nodes, sample_of(self.num_existing, self._sample_size))

    def aligned_trace(self, form: PositionsName) -> Estimate[float]:
        if form not in self._traces:
            self._traces[form] = 1 / self._alignment.count * self._aligned(form)
        return self._traces[form]

    def _aligned(self, name: PositionsName) -> Estimate[float]:
        if name == "positions":
            return self._positions[1].trace
        form, alignment = _blocks(self._rows, name), self._alignment
        [trace] = inverse_traces(form, self.graph.num_nodes, [alignment.projection])
        return trace

    def coupled_trace(self, rotations: RotationsName) -> Estimate[float]:
        """Errors: that of K by itself; that of I_pp moves N^T Pi by up to sqrt(c) times as much, c the largest ratio seen."""
        columns, along = self._positions
        moved = moved_rotations(self._rows.joint(), self.split[0], along.values)
        solver = InverseSolver(self.graph.edges, self.graph.num_nodes, self.anchor)
        found = solver.solve(_blocks(self._rows, rotations), moved)
        before, added = (np.sum(z * a, axis=(0, 1)) for z, a in ((along.values, columns), (found.values, moved)))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = 1.0 + _RATIO_SAFETY * float(np.max(added / before, initial=0.0, where=before > 0))
        trace = found.trace
        error = trace.error + 2 * along.relative_error * math.sqrt(max(0.0, ratio * along.trace.value * trace.value))
        return 1 / self._alignment.count * Estimate(trace.value, error)

    @property
    def has_fast_traces(self) -> bool:
        return is_compiled(self.graph.num_nodes * self.tangent_dim)

    def knows(self, form: FormName) -> bool:
        return (form, 0.0, "all") in self._known

    def knows_trace(self, form: PositionsName) -> bool:
        return form in self._traces

    @cached_property
    def _positions(self) -> tuple[FloatArray, Solutions]:
        """Columns Pi on all poses, and what I_pp^-1 makes of them."""
        form = _blocks(self._rows, "positions")
        columns = np.zeros((self.graph.num_nodes, form.block_size, self._alignment.count * self.split[0]))
        columns[self._alignment.nodes] = self._alignment.projection.columns(form.block_size)
        solver = InverseSolver(self.graph.edges, self.graph.num_nodes, form.strongest_node())
        return columns, solver.solve(form, columns)

    @cached_property
    def _alignment(self) -> Alignment:
        return Alignment.of(self._prior.positions, self._sample_size)

    @property
    def increments(self) -> None:
        return None

    def _of_all_poses(self, name: FormName, shift: float) -> Estimate[float]:
        form = self._form(name, self._rows)
        strongest = name == "joint" and not shift  # the information matrix may be worst conditioned: its strongest pose is held
        return self._solver(form.strongest_node() if strongest else self.anchor).log_det(form, shift=shift)

    def _of_new_poses(self, name: FormName) -> Estimate[float]:
        if self.num_new == 0:
            return Estimate(0.0, 0.0)
        form = self._form(name, self._new_rows)
        return LogDetSolver(form.edges, self.graph.num_nodes, np.arange(self.num_existing)).log_det(form)

    def _with_held(self, name: FormName, held: tuple[int, ...]) -> Estimate[float]:
        return LogDetSolver(self.graph.edges, self.graph.num_nodes, np.array(held)).log_det(self._form(name, self._rows))

    def _form(self, name: FormName, rows: FisherRows) -> EdgeForm:
        if name in ("trees_p", "trees_r"):
            rotations = name == "trees_r"
            return rows.trees(self.weights[rotations][self.graph.num_edges - len(rows.edges) :], rotations=rotations)
        return getattr(rows, name)()

    def _solver(self, held: int) -> LogDetSolver:
        """Forms of one block size share its ordering and symbolic factor."""
        if held not in self._solvers:
            self._solvers[held] = LogDetSolver(self.graph.edges, self.graph.num_nodes, held)
        return self._solvers[held]

    @cached_property
    def _weights(self) -> tuple[FloatArray, FloatArray]:
        return weights_of(self.graph.information)

    @cached_property
    def _new_rows(self) -> FisherRows:
        return fisher_rows(self.graph, first_edge=self._prior.num_edges)

    @cached_property
    def _rows(self) -> FisherRows:
        if self._prior is self.graph:
            return fisher_rows(self.graph)
        prior = fisher_rows(self._prior) if self._prior_rows is None else self._prior_rows
        return prior.joined(self._new_rows)


def _blocks(rows: FisherRows, name: PositionsName | RotationsName) -> EdgeForm:
    """A form in blocks of all variables of a pose, whatever the noise."""
    return getattr(replace(rows, weights=None), name)()
