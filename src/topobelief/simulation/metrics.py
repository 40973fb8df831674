"""How good a trajectory is against the truth, which nothing but scoring reads.

The trajectory error is the root mean square distance of positions after the rigid motion that fits the estimate to the truth
best (Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991, without scale).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.entropy import joint_entropy
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.record import Record


@dataclass(frozen=True, slots=True)
class TrajectoryErrors:
    """Root mean square position errors after alignment, metres."""

    slam: float
    odometry_factors: float  # of the graph alone, without its closures
    scan_odometry: float  # registered, before any noise was added
    wheel_odometry: float


def alignment(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """T_truth_estimate, the motion that fits the positions best in least squares; shape (3,), of shapes (n, 2 or 3).

    Where all positions coincide the headings do not matter and none is changed.

    Examples
    --------
    >>> truth = np.array([[0, 0], [0, 1], [0, 2]])
    >>> alignment(np.array([[1, 5], [2, 5], [3, 5]]), truth).round(3).tolist()
    [5.0, -1.0, 1.571]
    """
    if estimate.shape[0] != truth.shape[0] or len(estimate) == 0:
        raise InvalidInputError(f"expected as many true poses as estimated ones, got {len(truth)} and {len(estimate)}")
    a, b = (np.asarray(poses, dtype=np.float64)[:, :2] for poses in (estimate, truth))
    covariance = (a - a.mean(axis=0)).T @ (b - b.mean(axis=0))
    theta = math.atan2(covariance[0, 1] - covariance[1, 0], covariance[0, 0] + covariance[1, 1])
    turned = SE2_GROUP.compose(np.array([0.0, 0.0, theta]), np.array([*a.mean(axis=0), 0.0]))
    return np.array([*(b.mean(axis=0) - turned[:2]), theta])


def aligned(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """The estimated poses moved onto the true ones as one rigid body, shape (n, 3)."""
    return SE2_GROUP.compose(np.broadcast_to(alignment(estimate, truth), estimate.shape), estimate)


def from_start(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """The estimated poses moved as one rigid body so that the first is the true one, shape (n, 3).

    A run's start is known, so this shows how errors grow from nothing, where `aligned` spreads them over the whole run.
    """
    moved = SE2_GROUP.compose(truth[0], SE2_GROUP.inverse(estimate[0]))
    return SE2_GROUP.compose(np.broadcast_to(moved, estimate.shape), estimate)


def position_errors(estimate: FloatArray, truth: FloatArray) -> FloatArray:
    """Distance of each position from the true one after alignment, metres, shape (n,)."""
    return np.linalg.norm(aligned(estimate, truth)[:, :2] - truth[:, :2], axis=1)


def trajectory_error(estimate: FloatArray, truth: FloatArray, *, num_poses: int | None = None) -> float:
    """Root mean square of the position errors after alignment, metres.

    Parameters
    ----------
    estimate, truth : shape (n, 3)
    num_poses
        Only the first so many, as where runs are compared on the poses that they share.
    """
    return float(np.sqrt(np.mean(position_errors(estimate[:num_poses], truth[:num_poses]) ** 2)))


def chained(graph: PoseGraph) -> FloatArray:
    """Poses composed from the odometry factors alone, from the first pose on; shape (n, 3)."""
    consecutive = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) == 1
    return dead_reckoned_poses(
        graph.group,
        graph.num_poses,
        graph.edges[consecutive],
        graph.measurements[consecutive],
        known=[0],
        known_poses=graph.poses[:1],
    )


def trajectory_errors(
    graph: PoseGraph, registered: PoseGraph, wheel_odometry: FloatArray, truth: FloatArray, *, num_poses: int | None = None
) -> TrajectoryErrors:
    """All of them, on the first `num_poses` poses.

    Parameters
    ----------
    graph
        At its estimate; what the robot decides on.
    registered
        The same before noise was added.
    wheel_odometry, truth : shape (n, 3)
    """
    return TrajectoryErrors(
        *(
            trajectory_error(poses, truth, num_poses=num_poses)
            for poses in (graph.poses, chained(graph), chained(registered), wheel_odometry)
        )
    )


def run_metrics(record: Record) -> dict[str, float]:
    """Named numbers of a run; seconds, metres, nats, and `_value`s in the unit of the objective.

    `_before` is on the poses that existed before the last leg; the values are those of that leg.

    `goal_distance` and `believed_goal_distance` are the largest over the last legs to each goal, see `record.Leg`.
    """
    legs = record.legs
    decided = [leg for leg in legs if leg.is_decided]
    last = {leg.goal: leg for leg in decided if leg.goal}.values()  # the last leg to each goal
    before = decided[-1].first_pose + 1 if decided else len(record.truth)
    values: dict[str, float] = {
        "goals": len(record.scenario.goals),
        "goals_reached": record.num_goals_reached,
        "poses": len(record.truth),
        "poses_before": before,
        "closures": int(np.count_nonzero(np.abs(record.graph.edges[:, 0] - record.graph.edges[:, 1]) > 1)),
        "contacts": sum(leg.contacts for leg in legs),
        "goal_distance": _largest(leg.goal_distance for leg in last),
        "believed_goal_distance": _largest(leg.believed_goal_distance for leg in last),
        "distance": sum(leg.distance for leg in legs),
        "driven_seconds": sum(leg.driven_seconds for leg in legs),
        "candidates_seconds": sum(leg.candidates_seconds for leg in legs),
        "decision_seconds": sum(leg.decision_seconds for leg in legs),
    }
    for suffix, count in (("", None), ("_before", before)):
        errors = trajectory_errors(
            record.graph, record.registered, record.history.key_poses.wheel_odometry, record.truth, num_poses=count
        )
        values |= {f"error_{name}{suffix}": value for name, value in asdict(errors).items()}
    values["joint_entropy"] = joint_entropy(record.graph)
    if decided:
        values |= {f"{name}_value": getattr(decided[-1], f"{name}_value") for name in ("prior", "predicted", "achieved")}
    return values


def _largest(values: Iterable[float]) -> float:
    """Of those that are numbers; nan without any."""
    return max((value for value in values if not math.isnan(value)), default=math.nan)


def position_covariances(graph: PoseGraph) -> FloatArray:
    """Marginal covariance of each position in the world frame, the first pose held; shape (n, 2, 2), square metres.

    From the dense inverse of the Fisher information: for graphs of one run.
    """
    size = graph.tangent_dim
    form = fisher_rows(graph).joint()
    rows = np.zeros((graph.num_edges, size, graph.num_poses, size))
    index = np.arange(graph.num_edges)
    rows[index, :, form.edges[:, 0]] += form.rows_i
    rows[index, :, form.edges[:, 1]] += form.rows_j
    flat = rows.reshape(graph.num_edges * size, -1)[:, size:]
    covariance = np.zeros((graph.num_poses, size, graph.num_poses, size))
    covariance[1:, :, 1:] = np.linalg.inv(flat.T @ flat).reshape(graph.num_poses - 1, size, graph.num_poses - 1, size)
    poses = np.arange(graph.num_poses)
    return covariance[poses, :, poses][:, :2, :2]
