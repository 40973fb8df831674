"""Exact joint entropy of a pose graph, with an estimate of its rounding error.

    J = (n - 1) kappa / 2 ln(2 pi e) - 1/2 ln det I        (Kitanov and Indelman, arXiv 1903.00927, eq. 14)

With l landmarks, ((n - 1) kappa + l k) / 2 takes the place of the first factor, k the dimension of positions.
I is the Fisher information at the poses as they stand, each measurement taken as the one that they predict, with one pose
anchored (its block removed). ln det I is the same whatever pose is anchored; its rounding error is not, so the pose with the
strongest information is held whichever is asked for (on a real graph with one information of 2.7e12 that saves two digits).
"""

from __future__ import annotations

from topobelief.forms.of_graph import GraphForms
from topobelief.graph.fit import warn_of_misfit
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.well_posed import chosen_anchor, require_determined
from topobelief.linalg.estimate import LOG_2_PI_E, Estimate, Number


def joint_entropy(graph: PoseGraph, *, anchor: int | None = None) -> float:
    """Joint entropy J of all poses but the anchor, exact.

    Sparse L D L^T of H^T Omega H, any noise, SE(2) and SE(3); QR where that loses too many digits.

    Parameters
    ----------
    graph
        At the poses where the information is wanted: optimise it first (`topobelief.optimize`).
    anchor
        Pose that is held; J does not depend on it. Default: the first one.

    Returns
    -------
    float
        Nats; the smaller, the better the poses are known. 0 for a single pose.

    Raises
    ------
    DisconnectedGraphError
        Names the poses that the anchor does not reach.
    IllConditionedError
        If double precision cannot give J to 0.1 nats.

    Warns
    -----
    NotOptimizedWarning
        Where the poses are far from the estimate (chi^2 per degree of freedom above 100).

    Examples
    --------
    >>> import numpy as np
    >>> from topobelief.graph.pose_graph import PoseGraph
    >>> chain = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.diag([100, 100, 400]))
    >>> round(joint_entropy(chain), 6)  # a tree: 3 ln(2 pi e) - ln|Omega|
    -6.688174
    """
    entropy = joint_entropy_estimate(graph, anchor=anchor).value
    warn_of_misfit(graph)
    return entropy


def joint_entropy_estimate(graph: PoseGraph, *, anchor: int | None = None) -> Estimate[float]:
    """`joint_entropy` together with the estimate of its rounding error (docs, the mathematics, section 10)."""
    require_determined(graph, anchor=chosen_anchor(graph, anchor))
    forms = GraphForms(graph, anchor=int(graph.pose_indices[0]))
    return entropy_of(forms.log_det("joint"), forms.dimension)


def entropy_of(log_det: Estimate[Number], dimension: Number, *, what: str = "joint entropy") -> Estimate[Number]:
    """Entropy of `dimension` numbers whose information has this log-determinant, with its error; errors call it `what`.

    Raises
    ------
    IllConditionedError
        If the error exceeds 0.1 nats.
    """
    return (-0.5 * log_det).plus(LOG_2_PI_E / 2 * dimension).known(what)
