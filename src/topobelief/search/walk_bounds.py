"""The bounds for a graph, a roadmap and a question: what `flows` and `windows` need, put together."""

from __future__ import annotations

import math
from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.candidates.attitude import Attitude, Legs, lifted
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.observations import ObservationModel
from topobelief.candidates.roadmap import Roadmap
from topobelief.errors import InvalidInputError, PlanningError, require_choice
from topobelief.forms.prior_factors import PriorFactors
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.search.both_bounds import COARSEST
from topobelief.search.bound import Check, unchecked
from topobelief.search.criteria import Criterion
from topobelief.search.flows import FlowBound
from topobelief.search.layers import Layers, build_layers, num_spots
from topobelief.search.reduced_prior import ReducedPrior
from topobelief.search.rewards import Rewards, odometry_powers
from topobelief.search.tolls import slack
from topobelief.search.topological_prior import OBJECTIVES, SeenPrior, TopologicalPrior, WeightForm
from topobelief.search.ways import Ways, cells_of_pieces, find_landmarks, find_sightings, first_pieces
from topobelief.search.window_bound import WindowBound
from topobelief.search.windows import Windows, find_odometry
from topobelief.world import FreeSpace

_OBJECTIVES = ("error", "map", "joint", "per_pose")
_ARCS = 400_000  # aimed at: as many layers as make about so many arcs
_FINEST = 40  # pieces per spacing
_FINE = 10  # pieces per pose; where more are affordable, steps are cheap and splitting does without cells
_ROWS = 6000  # at most so many for all pairs of a new pose and a cell, kappa for each
_MOST_CELLS = 25
_MOST_IN_WINDOWS = 1500  # seen poses, the covariance between all of which windows need
_ARCS_OF_WINDOWS = 3_000_000
_SAME_PLACE = 1e-9  # metres


class _OfMap(TypedDict):
    """What priors have to know besides."""

    probability: float
    min_index_gap: int
    with_errors: bool


def walk_bounds(
    graph: PoseGraph,
    roadmap: Roadmap,
    *,
    start: int,
    goal: int | None,
    max_length: float,
    objective: str,
    closures: ClosureModel,
    observations: ObservationModel | None = None,
    spacing: float,
    information: ArrayLike,
    closure_information: ArrayLike | None = None,
    world: FreeSpace | None,
    cost_per_metre: float = 0.0,
    return_to_start: bool = False,
    pose: int | None = None,
    edge_costs: ArrayLike | None = None,
    pieces_per_pose: int | None = None,
    metric: bool = True,
    attitude: Attitude | None = None,
    factors: PriorFactors | None = None,
    check: Check = unchecked,
) -> tuple[FlowBound, WindowBound | None]:
    """The bounds over the walks from one vertex of a roadmap: by flows, and by windows where there are such.

    Windows are for entropies and at most one closure a pose, and need the information matrix (`metric`).

    It covers every walk that `predict_actions` makes an action of with these closures, this spacing and information, and no
    turn, and counts the closures with poses of the map. Closures among the walk's own new poses are not counted.

    Parameters
    ----------
    graph
        At its estimate.
    roadmap
    start, goal
        Vertices of the roadmap. Without a goal walks may end at any vertex, or at the start if they are to return.
    max_length
        Metres along the walk.
    objective
        "error" (metres), "map", "joint" (nats) or "per_pose" (nats a pose).
    closures
    observations
        Which landmarks of the map new poses observe, and how well. Default: none.
    spacing
        Metres from new pose to new pose.
    information : shape (kappa, kappa)
        Of odometry.
    closure_information : shape (kappa, kappa), optional
        Of a loop closure that is made for certain. Default: that of odometry.
    world
        What poses must see each other in; None: they always do.
    cost_per_metre
        In the unit of the objective.
    return_to_start
    pose
        Of the graph, to which the first new pose is joined. Default: the last one.
    edge_costs : shape (edges of the roadmap,), optional
        What driving each edge costs beyond its length, in the unit of the objective: time, energy, risk.
    pieces_per_pose
        Into how many layers the spacing is cut. Default: as many as are affordable, from 4 to 40.
    metric
        False: of the objective as its signature estimates it (`topological_prior`); not for "per_pose".
    attitude
        Of new poses in SE(3), as for `predict_actions`.
    factors
        Of the graph, as for `ReducedPrior`.
    check
        Called now and then, here and in each step of the bounds; what it raises ends the work.

    Raises
    ------
    InvalidInputError
        For an unknown objective, or a number out of range.
    PlanningError
        Where no walk within the length reaches the goal.
    """
    require_choice("objective", objective, _OBJECTIVES if metric else OBJECTIVES)
    if not metric and graph.num_landmarks:
        raise InvalidInputError(
            "expected a graph of poses alone for the topological form, got landmarks; search by metric=True"
        )
    omega = np.asarray(information, dtype=np.float64)
    of_closures = omega if closure_information is None else np.asarray(closure_information, dtype=np.float64)
    pose = graph.last_pose if pose is None else pose
    if not (math.isfinite(max_length) and max_length >= 0):
        raise InvalidInputError(f"expected a length of at least 0 m, got {max_length}")
    if not (math.isfinite(cost_per_metre) and cost_per_metre >= 0):
        raise InvalidInputError(f"expected a cost of at least 0 a metre, got {cost_per_metre}")
    extra = np.zeros(len(roadmap.edges)) if edge_costs is None else np.asarray(edge_costs, dtype=np.float64)
    if extra.shape != roadmap.lengths.shape or not (np.isfinite(extra) & (extra >= 0)).all():
        raise InvalidInputError(f"expected edge_costs of at least 0 for each of {len(roadmap.edges)} edges, got {extra.shape}")
    end = start if return_to_start and goal is None else goal
    to_go = np.zeros(len(roadmap.vertices)) if end is None else roadmap.distances_to(end)
    if not to_go[start] <= max_length + slack(max_length):
        raise PlanningError(
            f"expected a length of at least {to_go[start]:.2f} m, that of the shortest path, got {max_length:g} m; allow more"
        )
    a, b = roadmap.edges.T
    lengths = roadmap.lengths
    edges = np.tile(np.arange(len(lengths)), 2)
    source, target = np.r_[a, b], np.r_[b, a]
    spare = spare_metres(roadmap, start, end, max_length)
    alive = (spare >= -slack(max_length)) & (lengths[edges] > 0)
    edges, source, target, spare = edges[alive], source[alive], target[alive], spare[alive]
    kept = np.unique(np.concatenate([source, target, [start]]))
    vertices = np.concatenate([kept, [-1]])  # the last one: the pose where the robot is
    place = np.full(len(roadmap.vertices), -1)
    place[kept] = np.arange(len(kept))
    at_pose, begin = len(kept), graph.positions[pose]
    places = lifted(roadmap.vertices, graph, pose)
    lead_in = float(np.linalg.norm(places[start] - begin))
    has_lead = lead_in > _SAME_PLACE
    lead = [at_pose] if has_lead else []
    points = np.concatenate([places[kept], begin[None]])
    source = np.r_[place[source], lead].astype(np.int64)
    target = np.r_[place[target], [place[start]] if has_lead else []].astype(np.int64)
    if len(source) == 0:
        raise PlanningError(f"expected a roadmap with a way of at most {max_length:g} m from the start, got none; allow more")
    legs = Legs(graph, attitude, dim=roadmap.world.dim)
    ways = Ways(source, target, points[source], points[target], legs.poses(points[source], points[source], points[target]))
    driven = np.r_[lengths[edges], [0.0] if has_lead else []]
    prices = np.r_[cost_per_metre * lengths[edges] + extra[edges], [0.0] if has_lead else []]
    whole = max_length + (lead_in if has_lead else 0.0)
    is_end = np.ones(len(points), dtype=bool)
    if end is not None:
        is_end[:] = vertices == end
    is_end[at_pose] = False
    remaining = np.concatenate([to_go[kept], [lead_in + to_go[start]]])
    if pieces_per_pose is None:
        per_metre = 1.5 * float(np.maximum(spare, 0.0).sum())  # arcs, for layers of one metre
        pieces_per_pose = affordable(per_metre / spacing)
    delta = spacing / pieces_per_pose
    first_vertex = at_pose if has_lead else int(place[start])
    counts_idle = objective in ("joint", "per_pose")
    mixes = objective == "error" and pieces_per_pose <= _FINE  # a flow without cells mixes corridors more than it saves time
    most_cells = round(_ROWS * spacing / (graph.tangent_dim * whole)) if mixes else 1
    cells = _cells(ways, delta, closures.radius, most_cells)
    layers = build_layers(ways, first_vertex, remaining, is_end, whole, delta, pieces_per_pose, cells, check)
    num_new = max(1, int(layers.records.number.max(initial=1)))
    among = int(np.searchsorted(graph.pose_indices, pose))
    check()
    sightings = find_sightings(graph.poses_alone, ways, among, delta, closures, world, num_new, check)
    seen = graph.pose_indices[sightings.seen]
    num_seen_poses, observed, most_landmarks = len(seen), None, 0
    if observations is not None and graph.num_landmarks:
        landmarks = find_landmarks(graph, ways, delta, observations, world, check)
        sightings, seen = sightings.with_more(landmarks), np.concatenate([seen, landmarks.seen])
        observed = observations.information(graph.tangent_dim, graph.group.position_dim)
        most_landmarks = observations.max_per_pose or 0
    if not len(seen):
        seen, num_seen_poses = np.array([pose]), 1
    check()
    of_map = _OfMap(probability=closures.probability, min_index_gap=closures.min_index_gap, with_errors=objective == "error")
    if metric:
        prior: SeenPrior = ReducedPrior(graph, pose, seen, of_closures, observed=observed, factors=factors, **of_map)
        powers = odometry_powers(graph.group, ways, graph.positions[pose], omega)
    else:
        form = WeightForm.of(objective, graph, omega, of_closures)
        prior = TopologicalPrior.of(graph, pose, seen, of_closures, form, **of_map)
        powers = form.odometry_powers(omega, len(ways.source))
    check()
    idle = powers[0, 0] * float(counts_idle)
    fewest = max(0, math.ceil((whole - max_length + to_go[start]) / spacing - 1e-6))
    criterion = Criterion.of(objective, prior, idle, num_new, fewest)
    most = closures.max_per_pose or 0
    rewards = Rewards(
        layers,
        ways,
        sightings,
        delta,
        powers,
        idle,
        prior.earliest,
        most,
        num_new,
        driven,
        prices,
        cells,
        num_seen_poses,
        most_landmarks,
    )
    counted = "loop closures with the poses of the map" + ("" if observed is None else " and observations of its landmarks")
    covers = (
        f"every walk of the roadmap of at most {max_length:.6g} m"
        + (" to the goal" if goal is not None else " that returns to its start" if return_to_start else "")
        + f", counting {counted}, not closures among its own new poses; by {{}} in layers of "
        f"{100 * delta:.3g} cm"
    )
    every = np.arange(len(layers.arcs.source), dtype=np.int32)
    background, told = rewards.background(), covers.format("flows")
    flows = FlowBound(prior, criterion, rewards, background, vertices, max_length, whole - max_length, told, every, check)
    if (
        not isinstance(prior, ReducedPrior)
        or objective == "error"
        or most != 1
        or num_seen_poses < len(seen)
        or len(seen) > _MOST_IN_WINDOWS
    ):
        return flows, None
    odometry = find_odometry(graph.group, ways, graph.positions[pose], omega, sightings.first, delta, spacing)

    def windows() -> tuple[Windows, Layers]:
        size = spacing / 2
        while True:
            where = cells_of_pieces(ways, delta, size).astype(np.int64)
            windows = Windows.of(prior, sightings, odometry, where, spacing, of_poses=counts_idle)
            labels = windows.labels.astype(np.int32)
            share = num_spots(ways, first_vertex, labels, delta, pieces_per_pose) / layers.num_spots
            if share * len(every) < _ARCS_OF_WINDOWS or where.max() == 0:
                return windows, build_layers(ways, first_vertex, remaining, is_end, whole, delta, pieces_per_pose, labels)
            size *= 1.5

    return flows, WindowBound(criterion, windows, rewards, vertices, max_length, covers.format("windows of two poses"), check)


def spare_metres(roadmap: Roadmap, start: int, end: int | None, max_length: float) -> FloatArray:
    """What the shortest walk through each edge leaves of the limit, metres; all edges, then all in the other direction.

    Parameters
    ----------
    roadmap
    start, end
        Vertices; None where walks may end anywhere.
    max_length
        Metres.
    """
    to_go = np.zeros(len(roadmap.vertices)) if end is None else roadmap.distances_to(end)
    a, b = roadmap.edges.T
    shortest = roadmap.distances_to(start)[np.r_[a, b]] + np.tile(roadmap.lengths, 2) + to_go[np.r_[b, a]]
    return max_length - shortest


def affordable(arcs: float) -> int:
    """How many layers per new pose are affordable where one has so many arcs."""
    return int(np.clip(_ARCS / max(arcs, 1e-9), COARSEST, _FINEST))


def _cells(ways: Ways, delta: float, size: float, most: int) -> Int32Array:
    """The cell of each piece: squares of a size, or larger ones where that would make too many of them."""
    if most <= 1:
        return np.zeros(int(first_pieces(ways.lengths, delta)[-1]), dtype=np.int32)
    while True:
        cells = cells_of_pieces(ways, delta, size)
        too_many = (cells.max() + 1) / min(most, _MOST_CELLS)
        if too_many <= 1:
            return cells
        size *= max(1.1, 0.9 * math.sqrt(too_many))
