"""What the front end passes to the back end: a relative pose, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from topobelief.arrays import FloatArray

FactorKind = Literal["odometry", "closure"]
ODOMETRY: FactorKind = "odometry"
CLOSURE: FactorKind = "closure"


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """A measurement between two key poses.

    Attributes
    ----------
    i, j
        Indices of key poses, i < j.
    measurement : shape (3,)
        T_i_j.
    information : shape (3, 3)
        In the tangent at the measured pose.
    kind
        "odometry" between consecutive key poses, "closure" between others.
    note
        Why the scans had no part in it, or that the wheels slipped; empty where both agreed.
    """

    i: int
    j: int
    measurement: FloatArray
    information: FloatArray
    kind: FactorKind
    note: str = ""
