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

from topobelief.forms.of_topology import TopologyForms
from topobelief.forms.protocol import Part, TreeForms
from topobelief.graph.information import checked_information, tangent_split
from topobelief.graph.topology import Topology, checked_weights
from topobelief.graph.variable_kinds import points_among
from topobelief.linalg import LogDetSolver, laplacian_form
from topobelief.linalg.estimate import LOG_2_PI_E, Estimate, Number
from topobelief.signatures.options import SignatureOptions


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
    return tau.known("number of spanning trees").value


def spanning_tree_signature(topology: Topology, information: ArrayLike, *, kinds: ArrayLike | None = None) -> float:
    """s_ST, nats; the larger, the better known the poses.

    With one Omega, kappa/2 tau + (n - 1)/2 [ln |Omega| - kappa ln(2 pi e)] (the paper's eq. 8 with its n corrected); with any
    noise, 1/2 [k tau_p + q tau_r] - (n - 1) kappa/2 ln(2 pi e) on the weights w_p and w_r, which is the same for one Omega and
    -J on a tree.

    Parameters
    ----------
    topology
        Undirected graph, n nodes. Parallel edges add.
    information : shape (kappa, kappa) for all edges, or (num_edges, kappa, kappa)
        Symmetric positive definite, tangent order (translation, rotation). Of an edge to a landmark, which leads to it from a
        pose, the block of positions counts.
    kinds : shape (n,), optional
        "pose" or "landmark" for each node; with landmarks tau_p is taken over all nodes and tau_r over poses alone, and a
        landmark counts k in place of kappa. Default: all are poses.

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
    landmarks = points_among(kinds, topology.num_nodes)
    array = np.asarray(information)
    tangent_dim = int(array.shape[-1]) if array.ndim else 0
    tangent_split(tangent_dim)
    points = landmarks[topology.edges[:, 1]]
    checked = checked_information(array, num_edges=topology.num_edges, tangent_dim=tangent_dim, points=points)
    return joint_signature(TopologyForms(topology, checked, landmarks=landmarks)).known("s_ST").value


def spanning_trees(forms: TreeForms[Number], options: SignatureOptions) -> Estimate[Number]:
    """s_ST or s_map, whichever belongs to the objective."""
    return options.trees(forms).known("s_ST")


def joint_signature(forms: TreeForms[Number]) -> Estimate[Number]:
    """s_ST of all poses: minus the upper bound of their entropy."""
    return (0.5 * weighted_trees(forms)).plus(-(LOG_2_PI_E / 2) * forms.dimension)


def map_signature(forms: TreeForms[Number]) -> Estimate[Number]:
    """s_map: trees of the whole graph over those of its new part, the existing nodes contracted to one.

    1/2 [k (tau_p - ln det L_p,nn) + q (tau_r - ln det L_r,nn)]: the signature of what the existing nodes gain (docs, the
    mathematics, section 11).
    """
    return 0.5 * (weighted_trees(forms) - weighted_trees(forms, "new"))


def weighted_trees(forms: TreeForms[Number], part: Part = "all") -> Estimate[Number]:
    """k tau_p + q tau_r; one Laplacian serves both where w_r / w_p is constant."""
    k, q = forms.split
    positions, ratio = forms.log_det("trees_p", part=part), forms.weight_ratio
    if ratio is None:
        return float(k) * positions + float(q) * forms.log_det("trees_r", part=part)
    num_nodes = forms.num_new if part == "new" else forms.num_free - (0.0 if part == "all" else len(part) - 1.0)
    return (float(k + q) * positions).plus(q * math.log(ratio) * num_nodes)
