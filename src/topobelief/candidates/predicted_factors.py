"""What driving along a path would add to the pose graph: new poses, odometry between them, and loop closures.

New poses stand where a front end would put them (`new_poses`), and close loops as a `ClosureModel` says, learned from the graph
unless it is given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.attitude import Attitude, Legs, lifted
from topobelief.candidates.closures import ClosureModel, closures_of_paths
from topobelief.candidates.learned_closures import History, learn_closures
from topobelief.candidates.new_poses import poses_along
from topobelief.candidates.observations import ObservationModel, learn_observations, observations_from
from topobelief.candidates.polyline import checked_path, path_length
from topobelief.candidates.start import Start, find_start
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.graph.action import Action
from topobelief.graph.information import shared_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import FreeSpace
from topobelief.world.space import require_room_for, seen_by

_ROUNDING = 1e-9  # relative: what differs by less counts as equal
_FEW = 10  # closures, of which a median says little
KEY_POSE_TURN = math.radians(15)
"""Radians by which a path turns from new pose to new pose, as in our simulated front end."""


def predict_actions(
    graph: PoseGraph,
    paths: Sequence[ArrayLike],
    *,
    closures: ClosureModel | None = None,
    observations: ObservationModel | None = None,
    information: ArrayLike | None = None,
    spacing: float = 1.0,
    turn: float | None = KEY_POSE_TURN,
    closure_radius: float | None = None,
    closure_angle: float | None = None,
    min_index_gap: int | None = None,
    world: FreeSpace | None = None,
    start: int | ArrayLike | Start | None = None,
    attitude: Attitude | None = None,
) -> list[Action]:
    """One action a path, for a robot that stands at the graph's last pose unless told otherwise.

    Parameters
    ----------
    graph
        In SE(2), or in SE(3) with z up.
    paths
        Each of shape (waypoints, 2), or (waypoints, 3) in SE(3), metres. There a path of the plane is driven at the height of
        the pose where it starts. A path that does not begin at the start is led there straight.
    closures
        Which loops the new poses close. Default: learned from the graph (`learn_closures`), in the `world` that is given.
    observations
        Which landmarks the new poses observe, and how well. Default: learned from the graph (`learn_observations`).
    information : shape (kappa, kappa), optional
        Of a measurement between poses. Default: `default_information(graph)` for odometry and `closure_information(graph)` for
        closures. A predicted closure carries `closures.probability` times this.
    spacing
        Metres along the path from pose to pose; the last step, to the path's end, is shorter.
    turn
        Radians: a pose stands also where the robot has turned by this since the last one, several in one place at a sharp
        corner, the start among them. None: by distance only.
    closure_radius, closure_angle, min_index_gap
        In place of `closures`, a rule by hand (`ClosureModel.by_hand`): all poses nearer than this (2 m), turned by at most
        this (radians; pi: any) and at least so many steps apart (5), with certainty.
    world
        Where given, the poses must see each other in it, and the paths must stay in its free space.
    start
        Where the robot stands: index of a pose, to which the first new pose is joined, or a place (x, y). From a place the
        nearest pose in sight is taken, as if the robot had come straight from there: new poses begin on that way, which does
        not count as length. Default: the last pose. In SE(3) a place has its height (x, y, z).
    attitude
        Of new poses in SE(3), which all head along the path: "upright", level; or "along", with the x axis along the path and
        the z axis as the pose of the graph next to it has it. Default: upright where the paths are planar, or all poses of the
        graph are within 30 degrees of it; else along.

    Returns
    -------
    list of Action
        In the order of the paths, labelled by their indices, "path 0" the first; `length` is the path's. Poses head along the
        path, at a corner as they came. First the odometry, old -> new, then the closures, new -> old, sorted, then the
        observations of landmarks, new -> landmark, sorted. A path that ends where it begins at once adds nothing. A new pose
        first closes loops with poses of the graph; if that leaves some of `closures.max_per_pose`, then with new poses before
        it.

    Raises
    ------
    InvalidInputError
        Where a number is out of range, a path is not one, there is no such pose to start at, or `closures` comes with a rule
        by hand.
    PlanningError
        Where a path leaves the free space of the world, or no pose is in sight of the start. The straight way from a pose to a
        path that begins elsewhere counts too, unless the pose itself is not in free space.
    """
    if not (0 < spacing < math.inf):
        raise InvalidInputError(f"expected spacing above 0, got {spacing}")
    if turn is not None and not turn > 0:
        raise InvalidInputError(f"expected turn above 0, or None for none, got {turn}")
    by_hand = {"closure_radius": closure_radius, "closure_angle": closure_angle, "min_index_gap": min_index_gap}
    model = _chosen_model(graph, closures, {name: value for name, value in by_hand.items() if value is not None}, world)
    if information is None:
        of_odometry, of_closures = default_information(graph), closure_information(graph)
    else:
        of_odometry = of_closures = np.asarray(information, dtype=np.float64)
    seeing = learn_observations(graph, world=world) if observations is None else observations
    if world is not None:
        require_room_for(graph, world)
    begin = find_start(graph, start, world=world)
    ways: list[_Way] = []
    dim = 2
    for index, path in enumerate(paths):
        name = f"path {index}"
        checked = checked_path(path, name=name)
        if checked.shape[1] > graph.group.position_dim:
            raise InvalidInputError(f"expected {name} in the plane for a graph in {graph.group.name}, got one in space")
        dim = max(dim, checked.shape[1])
        ways.append(_way(graph, begin, lifted(checked, graph, begin.pose), tolerance=_ROUNDING * spacing))
        if world is not None:
            _require_free(world, ways[-1], name)
    legs = Legs(graph, attitude, dim=dim)
    poses = [poses_along(graph, begin.pose, way.full, spacing=spacing, turn=turn, legs=legs) for way in ways]
    found = closures_of_paths(graph, poses, model, start=begin.pose, world=world)
    sightings = _observations_of_paths(graph, poses, seeing, world)
    actions: list[Action] = []
    for index, (way, new_poses, closing, seen) in enumerate(zip(ways, poses, found, sightings, strict=True)):
        num_new = len(new_poses)
        new = graph.num_nodes + np.arange(num_new)
        before = np.r_[begin.pose, new][:num_new]
        edges = np.concatenate([np.stack([before, new], axis=1), closing, seen])
        parts = [(of_odometry, 1.0, num_new), (model.probability * of_closures, model.probability, len(closing))]
        if seeing is not None:
            parts.append((seeing.information(graph.tangent_dim, graph.group.position_dim), seeing.probability, len(seen)))
        parts = [part for part in parts if part[2]]
        certain = all(chance == 1 for _, chance, _ in parts)
        omega = of_odometry
        if not all(np.array_equal(matrix, of_odometry) for matrix, _, _ in parts):
            omega = np.concatenate([np.repeat(matrix[None], n, axis=0) for matrix, _, n in parts])
        actions.append(
            Action(
                new_poses,
                edges,
                omega,
                label=f"path {index}",
                length=path_length(way.driven),
                probabilities=None if certain else np.concatenate([np.full(n, chance) for _, chance, n in parts]),
            )
        )
    return actions


def _observations_of_paths(
    graph: PoseGraph, paths: Sequence[FloatArray], model: ObservationModel | None, world: FreeSpace | None
) -> list[IntArray]:
    """New pose, landmark, for the new poses of each path; indices as `Action` has them."""
    if model is None or not paths:
        return [np.zeros((0, 2), dtype=np.int64) for _ in paths]
    ends = np.cumsum([len(poses) for poses in paths])
    seen = observations_from(graph, np.concatenate(paths), model, world=world)
    parts = np.split(seen, np.searchsorted(seen[:, 0], ends[:-1]))
    return [
        part + np.array([graph.num_nodes - (end - len(poses)), 0])
        for part, end, poses in zip(parts, ends.tolist(), paths, strict=True)
    ]


def _chosen_model(
    graph: PoseGraph, closures: ClosureModel | None, by_hand: dict[str, Any], world: FreeSpace | None
) -> ClosureModel:
    if closures is None:
        return ClosureModel.by_hand(**by_hand) if by_hand else learn_closures(graph, world=world)
    if by_hand:
        raise InvalidInputError(f"expected closures or a rule by hand, got both; leave out {' and '.join(by_hand)}")
    return closures


def usual_spacing(graph: PoseGraph) -> float:
    """Metres between new poses that suit a graph: 1 in the plane, in space the median step of its odometry."""
    if graph.group.position_dim == 2:
        return 1.0
    return History.of(graph).step or 1.0


def default_information(graph: PoseGraph) -> FloatArray:
    """Noise to expect of a new factor: the one Omega that all edges share, or the median over the odometry chain.

    The median is taken entry by entry over the edges between consecutive poses (over all edges where there are none).
    Should it not be positive definite, the matrix with the median determinant stands in.

    Returns
    -------
    shape (kappa, kappa)

    Raises
    ------
    InvalidInputError
        For a graph without edges.
    """
    if graph.num_edges == 0:
        raise InvalidInputError("expected a graph with edges to take the noise from, got none; give `information`")
    graph = graph.poses_alone
    shared = shared_information(graph.information)
    if shared is not None:
        return shared
    consecutive = np.abs(graph.edges[:, 1] - graph.edges[:, 0]) == 1
    return _typical(graph.information[consecutive] if consecutive.any() else graph.information)


def closure_information(graph: PoseGraph) -> FloatArray:
    """Noise to expect of a new loop closure: the median over the graph's, entry by entry; that of odometry where it has few.

    Closures are told from odometry as `learn_closures` does. Fewer than 10 are few: then it is `default_information(graph)`.
    Should the median not be positive definite, the matrix with the median determinant stands in.

    Returns
    -------
    shape (kappa, kappa)

    Raises
    ------
    InvalidInputError
        For a graph without edges.
    """
    graph = graph.poses_alone
    if graph.num_edges == 0 or shared_information(graph.information) is not None:
        return default_information(graph)
    edges = History.of(graph).edges
    return default_information(graph) if len(edges) < _FEW else _typical(graph.information[edges])


def _typical(chain: FloatArray) -> FloatArray:
    """Median of information matrices; where it is not positive definite, the matrix with the median determinant."""
    median = np.median(chain, axis=0)
    scale = 1 / np.sqrt(np.diagonal(median))
    if np.linalg.eigvalsh(median * np.outer(scale, scale))[0] > _ROUNDING:
        return median
    log_dets = np.linalg.slogdet(chain)[1]
    return chain[np.argsort(log_dets, kind="stable")[len(chain) // 2]]


class _Way(NamedTuple):
    """Polylines of shape (waypoints, k), without repeated waypoints, along which new poses stand."""

    full: FloatArray  # from the pose at the start
    driven: FloatArray  # from the place where the robot stands
    leads_in: bool  # whether the first leg driven leads from the start to a path that begins elsewhere


def _way(graph: PoseGraph, start: Start, path: FloatArray, *, tolerance: float) -> _Way:
    arrived = bool(np.linalg.norm(path[0] - start.place) <= tolerance)
    driven = checked_path(np.vstack([start.place, path[1:] if arrived else path]))
    full = np.vstack([graph.positions[start.pose], driven]) if start.distance(graph) else driven
    return _Way(full, driven, leads_in=not arrived)


def _require_free(world: FreeSpace, way: _Way, name: str) -> None:
    """Refuse a path that leaves the free space; where it is led to from a pose in a wall, that way is not judged."""
    path = seen_by(world, way.driven)
    first = int(way.leads_in and not world.contains(path[:1])[0])
    a, b = (path[first:-1], path[first + 1 :]) if len(path) > 1 else (path, path)
    blocked = np.flatnonzero(~world.visible(a, b))
    if blocked.size:
        begin, end = (f"({', '.join(f'{x:.2f}' for x in ends[blocked[0]])})" for ends in (a, b))
        raise PlanningError(
            f"expected {name} in the free space of the world, got one that leaves it between {begin} and {end}; "
            "change the path, or leave `world` out to predict without walls"
        )
