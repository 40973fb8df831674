"""The best walk of a whole roadmap, and how much better any other could be: the public door of the search.

Local search (`local_search`) evaluates walks exactly and keeps the best at every length. A bound (`bound`) says which value no
walk undercuts; its walks are candidates for local search, and the best value lets it leave out parts of the roadmap. `anytime`
takes them in turns.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray
from topobelief.candidates.attitude import Attitude
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.ends import SAME_PLACE, checked_place, shown_place
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.observations import ObservationModel, learn_observations
from topobelief.candidates.predicted_factors import closure_information, default_information, predict_actions
from topobelief.candidates.roadmap_graph import Roadmap, with_way
from topobelief.candidates.start import Start, find_start
from topobelief.errors import InvalidInputError, PlanningError, require_choice
from topobelief.graph.action import Action, staying
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.planning.registry import default_signature
from topobelief.search.anytime import WARM_UP_SHARE, AnytimeSearch, SearchProgress
from topobelief.search.both_bounds import BothBounds
from topobelief.search.bound import Check, WalkBound
from topobelief.search.evaluations import Evaluations
from topobelief.search.front import below_front, on_front
from topobelief.search.front_bounds import FrontBounds
from topobelief.search.local_search import LocalSearch, spread_vias
from topobelief.search.refinement import refine_best
from topobelief.search.result import SearchResult, Way
from topobelief.search.topological_prior import OBJECTIVES, constant
from topobelief.search.walk_bounds import affordable, spare_metres, walk_bounds
from topobelief.search.walks import Walk, Walks
from topobelief.world import FreeSpace
from topobelief.world.space import require_room_for, seen_by

_NUM_CANDIDATES = 60  # vertices to lead walks through
_DIFFERENT = 0.05  # share of the length limit by which alternatives differ (Fréchet)
_SHARE_OF_REFINEMENT = 0.4  # of the time and of the evaluations
_TO_MAKE_BOUND = 3e-6  # seconds for each new pose that the limit leaves room for beyond the shortest walk through an edge


def search_roadmap(
    graph: PoseGraph,
    roadmap: Roadmap,
    *,
    goal: ArrayLike | None = None,
    max_detour: float = 1.3,
    max_length: float | None = None,
    return_to_start: bool = False,
    objective: str = "error",
    closures: ClosureModel | None = None,
    observations: ObservationModel | None = None,
    world: FreeSpace | None = None,
    cost_per_metre: float = 0.0,
    deadline: float | None = None,
    gap: float = 0.0,
    enough: float | None = None,
    max_evaluations: int | None = None,
    num_alternatives: int = 10,
    spacing: float = 1.0,
    turn: float | None = None,
    information: ArrayLike | None = None,
    start: int | ArrayLike | Start | None = None,
    attitude: Attitude | None = None,
    earlier: SearchResult | None = None,
    refine: bool = False,
    metric: bool = True,
    planner: Planner | None = None,
    seed: int = 0,
    on_progress: Callable[[SearchProgress], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> SearchResult:
    """The walk on a roadmap after which the map is best, and how much better any other could be.

    Parameters
    ----------
    graph
        The robot's belief, at its estimate (`topobelief.optimize`).
    roadmap
        Its first vertex is where walks begin.
    goal : shape (2,) or (3,), optional
        Where walks end, metres: x, y with or without a heading, which is ignored; on a roadmap in space x, y, z. A place that
        is no vertex is joined to the roadmap. Default: walks end anywhere.
    max_detour
        With a goal and without `max_length`: the limit in lengths of the shortest way, at least 1.
    max_length
        Metres; needed without a goal.
    return_to_start
        Without a goal: walks end where they begin.
    objective
        As for `Planner`.
    closures
        Which loops new poses close. Default: learned from the graph (`learn_closures`).
    observations
        Which landmarks new poses observe, and how well. Default: learned from the graph (`learn_observations`).
    world
        Where given, poses must see each other in it to close a loop.
    cost_per_metre
        In the unit of the objective: what a metre must gain to be worth driving.
    deadline
        Seconds from now, checked between batches of evaluations and steps of the bound; the best way so far is returned.
        There is no lower bound where making it would take more than 0.6 of that.
    gap
        Stop when no walk can be better by more than this, in the unit of the objective.
    enough
        Stop when no walk can better the objective of the graph as it is by more than this, in the same unit: nothing worth
        driving for is left.
    max_evaluations
        Stop after about so many exact evaluations, in place of a deadline where runs are to be repeated; at least 1.
    num_alternatives
        How many other ways to return at most.
    spacing, turn, information, start, attitude
        As for `predict_actions`; by default new poses stand every metre, and not where the path turns. With a `turn` there is
        no lower bound.
    earlier
        A result on the same roadmap whose ways are tried too: after a search with a smaller limit the value is never worse.
    refine
        Whether to better the best walk off the vertices of the roadmap in the end (`refinement`), in 0.4 of the time. The bound
        is about walks of the roadmap, so the way may turn out better than that.
    metric
        False: topological planning. What is minimised and bounded is the objective as its signature estimates it, from topology
        and weights alone: for "error" by effective resistance, for "map" and "joint" by spanning trees.
    planner
        One of this graph and objective that has been used before, so that the prior need not be factored again.
    seed
        The same seed gives the same result, unless a deadline is set.
    on_progress
        Called after each batch and each step of the bound.
    clock
        What the deadline and the seconds of the result are read from; `time.process_time` where other programs run.

    Returns
    -------
    SearchResult
        After Ctrl-C too, once a way was evaluated: the best so far.

    Raises
    ------
    PlanningError
        Where the limit is below the shortest way to the goal, or the goal cannot be joined to the roadmap.
    InvalidInputError
        For a number out of range, without a goal and a `max_length`, with a goal and `return_to_start`, and for an objective
        without a signature of its own where `metric` is False.

    Warns
    -----
    NotOptimizedWarning
        Where the graph is far from its estimate.
    """
    began = clock()
    _check_numbers(max_detour, max_length, cost_per_metre, deadline, gap, enough, max_evaluations, num_alternatives)
    require_room_for(graph, roadmap.world)
    if refine and earlier is not None and len(earlier.path) > 1:
        roadmap, _ = with_way(roadmap, earlier.path)
    walks = _walks_within(roadmap, goal, max_detour, max_length, return_to_start)
    if not metric:
        require_choice("objective of the topological form", objective, OBJECTIVES)
    if planner is None:
        engine = "incremental" if find_spec("numba") else "scratch"
        planner = Planner(graph, objective=objective, signature=default_signature(objective), engine=engine)
    elif planner.graph is not graph or planner.objective != objective:
        raise InvalidInputError("expected a planner of this graph and objective, got another; leave it out")
    model = learn_closures(graph, world=world) if closures is None else closures
    seeing = learn_observations(graph, world=world) if observations is None else observations
    of_odometry, of_closures = (
        (default_information(graph), closure_information(graph)) if information is None else (np.asarray(information),) * 2
    )
    begin = find_start(graph, start, world=world)

    def predict(paths: list[FloatArray]) -> list[Action]:
        return predict_actions(
            graph,
            paths,
            closures=model,
            observations=seeing,
            information=information,
            spacing=spacing,
            turn=turn,
            world=world,
            start=begin,
            attitude=attitude,
        )

    def measure(actions: list[Action]) -> FloatArray:
        if metric:
            return planner.entropies(actions)
        return constant(objective, graph) - planner.decide(actions, proof="none").signatures

    evaluations = Evaluations(planner, predict, walks.roadmap.vertices, cost_per_metre, measure=measure)
    places = seen_by(roadmap.world, graph.positions)
    near = np.asarray(KDTree(places[graph.pose_indices]).query(walks.roadmap.vertices)[0]) < model.radius
    if seeing is not None:
        near |= np.asarray(KDTree(places[graph.is_landmark]).query(walks.roadmap.vertices)[0]) < seeing.max_range
    candidates = spread_vias(walks, near, _NUM_CANDIDATES)
    local = LocalSearch(walks, evaluations, candidates, rng=np.random.default_rng(seed))

    def bounds(check: Check) -> tuple[WalkBound, FrontBounds]:
        make = partial(
            walk_bounds,
            graph,
            walks.roadmap,
            start=walks.start,
            goal=None if goal is None else walks.end,
            max_length=walks.max_length,
            objective=objective,
            closures=model,
            observations=seeing,
            spacing=spacing,
            information=of_odometry,
            closure_information=of_closures,
            world=world,
            cost_per_metre=cost_per_metre,
            return_to_start=return_to_start,
            pose=begin.pose,
            metric=metric,
            attitude=attitude,
            factors=planner.factors,
            check=check,
        )
        both = BothBounds(lambda pieces: make(pieces_per_pose=pieces), affordable)
        shortest = 0.0 if goal is None else float(walks.distances(walks.start)[walks.end or 0])
        return both, FrontBounds(both.flows, shortest, walks.max_length)

    stays = walks.in_reach.sum() == 1  # there is one walk, to stay
    value_now = float(measure([staying(graph)])[0])

    def told(progress: SearchProgress) -> None:
        if on_progress is not None:
            on_progress(progress._replace(so_far=lambda: result("progress")))

    share = 1 - _SHARE_OF_REFINEMENT if refine else 1.0
    search = AnytimeSearch(
        evaluations,
        local,
        bounds if turn is None and not stays and (deadline is None or _has_time_for_bound(walks, spacing, deadline)) else None,
        began=began,
        deadline=None if deadline is None else share * deadline,
        first_bound_by=None if deadline is None else deadline,
        gap=gap,
        enough=math.inf if enough is None else value_now - enough,
        max_evaluations=None if max_evaluations is None else math.ceil(share * max_evaluations),
        on_progress=told,
        clock=clock,
    )

    def ways(some: Sequence[Walk]) -> tuple[Way, ...]:
        return tuple(
            Way(evaluations.path(walk), action, evaluations.value(walk), evaluations.lengths[walk])
            for walk, action in zip(some, evaluations.actions(some), strict=True)
        )

    def result(stopped_by: str) -> SearchResult:
        every, lengths, values = evaluations.arrays()
        best = evaluations.best()
        best_first: list[int] = [every.index(best), *np.argsort(values, kind="stable").tolist()]
        others = evaluations.different(best_first, num_alternatives + 1, _DIFFERENT * walks.max_length)[1:]
        objectives = values - cost_per_metre * lengths
        front = on_front(lengths, objectives)
        walks_on_front: list[Walk] = [every[index] for index in front.tolist()]
        return SearchResult(
            best=ways([best])[0],
            alternatives=ways(others),
            on_front=ways(walks_on_front),
            front=np.column_stack([lengths[front], objectives[front]]),
            front_bounds=below_front(search.front_bounds, lengths[front], objectives[front]),
            lower_bound=evaluations.value(best) if stays else min(search.lower_bound, evaluations.value(best)),
            covers=f"the only walk of at most {walks.max_length:.6g} m, to stay" if stays else search.covers,
            bound_by=search.bound_by,
            value_with_map_alone=evaluations.value_with_map_alone(best),
            proven_optimal=search.proven or stays or evaluations.value(best) <= search.lower_bound,
            value_now=value_now,
            shortest=None if goal is None else ways([walks.walk(())])[0],
            max_length=walks.max_length,
            sees_map=evaluations.sees_map,
            any_sees_itself=evaluations.any_sees_itself,
            num_evaluations=len(evaluations),
            seconds=clock() - began,
            stopped_by="proof" if stays else stopped_by,
            objective=objective,
            cost_per_metre=cost_per_metre,
            metric=metric,
        )

    stopped_by = search.run([walks.walk(()), *_walks_of(earlier, walks.roadmap)])
    if refine and stopped_by not in ("enough", "interrupt"):
        most = math.inf if max_evaluations is None else max_evaluations - len(evaluations)
        end = math.inf if deadline is None else began + deadline
        rng = np.random.default_rng(seed)
        if refine_best(evaluations, walks.roadmap, walks.limit, rng=rng, most=most, end=end, clock=clock):
            stopped_by = "interrupt"
    return result(stopped_by)


def _check_numbers(
    max_detour: float,
    max_length: float | None,
    cost_per_metre: float,
    deadline: float | None,
    gap: float,
    enough: float | None,
    max_evaluations: int | None,
    num_alternatives: int,
) -> None:
    if not max_detour >= 1:
        raise InvalidInputError(f"expected max_detour of at least 1 times the shortest way, got {max_detour}")
    if max_length is not None and not 0 <= max_length < math.inf:
        raise InvalidInputError(f"expected a finite max_length of at least 0 m, got {max_length}")
    if not 0 <= cost_per_metre < math.inf:
        raise InvalidInputError(f"expected a finite cost_per_metre of at least 0, got {cost_per_metre}")
    if deadline is not None and not deadline >= 0:
        raise InvalidInputError(f"expected a deadline of at least 0 seconds, got {deadline}")
    if not gap >= 0:
        raise InvalidInputError(f"expected a gap of at least 0, got {gap}")
    if enough is not None and not enough >= 0:
        raise InvalidInputError(f"expected enough of at least 0, got {enough}")
    if max_evaluations is not None and max_evaluations < 1:
        raise InvalidInputError(f"expected max_evaluations of at least 1, got {max_evaluations}")
    if num_alternatives < 0:
        raise InvalidInputError(f"expected num_alternatives of at least 0, got {num_alternatives}")


def _has_time_for_bound(walks: Walks, spacing: float, deadline: float) -> bool:
    """Whether a bound would know anything in about the time that is left to it."""
    spare = spare_metres(walks.roadmap, walks.start, walks.end, walks.max_length)
    return _TO_MAKE_BOUND * float(np.maximum(spare, 0.0).sum()) / spacing <= (1 - WARM_UP_SHARE) * deadline


def _walks_within(
    roadmap: Roadmap, goal: ArrayLike | None, max_detour: float, max_length: float | None, return_to_start: bool
) -> Walks:
    """The walks that are searched."""
    if goal is None:
        if max_length is None:
            raise InvalidInputError("expected max_length for a trip without a goal, got none; say how many metres it may have")
        return Walks(roadmap, 0 if return_to_start else None, max_length)
    if return_to_start:
        raise InvalidInputError("expected a goal or return_to_start, got both; leave out the goal to return to the start")
    place = checked_place(roadmap.world, goal, "goal")
    apart = np.linalg.norm(roadmap.vertices - place, axis=1)
    end = int(np.argmin(apart))
    if apart[end] > SAME_PLACE:
        roadmap, end = roadmap.between(roadmap.vertices[0], place), 1
    shortest = float(roadmap.distances_to(end)[0])
    if math.isinf(shortest):
        raise PlanningError(f"expected a goal that the roadmap leads to, got {shown_place(place)}; build a roadmap for it")
    walks = Walks(roadmap, end, max_detour * shortest if max_length is None else max_length)
    if shortest > walks.limit:
        raise PlanningError(
            f"expected max_length of at least {shortest:.2f} m, the shortest way to the goal, got {max_length:g} m; raise it"
        )
    return walks


def _walks_of(earlier: SearchResult | None, roadmap: Roadmap) -> list[Walk]:
    """The ways of an earlier result as walks on a roadmap; those that it does not have are left out."""
    if earlier is None:
        return []
    tree, edges = KDTree(roadmap.vertices), {tuple(edge) for edge in roadmap.edges.tolist()}
    walks: list[Walk] = []
    for way in (earlier.best, *earlier.alternatives, *earlier.on_front):
        distances, vertices = tree.query(way.path)
        walk = tuple(np.atleast_1d(vertices).tolist())
        joined = all((min(pair), max(pair)) in edges for pair in itertools.pairwise(walk))
        if joined and np.max(distances) <= SAME_PLACE:
            walks.append(walk)
    return walks
