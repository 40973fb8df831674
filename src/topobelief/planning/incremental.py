"""Signatures, bounds and exact entropies of many actions on one prior: factored once, each action pays for what it touches.

The same quantities as `evaluation`, whose notation holds; `posterior_forms` has the matrices' log-determinants. With equal
noise one Laplacian serves the signature, I_pp and L_r|p.

The family "anchored" (docs, the mathematics, section 8) bounds the increment alone. With I_b the prior extended by the forest
of an action's new poses, exact, and R = U H I_b^-1 H^T U^T of its closures, whose whitened rows U H have positions first,

    ln det I_b + ln det (I + R_pp|r) + ln det (I + R_rr)  <=  ln det I  <=  ln det I_b + ln det (I + R_pp) + ln det (I + R_rr).

I + R is the covariance of what the closures will see. Right: Fischer's inequality. Left: its Schur complement, what is left to
see of the positions when the rotation rows are known, is at least what is left when all rotations are known; then the position
rows are those of I_pp, whose own increment by the closures is ln det (I + R_pp|r). Where nothing is closed, all three meet.

The family "auto" is settled by the first actions whose bounds are asked for: Fischer's bounds of a few of them tell how many
they would leave open, and each of those costs an exact value, about as much as an anchored bound of any action.

Every value has an estimate of its rounding error, by which bounds are widened. Where a factor is not to be trusted, or an
action closes so many loops that its dense part costs more than the graph, the action is evaluated from scratch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import ClassVar

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.paper import require_equal_noise
from topobelief.entropy import LOG_2_PI_E
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import LogDet
from topobelief.linalg.log_det import MAX_ERROR_NATS, UNIT_ROUNDOFF
from topobelief.planning.action_batch import ActionBatch
from topobelief.planning.evaluation import ScratchEvaluation, SignatureName
from topobelief.planning.objectives import ObjectiveName
from topobelief.planning.posterior_forms import Estimates, PosteriorForms, PriorForms
from topobelief.signatures.degree_increments import DegreeEntropy

_MAX_CLOSURE_ROWS = 1500  # a dense Cholesky factor of this size takes as long as a sparse one of a large graph
_SAMPLE_SIZE = 32  # actions whose bounds tell which family to take
_OPEN_SHARE = 0.5  # what Fischer's bounds may leave open: they and so many exact values cost as much as anchored bounds of all
_may_overflow = np.errstate(over="ignore", divide="ignore", invalid="ignore")  # what is not finite is refused


class IncrementalEvaluation:
    """Quantities of many actions on one prior; factors of the prior are kept from one call to the next.

    Parameters
    ----------
    graph
        The prior; connected.
    objective, signature, normalized, family, determinant, anchor
        As for `topobelief.Planner`; `family` is its `bounds`.
    """

    batch_size: ClassVar[int] = 1024  # smaller batches compute the paths that actions share more often

    def __init__(
        self,
        graph: PoseGraph,
        objective: ObjectiveName,
        signature: SignatureName,
        normalized: bool,
        family: str,
        determinant: str,
        anchor: int,
    ) -> None:
        self.graph, self.normalized, self.anchor = graph, normalized, anchor
        self.objective: ObjectiveName = objective
        self.signature: SignatureName = signature
        self.family, self.determinant = family, determinant
        self._given_family = family
        from_scratch = "fischer" if family in ("anchored", "auto") else family
        self._scratch = ScratchEvaluation(graph, objective, signature, normalized, from_scratch, determinant, anchor)
        self._prior = PriorForms(graph, anchor)
        self._current = PosteriorForms(self._prior, ActionBatch(graph, ()))

    def extended(self, graph: PoseGraph, anchor: int) -> IncrementalEvaluation:
        """The same on a graph that has grown out of this one's, whose factors it takes over where it can.

        Parameters
        ----------
        graph
            In the same group; its first poses are those of the graph as it was.
        anchor
        """
        choices = self.objective, self.signature, self.normalized, self._given_family, self.determinant
        grown = IncrementalEvaluation(graph, *choices, anchor)
        grown._prior = PriorForms(graph, anchor, earlier=self._prior)
        grown._current = PosteriorForms(grown._prior, ActionBatch(graph, ()))
        return grown

    @_may_overflow
    def signatures(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """Raw signatures, the larger, the better, and their rounding errors; each of shape (K,).

        Parameters
        ----------
        actions
            Checked against the graph; at least one.
        """
        if self.signature == "von_neumann_approx":
            return self._degree_signatures(ActionBatch(self.graph, tuple(actions)))
        at_once = self._tree_signatures if self.signature == "spanning_trees" else None
        values, errors = self._evaluate(actions, at_once, lambda action: _pair(self._scratch.of(action).signature()))
        return values, errors

    def for_one_decision(self) -> IncrementalEvaluation:
        """One that shares all factors with this, but settles "auto" for itself."""
        return copy(self)

    @_may_overflow
    def bounds(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """LB and UB of the objective, cost excluded, widened by their rounding errors; each of shape (K,)."""
        if self.family == "auto":
            self.family = self._cheaper_family(actions)
        family = {"fischer": self._fischer, "paper": self._paper, "anchored": self._anchored}[self.family]

        def at_once(forms: PosteriorForms) -> FloatArray:
            low, high = family(forms)
            lower, upper = self._objective(high, forms), self._objective(low, forms)
            return np.stack([lower.values - lower.errors, upper.values + upper.errors])

        lower, upper = self._evaluate(actions, at_once, lambda action: self._scratch.of(action).bounds())
        return lower, upper

    @_may_overflow
    def entropies(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """The exact objective, cost excluded, and its rounding error; each of shape (K,).

        Some of the actions that were bounded last by the family "anchored" cost nothing: their bounds took the same increments.

        Raises
        ------
        IllConditionedError
            Where double precision cannot give an entropy to 0.1 nats.
        """

        def at_once(forms: PosteriorForms) -> FloatArray:
            return self._objective(forms.log_dets("joint").whole, forms).rows()

        places = self._current.batch.places(actions)
        if places is not None and self._current.knows("joint"):
            known = at_once(self._current)[:, places]
            if np.isfinite(known).all():
                return known[0], known[1]
        values, errors = self._evaluate(actions, at_once, lambda action: _pair(self._scratch.of(action).entropy()))
        return values, errors

    def _cheaper_family(self, actions: Sequence[Action]) -> str:
        """The family by which a proof is expected to cost less."""
        places: list[int] = np.unique(np.linspace(0, len(actions) - 1, _SAMPLE_SIZE).astype(int)).tolist()
        sample = [actions[place] for place in places]
        trial = self.for_one_decision()
        trial.family = "fischer"
        lower, upper = np.stack(trial.bounds(sample)) + np.array([action.cost for action in sample])
        num_open = np.count_nonzero(lower <= upper.min()) - 1  # without the best
        return "fischer" if num_open <= _OPEN_SHARE * (len(sample) - 1) else "anchored"

    def _evaluate(
        self,
        actions: Sequence[Action],
        at_once: Callable[[PosteriorForms], FloatArray] | None,
        from_scratch: Callable[[Action], tuple[float, float]],
    ) -> FloatArray:
        """Two numbers of each action, shape (2, K); from scratch those that are not to be had at once."""
        results = np.full((2, len(actions)), np.nan)
        kappa = self.graph.tangent_dim
        light = [n for n, action in enumerate(actions) if kappa * action.num_closures <= _MAX_CLOSURE_ROWS]
        if at_once is not None and light:
            chosen = [actions[n] for n in light]
            if not self._current.batch.holds(chosen):
                self._current = PosteriorForms(self._prior, ActionBatch(self.graph, tuple(chosen)))
            results[:, light] = at_once(self._current)
        missing: list[int] = np.flatnonzero(~np.isfinite(results).all(axis=0)).tolist()
        for n in missing:
            results[:, n] = from_scratch(actions[n])
        return results

    # Signatures

    def _tree_signatures(self, forms: PosteriorForms) -> FloatArray:
        whole = forms.weighted_trees(lambda log_dets: log_dets.whole, forms.num_free)
        if self.objective == "map":
            signature = 0.5 * (whole - forms.weighted_trees(lambda log_dets: log_dets.new, forms.batch.num_new))
        else:
            signature = (0.5 * whole).plus(-forms.num_free * self.graph.tangent_dim / 2 * LOG_2_PI_E)
        return self._per_pose(signature, forms).rows()

    def _degree_signatures(self, batch: ActionBatch) -> tuple[FloatArray, FloatArray]:
        num_nodes = self.graph.num_poses + batch.num_new
        values = self._degrees.of_extensions(batch.edges, batch.edge_start, batch.num_new)
        if self.normalized:
            log_dets = self._prior_log_dets + batch.sums(np.linalg.slogdet(batch.information)[1])
            mean = log_dets / np.maximum(self.graph.num_edges + batch.num_edges, 1)
            values = values + (num_nodes - 1) / 2 * (mean - self.graph.tangent_dim * LOG_2_PI_E)
        return values, UNIT_ROUNDOFF * num_nodes.astype(np.float64) * np.maximum(1.0, np.abs(values))

    @cached_property
    def _degrees(self) -> DegreeEntropy:
        return DegreeEntropy(self.graph.topology)

    @cached_property
    def _prior_log_dets(self) -> float:
        return float(np.sum(np.linalg.slogdet(self.graph.information)[1]))

    # Bounds of ln det I: (lower, upper)

    def _fischer(self, forms: PosteriorForms) -> tuple[Estimates, Estimates]:
        if forms.isotropic:
            low = forms.weighted_trees(lambda log_dets: log_dets.whole, forms.num_free)
            positions = float(self.graph.group.position_dim) * forms.log_dets("trees_p").whole
        else:
            positions = forms.log_dets("positions").whole
            low = positions + forms.log_dets("rotations_given_positions").whole
        if self.determinant == "hadamard":
            return low, positions + forms.hadamard("rotations")
        return low, positions + forms.log_dets("rotations").whole

    def _paper(self, forms: PosteriorForms) -> tuple[Estimates, Estimates]:
        require_equal_noise(self._prior.rows.joined(forms.batch.rows))
        k, q = float(self.graph.group.position_dim), float(self.graph.group.rotation_dim)
        low = forms.weighted_trees(lambda log_dets: log_dets.whole, forms.num_free)
        shift = forms.largest_lever_sums
        if self.determinant == "hadamard":
            shifted = forms.hadamard("trees_r", shift=shift)
        else:  # one factor serves the actions that leave Psi as it is
            unchanged = float(self._prior.lever_sums.max(initial=0.0))
            shifted = forms.log_dets("trees_r", shift=unchanged).whole
            shifted = Estimates(np.where(shift == unchanged, shifted.values, np.nan), shifted.errors)
        return low, k * forms.log_dets("trees_p").whole + q * shifted

    def _anchored(self, forms: PosteriorForms) -> tuple[Estimates, Estimates]:
        k = self.graph.group.position_dim
        joint = forms.log_dets("joint", split=k)
        first, others = joint.increments.first_rows, joint.increments.other_rows
        copies, laplacian = (float(k), "trees_p") if forms.isotropic else (1.0, "positions")
        given = copies * forms.log_dets(laplacian).closures
        low = joint.extended_by(given.values + others)
        low = Estimates(low.values, low.errors + given.errors)
        return low, joint.extended_by(first + others)

    def _objective(self, log_det: Estimates, forms: PosteriorForms) -> Estimates:
        """The objective where ln det I is `log_det`; nan where it is not known to `MAX_ERROR_NATS`."""
        num_free, kappa = forms.num_free, self.graph.tangent_dim
        if self.objective == "map":
            log_det, num_free = log_det - forms.new_log_dets("joint"), num_free - forms.batch.num_new
        entropy = (-0.5 * log_det).plus(num_free * kappa / 2 * LOG_2_PI_E)
        entropy = Estimates(np.where(entropy.errors <= MAX_ERROR_NATS, entropy.values, np.nan), entropy.errors)
        return self._per_pose(entropy, forms)

    def _per_pose(self, quantity: Estimates, forms: PosteriorForms) -> Estimates:
        return (1 / np.maximum(forms.num_free, 1)) * quantity if self.objective == "per_pose" else quantity


def _pair(estimate: LogDet) -> tuple[float, float]:
    return estimate.value, estimate.error
