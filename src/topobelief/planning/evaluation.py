"""Signatures, bounds and exact entropies of actions, each from scratch on the posterior graph.

The reference for everything faster: every quantity is that of `posterior(graph, action)`. Only what all actions share, the
prior's whitened rows, is computed once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal, Protocol

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds import log_det_bounds
from topobelief.graph.action import Action, posterior
from topobelief.graph.fisher import FisherRows, fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import LogDet, LogDetSolver
from topobelief.linalg.log_det import UNIT_ROUNDOFF
from topobelief.planning.objectives import ObjectiveName, PosteriorSize, objective_value
from topobelief.signatures.spanning_trees import map_signature_estimate, spanning_tree_estimate
from topobelief.signatures.von_neumann import von_neumann_entropy, von_neumann_entropy_approx

SignatureName = Literal["spanning_trees", "von_neumann", "von_neumann_approx"]


class PosteriorEvaluation:
    """One action's posterior; what several quantities share is computed once.

    Parameters
    ----------
    graph
        The prior.
    prior_rows
        Its whitened rows.
    action
        Checked against the prior.
    anchor
        The pose that bounds hold.
    """

    def __init__(self, graph: PoseGraph, prior_rows: FisherRows, action: Action, anchor: int) -> None:
        self._prior, self._prior_rows, self._anchor = graph, prior_rows, anchor
        self._posterior = posterior(graph, action)

    @cached_property
    def _new_rows(self) -> FisherRows:
        return fisher_rows(self._posterior, first_edge=self._prior.num_edges)

    @cached_property
    def _rows(self) -> FisherRows:
        return self._prior_rows.joined(self._new_rows)

    def size(self, objective: ObjectiveName) -> PosteriorSize:
        """What the objective needs besides ln det I."""
        num_existing, tangent_dim = self._prior.num_poses, self._prior.tangent_dim
        num_new = self._posterior.num_poses - num_existing
        if objective != "map" or num_new == 0:
            return PosteriorSize(num_existing, num_new, tangent_dim)
        solver = LogDetSolver(self._new_rows.edges, self._posterior.num_poses, np.arange(num_existing))
        return PosteriorSize(num_existing, num_new, tangent_dim, solver.log_det(self._new_rows.joint()))

    @cached_property
    def _solver(self) -> LogDetSolver:
        """Holds the anchor; signature and bounds share its ordering and symbolic factors."""
        return LogDetSolver(self._rows.edges, self._posterior.num_poses, self._anchor)

    def signature(self, name: SignatureName, objective: ObjectiveName, *, normalized: bool) -> LogDet:
        """The raw signature; for spanning trees the one that belongs to the objective."""
        topology, information = self._posterior.topology, self._posterior.information
        if name == "von_neumann":
            return _rounded(von_neumann_entropy(topology), topology.num_nodes)
        if name == "von_neumann_approx":
            value = von_neumann_entropy_approx(topology, information=information if normalized else None)
            return _rounded(value, topology.num_nodes)
        if objective == "map":
            existing = np.arange(self._prior.num_poses)
            new_solver = LogDetSolver(topology.edges, topology.num_nodes, existing)
            return map_signature_estimate(topology, information, self._solver, new_solver)
        joint = spanning_tree_estimate(topology, information, self._solver)
        num_free = topology.num_nodes - 1
        return (1 / num_free) * joint if objective == "per_pose" and num_free else joint

    def bounds(self, family: str, determinant: str, objective: ObjectiveName) -> tuple[LogDet, LogDet]:
        """(lower, upper) bounds of the objective."""
        bounds = log_det_bounds(self._rows, self._solver, family=family, determinant=determinant)
        size = self.size(objective)
        return objective_value(objective, bounds.upper, size), objective_value(objective, bounds.lower, size)

    def entropy(self, objective: ObjectiveName) -> LogDet:
        """The exact objective."""
        form = self._rows.joint()
        solver = LogDetSolver(self._rows.edges, self._posterior.num_poses, form.strongest_node())
        return objective_value(objective, solver.log_det(form), self.size(objective))


class Evaluation(Protocol):
    """Quantities of actions on one prior, however they are computed; parameters as for `topobelief.Planner`."""

    batch_size: ClassVar[int]
    """Actions that are best asked for together."""

    @property
    def graph(self) -> PoseGraph: ...
    @property
    def objective(self) -> ObjectiveName: ...
    @property
    def signature(self) -> SignatureName: ...
    @property
    def family(self) -> str: ...
    @property
    def determinant(self) -> str: ...
    def signatures(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """Raw signatures, the larger, the better, and their rounding errors; each of shape (K,)."""
        ...

    def bounds(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """LB and UB of the objective, cost excluded, widened by their rounding errors; each of shape (K,)."""
        ...

    def entropies(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """The exact objective, cost excluded, and its rounding error; each of shape (K,)."""
        ...


@dataclass
class ScratchEvaluation:
    """Quantities of any action on one prior, from scratch.

    Parameters
    ----------
    graph
        The prior; connected.
    objective, signature, normalized, family, determinant, anchor
        As for `topobelief.Planner`.
    """

    graph: PoseGraph
    objective: ObjectiveName
    signature: SignatureName
    normalized: bool
    family: str
    determinant: str
    anchor: int
    _kept: tuple[Action, ActionEvaluation] | None = field(default=None, init=False, repr=False)

    batch_size: ClassVar[int] = 1

    @cached_property
    def _prior_rows(self) -> FisherRows:
        return fisher_rows(self.graph)

    def of(self, action: Action) -> ActionEvaluation:
        """The quantities of one action, computed when asked for."""
        return ActionEvaluation(self, PosteriorEvaluation(self.graph, self._prior_rows, action, self.anchor))

    def signatures(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """Raw signatures, the larger, the better, and their rounding errors; each of shape (K,)."""
        return _columns(_pair(self._latest(action).signature()) for action in actions)

    def bounds(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """LB and UB of the objective, cost excluded, widened by their rounding errors; each of shape (K,)."""
        return _columns(self._latest(action).bounds() for action in actions)

    def entropies(self, actions: Sequence[Action]) -> tuple[FloatArray, FloatArray]:
        """The exact objective, cost excluded, and its rounding error; each of shape (K,)."""
        return _columns(_pair(self._latest(action).entropy()) for action in actions)

    def _latest(self, action: Action) -> ActionEvaluation:
        """The quantities of an action; those of the last one asked for are kept, so that a signature and bounds share them."""
        if self._kept is None or self._kept[0] is not action:
            self._kept = (action, self.of(action))
        return self._kept[1]


@dataclass(frozen=True, slots=True)
class ActionEvaluation:
    """What a decision asks of one action."""

    session: ScratchEvaluation
    posterior: PosteriorEvaluation

    def signature(self) -> LogDet:
        """Raw signature with its rounding error; the larger, the better."""
        session = self.session
        return self.posterior.signature(session.signature, session.objective, normalized=session.normalized)

    def bounds(self) -> tuple[float, float]:
        """LB and UB of the objective, cost excluded, widened by their rounding errors."""
        session = self.session
        lower, upper = self.posterior.bounds(session.family, session.determinant, session.objective)
        return lower.value - lower.error, upper.value + upper.error

    def entropy(self) -> LogDet:
        """The exact objective, cost excluded, with its rounding error."""
        return self.posterior.entropy(self.session.objective)


def _rounded(value: float, num_terms: int) -> LogDet:
    """A sum of `num_terms` terms of one sign, with its rounding error."""
    return LogDet(value, UNIT_ROUNDOFF * num_terms * max(1.0, abs(value)))


def _pair(quantity: LogDet) -> tuple[float, float]:
    return quantity.value, quantity.error


def _columns(pairs: Iterable[tuple[float, float]]) -> tuple[FloatArray, FloatArray]:
    first, second = np.array(list(pairs), dtype=np.float64).reshape(-1, 2).T
    return first, second
