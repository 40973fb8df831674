"""The spanning-tree signature s_ST (Kitanov and Indelman, arXiv 1903.00927, eq. 8).

Notation: t(G) the (weighted) number of spanning trees, tau = ln t(G) = ln det L_tilde (matrix-tree theorem); k and q the
dimensions of positions and rotations, kappa = k + q; w_p = |O_pp|^(1/k) and w_r = |O_r|p|^(1/q) an edge's noise as two weights.

The paper prints n/2 in s_ST where its own bound has (n - 1)/2; the latter stands here, so that s_ST is exactly minus the
upper bound of the entropy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.graph.information import checked_information, scalar_weights, shared_information, tangent_split
from topobelief.graph.topology import Topology, checked_weights
from topobelief.linalg import LogDet, LogDetSolver, laplacian_form


def log_num_spanning_trees(topology: Topology, *, weights: ArrayLike | None = None) -> float:
    """Logarithm of the weighted number of spanning trees, tau = ln t(G).

    Log-determinant of the reduced Laplacian (matrix-tree theorem), from one sparse factor; t(G) is never formed.

    Parameters
    ----------
    topology
        Undirected graph. Parallel edges add.
    weights : shape (num_edges,), optional
        Positive, in edge order. Default: ones.

    Returns
    -------
    float
        Nats. 0 for an unweighted tree and for a single node.

    Raises
    ------
    DisconnectedGraphError
        Names the nodes that node 0 does not reach.
    IllConditionedError
        If double precision cannot give it to 0.1 nats.

    Examples
    --------
    >>> cycle = Topology(5, [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)])
    >>> round(math.exp(log_num_spanning_trees(cycle)), 9)
    5.0
    """
    topology.require_connected()
    solver = LogDetSolver(topology.edges, topology.num_nodes, 0)
    tau = solver.log_det(laplacian_form(topology.edges, checked_weights(topology, weights)))
    return tau.require_accuracy("number of spanning trees").value


def spanning_tree_signature(topology: Topology, information: ArrayLike) -> float:
    """s_ST, nats; the larger, the better known the poses.

    With one Omega, kappa/2 tau + (n - 1)/2 [ln |Omega| - kappa ln(2 pi e)] (the paper's eq. 8 with its n corrected); with any
    noise, 1/2 [k tau_p + q tau_r] - (n - 1) kappa/2 ln(2 pi e) on the weights w_p and w_r, which is the same for one Omega and
    -J on a tree.

    Parameters
    ----------
    topology
        Undirected graph, n nodes. Parallel edges add.
    information : shape (kappa, kappa) for all edges, or (num_edges, kappa, kappa)
        Symmetric positive definite, tangent order (translation, rotation).

    Raises
    ------
    DisconnectedGraphError
        Names the nodes that node 0 does not reach.
    InvalidGraphError
        Where an information matrix is malformed.
    IllConditionedError
        If double precision cannot give it to 0.1 nats.
    """
    topology.require_connected()
    array = np.asarray(information)
    tangent_dim = int(array.shape[-1]) if array.ndim else 0
    tangent_split(tangent_dim)
    checked = checked_information(array, num_edges=topology.num_edges, tangent_dim=tangent_dim)
    return spanning_tree_estimate(topology, checked, LogDetSolver(topology.edges, topology.num_nodes, 0)).value


def spanning_tree_estimate(topology: Topology, information: FloatArray, solver: LogDetSolver) -> LogDet:
    """`spanning_tree_signature` of checked input with its rounding error; the solver holds any one node."""
    constant = (topology.num_nodes - 1) * information.shape[-1] / 2 * math.log(2 * math.pi * math.e)
    return (0.5 * weighted_trees(topology, information, solver)).plus(-constant).require_accuracy("s_ST")


def map_signature_estimate(
    topology: Topology, information: FloatArray, solver: LogDetSolver, new_solver: LogDetSolver
) -> LogDet:
    """s_map: trees of the whole graph over those of its new part, the existing nodes contracted to one; with its error.

    s_map = 1/2 [k (tau_p - ln det L_p,nn) + q (tau_r - ln det L_r,nn)]: the signature of what the existing nodes gain (docs,
    the mathematics, section 11). `solver` holds any one node, `new_solver` all that exist.
    """
    whole = weighted_trees(topology, information, solver)
    return (0.5 * (whole - weighted_trees(topology, information, new_solver))).require_accuracy("s_map")


def weighted_trees(topology: Topology, information: FloatArray, solver: LogDetSolver) -> LogDet:
    """k tau_p + q tau_r, without the nodes that the solver holds."""
    tangent_dim = int(information.shape[-1])
    k, q = tangent_split(tangent_dim)
    if shared_information(information) is not None:
        tau = solver.log_det(laplacian_form(topology.edges, np.ones(topology.num_edges)))
        return (float(tangent_dim) * tau).plus(solver.num_free * float(np.linalg.slogdet(information[0])[1]))
    w_p, w_r = scalar_weights(information)
    tau_p = solver.log_det(laplacian_form(topology.edges, w_p))
    return float(k) * tau_p + float(q) * solver.log_det(laplacian_form(topology.edges, w_r))
