"""What driving along a path would add to the pose graph: new poses, odometry between them, and loop closures.

The rules are those of the paper's simulations (Kitanov and Indelman, arXiv 1903.00927, section V): a pose every so many
metres, a closure between two poses that are near each other in space and heading but not in time. Its numbers are
1.0 m, 2.0 m, 1.0 rad and an index gap of 2, with no test of whether the two see each other; the defaults here suit a
lidar that looks all around.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.polyline import checked_path, path_length, stations
from topobelief.candidates.start import Start, find_start
from topobelief.errors import InvalidInputError, PlanningError, degrees_hint
from topobelief.graph.action import Action
from topobelief.graph.information import shared_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World

_ROUNDING = 1e-9  # relative: what differs by less counts as equal


def predict_actions(
    graph: PoseGraph,
    paths: Sequence[ArrayLike],
    *,
    information: ArrayLike | None = None,
    spacing: float = 1.0,
    closure_radius: float = 2.0,
    closure_angle: float = math.pi,
    min_index_gap: int = 5,
    world: World | None = None,
    start: int | ArrayLike | Start | None = None,
) -> list[Action]:
    """One action a path, for a robot that stands at the graph's last pose unless told otherwise.

    Parameters
    ----------
    graph
        In SE(2), or in SE(3) with z up: there a path is driven upright at the height of the pose where it starts.
    paths
        Each of shape (waypoints, 2), metres. A path that does not begin at the start is led there straight.
    information : shape (kappa, kappa), optional
        Of every predicted factor. Default: `default_information(graph)`.
    spacing
        Metres along the path from pose to pose; the last step, to the path's end, is shorter.
    closure_radius
        Poses nearer than this close a loop, metres. At exactly this distance (to 1e-9 of it) they do not, so that two
        poses back on a straight path at 1.0 m never are a closure within 2.0 m by rounding.
    closure_angle
        Largest relative heading, radians; pi: any.
    min_index_gap
        Least number of steps between the two poses, at least 2. Steps are counted along the indices that lead up to the start
        and then along the new poses; old poses behind the start in the graph (of another robot, or tags) are any number away.
    world
        Where given, the poses must see each other in it, and the paths must stay in its free space.
    start
        Where the robot stands: index of a pose, to which the first new pose is joined, or a place (x, y). From a place the
        nearest pose in sight is taken, as if the robot had come straight from there: new poses begin on that way, which does
        not count as length. Default: the last pose.

    Returns
    -------
    list of Action
        In the order of the paths, labelled by their indices, "path 0" the first; `length` is the path's. Poses head along
        the path, at a corner as they came. First the odometry, old -> new, then the closures, new -> old, sorted. A path that
        ends where it begins at once adds nothing.

    Raises
    ------
    InvalidInputError
        Where a number is out of range, a path is not one, or there is no such pose to start at.
    PlanningError
        Where a path leaves the free space of the world, or no pose is in sight of the start. The straight way from a pose to a
        path that begins elsewhere counts too, unless the pose itself is not in free space.
    """
    for name, value, upper in (
        ("spacing", spacing, math.inf),
        ("closure_radius", closure_radius, math.inf),
        ("closure_angle", closure_angle, math.pi),
    ):
        if not (0 < value <= upper and math.isfinite(value)):
            limit, hint = ("", "") if upper == math.inf else (f" and at most {upper:.6g}", degrees_hint(value))
            raise InvalidInputError(f"expected {name} above 0{limit}, got {value}{hint}")
    if min_index_gap < 2:
        raise InvalidInputError(f"expected min_index_gap of at least 2 (1 is odometry), got {min_index_gap}")
    omega = default_information(graph) if information is None else information
    tree = KDTree(graph.positions)
    begin = find_start(graph, start, world=world)
    actions: list[Action] = []
    for index, path in enumerate(paths):
        name = f"path {index}"
        way = _way(graph, begin, checked_path(path, name=name), tolerance=_ROUNDING * spacing)
        if world is not None:
            _require_free(world, way, name)
        poses = _poses_along(graph, begin, way, spacing)
        new = graph.num_poses + np.arange(len(poses))
        closures = _closures(
            graph, begin, poses, tree, radius=closure_radius, angle=closure_angle, min_index_gap=min_index_gap, world=world
        )
        before = np.r_[begin.pose, new][: len(new)]
        edges = np.concatenate([np.stack([before, new], axis=1), closures])
        actions.append(Action(poses, edges, omega, label=name, length=path_length(way.driven)))
    return actions


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
    shared = shared_information(graph.information)
    if shared is not None:
        return shared
    consecutive = np.abs(graph.edges[:, 1] - graph.edges[:, 0]) == 1
    chain = graph.information[consecutive] if consecutive.any() else graph.information
    median = np.median(chain, axis=0)
    scale = 1 / np.sqrt(np.diagonal(median))
    if np.linalg.eigvalsh(median * np.outer(scale, scale))[0] > _ROUNDING:
        return median
    log_dets = np.linalg.slogdet(chain)[1]
    return chain[np.argsort(log_dets, kind="stable")[len(chain) // 2]]


class _Way(NamedTuple):
    """Polylines of shape (waypoints, 2), without repeated waypoints, along which new poses stand."""

    full: FloatArray  # from the pose at the start
    driven: FloatArray  # from the place where the robot stands
    leads_in: bool  # whether the first leg driven leads from the start to a path that begins elsewhere


def _way(graph: PoseGraph, start: Start, path: FloatArray, *, tolerance: float) -> _Way:
    arrived = bool(np.linalg.norm(path[0] - start.place) <= tolerance)
    driven = checked_path(np.vstack([start.place, path[1:] if arrived else path]))
    full = np.vstack([graph.positions[start.pose, :2], driven]) if start.distance(graph) else driven
    return _Way(full, driven, leads_in=not arrived)


def _require_free(world: World, way: _Way, name: str) -> None:
    """Refuse a path that leaves the free space; where it is led to from a pose in a wall, that way is not judged."""
    path = way.driven
    first = int(way.leads_in and not world.contains(path[:1])[0])
    a, b = (path[first:-1], path[first + 1 :]) if len(path) > 1 else (path, path)
    blocked = np.flatnonzero(~world.visible(a, b))
    if blocked.size:
        (x, y), (u, v) = a[blocked[0]], b[blocked[0]]
        raise PlanningError(
            f"expected {name} in the free space of the world, got one that leaves it between ({x:.2f}, {y:.2f}) and "
            f"({u:.2f}, {v:.2f}); change the path, or leave `world` out to predict without walls"
        )


def _poses_along(graph: PoseGraph, start: Start, way: _Way, spacing: float) -> FloatArray:
    """New poses, shape (L, pose_size), `spacing` apart along the way."""
    path, length = way.full, path_length(way.full)
    if length <= _ROUNDING * spacing:
        return np.zeros((0, graph.group.pose_size))
    steps = max(1, math.ceil(length / spacing - _ROUNDING))
    x_y, heading = stations(path, np.minimum(spacing * np.arange(1, steps + 1), length))
    x_y[-1] = path[-1]
    if graph.group.pose_size == 3:
        return np.column_stack([x_y, heading])
    z, zero = np.full(steps, graph.positions[start.pose, 2]), np.zeros(steps)
    return np.column_stack([x_y, z, zero, zero, np.sin(heading / 2), np.cos(heading / 2)])


def _closures(
    graph: PoseGraph,
    start: Start,
    poses: FloatArray,
    tree: KDTree,
    *,
    radius: float,
    angle: float,
    min_index_gap: int,
    world: World | None,
) -> IntArray:
    """Closures (new, old) of new poses with the graph's, whose positions are in the tree, and among themselves."""
    group, n = graph.group, graph.num_poses
    if len(poses) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    new_tree = KDTree(group.position(poses))
    with_prior = new_tree.sparse_distance_matrix(tree, radius, output_type="ndarray")
    among_new = new_tree.query_pairs(radius, output_type="ndarray")
    pairs = np.concatenate([np.stack([with_prior["i"] + n, with_prior["j"]], axis=1), among_new[:, ::-1] + n])
    pairs = pairs[_steps_between(pairs, n, start.pose) >= min_index_gap]
    new, old = pairs[np.lexsort(pairs.T[::-1])].T
    every = np.concatenate([graph.poses, poses])
    relative = group.between(every[new], every[old])
    near = np.linalg.norm(group.position(relative), axis=1) < radius * (1 - _ROUNDING)
    aligned = np.linalg.norm(group.rotation_vector(relative), axis=1) <= angle * (1 + _ROUNDING)
    new, old = new[near & aligned], old[near & aligned]
    if world is not None:
        seen = world.visible(every[new, :2], every[old, :2])
        new, old = new[seen], old[seen]
    return np.stack([new, old], axis=1).astype(np.int64)


def _steps_between(pairs: IntArray, num_old: int, start: int) -> FloatArray:
    """Steps from each old pose along the graph to the start and on to the new pose; inf from poses behind the start."""
    new, old = pairs[:, 0], pairs[:, 1]
    is_old = old < num_old
    steps = new - old - (num_old - 1 - start) * is_old  # as if the start were the last of the old poses
    return np.where(is_old & (old > start), np.inf, steps)
