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
from topobelief.forms.of_topology import TopologyForms
from topobelief.forms.protocol import TreeForms
from topobelief.graph.information import checked_information, tangent_split
from topobelief.graph.topology import Topology
from topobelief.linalg.estimate import LOG_2_PI_E, UNIT_ROUNDOFF, Estimate, Number
from topobelief.signatures.options import SignatureOptions

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
    forms = TopologyForms(topology, _checked(topology, information))
    return by_degrees(forms, normalized=information is not None).value


def von_neumann(forms: TreeForms[Number], options: SignatureOptions) -> Estimate[Number]:
    """s_VN."""
    return _rounded(forms.of_topology(von_neumann_entropy), forms)


def von_neumann_approx(forms: TreeForms[Number], options: SignatureOptions) -> Estimate[Number]:
    """s_VN by degrees, normalised where the options say so."""
    return by_degrees(forms, normalized=options.normalized)


def by_degrees(forms: TreeForms[Number], *, normalized: bool) -> Estimate[Number]:
    """s_VN by degrees; normalised, (n - 1)/2 [mean of ln |Omega| - kappa ln(2 pi e)] is added, as for s_ST."""
    value = math.log(2) / 2 * (forms.num_free + 1.0) - 0.5 * forms.degree_sum()
    if normalized:
        value = value + forms.num_free / 2 * forms.mean_log_noise() - forms.dimension / 2 * LOG_2_PI_E
    return _rounded(value, forms)


def _rounded(value: Number, forms: TreeForms[Number]) -> Estimate[Number]:
    """A sum of about as many terms of one sign as there are nodes, with its rounding error."""
    return Estimate(value, UNIT_ROUNDOFF * (forms.num_free + 1.0) * (1.0 + abs(value)))


def _checked(topology: Topology, information: ArrayLike | None) -> FloatArray:
    """Information matrices of all edges; any where none are given."""
    array = np.eye(3) if information is None else np.asarray(information)
    tangent_dim = int(array.shape[-1]) if array.ndim else 0
    tangent_split(tangent_dim)
    return checked_information(array, num_edges=topology.num_edges, tangent_dim=tangent_dim)
