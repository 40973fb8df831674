"""Log-determinants of the theory's matrices after many actions, from those of the prior (docs, the mathematics, section 7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.information import SAME_NOISE
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import EdgeForm, LogDet, LogDetSolver, laplacian_form
from topobelief.linalg.elimination_paths import FormFactor, KnownColumns, changed_nodes
from topobelief.linalg.elimination_tree import EliminationTree
from topobelief.linalg.increments import Increments, diagonal_increments, log_det_increments
from topobelief.linalg.log_det import UNIT_ROUNDOFF
from topobelief.planning.action_batch import ActionBatch, scalar_weights_of

FormName = Literal["trees_p", "trees_r", "positions", "rotations", "rotations_given_positions", "joint"]
"""Laplacians with the weights w_p and w_r; I_pp, I_rr, L_r|p and I in blocks."""

_HOLD_STRONGEST_ERROR = 1e-6  # nats; below it one more factorisation would not be seen
_STRONG_ROWS_ERROR = 1e-4  # nats; beyond it one more factorisation with strong rows last is worth its time
_APPENDED_SHARE = 0.2  # of the longest path: poses that may follow an old order before a new one pays
_LARGEST_ERROR = 1.0  # nats; a factor that knows less is none
_QR_SIZE = 1200  # up to here an evaluation from scratch may do better, by QR, than a factor
_QR_ERROR = 1e-3  # nats; only beyond it is that worth its time


@dataclass(frozen=True, eq=False, slots=True)
class Estimates:
    """A number for each action with an estimate of its rounding error; nan where there is none to be trusted."""

    values: FloatArray
    errors: FloatArray

    __array_ufunc__: ClassVar[None] = None  # array * Estimates is for `__rmul__`

    def __add__(self, other: Estimates) -> Estimates:
        return Estimates(self.values + other.values, self.errors + other.errors)

    def __sub__(self, other: Estimates) -> Estimates:
        return Estimates(self.values - other.values, self.errors + other.errors)

    def __rmul__(self, factor: float | FloatArray) -> Estimates:
        return Estimates(factor * self.values, np.abs(factor) * self.errors)

    def rows(self) -> FloatArray:
        """Values and errors, shape (2, K)."""
        return np.stack([self.values, self.errors])

    def plus(self, constant: float | FloatArray) -> Estimates:
        """A constant added, with the rounding that the sum costs."""
        values = self.values + constant
        return Estimates(values, self.errors + UNIT_ROUNDOFF * (np.abs(constant) + np.abs(self.values) + np.abs(values)))


@dataclass(frozen=True, eq=False, slots=True)
class FormLogDets:
    """ln det of one form after each action, multiplicity left out.

    Attributes
    ----------
    prior, error
        ln det M of the prior, and the error that all actions have in common.
    increments
        What actions add.
    """

    prior: float
    error: float
    increments: Increments

    @property
    def whole(self) -> Estimates:
        """ln det M'."""
        return self.extended_by(self.increments.closures)

    @property
    def new(self) -> Estimates:
        """ln det of the new poses' block of M'."""
        return Estimates(self.increments.forest + self.increments.closures_held, self.increments.error)

    @property
    def closures(self) -> Estimates:
        """What closures add to ln det of the prior extended by the forests of new poses; exactly 0 where there are none."""
        values = self.increments.closures if math.isfinite(self.prior) else np.full_like(self.increments.closures, np.nan)
        return Estimates(values, np.where(values == 0, 0.0, self.error + self.increments.error))

    def extended_by(self, closures: FloatArray) -> Estimates:
        """ln det of the prior extended by the forests of new poses, plus what closures are said to add."""
        return Estimates(self.prior + self.increments.forest + closures, self.error + self.increments.error)


class PriorForms:
    """The prior's forms, each factored when it is first needed and kept.

    Parameters
    ----------
    graph
        The prior.
    anchor
        The pose that all forms hold.
    earlier
        Those of the graph before it grew, whose orders are kept and from whose factors columns that are still right are copied.
        They are used up by that.
    """

    def __init__(self, graph: PoseGraph, anchor: int, *, earlier: PriorForms | None = None) -> None:
        self.graph, self.anchor = graph, anchor
        self._trees: dict[int, EliminationTree] = {}
        self._bases: dict[int, EliminationTree] = {}  # of the trees that keep an order
        self._factors: dict[tuple[FormName, float], FormFactor] = {}
        self._best: dict[tuple[FormName, float], FormFactor] = {}
        self._earlier = earlier
        if earlier is not None:
            earlier._earlier = None

    @property
    def edges(self) -> IntArray:
        """The prior's edges, shape (m, 2)."""
        return self.graph.edges

    @cached_property
    def rows(self) -> FisherRows:
        """Whitened rows of the prior's edges."""
        return fisher_rows(self.graph)

    @cached_property
    def scalar_weights(self) -> tuple[FloatArray, FloatArray]:
        """(w_p, w_r) of the prior's edges."""
        return scalar_weights_of(self.graph.information)

    @cached_property
    def lever_sums(self) -> FloatArray:
        """Sum of w_p |d|^2 over the edges that leave each pose, shape (n,)."""
        weights = self.scalar_weights[0] * self.rows.squared_lengths()
        return np.bincount(self.graph.edges[:, 0], weights=weights, minlength=self.graph.num_poses).astype(np.float64)

    def factor(self, name: FormName, shift: float) -> FormFactor:
        """The factor of a form plus `shift` times I.

        Where it does not matter which pose is held but rounding does, the one with the strongest rows is, if that is better.
        Where that is not enough, strong rows come last.
        """
        if (name, shift) not in self._best:
            factor, edges, num_nodes = self._plain_factor(name, shift), self.graph.edges, self.graph.num_poses
            if not factor.log_det.error <= _STRONG_ROWS_ERROR:
                form = form_of(name, self)
                apart = FormFactor.with_strong_rows_last(edges, num_nodes, factor.tree.held, form, shift=shift)
                factor = min(factor, apart or factor, key=lambda candidate: candidate.log_det.error)
            self._best[name, shift] = factor
        return self._best[name, shift]

    def _plain_factor(self, name: FormName, shift: float) -> FormFactor:
        if (name, shift) not in self._factors:
            form, invariant = form_of(name, self), not (name == "rotations" or shift)
            old = None if self._earlier is None else self._earlier._factors.pop((name, shift), None)
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
        changed = changed_nodes(form_of(name, self._earlier), form, self.graph.num_poses, (old.tree.held, held))
        return KnownColumns(old, changed)

    def hadamard(self, name: FormName, shift: float) -> LogDet:
        """Sum of ln det of the diagonal blocks."""
        return self._diagonal_solver.hadamard(form_of(name, self), shift=shift)

    def _tree(self, held: int, base: EliminationTree | None = None) -> EliminationTree:
        """The tree with this pose held, in the order of a `base` of the graph as it was unless that has grown too much."""
        if held not in self._trees:
            edges, num_nodes = self.graph.edges, self.graph.num_poses
            tree = None if base is None else base.adapted(edges, num_nodes, held)
            if base is None or tree is None or tree.num_appended > _APPENDED_SHARE * tree.longest_path:
                tree = EliminationTree.build(edges, num_nodes, held)
            else:
                self._bases[held] = base
            self._trees[held] = tree
        return self._trees[held]

    @cached_property
    def _diagonal_solver(self) -> LogDetSolver:
        return LogDetSolver(self.graph.edges, self.graph.num_poses, self.anchor)


class PosteriorForms:
    """The forms after each action of a batch; each is computed when it is first needed and kept.

    Parameters
    ----------
    prior
    batch
        At least one action.
    """

    def __init__(self, prior: PriorForms, batch: ActionBatch) -> None:
        self.prior, self.batch = prior, batch
        self._known: dict[tuple[FormName, float], FormLogDets] = {}

    @cached_property
    def num_free(self) -> IntArray:
        """Free poses after each action, shape (K,)."""
        return self.prior.graph.num_poses - 1 + self.batch.num_new

    @property
    def isotropic(self) -> bool:
        """Whether all noise is block-isotropic, so that I_pp and L_r|p are scalar Laplacians."""
        return self.prior.rows.weights is not None and self.batch.rows.weights is not None

    def log_dets(self, name: FormName, *, shift: float = 0.0, split: int = 0) -> FormLogDets:
        """ln det of a form plus `shift` times I; with `split`, closures in two parts too. nan where it is not to be trusted."""
        known = self._known.get((name, shift))
        if known is None or (split and known.increments.split != split):
            factor = self.prior.factor(name, shift)
            increments = log_det_increments(factor, self.batch.extensions, form_of(name, self.batch), shift=shift, split=split)
            value, error = factor.log_det.value, 2 * factor.log_det.error
            small = factor.tree.num_free * factor.block_size <= _QR_SIZE
            if not error <= (_QR_ERROR if small else _LARGEST_ERROR):
                value = math.nan
            known = self._known[name, shift] = FormLogDets(value, error, increments)
        return known

    def knows(self, name: FormName) -> bool:
        """Whether a form has been computed."""
        return (name, 0.0) in self._known

    def new_log_dets(self, name: FormName) -> Estimates:
        """ln det of the new poses' block of a form, for which the prior need not be factored."""
        if self.knows(name):
            return self.log_dets(name).new
        increments = log_det_increments(None, self.batch.extensions, form_of(name, self.batch))
        return Estimates(increments.forest + increments.closures_held, increments.error)

    def weighted_trees(self, part: Callable[[FormLogDets], Estimates], num_free: IntArray) -> Estimates:
        """k tau_p + q tau_r, or a part of it with `num_free` poses; one Laplacian serves both if w_r / w_p is constant."""
        group = self.prior.graph.group
        k, q = float(group.position_dim), float(group.rotation_dim)
        positions = part(self.log_dets("trees_p"))
        if self._ratio is not None:
            return ((k + q) * positions).plus(num_free.astype(np.float64) * (q * math.log(self._ratio)))
        return k * positions + q * part(self.log_dets("trees_r"))

    def hadamard(self, name: FormName, *, shift: FloatArray | None = None) -> Estimates:
        """Sum of ln det of the diagonal blocks; `shift`, shape (K,), may differ from action to action."""
        shifts = np.zeros(self.batch.count) if shift is None else shift
        distinct, which = np.unique(shifts, return_inverse=True)
        prior = [self.prior.hadamard(name, float(value)) for value in distinct]
        form, held = form_of(name, self.prior), self.prior.anchor
        increments, errors = diagonal_increments(form, held, self.batch.extensions, form_of(name, self.batch), shifts)
        values = np.array([value.value for value in prior])[which] + increments
        return Estimates(values, np.array([value.error for value in prior])[which] + errors)

    @cached_property
    def largest_lever_sums(self) -> FloatArray:
        """w_r Psi: the largest sum of w_p |d|^2 over the edges that leave a pose, after each action; shape (K,)."""
        batch, before, count = self.batch, self.prior.lever_sums, self.batch.count
        sources, action = batch.extensions.edges[:, 0], np.repeat(np.arange(count), batch.num_edges)
        keys, which = np.unique(action * (len(before) + batch.extensions.node_start[-1]) + sources, return_inverse=True)
        weights = batch.scalar_weights[0] * batch.rows.squared_lengths()
        added = np.bincount(which, weights=weights, minlength=len(keys)).astype(np.float64)  # without edges it counts integers
        action, source = np.divmod(keys, len(before) + batch.extensions.node_start[-1])
        old = source < len(before)
        added[old] += before[source[old]]
        largest = np.full(count, before.max(initial=0.0))
        np.maximum.at(largest, action, added)
        return largest

    @cached_property
    def _ratio(self) -> float | None:
        """w_r / w_p where it is the same on all edges of prior and actions, else None."""
        ratios = np.concatenate([w_r / w_p for w_p, w_r in (self.prior.scalar_weights, self.batch.scalar_weights)])
        if len(ratios) == 0:
            return 1.0
        return float(ratios[0]) if np.ptp(ratios) <= SAME_NOISE * ratios[0] else None


def form_of(name: FormName, edges: ActionBatch | PriorForms) -> EdgeForm:
    """A form of the prior's edges or of a batch's; in blocks, whatever the noise. Trees need no rows, which take time."""
    if name in ("trees_p", "trees_r"):
        return laplacian_form(edges.edges, edges.scalar_weights[name == "trees_r"])
    return getattr(replace(edges.rows, weights=None), name)()
