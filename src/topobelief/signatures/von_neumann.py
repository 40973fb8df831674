"""Von Neumann entropy of a graph, by spectrum and by degrees (Kitanov and Indelman, arXiv 1903.00927, eqs. 6, 7).

Notation: L_hat the normalised Laplacian of the simple graph (parallel edges collapse), lambda_hat its eigenvalues, d(i) node
degrees.

    s_VN = - sum (lambda_hat / 2) ln(lambda_hat / 2),   s_VN by degrees = n/2 ln 2 - 1/2 sum over edges of 1 / (d(i) d(j))

The second is the quadratic expansion of the first about lambda_hat / 2 = 1/2. Neither needs a connected graph.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.graph.information import checked_information, tangent_split
from topobelief.graph.topology import Topology

DENSE_SPECTRUM_SIZE = 3000
"""Nodes above which a dense spectrum is announced (here) or refused (in the planner)."""

_SECONDS_PER_CUBED_NODE = 5e-11  # 50 s at 10 000 nodes on two cores


class ExpensiveSpectrumWarning(UserWarning):
    """A dense spectrum of a large graph is about to be computed."""


def von_neumann_entropy(topology: Topology) -> float:
    """Von Neumann entropy s_VN from the dense spectrum of the normalised Laplacian, O(n^3).

    Parameters
    ----------
    topology
        Undirected graph. Parallel edges collapse. Isolated nodes contribute nothing.

    Returns
    -------
    float
        Nats; 0 for a single node.

    Warns
    -----
    ExpensiveSpectrumWarning
        Above 3000 nodes, with the time and memory to expect.

    Examples
    --------
    >>> round(von_neumann_entropy(Topology(2, [(0, 1)])), 12)  # eigenvalues 0 and 2: nothing is uncertain
    0.0
    """
    n = topology.num_nodes
    if n > DENSE_SPECTRUM_SIZE:
        warnings.warn(
            f"the spectrum of {n} nodes takes about {expected_spectrum_seconds(n):.0f} s and {8e-9 * n * n * 2:.1f} GB; "
            "von_neumann_entropy_approx needs node degrees only",
            ExpensiveSpectrumWarning,
            stacklevel=2,
        )
    halves = np.linalg.eigvalsh(normalized_laplacian(topology)) / 2
    positive = halves[halves > n * np.finfo(float).eps]
    return abs(float(np.sum(positive * np.log(positive))))  # each term is negative or zero


def expected_spectrum_seconds(num_nodes: int) -> float:
    """Rough time of a dense symmetric spectrum on two cores, seconds."""
    return _SECONDS_PER_CUBED_NODE * num_nodes**3


def normalized_laplacian(topology: Topology) -> FloatArray:
    """L_hat = D^-1/2 L D^-1/2 of the simple graph, dense, shape (n, n); isolated nodes have zero rows."""
    simple = topology.simple()
    i, j = simple.edges.T
    d = simple.degrees.astype(float)
    result = np.diag((d > 0).astype(float))
    result[i, j] = result[j, i] = -1 / np.sqrt(d[i] * d[j])
    return result


def von_neumann_entropy_approx(topology: Topology, *, information: ArrayLike | None = None) -> float:
    """Von Neumann entropy by node degrees, O(number of edges).

    Parameters
    ----------
    topology
        Undirected graph. Parallel edges collapse.
    information : shape (kappa, kappa) or (num_edges, kappa, kappa), optional
        If given, the normalised form: (n - 1)/2 [ln |Omega| - kappa ln(2 pi e)] is added, as for s_ST, with the mean
        of ln |Omega| where edges differ.

    Returns
    -------
    float
        Nats.

    Examples
    --------
    >>> round(von_neumann_entropy_approx(Topology(2, [(0, 1)])), 12)  # ln 2 - 1/2
    0.19314718056
    """
    simple = topology.simple()
    i, j = simple.edges.T
    d = simple.degrees.astype(float)
    value = topology.num_nodes / 2 * math.log(2) - 0.5 * float(np.sum(1 / (d[i] * d[j])))
    return value if information is None else value + noise_normalization(topology, information)


def noise_normalization(topology: Topology, information: ArrayLike) -> float:
    """(n - 1)/2 [ln |Omega| - kappa ln(2 pi e)], the term that makes graphs of different sizes comparable."""
    array = np.asarray(information)
    tangent_dim = int(array.shape[-1]) if array.ndim else 0
    tangent_split(tangent_dim)
    checked = checked_information(array, num_edges=topology.num_edges, tangent_dim=tangent_dim)
    log_dets: FloatArray = np.linalg.slogdet(checked)[1]
    mean_log_det = float(log_dets.mean()) if topology.num_edges else 0.0
    return (topology.num_nodes - 1) / 2 * (mean_log_det - tangent_dim * math.log(2 * math.pi * math.e))
