"""Formats of pose-graph files in lines of text: which tags they have, and in which order the information of an edge stands."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from topobelief.arrays import IntArray
from topobelief.geometry import Group

Entries = tuple[IntArray, IntArray]
"""(row, column) of each number of an edge's information, in the order of the file."""


@dataclass(frozen=True)
class Tag:
    """What a line with this tag holds: ids, the numbers of a pose, and an edge's information."""

    kind: Literal["vertex", "edge"]
    group: Group

    @property
    def num_ids(self) -> int:
        """1 for a vertex, 2 for an edge."""
        return 1 if self.kind == "vertex" else 2

    @property
    def num_information(self) -> int:
        """Entries of the upper triangle for an edge, 0 for a vertex."""
        return self.group.tangent_dim * (self.group.tangent_dim + 1) // 2 if self.kind == "edge" else 0

    @property
    def num_fields(self) -> int:
        """Fields after the tag."""
        return self.num_ids + self.group.pose_size + self.num_information


@dataclass(frozen=True)
class Dialect:
    """A format of pose-graph files.

    Parameters
    ----------
    name
        As its users call it.
    tags
        The lines that are read; "FIX" is part of every dialect.
    marks
        Tags by which a file shows that it is of this format, whether this reader takes them or not.
    orders
        Orders of an edge's information by name, each with its entries for every tangent dimension. The first is the default.
    refused
        Tags that the format knows and this reader does not, and why.
    aliases
        Other tags for the same lines, each with the tag in `tags` that it stands for.
    roots
        Those of the orders in which a line holds the upper triangle R of a square root of its information, R^T R.
    inverses
        Those in which it holds the upper triangle of a covariance.
    """

    name: str
    tags: Mapping[str, Tag]
    marks: re.Pattern[str]
    orders: Mapping[str, Mapping[int, Entries]]
    refused: Mapping[str, str] = field(default_factory=dict[str, str])
    aliases: Mapping[str, str] = field(default_factory=dict[str, str])
    roots: frozenset[str] = frozenset()
    inverses: frozenset[str] = frozenset()


def upper_triangle(size: int) -> Entries:
    """(row, column) of the entries of an upper triangle, row by row."""
    rows, columns = np.triu_indices(size)
    return rows.astype(np.int64), columns.astype(np.int64)
