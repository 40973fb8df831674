"""The resistance signature: how far apart the existing nodes are in the graph as an electrical network.

Notation (docs, the mathematics, section 12): w_p = |O_pp|^(1/k) an edge's information on positions as one weight, k dimensions;
L the Laplacian with these weights, in which an edge is a resistor of 1 / w_p; R_ij the effective resistance between nodes i and
j; n existing nodes, of which a sample may stand for all; Pi_n = I - 1 1^T / n.

    s_R = - sqrt(k/n tr(Pi_n L^+ Pi_n)) = - sqrt(k/n^2 sum over i < j of R_ij)        metres

With rotations known, one block-isotropic Omega and without the turn that an alignment takes out, -s_R is the expected error of
the map. That variances of positions are effective resistances is known (Barooah and Hespanha, IEEE Control Systems Magazine 27,
2007), as are criteria of optimality of the whole graph from the spectrum of its weighted Laplacian (Placed and Castellanos,
2021 to 2023).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from topobelief.errors import InvalidInputError
from topobelief.forms.of_topology import TopologyForms
from topobelief.forms.protocol import TreeForms
from topobelief.graph.alignment import DEFAULT_SAMPLE_SIZE, checked_sample_size
from topobelief.graph.information import checked_information, tangent_split
from topobelief.graph.topology import Topology
from topobelief.linalg.estimate import Estimate, Number
from topobelief.signatures.options import SignatureOptions


def resistance_signature(
    topology: Topology, information: ArrayLike, existing: int, *, sample_size: int = DEFAULT_SAMPLE_SIZE
) -> float:
    """s_R, metres; the larger (the nearer to 0), the better known are the existing nodes.

    It depends on topology and noise alone. It has the unit of the expected error, so a cost in metres of error can be taken
    from it.

    Parameters
    ----------
    topology
        Undirected graph after an action. Parallel edges add.
    information : shape (kappa, kappa) for all edges, or (num_edges, kappa, kappa)
        Symmetric positive definite, tangent order (translation, rotation).
    existing
        How many nodes, the first ones, exist already: the mean is over pairs of these.
    sample_size
        Where there are more, so many evenly spaced ones stand for them.

    Raises
    ------
    DisconnectedGraphError
        Names the nodes that node 0 does not reach.
    InvalidGraphError
        Where an information matrix is malformed.
    InvalidInputError
        Where `existing` or `sample_size` is out of range.
    IllConditionedError
        If double precision cannot give it to 1 % of itself.

    Examples
    --------
    >>> two = Topology(2, [(0, 1)])  # one step of 0.1 m along each axis: each end is half of it from their mean
    >>> round(resistance_signature(two, np.diag([100, 100, 400]), 2), 9)
    -0.070710678
    """
    topology.require_connected()
    if not 1 <= existing <= topology.num_nodes:
        raise InvalidInputError(f"expected between 1 and {topology.num_nodes} existing nodes, got {existing}")
    array = np.asarray(information)
    tangent_dim = int(array.shape[-1]) if array.ndim else 0
    tangent_split(tangent_dim)
    checked = checked_information(array, num_edges=topology.num_edges, tangent_dim=tangent_dim)
    forms = TopologyForms(topology, checked, existing=existing, sample_size=checked_sample_size(sample_size))
    return _signature(forms).value


def resistance(forms: TreeForms[Number], options: SignatureOptions) -> Estimate[Number]:
    """s_R."""
    return _signature(forms)


def _signature(forms: TreeForms[Number]) -> Estimate[Number]:
    square = float(forms.split[0]) * forms.mean_resistance()
    return -1.0 * square.root().known_length("resistance signature")
