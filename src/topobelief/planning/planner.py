"""Algorithm 1 of Kitanov and Indelman (arXiv 1903.00927) and the search that proves its choice.

Notation: s signature, U^ = argmax s, LB and UB the bounds of the objective J plus the action's cost.

    margin given:      U^ alone if UB(U^) < margin, else all actions in ranking order
    margin not given:  Delta J_max = max(0, UB(U^) - min of LB over the others),   A = {U : LB(U) <= UB(U^)} and U^

The paper has < in A; where bounds meet, a strict test would lose the winner. The theorem holds for any U^, so for one chosen
by a von Neumann signature too. The proof evaluates J along the ranking and skips what its lower bound rules out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.entropy_bounds import Determinant
from topobelief.bounds.paper import require_equal_noise
from topobelief.errors import InvalidActionError, InvalidGraphError, InvalidInputError, require_choice
from topobelief.graph.action import Action, check_actions, posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.fit import warn_of_misfit
from topobelief.graph.information import SAME_NOISE, shared_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import checked_anchor
from topobelief.planning.decision import Decision
from topobelief.planning.evaluation import Evaluation, ScratchEvaluation, SignatureName
from topobelief.planning.objectives import ObjectiveName
from topobelief.planning.search import Clock, Progress, Search, named_quantity
from topobelief.signatures.von_neumann import DENSE_SPECTRUM_SIZE, expected_spectrum_seconds

if TYPE_CHECKING:
    from topobelief.planning.incremental import IncrementalEvaluation

_INCREMENTAL_WORK = 250_000  # actions times edges of the prior from which increments pay

BoundsName = Literal["paper", "fischer", "anchored", "auto"]
Proof = Literal["none", "bounded", "optimal"]


class Planner:
    """Chooses among actions on one pose graph.

    Parameters
    ----------
    graph
        The robot's belief; connected, at its maximum-likelihood estimate (`topobelief.optimize`).
    objective
        "joint": entropy of all poses after the action, the paper's. "map": of the poses that exist now, free of units and
        recommended where paths differ in length. "per_pose": joint over the number of free poses.
    signature
        What ranks the actions: "spanning_trees", "von_neumann" (dense spectrum) or "von_neumann_approx" (degrees).
    bounds
        Family of bounds: "fischer" (any noise), "paper" (one block-isotropic Omega) or "anchored" (any noise: exact prior,
        bounded increment; far tighter, and about as dear as exact values; needs the extra `fast`). "auto": anchored where
        many actions are evaluated by increments and Fischer's bounds of some of them leave more than half open, else
        Fischer's; the decision says which.
    determinant
        "cholesky" or "hadamard" (looser, cheaper), in the lower bound of J.
    anchor
        Pose that the bounds hold. Default: the last one, where the robot is.
    normalized
        Add the noise normalisation of s_ST to "von_neumann_approx" (the paper's last remark).
    allow_dense_spectrum
        Let "von_neumann" run above 3000 poses, at O(n^3) an action.

    Raises
    ------
    InvalidInputError
        For an unknown choice, or a dense spectrum that was not asked for twice.
    DisconnectedGraphError
        Names the poses that the anchor does not reach.

    Warns
    -----
    NotOptimizedWarning
        Where the graph is far from its estimate (chi^2 per degree of freedom above 100).

    Examples
    --------
    >>> prior = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.eye(3) * 100)
    >>> explore = Action([[3, 0, 0]], [(2, 3)], np.eye(3) * 100, label="explore")
    >>> revisit = Action([[1, 1, 0]], [(2, 3), (3, 1), (3, 0)], np.eye(3) * 100, label="revisit")
    >>> decision = Planner(prior).decide([explore, revisit])
    >>> decision.best, decision.proven_optimal
    (1, True)
    """

    def __init__(
        self,
        graph: PoseGraph,
        *,
        objective: ObjectiveName = "joint",
        signature: SignatureName = "spanning_trees",
        bounds: BoundsName = "fischer",
        determinant: Determinant = "cholesky",
        anchor: int | None = None,
        normalized: bool = False,
        allow_dense_spectrum: bool = False,
    ) -> None:
        require_choice("objective", objective, get_args(ObjectiveName))
        require_choice("signature", signature, get_args(SignatureName))
        require_choice("bounds", bounds, get_args(BoundsName))
        require_choice("determinant", determinant, get_args(Determinant))
        self._largest_spectrum = DENSE_SPECTRUM_SIZE if signature == "von_neumann" and not allow_dense_spectrum else math.inf
        if bounds == "anchored" and not _has_kernels():
            raise InvalidInputError(
                "bounds=\"anchored\" expects numba to be installed, got none; run pip install 'topobelief[fast]'"
            )
        self._bounds: BoundsName = bounds
        self._given_anchor = anchor
        self._choices = (objective, signature, normalized)
        self._determinant: Determinant = determinant
        self._take(graph)
        warn_of_misfit(graph)
        self._scratch: ScratchEvaluation | None = None
        self._incremental: IncrementalEvaluation | None = None

    def _take(self, graph: PoseGraph) -> None:
        """Check a prior and plan on it from now on."""
        anchor = graph.num_poses - 1 if self._given_anchor is None else checked_anchor(graph.num_poses, self._given_anchor)
        graph.topology.require_connected(anchor=anchor, names=graph.ids)
        self._refuse_dense_spectrum(graph.num_poses)
        if self._bounds == "paper":
            require_equal_noise(fisher_rows(graph))
        self._graph, self._anchor = graph, anchor

    @property
    def graph(self) -> PoseGraph:
        """The prior."""
        return self._graph

    def extend(self, graph: PoseGraph) -> Planner:
        """Plan on a graph that has grown: the chosen path was driven, or new measurements came in.

        What the planner factored is taken over where it can be (docs, the mathematics, section 7): orders of elimination, and
        those parts of each factor below which nothing has changed. Topological ones survive a new estimate; those of the
        information matrix where poses have not moved.

        Parameters
        ----------
        graph
            Its first poses and edges are those of the graph as it was, at any poses. Other graphs are valid, and start anew.
            Unless an anchor was given, the new last pose is held.

        Returns
        -------
        Planner
            This one.

        Raises
        ------
        InvalidInputError, DisconnectedGraphError, InvalidGraphError
            As for the planner; it then still plans on the graph as it was.

        Examples
        --------
        >>> prior = PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3) * 100)
        >>> planner = Planner(prior)
        >>> ahead = Action([[2, 0, 0]], [(1, 2)], np.eye(3) * 100)
        >>> planner.extend(posterior(prior, ahead)).graph.num_poses
        3
        """
        before = self._graph
        self._take(graph)
        self._scratch = None
        if self._incremental is not None:
            grown = graph.group is before.group and graph.num_poses >= before.num_poses
            self._incremental = self._incremental.extended(graph, self._anchor) if grown else None
        return self

    def decide(
        self,
        actions: Sequence[Action],
        *,
        margin: float | None = None,
        proof: Proof = "bounded",
        max_evaluations: int | None = None,
        deadline: float | None = None,
        on_progress: Progress | None = None,
    ) -> Decision:
        """Choose one of the actions.

        Parameters
        ----------
        actions
            At least one.
        margin
            Uncertainty that is good enough, nats, cost included: Algorithm 1's first branch, one upper bound.
        proof
            "none": signatures only. "bounded": bounds of all actions. "optimal": exact evaluations along the ranking until
            no bound is below the best value found.
        max_evaluations
            Stop the proof after this many exact evaluations, with the certificate reached.
        deadline
            Seconds from now, checked between actions. A ranking always comes back; bounds and evaluations may be missing.
        on_progress
            Called after each action of each stage.

        Returns
        -------
        Decision

        Raises
        ------
        InvalidActionError
            Names the first malformed action and its edge; for no actions at all. Nothing is computed before.
        InvalidInputError
            For a margin together with a proof of optimality, or a limit that is not a number above zero.
        InvalidGraphError
            Where the paper's bounds meet noise that they do not cover.
        IllConditionedError
            Where double precision cannot give a quantity.
        """
        _check_limits(margin, proof, max_evaluations, deadline)
        check_actions(self._graph, actions)
        self._refuse_dense_spectrum(self._graph.num_poses + max(action.num_new_poses for action in actions))
        if self._bounds == "paper":
            self._require_equal_noise(actions)
        search = Search(self._evaluation_of(len(actions)), actions, Clock(deadline, on_progress))
        together = margin is None and proof != "none" and deadline is None
        search.rank(bounds_too=together)
        if margin is not None:
            return search.decision_with_margin(margin)
        if proof == "none":
            return search.decision()
        if not together:
            search.bound_all()
        if proof == "optimal":
            search.prove(len(actions) if max_evaluations is None else max_evaluations)
        return search.decision()

    def entropies(self, actions: Sequence[Action], *, on_progress: Progress | None = None) -> FloatArray:
        """The exact objective of each action, shape (K,), nats, cost excluded: standard belief space planning.

        Parameters
        ----------
        actions, on_progress
            As for `decide`.

        Raises
        ------
        InvalidActionError
            Names the first malformed action and its edge.
        IllConditionedError
            Where double precision cannot give an entropy.
        """
        check_actions(self._graph, actions)
        clock, evaluation = Clock(None, on_progress), self._evaluation_of(len(actions))
        values = np.empty(len(actions))
        for start in range(0, len(actions), evaluation.batch_size):
            batch = list(range(start, min(start + evaluation.batch_size, len(actions))))
            values[batch], _ = named_quantity(evaluation.entropies, actions, batch)
            clock.report("evaluations", batch[-1] + 1, len(actions))
        return values

    def _evaluation_of(self, num_actions: int) -> Evaluation:
        """From scratch, or by increments where that is worth the compiled kernels' time to load."""
        worthwhile = num_actions * self._graph.num_edges >= _INCREMENTAL_WORK and _has_kernels()
        if not (worthwhile or self._bounds == "anchored"):
            if self._scratch is None:
                family = "fischer" if self._bounds == "auto" else self._bounds
                self._scratch = ScratchEvaluation(self._graph, *self._choices, family, self._determinant, self._anchor)
            return self._scratch
        if self._incremental is None:
            from topobelief.planning.incremental import IncrementalEvaluation  # loads numba

            choices = *self._choices, self._bounds, self._determinant
            self._incremental = IncrementalEvaluation(self._graph, *choices, self._anchor)
        return self._incremental.for_one_decision() if self._bounds == "auto" else self._incremental

    def _refuse_dense_spectrum(self, num_poses: int) -> None:
        if num_poses > self._largest_spectrum:
            raise InvalidInputError(
                f"the exact von Neumann entropy of {num_poses} poses takes about "
                f'{expected_spectrum_seconds(num_poses):.0f} s an action; use "von_neumann_approx", '
                "or pass allow_dense_spectrum=True"
            )

    def _require_equal_noise(self, actions: Sequence[Action]) -> None:
        """Fail before the work, not in the middle of it, where the paper's family meets other noise."""
        expected = shared_information(self._graph.information)
        for index, action in enumerate(actions):
            if expected is None:  # a graph without edges
                try:
                    require_equal_noise(fisher_rows(posterior(self._graph, action)))
                except InvalidGraphError as error:
                    raise InvalidActionError(str(error), action=index, label=action.label) from None
                continue
            same = np.isclose(action.information, expected, rtol=SAME_NOISE, atol=0).all(axis=(1, 2))
            for edge in np.flatnonzero(~same)[:1]:
                raise InvalidActionError(
                    "the paper's bounds expect the graph's information matrix on all edges, got another one; "
                    'use bounds="fischer"',
                    action=index,
                    edge=int(edge),
                    label=action.label,
                )


def _has_kernels() -> bool:
    """Whether what increments are compiled with is installed."""
    return find_spec("numba") is not None


def _check_limits(margin: float | None, proof: str, max_evaluations: int | None, deadline: float | None) -> None:
    require_choice("proof", proof, get_args(Proof))
    if margin is not None and not math.isfinite(margin):
        raise InvalidInputError(f"expected a finite margin in nats, got {margin}")
    if margin is not None and proof == "optimal":
        raise InvalidInputError('expected a margin or proof="optimal", got both; a margin asks for one upper bound only')
    if max_evaluations is not None and max_evaluations < 0:
        raise InvalidInputError(f"expected max_evaluations of at least 0, got {max_evaluations}")
    if deadline is not None and not deadline >= 0:
        raise InvalidInputError(f"expected a deadline of at least 0 seconds, got {deadline}")
