"""Algorithm 1 of Kitanov and Indelman (arXiv 1903.00927) and the search that proves its choice.

Notation: s signature, U^ = argmax s, LB and UB the bounds of the objective J plus the action's cost.

    margin given:      U^ alone if UB(U^) < margin, else all actions in ranking order
    margin not given:  Delta J_max = max(0, UB(U^) - min of LB over the others),   A = {U : LB(U) <= UB(U^)} and U^

The paper has < in A; where bounds meet, a strict test would drop U^ itself. The theorem holds for any U^, so for one chosen
by a von Neumann signature too. The proof evaluates J along the ranking and skips what its lower bound rules out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.bounds.options import BoundOptions, Determinant
from topobelief.bounds.paper import require_equal_noise, require_poses_alone
from topobelief.errors import InvalidActionError, InvalidGraphError, InvalidInputError, require_choice
from topobelief.graph.action import Action, check_actions
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, checked_sample_size
from topobelief.graph.fit import warn_of_misfit
from topobelief.graph.information import SAME_NOISE, shared_information
from topobelief.graph.pose_graph import PoseGraph, require_pose_graph
from topobelief.graph.topology import checked_anchor
from topobelief.graph.well_posed import require_connected_poses, require_determined
from topobelief.optional import has_kernels, missing_packages
from topobelief.planning.batch import Batch, Criteria
from topobelief.planning.decision import Decision
from topobelief.planning.engine import Engine
from topobelief.planning.registry import ALL_OBJECTIVES, AUTO, BOUNDS, ENGINES, FOCUSED, SIGNATURES, chosen
from topobelief.planning.search import Clock, Progress, Search
from topobelief.signatures.von_neumann import DENSE_SPECTRUM_SIZE, expected_spectrum_seconds

if TYPE_CHECKING:
    from topobelief.forms.prior_factors import PriorFactors  # needs numba, which not every engine does

_INCREMENTAL_WORK = 250_000  # actions times edges of the prior above which increments are faster
_INVERSE_WORK = 100  # times that of a determinant
_SAMPLE_SIZE = 32  # actions whose bounds tell which family to take
_OPEN_SHARE = 0.5  # what Fischer's bounds may leave open: they and so many exact values cost as much as chained bounds of all

Proof = Literal["none", "bounded", "optimal"]


class Planner:
    """Chooses among actions on one pose graph.

    Threads may share a planner. A pickled or copied planner has factored nothing yet.

    Parameters
    ----------
    graph
        The robot's belief; connected, at its maximum-likelihood estimate (`topobelief.optimize`).
    objective
        "joint": entropy of all poses after the action, the paper's. "map": of the poses that exist now, free of units and
        recommended where paths differ in length. "per_pose": joint over the number of free poses. "error": the expected
        error of the map, metres; costs, margins and bounds are then in metres too. "focused": entropy of the poses in `focus`,
        relative to the anchor; evaluated from scratch by either engine.
    signature
        What ranks the actions: "spanning_trees", "von_neumann" (dense spectrum), "von_neumann_approx" (degrees) or "resistance"
        (mean effective resistance, which goes with "error").
    bounds
        Family of bounds, for any noise but where it says otherwise. "fischer"; "fischer_step": never looser, from scratch;
        "paper": one block-isotropic Omega; "anchored": exact prior, bounded increment, far tighter, about as expensive as exact
        values; "chain": anchored, each closure given those before it, tighter still. "auto": chain where many actions are
        evaluated by increments and Fischer's bounds of some of them leave more than half open, else Fischer's; the decision
        says which. Objective "error" has "fischer", "anchored" and "chain"; the last two, and by increments all of them, are
        exact, because exact values cost less than bounds.
    determinant
        "cholesky" or "hadamard" (looser, cheaper), in the lower bound of an entropy.
    window
        Closures before each one on which the family "chain" conditions it.
    engine
        "scratch": each action alone. "incremental": all at once, by increments to a prior that is factored once (extra `fast`).
        "auto": by increments where there is enough to do to load the compiled kernels, which takes half a second; where many
        small decisions are made in one process, "incremental" is faster.
    anchor
        Pose that the bounds hold. Default: the last one, where the robot is.
    focus
        Indices of existing poses and landmarks, for the objective "focused".
    normalized
        Add the noise normalisation of s_ST to "von_neumann_approx" (the paper's last remark).
    sample_size
        Over how many poses of the graph, evenly spaced, "error" and "resistance" are taken at most.
    allow_dense_spectrum
        Let "von_neumann" run above 3000 poses, at O(n^3) an action.

    Raises
    ------
    InvalidInputError
        For an unknown choice, or a dense spectrum above 3000 poses without `allow_dense_spectrum`.
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
        objective: str = "joint",
        signature: str = "spanning_trees",
        bounds: str = "fischer",
        determinant: Determinant = "cholesky",
        window: int = 2,
        engine: str = AUTO,
        anchor: int | None = None,
        focus: Sequence[int] | None = None,
        normalized: bool = False,
        sample_size: int = DEFAULT_SAMPLE_SIZE,
        allow_dense_spectrum: bool = False,
    ) -> None:
        require_choice("objective", objective, ALL_OBJECTIVES)
        require_choice("signature", signature, SIGNATURES)
        require_pose_graph(graph)
        require_choice("engine", engine, (*ENGINES, AUTO))
        if engine == "incremental" and not has_kernels():
            raise missing_packages(["numba"], ["fast"])
        require_choice("bounds", bounds, (*BOUNDS, AUTO))
        self._criteria = Criteria(objective, signature, bounds, BoundOptions(determinant, window), normalized)
        require_choice(f'bounds of objective "{objective}"', bounds, (*self._criteria.families, AUTO))
        self._sample_size = checked_sample_size(sample_size)
        self._given_anchor, self._given_engine = anchor, engine
        self._allow_dense_spectrum = allow_dense_spectrum
        self._engines: dict[str, Engine] = {}
        self._graph, self._anchor = graph, self._checked(graph)
        self._focus = _checked_focus(graph, objective, focus)
        if self._focus:
            self._criteria = replace(self._criteria, held=tuple(sorted({*self._focus, self._anchor})))
        warn_of_misfit(graph)

    def __repr__(self) -> str:
        c = self._criteria
        return f"Planner({self._graph!r}, objective {c.objective!r}, signature {c.signature!r}, bounds {c.bounds!r})"

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_engines": {}}

    def _checked(self, graph: PoseGraph) -> int:
        """The pose to hold on a graph that can be planned on."""
        anchor = graph.last_pose if self._given_anchor is None else checked_anchor(graph.num_nodes, self._given_anchor)
        require_determined(graph, anchor=anchor)
        require_connected_poses(graph, anchor=anchor)
        self._refuse_dense_spectrum(graph.num_nodes)
        if self._criteria.bounds == "paper":
            require_poses_alone(graph.num_landmarks)
            require_equal_noise(graph.information)
        return anchor

    @property
    def objective(self) -> str:
        """Name of what is minimised."""
        return self._criteria.objective

    @property
    def graph(self) -> PoseGraph:
        """The prior."""
        return self._graph

    @property
    def factors(self) -> PriorFactors | None:
        """Factors of the prior that the incremental engine has made and keeps; None where it has not been used."""
        engine = self._engines.get("incremental")
        return None if engine is None else engine.factors

    def extended(self, graph: PoseGraph) -> Planner:
        """A planner on a graph that has grown: the chosen path was driven, or new measurements came in.

        What this planner factored is taken over where it can be (docs, the mathematics, section 7): orders of elimination, and
        those parts of each factor below which nothing has changed. Topological ones survive a new estimate; those of the
        information matrix where poses have not moved. This planner stays as it is.

        Parameters
        ----------
        graph
            Its first poses and edges are those of the graph as it was, at any poses. Other graphs are valid, and start anew.
            Unless an anchor was given, the new last pose is held.

        Raises
        ------
        InvalidInputError, DisconnectedGraphError, InvalidGraphError
            As for the planner.

        Examples
        --------
        >>> from topobelief.graph.action import posterior
        >>> prior = PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3) * 100)
        >>> planner = Planner(prior)
        >>> ahead = Action([[2, 0, 0]], [(1, 2)], np.eye(3) * 100)
        >>> planner.extended(posterior(prior, ahead)).graph.num_poses
        3
        """
        criteria = self._criteria
        grown = Planner(
            graph,
            objective=criteria.objective,
            signature=criteria.signature,
            bounds=criteria.bounds,
            determinant=criteria.options.determinant,
            window=criteria.options.window,
            engine=self._given_engine,
            anchor=self._given_anchor,
            focus=self._focus or None,
            normalized=criteria.normalized,
            sample_size=self._sample_size,
            allow_dense_spectrum=self._allow_dense_spectrum,
        )
        grown._engines = {name: engine.extended(graph, grown._anchor) for name, engine in self._engines.items()}
        return grown

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
            Uncertainty that is good enough, in the objective's unit, cost included: Algorithm 1's first branch, one upper
            bound.
        proof
            "none": signatures only. "bounded": bounds of all actions. "optimal": exact evaluations along the ranking until
            no bound is below the best value found.
        max_evaluations
            Maximum number of exact evaluations; the decision then has the certificate reached so far.
        deadline
            Seconds from now, checked between actions. A ranking is always returned; bounds and evaluations may be missing.
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
        _check_limits(margin, proof, max_evaluations, deadline, self._criteria.objective_itself.unit)
        check_actions(self._graph, actions)
        self._refuse_dense_spectrum(self._graph.num_nodes + max(action.num_new_poses for action in actions))
        if self._criteria.bounds == "paper":
            self._require_equal_noise(actions)
        engine = self._engine_for(len(actions))
        criteria = self._criteria
        if criteria.bounds == AUTO:
            criteria = replace(criteria, bounds=_cheapest_bounds(engine, criteria, actions))
        search = Search(engine, criteria, actions, Clock(deadline, on_progress))
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
        """The exact objective of each action, shape (K,), nats or metres, cost excluded: standard belief space planning.

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
        clock = Clock(None, on_progress)
        return Search(self._engine_for(len(actions)), self._criteria, actions, clock).entropies_of_all()

    def _engine_for(self, num_actions: int) -> Engine:
        """The engine that was asked for, or the one that is worth its time."""
        name = self._given_engine
        if name == AUTO:
            work = num_actions * self._graph.num_edges * (_INVERSE_WORK if self._criteria.needs_inverses else 1)
            large = work >= _INCREMENTAL_WORK
            worthwhile = large or self._criteria.bounds in ("anchored", "chain")
            name = "incremental" if worthwhile and has_kernels() else "scratch"
        if name not in self._engines:
            self._engines[name] = chosen(ENGINES, name)(self._graph, self._anchor, sample_size=self._sample_size)
        return self._engines[name]

    def _refuse_dense_spectrum(self, num_poses: int) -> None:
        spectral = self._criteria.signature == "von_neumann" and not self._allow_dense_spectrum
        if spectral and num_poses > DENSE_SPECTRUM_SIZE:
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
                    require_equal_noise(action.information)
                except InvalidGraphError as error:
                    raise InvalidActionError(str(error), action=index, label=action.label) from None
                continue
            same = np.isclose(action.information, expected, rtol=SAME_NOISE, atol=0).all(axis=(1, 2))
            for edge in np.flatnonzero(~same)[:1]:
                weighed = "" if action.probabilities is None else ", or predict closures with certainty (ClosureModel.paper())"
                raise InvalidActionError(
                    "the paper's bounds expect the graph's information matrix on all edges, got another one; "
                    f'use bounds="fischer"{weighed}',
                    action=index,
                    edge=int(edge),
                    label=action.label,
                )


def _checked_focus(graph: PoseGraph, objective: str, focus: Sequence[int] | None) -> tuple[int, ...]:
    """The poses in focus; none unless the objective asks for them."""
    if objective == FOCUSED and focus is None:
        raise InvalidInputError(f'expected focus=[indices of poses] with objective="{FOCUSED}", got none')
    if objective != FOCUSED and focus is not None:
        raise InvalidInputError(f'expected focus= with objective="{FOCUSED}" only, got it with "{objective}"; leave it out')
    poses = tuple(int(pose) for pose in focus or ())
    if focus is not None and not poses:
        raise InvalidInputError("expected at least one pose in focus, got none")
    for pose in poses:
        if not 0 <= pose < graph.num_nodes:
            raise InvalidInputError(f"expected poses in focus from 0 to {graph.num_nodes - 1}, got {pose}")
    return poses


def _cheapest_bounds(engine: Engine, criteria: Criteria, actions: Sequence[Action]) -> str:
    """The family by which a proof is expected to cost least: the cheap one, unless it leaves most of a sample open."""
    cheap, tight = criteria.objective_itself.cheap_bounds, criteria.objective_itself.tight_bounds
    if engine.batch_size == 1 or cheap == tight:
        return cheap
    places: list[int] = np.unique(np.linspace(0, len(actions) - 1, _SAMPLE_SIZE).astype(int)).tolist()
    sample = [actions[place] for place in places]
    lower, upper = Batch(engine, replace(criteria, bounds=cheap), sample, places).bounds()
    costs = np.array([action.cost for action in sample])
    num_open = np.count_nonzero(lower + costs <= (upper + costs).min()) - 1  # without the best
    return cheap if num_open <= _OPEN_SHARE * (len(sample) - 1) else tight


def _check_limits(margin: float | None, proof: str, max_evaluations: int | None, deadline: float | None, unit: str) -> None:
    require_choice("proof", proof, get_args(Proof))
    if margin is not None and not math.isfinite(margin):
        raise InvalidInputError(f"expected a finite margin in {unit}, got {margin}")
    if margin is not None and proof == "optimal":
        raise InvalidInputError('expected a margin or proof="optimal", got both; a margin asks for one upper bound only')
    if max_evaluations is not None and max_evaluations < 0:
        raise InvalidInputError(f"expected max_evaluations of at least 0, got {max_evaluations}")
    if deadline is not None and not deadline >= 0:
        raise InvalidInputError(f"expected a deadline of at least 0 seconds, got {deadline}")
