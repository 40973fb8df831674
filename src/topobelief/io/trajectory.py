"""Trajectories as pose graphs: odometry between consecutive poses, and closures where a rule asks for them.

    timestamp x y z qx qy qz qw                              TUM
    r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z                KITTI: the upper three rows of T_world_body

A trajectory is an estimate: it holds no measurements and no noise. Each edge is taken to have measured what the two poses say,
with a noise that the reader is told. KITTI's own poses are those of a camera (x right, y down, z forward); where the robot
moves along z, axes are turned so that x is forward and z up.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from topobelief.arrays import FloatArray, IntArray
from topobelief.errors import FileError
from topobelief.geometry import SE3_GROUP
from topobelief.graph.information import block_isotropic
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.filed_path import numbered_lines, numbered_rows
from topobelief.io.files import StrPath, read_text
from topobelief.io.part import wanted_part
from topobelief.io.reading import ReadGraph, ReadingOptions
from topobelief.io.transforms import FARTHEST, poses_of_matrices
from topobelief.io.tum import read_tum_path
from topobelief.wording import counted

_KITTI = "r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z"
_NUM_FIELDS = (8, 12)
_NEIGHBOURS = 64  # nearest poses among which a closure is sought; spacing leaves some 20 of the robot's own last way in reach
_FORWARD_UP = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # T_body_camera


def is_trajectory(head: bytes) -> bool:
    """Whether the first line that is neither empty nor a comment has the numbers of a pose."""
    lines = (line.strip() for line in head.splitlines())
    fields = next((line for line in lines if line and not line.startswith(b"#")), b"").split()
    try:
        return len(fields) in _NUM_FIELDS and bool([float(text) for text in fields])
    except ValueError:
        return False


def read_trajectory(path: StrPath, options: ReadingOptions) -> ReadGraph:
    """Read a trajectory in TUM or KITTI format, told apart by the numbers of a line, as a graph in SE(3).

    Raises
    ------
    FileError
        If no noise is stated, or a line is not a pose; names the line.
    """
    _require_noise(path, options)
    poses, notes = _poses(path)
    return graph_along(path, poses, options, notes)


def graph_along(path: StrPath, poses: FloatArray, options: ReadingOptions, notes: list[str]) -> ReadGraph:
    """The graph in SE(3) of a trajectory: odometry and closures by the rule of the options.

    Parameters
    ----------
    path
        What it was read from.
    poses : shape (N, 7)
    options
        Noise, spacing and the rule of closures.
    notes
        What was assumed so far.

    Raises
    ------
    FileError
        If no noise is stated.
    """
    noise = _require_noise(path, options)
    kept = _spaced(poses[:, :3], options.spacing)
    poses = poses[kept]
    odometry = np.column_stack([np.arange(len(poses) - 1), np.arange(1, len(poses))])
    closures = _closures(poses[:, :3], options.closure_radius)
    information = block_isotropic(*noise, tangent_dim=SE3_GROUP.tangent_dim)
    graph = PoseGraph(poses, np.concatenate([odometry, closures]), None, information, ids=kept)
    notes = [
        *notes,
        f"took {len(poses)} of {kept[-1] + 1} poses of a trajectory for a graph with {counted(len(odometry), 'odometry edge')} "
        f"and {counted(len(closures), 'closure')} by rule; each measured what its poses say, with standard deviations of "
        f"{noise[0]:g} m and {math.degrees(noise[1]):g} degrees",
    ]
    return wanted_part(path, graph, options, notes)


def _require_noise(path: StrPath, options: ReadingOptions) -> tuple[float, float]:
    if options.noise is None:
        raise FileError(
            path,
            "expected a noise for the odometry of a trajectory, which states none, got none; give standard deviations a step "
            "with noise=(metres, radians) in Python, or make a graph with `topobelief convert FILE graph.g2o --noise M DEG`",
        )
    return options.noise


def _poses(path: StrPath) -> tuple[FloatArray, list[str]]:
    """Poses of shape (N, 7), and what was assumed about them."""
    _, first = next(numbered_lines(read_text(path)))
    if len(first.split()) == _NUM_FIELDS[0]:
        filed = read_tum_path(path)
        far = np.flatnonzero(np.abs(filed.poses[:, :3]).max(axis=1) > FARTHEST)
        if far.size:
            message = f"expected positions within {FARTHEST:.0e} m of the origin, got one beyond"
            raise FileError(path, message, line=filed.lines[int(far[0])])
        return filed.poses, []
    return _kitti_poses(path)


def _kitti_poses(path: StrPath) -> tuple[FloatArray, list[str]]:
    numbers, lines = numbered_rows(path, _KITTI)
    poses, wrong = poses_of_matrices(np.array(numbers).reshape(-1, 3, 4))
    if wrong is not None:
        message = "expected a rotation matrix in columns 1-3, 5-7 and 9-11 and a position within 1e9 m, got other numbers"
        raise FileError(path, message, line=lines[wrong])
    positions, rotations = poses[:, :3], Rotation.from_quat(poses[:, 3:])
    moves = np.diff(positions, axis=0)
    steps = np.abs(rotations[:-1].inv().apply(moves)).mean(axis=0) if len(moves) else np.zeros(3)
    if steps[2] <= max(steps[0], steps[1]):
        return poses, []
    turned = (_FORWARD_UP * rotations * _FORWARD_UP.inv()).as_quat()
    note = "turned the axes of a camera (x right, y down, z forward) to x forward, y left and z up, because it moves along z"
    return np.column_stack([_FORWARD_UP.apply(positions), turned]), [note]


def _spaced(positions: FloatArray, spacing: float) -> IntArray:
    """Indices of the poses to keep, in increasing order, the first and the last among them."""
    if spacing == 0:
        return np.arange(len(positions))
    kept, last = [0], positions[0]
    for index, position in enumerate(positions[1:-1], start=1):
        if math.dist(position, last) >= spacing:
            kept.append(index)
            last = position
    return np.array(kept + [len(positions) - 1] * (len(positions) > 1))


def _closures(positions: FloatArray, radius: float | None) -> IntArray:
    """Edges from poses to the nearest earlier ones that the rule allows, shape (m, 2)."""
    if radius is None or len(positions) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])
    places, first = np.unique(positions, axis=0, return_index=True)  # the first visit of a place is the one to join
    count = min(_NEIGHBOURS, len(places))
    distances, nearest = cKDTree(places).query(positions, k=np.arange(1, count + 1), distance_upper_bound=radius)
    earlier = np.where(np.isfinite(distances), first[np.minimum(nearest, len(places) - 1)], len(positions) - 1)
    allowed = way[:, None] - way[earlier] >= 3 * radius
    new = np.flatnonzero(allowed.any(axis=1))
    return np.column_stack([new, earlier[new, allowed[new].argmax(axis=1)]])
