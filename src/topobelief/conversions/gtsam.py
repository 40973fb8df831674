"""Pose graphs to and from GTSAM (gtsam.org): between factors, observations of landmarks, and values.

GTSAM orders the tangent of Pose3 (rotation, translation), we (translation, rotation); in the plane both put the
translation first. It takes the whole logarithm of an error for its residual where `Group.residual` takes the translation as it
is: the two agree to first order, so information matrices, log-determinants and estimates do and chi^2 nearly does.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.conversions.gtsam_landmarks import observation_factor, observation_of
from topobelief.errors import InvalidInputError, ReadingWarning
from topobelief.geometry import SE2_GROUP, SE3_GROUP, group_of_size
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.readings import READING_KINDS, RELATIVE_POSE
from topobelief.graph.variable_kinds import LANDMARK, POSE
from topobelief.optional import load
from topobelief.symbols import id_of_key, key_of_id
from topobelief.wording import counted

_LEAST_WEIGHT = 1e-6  # of a robust factor, below which it is an outlier that counts no more
_ROTATION_FIRST = np.array([3, 4, 5, 0, 1, 2])  # its own inverse


def to_gtsam(graph: PoseGraph) -> tuple[Any, Any]:
    """Between factors and values of a pose graph; keys are the graph's ids.

    Nothing anchors the factors: add a prior before eliminating them.

    Parameters
    ----------
    graph

    Returns
    -------
    factors : gtsam.NonlinearFactorGraph
        One BetweenFactorPose2 or BetweenFactorPose3 per edge, in the order of the edges; for an observation of a landmark one
        BearingRangeFactor, RangeFactor or BearingFactor, 2D or 3D. A position becomes a bearing and a range.
    values : gtsam.Values
        Landmarks as Point2 or Point3.

    Raises
    ------
    InvalidInputError
        If a landmark is seen at the position of the pose.
    """
    return _factors_and_values(graph, first_pose=0, first_edge=0)


def action_to_gtsam(graph: PoseGraph, action: Action) -> tuple[Any, Any]:
    """What an action adds to the factors and values of a pose graph, as for `gtsam.ISAM2.update`.

    Keys of new poses are their ids in `topobelief.posterior`: one after the other above the largest id of the graph, so that
    the symbols x0 … x9 are followed by x10.

    Parameters
    ----------
    graph
    action
        Its measurements are those that its poses predict.

    Returns
    -------
    factors : gtsam.NonlinearFactorGraph
        One between factor per edge of the action, in their order.
    values : gtsam.Values
        The new poses.

    Raises
    ------
    InvalidActionError
        If the action does not fit the graph.
    """
    return _factors_and_values(posterior(graph, action), first_pose=graph.num_nodes, first_edge=graph.num_edges)


def _factors_and_values(graph: PoseGraph, *, first_pose: int, first_edge: int) -> tuple[Any, Any]:
    """Factors and values of the poses and edges from these on."""
    gtsam = load_gtsam()
    planar = graph.group is SE2_GROUP
    between = gtsam.BetweenFactorPose2 if planar else gtsam.BetweenFactorPose3
    order = np.arange(3) if planar else _ROTATION_FIRST
    information = np.ascontiguousarray(graph.noise[first_edge:, order][:, :, order])
    k, kinds = graph.group.position_dim, {kind.name: kind for kind in READING_KINDS}
    factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    ids: list[int] = graph.ids.tolist()
    keys = [key_of_id(node) for node in ids]
    for node, key in enumerate(keys[first_pose:], start=first_pose):
        pose = graph.poses[node]
        values.insert(key, np.array(pose[:k]) if graph.is_landmark[node] else _to_pose(gtsam, pose.tolist()))
    edges: list[tuple[int, int]] = graph.edges[first_edge:].tolist()
    measurements = graph.measurements[first_edge:].tolist()
    readings = graph.readings[first_edge:].tolist()
    for e, ((i, j), measured, matrix, reading) in enumerate(zip(edges, measurements, information, readings, strict=True)):
        if reading == RELATIVE_POSE:
            noise = gtsam.noiseModel.Gaussian.Information(matrix)
            factors.add(between(keys[i], keys[j], _to_pose(gtsam, measured), noise))
            continue
        d = kinds[reading].dimension(k)
        read = graph.noise[first_edge + e, :d, :d]
        factors.add(observation_factor(gtsam, keys[i], keys[j], np.array(measured[:k]), read, reading))
    return factors, values


def from_gtsam(factors: Any, values: Any = None) -> PoseGraph:
    """A pose graph from GTSAM's between factors and values; ids are the keys, and symbols are shown as such.

    Poses are in the order of their keys: `graph.index("x3")` finds one, `graph.label(index)` says how it is called. A key from
    2^63 on is the negative id of the same 64 bits, of which `to_gtsam` makes the key again.

    Parameters
    ----------
    factors : gtsam.NonlinearFactorGraph or gtsam.ISAM2
        BetweenFactorPose2 or BetweenFactorPose3, and BearingRangeFactor, RangeFactor and BearingFactor from poses to points (2D
        or 3D), with Gaussian or robust noise. The latter keep their Jacobians: see `readings` of `PoseGraph`. A robust factor
        is taken for the Gaussian of its weight at the values, w times its information, and left out where w is below 1e-6; a
        `ReadingWarning` says so. One prior on one pose is allowed and left out: it only says where the graph lies, on which no
        quantity depends. Slots of removed factors are skipped. An ISAM2 stands for its factors and its estimate.
    values : gtsam.Values, optional
        A pose or a point for every key of the factors; keys may be any. Only an ISAM2 needs none.

    Raises
    ------
    InvalidInputError
        If the arguments are of other types or swapped; if a factor is of another kind, has constrained noise, or is a second
        prior; if a pose is missing. Names the factor or the key.
    InvalidGraphError
        If the graph itself is malformed, for example a self-loop.
    """
    gtsam = load_gtsam()
    if isinstance(factors, gtsam.ISAM2) and values is None:
        factors, values = factors.getFactorsUnsafe(), factors.calculateEstimate()
    _require_factors_and_values(gtsam, factors, values)
    keys: list[int] = sorted(values.keys())
    found = {key: _value(gtsam, values, key) for key in keys}
    keys.sort(key=lambda key: (found[key][1], key))  # poses first
    index_of = {key: index for index, key in enumerate(keys)}
    poses, is_point = [found[key][0] for key in keys], [found[key][1] for key in keys]
    edges: list[tuple[int, int]] = []
    measurements: list[FloatArray] = []
    information: list[FloatArray] = []
    readings: list[str] = []
    weights: list[float] = []  # of robust factors
    num_priors = 0
    for number in range(factors.size()):
        factor = factors.at(number)
        if factor is None:  # removed
            continue
        if isinstance(factor, gtsam.PriorFactorPose2 | gtsam.PriorFactorPose3) and num_priors == 0:
            num_priors = 1
            continue
        seen = observation_of(gtsam, factor)
        if seen is None and not isinstance(factor, gtsam.BetweenFactorPose2 | gtsam.BetweenFactorPose3):
            raise InvalidInputError(
                "expected BetweenFactorPose2 or BetweenFactorPose3, factors of bearing and range from a pose to a point, "
                f"and at most one prior, got {type(factor).__name__} as factor {number}"
            )
        i, j = factor.keys()
        if i not in index_of or j not in index_of:
            missing = gtsam.DefaultKeyFormatter(i if i not in index_of else j)
            raise InvalidInputError(f"expected a value for every key, got none for {missing} of factor {number}")
        noise, weight = factor.noiseModel(), 1.0
        if isinstance(noise, gtsam.noiseModel.Robust):
            noise, weight = noise.noise(), _weight(factor, values)
            weights.append(weight)
            if weight < _LEAST_WEIGHT:
                continue
        edges.append((index_of[i], index_of[j]))
        matrix = weight * _information(gtsam, noise, number)
        measured = _from_pose(gtsam, factor.measured()) if seen is None else _pose_at(seen[1])
        measurements.append(measured)
        information.append(matrix if seen is None else _filled(matrix, group_of_size(len(measured)).tangent_dim))
        readings.append(RELATIVE_POSE if seen is None else seen[0].name)
    if weights:
        warnings.warn(_robust_note(weights), ReadingWarning, stacklevel=2)
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
        np.where(is_point, LANDMARK.name, POSE.name) if any(is_point) else None,
        ids=np.array([id_of_key(key) for key in keys], dtype=np.int64),
        readings=readings if any(is_point) else None,
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


def _weight(factor: Any, values: Any) -> float:
    """The weight that a robust factor has in the next linearisation at these values."""
    noise = factor.noiseModel()
    return float(noise.robust().weight(noise.noise().mahalanobisDistance(factor.unwhitenedError(values))))


def _robust_note(weights: list[float]) -> str:
    outliers = sum(weight < _LEAST_WEIGHT for weight in weights)
    kept = [weight for weight in weights if weight >= _LEAST_WEIGHT]
    taken = f", with weights from {min(kept):.3g} to {max(kept):.3g}" if kept else ""
    left = f"; left out {counted(outliers, 'outlier')} of no weight" if outliers else ""
    return f"took {counted(len(kept), 'robust factor')} for the Gaussian of its weight at the values{taken}{left}"


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
        raise InvalidInputError(f"expected Gaussian or robust noise, got {type(noise).__name__} on factor {number}")
    matrix = np.asarray(noise.information(), dtype=np.float64)
    order = _ROTATION_FIRST if len(matrix) == SE3_GROUP.tangent_dim else np.arange(len(matrix))
    return (matrix + matrix.T)[np.ix_(order, order)] / 2


def _value(gtsam: Any, values: Any, key: int) -> tuple[FloatArray, bool]:
    """A value as a pose, and whether it is a point."""
    for at in (values.atPose2, values.atPose3):
        try:
            return _from_pose(gtsam, at(key)), False
        except RuntimeError:  # the value is of another type
            continue
    for at in (values.atPoint2, values.atPoint3):
        try:
            return _pose_at(np.asarray(at(key), dtype=np.float64)), True
        except RuntimeError:
            continue
    raise InvalidInputError(
        f"expected values of type Pose2, Pose3, Point2 or Point3, got another at {gtsam.DefaultKeyFormatter(key)}"
    )


def _pose_at(point: FloatArray) -> FloatArray:
    """The pose at a point that is not turned."""
    group = SE2_GROUP if len(point) == SE2_GROUP.position_dim else SE3_GROUP
    return np.concatenate([point, group.identity()[len(point) :]])


def _filled(matrix: FloatArray, size: int) -> FloatArray:
    """A matrix as the first block of a larger one, the rest zero."""
    filled = np.zeros((size, size))
    filled[: len(matrix), : len(matrix)] = matrix
    return filled
