"""The prior's forms, each factored once and shared by all actions."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.forms.action_batch import ActionBatch
from topobelief.forms.degree_sums import DegreeSums
from topobelief.forms.of_topology import weights_of
from topobelief.forms.protocol import FormName, PositionsName
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, Alignment, centring
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.information import log_dets_of_noise
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import EdgeForm, Estimate, LogDetSolver, laplacian_form
from topobelief.linalg.elimination_paths import FormFactor, KnownColumns, changed_nodes
from topobelief.linalg.elimination_tree import EliminationTree
from topobelief.linalg.inverse import Projection, Solutions
from topobelief.linalg.inverse_traces import COMPILED_SIZE
from topobelief.linalg.selected_inverse import projected_trace
from topobelief.linalg.solutions import solutions

SolvedName = Literal["trees_p"] | PositionsName

_HOLD_STRONGEST_ERROR = 1e-6  # nats; below it one more factorisation would make no visible difference
_APPENDED_SHARE = 0.2  # of the longest elimination path: poses appended to an old order beyond which a new order pays


class PriorFactors:
    """The prior's forms, each factored when it is first needed and kept.

    Parameters
    ----------
    graph
        The prior.
    anchor
        The pose that all forms hold.
    earlier
        Those of the graph before it grew, whose orders are kept and from whose factors columns that are still right are copied.
    sample_size
        Over how many poses traces are taken at most.
    """

    def __init__(
        self,
        graph: PoseGraph,
        anchor: int,
        *,
        earlier: PriorFactors | None = None,
        sample_size: int = DEFAULT_SAMPLE_SIZE,
    ) -> None:
        self.graph, self.anchor, self.sample_size = graph, anchor, sample_size
        self._solutions: dict[FormName, Solutions] = {}
        self._traces: dict[FormName, Estimate[float]] = {}
        self._trees: dict[int, EliminationTree] = {}
        self._bases: dict[int, EliminationTree] = {}  # of the trees that keep an order
        self._factors: dict[tuple[FormName, float], FormFactor] = {}
        self._best: dict[tuple[FormName, float], FormFactor] = {}
        self._earlier = None if earlier is None else earlier._without_earlier()

    def _without_earlier(self) -> PriorFactors:
        """The same without those that they came from, so that a graph that grows again and again does not keep them all."""
        alone = copy(self)
        alone._earlier, alone._solutions, alone._traces = None, {}, {}
        return alone

    @property
    def edges(self) -> IntArray:
        """The prior's edges, shape (m, 2)."""
        return self.graph.edges

    @cached_property
    def rows(self) -> FisherRows:
        """Whitened rows of the prior's edges."""
        return fisher_rows(self.graph)

    @property
    def marks(self) -> tuple[BoolArray, BoolArray | None] | None:
        """Which edges lead to landmarks, and which of these carry their pads; None without landmarks."""
        rows = self.rows if self.graph.num_landmarks else None
        return None if rows is None or rows.observing is None else (rows.observing, rows.pads)

    @cached_property
    def scalar_weights(self) -> tuple[FloatArray, FloatArray]:
        """(w_p, w_r) of the prior's edges."""
        return weights_of(self.graph.information)

    @cached_property
    def lever_sums(self) -> FloatArray:
        """Sum of w_p |d|^2 over the edges that leave each pose, shape (n,)."""
        weights = self.scalar_weights[0] * self.rows.squared_lengths()
        return np.bincount(self.graph.edges[:, 0], weights=weights, minlength=self.graph.num_nodes).astype(np.float64)

    @cached_property
    def degrees(self) -> DegreeSums:
        """Degree sums of the graph and its extensions."""
        return DegreeSums(self.graph.topology)

    @cached_property
    def log_noise(self) -> float:
        """Sum over the prior's edges of ln |Omega|."""
        return float(np.sum(log_dets_of_noise(self.graph.information)))

    def factor(self, name: FormName, shift: float) -> FormFactor:
        """The factor of a form plus `shift` times I.

        Where it does not matter which pose is held but rounding does, the one with the strongest rows is, if that is better.
        Where that is not enough, strong rows come last.
        """
        if (name, shift) not in self._best:
            factor = self._plain_factor(name, shift)
            self._best[name, shift] = factor.or_with_strong_rows_last(form_of(name, self), shift=shift)
        return self._best[name, shift]

    def _plain_factor(self, name: FormName, shift: float) -> FormFactor:
        """Of which a grown graph may copy columns."""
        if (name, shift) not in self._factors:
            form, invariant = form_of(name, self), not (name == "rotations" or shift)
            old = None if self._earlier is None else self._earlier._factors.get((name, shift))
            held = self.anchor if old is None or not invariant else old.tree.held
            tree = self._tree(held, None if old is None else old.tree)
            factor = FormFactor.of(tree, form, shift=shift, known=self._known_columns(name, form, old, held))
            strongest = form.strongest_node()
            if invariant and not factor.log_det.error <= _HOLD_STRONGEST_ERROR and strongest != held:
                best_held = FormFactor.of(self._tree(strongest), form)
                factor = min(factor, best_held, key=lambda candidate: candidate.log_det.error)
            self._factors[name, shift] = factor
        return self._factors[name, shift]

    def _known_columns(self, name: FormName, form: EdgeForm, old: FormFactor | None, held: int) -> KnownColumns | None:
        if old is None or self._earlier is None or self._bases.get(held) is not old.tree:
            return None
        changed = changed_nodes(form_of(name, self._earlier), form, self.graph.num_nodes, (old.tree.held, held))
        return KnownColumns(old, changed)

    def solutions(self, name: SolvedName) -> Solutions:
        """M^-1 C of the columns of a projection of positions: Pi, or Pi_n for trees, and tr(C^T M^-1 C)."""
        if name not in self._solutions:
            factor, projection = self.factor(name, 0.0), self.projection(name)
            self._solutions[name] = solutions(factor, projection.nodes, projection.columns(factor.block_size))
        return self._solutions[name]

    def trace(self, name: SolvedName) -> Estimate[float]:
        """tr(C^T M^-1 C) of the same columns; of large graphs without the solutions, while nobody has asked for these."""
        factor = self.factor(name, 0.0)
        if name in self._solutions or factor.tree.num_free * factor.block_size <= COMPILED_SIZE:
            return self.solutions(name).trace
        if name not in self._traces:
            self._traces[name] = projected_trace(factor, self.projection(name))
        return self._traces[name]

    def projection(self, name: SolvedName) -> Projection:
        """What traces are taken with."""
        return centring(self.alignment.nodes) if name == "trees_p" else self.alignment.projection

    @cached_property
    def alignment(self) -> Alignment:
        """Pi of the sample of the prior's poses."""
        return Alignment.of(self.graph.positions, self.sample_size)

    def hadamard(self, name: FormName, shift: float) -> Estimate[float]:
        """Sum of ln det of the diagonal blocks."""
        return self._diagonal_solver.hadamard(form_of(name, self), shift=shift)

    def _tree(self, held: int, base: EliminationTree | None = None) -> EliminationTree:
        """The tree with this pose held, in the order of a `base` of the graph as it was unless that has grown too much."""
        if held not in self._trees:
            edges, num_nodes = self.graph.edges, self.graph.num_nodes
            tree = None if base is None else base.adapted(edges, num_nodes, held)
            if base is None or tree is None or tree.num_appended > _APPENDED_SHARE * tree.longest_path:
                tree = EliminationTree.build(edges, num_nodes, held)
            else:
                self._bases[held] = base
            self._trees[held] = tree
        return self._trees[held]

    @cached_property
    def _diagonal_solver(self) -> LogDetSolver:
        return LogDetSolver(self.graph.edges, self.graph.num_nodes, self.anchor)


def form_of(name: FormName, edges: ActionBatch | PriorFactors) -> EdgeForm:
    """A form of the prior's edges or of a batch's; in blocks, whatever the noise. Trees need no rows, which take time."""
    if name in ("trees_p", "trees_r"):
        form = laplacian_form(edges.edges, edges.scalar_weights[name == "trees_r"])
        return form.padded(*edges.marks, 1) if name == "trees_r" and edges.marks else form
    return getattr(replace(edges.rows, weights=None), name)()
