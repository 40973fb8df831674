"""Pose graphs to and from GTSAM (gtsam.org): between factors and values.

GTSAM orders the tangent of Pose3 (rotation, translation), we (translation, rotation); in the plane both put the
translation first. It takes the whole logarithm of an error for its residual where `Group.residual` takes the translation as it
is: the two agree to first order, so information matrices, log-determinants and estimates do and chi^2 nearly does.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP, group_of_size
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import load

_ROTATION_FIRST = np.array([3, 4, 5, 0, 1, 2])  # its own inverse


def to_gtsam(graph: PoseGraph) -> tuple[Any, Any]:
    """Between factors and values of a pose graph; keys are the graph's ids.

    Nothing anchors the factors: add a prior before eliminating them.

    Parameters
    ----------
    graph
        With ids that are not negative.

    Returns
    -------
    factors : gtsam.NonlinearFactorGraph
        One BetweenFactorPose2 or BetweenFactorPose3 per edge, in the order of the edges.
    values : gtsam.Values

    Raises
    ------
    InvalidInputError
        If an id is negative, which no GTSAM key can be.
    """
    gtsam = load_gtsam()
    if (graph.ids < 0).any():
        raise InvalidInputError(f"expected ids from 0 as GTSAM keys, got {graph.ids.min()}")
    planar = graph.group is SE2_GROUP
    between = gtsam.BetweenFactorPose2 if planar else gtsam.BetweenFactorPose3
    order = np.arange(3) if planar else _ROTATION_FIRST
    information = np.ascontiguousarray(graph.information[:, order][:, :, order])
    factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for key, pose in zip(graph.ids.tolist(), graph.poses.tolist(), strict=True):
        values.insert(key, _to_pose(gtsam, pose))
    for (i, j), measured, matrix in zip(graph.ids[graph.edges].tolist(), graph.measurements.tolist(), information, strict=True):
        factors.add(between(i, j, _to_pose(gtsam, measured), gtsam.noiseModel.Gaussian.Information(matrix)))
    return factors, values


def from_gtsam(factors: Any, values: Any) -> PoseGraph:
    """A pose graph from GTSAM's between factors and values; ids are the keys.

    Parameters
    ----------
    factors : gtsam.NonlinearFactorGraph
        BetweenFactorPose2 or BetweenFactorPose3 with Gaussian noise. One prior on one pose is allowed and left out: it only
        says where the graph lies, on which no quantity depends. Slots of removed factors are skipped.
    values : gtsam.Values
        A pose for every key of the factors; keys are below 2^63.

    Raises
    ------
    InvalidInputError
        If the arguments are of other types or swapped; if a factor is of another kind, has robust or constrained noise, or is a
        second prior; if a pose is missing, or a key too large for an id. Names the factor or the key.
    InvalidGraphError
        If the graph itself is malformed, for example a self-loop.
    """
    gtsam = load_gtsam()
    _require_factors_and_values(gtsam, factors, values)
    keys: list[int] = sorted(values.keys())
    if keys and keys[-1] >= 2**63:
        raise InvalidInputError(f"expected keys below 2^63, got {keys[-1]}; use a symbol with an ASCII character")
    index_of = {key: index for index, key in enumerate(keys)}
    poses = [_value(gtsam, values, key) for key in keys]
    edges: list[tuple[int, int]] = []
    measurements: list[FloatArray] = []
    information: list[FloatArray] = []
    num_priors = 0
    for number in range(factors.size()):
        factor = factors.at(number)
        if factor is None:  # removed
            continue
        if isinstance(factor, gtsam.PriorFactorPose2 | gtsam.PriorFactorPose3) and num_priors == 0:
            num_priors = 1
            continue
        if not isinstance(factor, gtsam.BetweenFactorPose2 | gtsam.BetweenFactorPose3):
            raise InvalidInputError(
                "expected BetweenFactorPose2 or BetweenFactorPose3 and at most one prior, "
                f"got {type(factor).__name__} as factor {number}"
            )
        i, j = factor.keys()
        if i not in index_of or j not in index_of:
            missing = gtsam.DefaultKeyFormatter(i if i not in index_of else j)
            raise InvalidInputError(f"expected a value for every key, got none for {missing} of factor {number}")
        edges.append((index_of[i], index_of[j]))
        measurements.append(_from_pose(gtsam, factor.measured()))
        information.append(_information(gtsam, factor.noiseModel(), number))
    if len({len(pose) for pose in poses + measurements}) > 1:
        raise InvalidInputError("expected poses and factors of one kind, got both Pose2 and Pose3")
    if not poses:
        raise InvalidInputError("expected at least one value, got none")
    identity = np.eye(group_of_size(len(poses[0])).tangent_dim)
    return PoseGraph(
        np.array(poses),
        np.array(edges, dtype=np.int64),
        np.array(measurements).reshape(-1, len(poses[0])),
        np.array(information) if information else identity,
        ids=np.array(keys, dtype=np.int64),
    )


def load_gtsam() -> Any:
    """GTSAM, whose bindings carry no usable types; loaded when first used."""
    return load("gtsam", "gtsam")


def _require_factors_and_values(gtsam: Any, factors: Any, values: Any) -> None:
    if isinstance(factors, gtsam.NonlinearFactorGraph) and isinstance(values, gtsam.Values):
        return
    got = f"({type(factors).__name__}, {type(values).__name__})"
    swapped = isinstance(factors, gtsam.Values) and isinstance(values, gtsam.NonlinearFactorGraph)
    advice = "; swap the arguments" if swapped else ""
    raise InvalidInputError(f"expected (NonlinearFactorGraph, Values), got {got}{advice}")


def _to_pose(gtsam: Any, pose: list[float]) -> Any:
    if len(pose) == SE2_GROUP.pose_size:
        return gtsam.Pose2(*pose)
    x, y, z, qx, qy, qz, qw = pose
    return gtsam.Pose3(gtsam.Rot3.Quaternion(qw, qx, qy, qz), np.array([x, y, z]))


def _from_pose(gtsam: Any, pose: Any) -> FloatArray:
    if isinstance(pose, gtsam.Pose2):
        return np.array([pose.x(), pose.y(), pose.theta()])
    quaternion = pose.rotation().toQuaternion()
    return np.array([*pose.translation(), quaternion.x(), quaternion.y(), quaternion.z(), quaternion.w()])


def _information(gtsam: Any, noise: Any, number: int) -> FloatArray:
    if not isinstance(noise, gtsam.noiseModel.Gaussian) or noise.isConstrained():
        raise InvalidInputError(f"expected Gaussian noise, got {type(noise).__name__} on factor {number}")
    matrix = np.asarray(noise.information(), dtype=np.float64)
    order = np.arange(3) if len(matrix) == SE2_GROUP.tangent_dim else _ROTATION_FIRST
    return (matrix + matrix.T)[np.ix_(order, order)] / 2


def _value(gtsam: Any, values: Any, key: int) -> FloatArray:
    for at in (values.atPose2, values.atPose3):
        try:
            return _from_pose(gtsam, at(key))
        except RuntimeError:  # the value is of another type
            continue
    raise InvalidInputError(f"expected values of type Pose2 or Pose3, got another at {gtsam.DefaultKeyFormatter(key)}")
