"""Kinds of variables that a node of a graph may stand for: which dimensions of the tangent each one has.

All nodes have a block of kappa = k + q numbers in linear algebra, positions first. A kind that has fewer is *padded*: the
missing ones get a unit row of their own that couples to nothing, so that every log-determinant is that of the variables that
exist (the pad adds ln 1 = 0), every Schur complement is theirs, and every trace over positions is theirs. What a room needs to
know of a node it asks its kind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, IntArray, read_only
from topobelief.errors import InvalidGraphError


@dataclass(frozen=True, slots=True)
class VariableKind:
    """What a node stands for.

    Attributes
    ----------
    name
        As in `PoseGraph.kinds`.
    turns
        Whether it has a rotation. Without one it is a point: it can be measured from a pose, and measures nothing itself.
    """

    name: str
    turns: bool

    def split(self, k: int, q: int) -> tuple[int, int]:
        """(positions, rotations): how many numbers it has of each, where a pose has k and q."""
        return k, q if self.turns else 0

    def dimension(self, k: int, q: int) -> int:
        """How many numbers it has, where a pose has k of position and q of rotation."""
        return sum(self.split(k, q))


POSE = VariableKind("pose", turns=True)
LANDMARK = VariableKind("landmark", turns=False)
VARIABLE_KINDS = {kind.name: kind for kind in (POSE, LANDMARK)}


def points_among(kinds: ArrayLike | None, num_nodes: int) -> BoolArray:
    """Which nodes are of a kind that has no rotation, shape (num_nodes,), read-only.

    Parameters
    ----------
    kinds : shape (num_nodes,), optional
        Names. Default: all are poses.

    Raises
    ------
    InvalidGraphError
        Names the first node whose kind is unknown.
    """
    if kinds is None:
        return read_only(np.zeros(num_nodes, dtype=np.bool_))
    names = np.asarray(kinds)
    if names.shape != (num_nodes,):
        raise InvalidGraphError(f"expected a kind per node, shape ({num_nodes},), got {names.shape}")
    unknown = np.flatnonzero(~np.isin(names, list(VARIABLE_KINDS)))
    if unknown.size:
        listed = " or ".join(f'"{name}"' for name in VARIABLE_KINDS)
        raise InvalidGraphError(f"expected every kind to be {listed}, got {names[unknown[0]]!r} at node {unknown[0]}")
    return read_only(np.isin(names, [name for name, kind in VARIABLE_KINDS.items() if not kind.turns]))


def require_observers(is_landmark: BoolArray, edges: IntArray) -> None:
    """Raise where nothing is a pose, or a landmark is said to measure."""
    if is_landmark.all():
        raise InvalidGraphError("expected at least one pose, got landmarks alone")
    measuring = np.flatnonzero(is_landmark[edges[:, 0]])
    if measuring.size:
        raise InvalidGraphError(
            f"expected an observation to lead from a pose to a landmark, got edge {measuring[0]} = "
            f"{tuple(edges[measuring[0]].tolist())} from a landmark; turn it round"
        )


def first_edges_of(points: BoolArray, targets: IntArray) -> BoolArray:
    """Which edges are the first that leads to a point: they carry its pad.

    Parameters
    ----------
    points : shape (num_nodes,)
    targets : shape (m,)
        `edges[:, 1]`.
    """
    carries = np.zeros(len(targets), dtype=np.bool_)
    if points.any():
        reached, first = np.unique(targets, return_index=True)
        carries[first[points[reached]]] = True
    return carries
