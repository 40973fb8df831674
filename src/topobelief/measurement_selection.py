"""Which measurements to make, or to keep: k of the candidates that reduce the joint entropy most, chosen greedily.

With rows A_e of candidate e (whitened, so that A_e^T A_e is what it adds to the Fisher information I), the measurements in a
set S reduce the entropy by

    f(S) = 1/2 ln det(I + sum of A_e^T A_e) - 1/2 ln det I = 1/2 ln det(1 + A_S I^-1 A_S^T).

f never falls when S grows, and a measurement brings less the more there are (f is submodular). So the greedy choice, the
largest gain each time, reaches at least 1 - (1 - 1/k)^k > 1 - 1/e of the best f of any k candidates (Nemhauser, Wolsey and
Fisher, Mathematical Programming 14, 1978; for pose graphs Khosoussi et al., International Journal of Robotics Research 38,
2019). After any number of choices the best f is at most what they have and the k largest gains on top of them, and that is
usually a much better guarantee.

Greedy choice is block Cholesky of 1 + A I^-1 A^T over all candidates, in the order of the largest pivot. Kept are the diagonal
blocks, which give all gains, and the columns of those that were chosen, one solution with I for each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, IntArray, ReadOnlyArrays, frozen_floats, frozen_ints
from topobelief.errors import IllConditionedError, InvalidActionError, InvalidInputError
from topobelief.graph.action import Action, posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.fit import warn_of_misfit
from topobelief.graph.pose_graph import PoseGraph, require_pose_graph
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.inverse import InverseSolver

_COLUMNS = 1 << 22  # numbers in the columns that are solved for at a time: 32 MB
_LARGEST_ERROR = 0.1  # relative, of gains

Candidates = Action | tuple[ArrayLike, ArrayLike] | list[tuple[ArrayLike, ArrayLike]]


@dataclass(frozen=True, eq=False, repr=False)
class Selection(ReadOnlyArrays):
    """The measurements that were chosen, and how much better any others could be.

    Attributes
    ----------
    indices : shape (k,)
        Of the candidates, in the order in which they were chosen.
    gains : shape (k,)
        By how much each reduces the joint entropy after those before it, nats; none is larger than the one before.
    upper_bound
        No k of the candidates reduce the entropy by more, nats.
    num_candidates
    """

    indices: IntArray
    gains: FloatArray
    upper_bound: float
    num_candidates: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "indices", frozen_ints(self.indices, name="indices"))
        object.__setattr__(self, "gains", frozen_floats(self.gains, name="gains"))

    @property
    def gain(self) -> float:
        """By how much all of them reduce the joint entropy, nats."""
        return math.fsum(self.gains)

    @property
    def guarantee(self) -> float:
        """The share of the best possible gain that is certainly reached: at least 1 - 1/e."""
        return self.gain / self.upper_bound if self.upper_bound > 0 else 1.0

    def __repr__(self) -> str:
        reached = f"{self.gain:.4g} nats, at least {math.floor(100 * self.guarantee)} % of the most"
        return f"Selection({len(self.indices)} of {self.num_candidates} measurements, {reached})"


def select_measurements(graph: PoseGraph, candidates: Candidates, k: int) -> Selection:
    """The k candidate measurements that reduce the joint entropy most, chosen greedily, with the guarantee.

    Parameters
    ----------
    graph
        Connected, at the poses where the information is wanted: optimise it first (`topobelief.optimize`).
    candidates
        Edges between its poses, with information: an `Action` without new poses; a tuple (edges of shape (c, 2), information of
        shape (c, kappa, kappa) or (kappa, kappa)); or a list of ((i, j), information of shape (kappa, kappa)). Several between
        the same poses are different measurements. Each is taken to measure what the poses predict.
    k
        How many, from 0 to the number of candidates.

    Returns
    -------
    Selection
        Of equal gains the first candidate is chosen.

    Raises
    ------
    InvalidInputError
        If k is out of range, or candidates are malformed.
    InvalidActionError
        Names the candidate that does not fit the graph.
    DisconnectedGraphError
        If the graph is not connected.
    IllConditionedError
        If double precision cannot give the gains.

    Warns
    -----
    NotOptimizedWarning
        Where the poses are far from the estimate.

    Examples
    --------
    >>> from topobelief.graph.pose_graph import PoseGraph
    >>> chain = PoseGraph([[x, 0, 0] for x in range(5)], [(x, x + 1) for x in range(4)], None, np.diag([100, 100, 400]))
    >>> chosen = select_measurements(chain, ([(0, 1), (0, 4), (1, 3)], np.diag([100, 100, 400])), 2)
    >>> chosen.indices.tolist(), chosen
    ([1, 2], Selection(2 of 3 measurements, 3.796 nats, at least 89 % of the most))
    """
    require_pose_graph(graph)
    action = _as_action(graph, candidates)
    count = len(action.edges)
    if not 0 <= k <= count:
        raise InvalidInputError(f"expected k from 0 to the number of candidates, {count}, got {k}")
    graph.topology.require_connected(names=graph.ids)
    warn_of_misfit(graph)
    if k == 0:
        return Selection(np.zeros(0, dtype=np.int64), np.zeros(0), 0.0, count)
    return _greedy(_Products(graph, action), k)


def _as_action(graph: PoseGraph, candidates: Candidates) -> Action:
    if isinstance(candidates, Action):
        action = candidates
    elif isinstance(candidates, tuple):
        action = Action([], *candidates)
    else:
        edges = [np.asarray(edge) for edge, _ in candidates]
        matrices = [np.asarray(matrix, dtype=np.float64) for _, matrix in candidates]
        action = Action([], np.array(edges), np.array(matrices) if matrices else np.eye(graph.tangent_dim))
    if action.num_new_poses:
        raise InvalidActionError("expected measurements between poses of the graph, got new poses", label=action.label)
    return action


class _Products:
    """Blocks of A I^-1 A^T for the candidates of an action."""

    def __init__(self, graph: PoseGraph, action: Action) -> None:
        self._form = fisher_rows(graph).joint()
        after = posterior(graph, action)  # checks the action
        self._rows: EdgeForm = fisher_rows(after, first_edge=graph.num_edges).joint()
        self._num_nodes = graph.num_poses
        self._solver = InverseSolver(graph.edges, graph.num_poses, self._form.strongest_node())

    @property
    def count(self) -> int:
        """c, candidates."""
        return len(self._rows.edges)

    @property
    def block_size(self) -> int:
        """kappa."""
        return self._rows.block_size

    def diagonal(self) -> FloatArray:
        """Blocks (e, e), shape (c, kappa, kappa)."""
        kappa = self._rows.block_size
        step = max(1, _COLUMNS // (self._num_nodes * kappa**2))
        blocks = np.zeros((self.count, kappa, kappa))
        for first in range(0, self.count, step):
            part = np.arange(first, min(first + step, self.count))
            values = self._solved(part).reshape(self._num_nodes, kappa, len(part), kappa)
            (i, j), at = self._rows.edges[part].T, np.arange(len(part))
            blocks[part] = self._times(part, values[i, :, at], values[j, :, at])
        return blocks

    def column(self, candidate: int) -> FloatArray:
        """Blocks (f, e) for one candidate e, shape (c, kappa, kappa)."""
        values = self._solved(np.array([candidate]))
        return self._times(np.arange(self.count), values[self._rows.edges[:, 0]], values[self._rows.edges[:, 1]])

    def _times(self, which: IntArray, at_i: FloatArray, at_j: FloatArray) -> FloatArray:
        """Rows of some candidates times what stands at their two ends, each of shape (len(which), kappa, kappa)."""
        return self._rows.rows_i[which] @ at_i + self._rows.rows_j[which] @ at_j

    def _solved(self, which: IntArray) -> FloatArray:
        """I^-1 A^T of some candidates, shape (num_nodes, kappa, len(which) kappa)."""
        kappa, edges = self._rows.block_size, self._rows.edges[which]
        columns = np.zeros((self._num_nodes, kappa, len(which), kappa))
        at = np.arange(len(which))
        columns[edges[:, 0], :, at] = self._rows.rows_i[which].transpose(0, 2, 1)
        columns[edges[:, 1], :, at] = self._rows.rows_j[which].transpose(0, 2, 1)
        found = self._solver.solve(self._form, columns.reshape(self._num_nodes, kappa, -1))
        if not found.relative_error <= _LARGEST_ERROR:
            raise IllConditionedError("gains of measurements", found.relative_error)
        return found.values


def _greedy(products: _Products, k: int) -> Selection:
    pivots: FloatArray = np.eye(products.block_size) + products.diagonal()
    columns: list[FloatArray] = []  # of the block Cholesky factor, each of shape (c, kappa, kappa)
    chosen: list[int] = []
    found: list[float] = []
    gains, upper = _gains(pivots, chosen), math.inf
    for _ in range(k):
        upper = min(upper, math.fsum(found) + _most(gains, k))
        best = int(np.argmax(gains))
        column = products.column(best)
        for earlier in columns:
            column = column - earlier @ earlier[best].T
        pivot: FloatArray = pivots[best]
        half = np.linalg.solve(np.linalg.cholesky(pivot), column.transpose(0, 2, 1))
        columns.append(np.asarray(half.transpose(0, 2, 1), dtype=np.float64))
        pivots = pivots - columns[-1] @ columns[-1].transpose(0, 2, 1)
        chosen.append(best)
        found.append(float(gains[best]))
        gains = _gains(pivots, chosen)
    upper = min(upper, math.fsum(found) + _most(gains, k))
    return Selection(np.array(chosen), np.array(found), max(upper, math.fsum(found)), products.count)


def _gains(pivots: FloatArray, chosen: list[int]) -> FloatArray:
    """By how much each candidate reduces the entropy now, shape (c,); -inf where it is chosen already."""
    gains = np.linalg.slogdet(pivots)[1] / 2
    gains[chosen] = -np.inf
    return gains


def _most(gains: FloatArray, k: int) -> float:
    """The sum of the k largest finite gains."""
    return math.fsum(np.sort(gains[np.isfinite(gains)])[::-1][:k])
