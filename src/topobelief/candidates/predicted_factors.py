"""What driving along a path would add to the pose graph: new poses, odometry between them, and loop closures.

The rules are those of the paper's simulations (Kitanov and Indelman, arXiv 1903.00927, section V): a pose every so many
metres, a closure between two poses that are near each other in space and heading but not in time. Its numbers are
1.0 m, 2.0 m, 1.0 rad and an index gap of 2, with no test of whether the two see each other; the defaults here suit a
lidar that looks all around.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.polyline import checked_path, path_length, stations
from topobelief.errors import InvalidInputError
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
) -> list[Action]:
    """One action a path, for a robot that stands at the graph's last pose.

    Parameters
    ----------
    graph
        In SE(2), or in SE(3) with z up: there a path is driven upright at the last pose's height.
    paths
        Each of shape (waypoints, 2), metres. A path that does not begin at the last pose is led there straight.
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
        Least difference of the two poses' indices, at least 2.
    world
        Where given, the poses must see each other in it.

    Returns
    -------
    list of Action
        In the order of the paths and labelled from "path 1" on (labels are for people; indices count from 0). Poses
        head along the path, at a corner as they came. First the odometry, old -> new, then the closures, new -> old,
        sorted. A path that ends where it begins at once adds nothing.

    Raises
    ------
    InvalidInputError
        Where a number is out of range or a path is not one.
    """
    for name, value, upper in (
        ("spacing", spacing, math.inf),
        ("closure_radius", closure_radius, math.inf),
        ("closure_angle", closure_angle, math.pi),
    ):
        if not (0 < value <= upper and math.isfinite(value)):
            limit = "" if upper == math.inf else f" and at most {upper:.6g}"
            raise InvalidInputError(f"expected {name} above 0{limit}, got {value}")
    if min_index_gap < 2:
        raise InvalidInputError(f"expected min_index_gap of at least 2 (1 is odometry), got {min_index_gap}")
    omega = default_information(graph) if information is None else information
    tree = KDTree(graph.positions)
    actions: list[Action] = []
    for index, path in enumerate(paths):
        poses = _poses_along(graph, checked_path(path, name=f"path {index}"), spacing)
        new = graph.num_poses + np.arange(len(poses))
        closures = _closures(
            graph, poses, tree, radius=closure_radius, angle=closure_angle, min_index_gap=min_index_gap, world=world
        )
        edges = np.concatenate([np.stack([new - 1, new], axis=1), closures])
        actions.append(Action(poses, edges, omega, label=f"path {index + 1}"))
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


def _poses_along(graph: PoseGraph, path: FloatArray, spacing: float) -> FloatArray:
    """New poses, shape (L, pose_size), `spacing` apart along a path that begins at the graph's last pose."""
    here = graph.positions[-1]
    arrived = np.linalg.norm(path[0] - here[:2]) <= _ROUNDING * spacing
    path = checked_path(np.vstack([here[:2], path[1:] if arrived else path]))
    length = path_length(path)
    if length <= _ROUNDING * spacing:
        return np.zeros((0, graph.group.pose_size))
    steps = max(1, math.ceil(length / spacing - _ROUNDING))
    x_y, heading = stations(path, np.minimum(spacing * np.arange(1, steps + 1), length))
    x_y[-1] = path[-1]
    if graph.group.pose_size == 3:
        return np.column_stack([x_y, heading])
    z, zero = np.full(steps, here[2]), np.zeros(steps)
    return np.column_stack([x_y, z, zero, zero, np.sin(heading / 2), np.cos(heading / 2)])


def _closures(
    graph: PoseGraph,
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
    pairs = pairs[pairs[:, 0] - pairs[:, 1] >= min_index_gap]
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
