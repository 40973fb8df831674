"""Expected errors of positions in metres: of the map, aligned, and of the last pose relative to the first.

With C the covariance of the positions of the n poses that exist now and Pi the projection that takes out the best rigid
alignment (docs, the mathematics, section 12),

    E^2 = 1/n tr(Pi C Pi).

The variance of a pose relative to the first one is that of what a measurement of its position in the first pose's frame would
see. Neither depends on which pose is held when the information matrix is inverted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.graph.action import Action, posterior
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, Alignment, checked_sample_size
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.fit import warn_of_misfit
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.well_posed import require_determined
from topobelief.linalg.estimate import Estimate
from topobelief.linalg.inverse_traces import inverse_traces


@dataclass(frozen=True, slots=True)
class ExpectedErrors:
    """What is expected of a map and of where the robot is.

    Attributes
    ----------
    map_rmse : float
        E, metres: expected root mean square error of the positions of the poses that exist now, after the best rigid alignment.
    goal_std : float
        Metres: root of the expected squared error of the position of the last pose (after an action with new poses, of the
        last of these) in the frame of the first pose of the graph. 0 for a single pose.
    """

    map_rmse: float
    goal_std: float


def expected_errors(
    graph: PoseGraph, action: Action | None = None, *, sample_size: int = DEFAULT_SAMPLE_SIZE
) -> ExpectedErrors:
    """The map's expected error in metres and the standard deviation of the last pose, now or after an action; exact.

    Parameters
    ----------
    graph
        At the poses where the errors are wanted: optimise it first (`topobelief.optimize`).
    action
        What will be added. Default: nothing.
    sample_size
        Where the graph has more poses, `map_rmse` is taken over so many of them, evenly spaced, each with its exact covariance.

    Returns
    -------
    ExpectedErrors
        Metres.

    Raises
    ------
    DisconnectedGraphError
        Names the poses that the first one does not reach.
    InvalidActionError
        Where the action does not fit the graph.
    InvalidInputError
        For a sample of fewer than 2 poses.
    IllConditionedError
        If double precision cannot give one of them to 1 % of itself.

    Warns
    -----
    NotOptimizedWarning
        Where the poses are far from the estimate (chi^2 per degree of freedom above 100).

    Examples
    --------
    >>> line = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.diag([100, 100, 1e8]))
    >>> errors = expected_errors(line)  # the first of two steps of 0.1 m along and across; the bearing is all but known
    >>> round(errors.goal_std, 3), round(errors.map_rmse, 3)
    (0.2, 0.075)
    """
    alignment = Alignment.of(graph.positions, checked_sample_size(sample_size))
    after = graph if action is None else posterior(graph, action)
    start = int(after.pose_indices[0])
    require_determined(after, anchor=start)
    goal = after.last_pose
    ends = np.unique([start, goal])
    square, variance = inverse_traces(
        fisher_rows(after).joint(),
        after.num_nodes,
        [alignment.projection, (ends, _relative_position(after, start, goal)[: len(ends)])],
    )
    map_rmse = (1 / alignment.count * square).root().known_length("expected error of the map")
    goal_std = variance.root().known_length("standard deviation of the last pose") if goal > start else Estimate(0.0, 0.0)
    warn_of_misfit(graph)
    return ExpectedErrors(map_rmse.value, goal_std.value)


def _relative_position(graph: PoseGraph, start: int, goal: int) -> FloatArray:
    """Columns on two poses, shape (2, kappa, k): the position of `goal` seen from `start`."""
    k, kappa = graph.group.position_dim, graph.tangent_dim
    columns = np.zeros((2, kappa, k))
    lever = graph.group.lever(graph.positions[[goal]] - graph.positions[[start]])[0]
    columns[0, :k], columns[0, k:], columns[1, :k] = -np.eye(k), lever.T, np.eye(k)
    return columns
