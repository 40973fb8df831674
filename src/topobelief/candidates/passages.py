"""Passages: a place in every gap that the robot can pass on its way, and straight links between these places.

The region that the robot's centre can reach is cut into triangles with their corners on its outline (a constrained
Delaunay triangulation). A path is, up to deformation, the sequence of triangle sides that it crosses, so the triangles
hold all homotopy classes of paths, however wide or narrow the gaps (Demyen and Buro, "Efficient triangulation-based
pathfinding", AAAI 2006). Without the triangles of dead ends, junctions remain and chains of triangles between them.
Each chain is a passage, and the middle of its shortest side is its place. Places of two passages that meet at a
junction are linked by the straight way between them, where that is free and crosses the sides in between; else by way
of the middles of some of these sides.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np
from shapely import Polygon

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.world import World, shapes


class Passages(NamedTuple):
    """Places in the passages of a region, and links between them.

    Attributes
    ----------
    places : shape (N, 2)
        Metres; the first two are start and goal.
    links : shape (K, 2)
        Pairs of places between which the straight way is free.
    """

    places: FloatArray
    links: IntArray


def find_passages(world: World, region: Polygon, ends: FloatArray, robot_radius: float) -> Passages:
    """Passages between start and goal and around all obstacles within reach.

    Parameters
    ----------
    world
    region
        What the robot's centre can reach, see `World.component`.
    ends : shape (2, 2)
        Start and goal, in the region.
    robot_radius
        Metres.
    """
    mesh = _Mesh.of(shapes.triangles(region), ends)
    runs = mesh.runs()
    gates = np.concatenate([np.array(run, dtype=np.int64) for run in runs])
    first, second = mesh.gates.transpose(1, 0, 2)
    middle = (first + second) / 2
    last = np.cumsum([len(run) for run in runs]) - 1
    low, high = np.r_[0, last[:-1] + 1], last
    links: list[IntArray] = []
    while len(low):
        pairs = np.stack([gates[low], gates[high]], axis=1)
        straight = _crosses_all(first[gates], second[gates], middle[gates], low, high)
        a, b = pairs[straight].T
        straight[straight] = world.segments_free(middle[a], middle[b], robot_radius)
        links.append(pairs[straight])
        halved = ~straight & (high - low > 1)
        low, high = low[halved], high[halved]
        half = (low + high) // 2
        low, high = np.concatenate([low, half]), np.concatenate([half, high])
    used, numbered = np.unique(np.concatenate([[[0, 1]], *links]), return_inverse=True)
    found = np.unique(np.sort(numbered.reshape(-1, 2)[1:], axis=1), axis=0)
    return Passages(middle[used], found[found[:, 0] != found[:, 1]])


def _crosses_all(first: FloatArray, second: FloatArray, middle: FloatArray, low: IntArray, high: IntArray) -> BoolArray:
    """Whether each straight way, from the middle of gate `low` to that of gate `high`, crosses all gates between them.

    Within a chain of triangles, that is whether its line parts the two ends of each gate.
    """
    count = np.maximum(high - low - 1, 0)
    way = np.repeat(np.arange(len(low)), count)
    gate = low[way] + 1 + np.arange(len(way)) - np.repeat(np.cumsum(count) - count, count)
    start = middle[low[way]]
    x, y = (middle[high[way]] - start).T
    sides = [x * (end[gate] - start)[:, 1] - y * (end[gate] - start)[:, 0] for end in (first, second)]
    missed = np.bincount(way, weights=sides[0] * sides[1] >= 0, minlength=len(low))
    return missed == 0


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Triangles and the gates between them, as far as they are on the way to something.

    Attributes
    ----------
    gates : shape (2 + G, 2, 2)
        Ends of each gate: start and goal first, as gates without width, then the sides that two triangles share.
    beside : shape (G, 2)
        The two triangles.
    homes
        The triangles in which start and goal are.
    """

    gates: FloatArray
    beside: IntArray
    homes: list[int]

    @classmethod
    def of(cls, triangles: FloatArray, ends: FloatArray) -> _Mesh:
        """Of triangles that share whole sides; shape (T, 3, 2)."""
        corners, corner = np.unique(triangles.reshape(-1, 2), axis=0, return_inverse=True)
        corner = corner.reshape(-1, 3)
        sides, side, count = np.unique(
            np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        by_side = np.argsort(side.ravel(), kind="stable")
        beside = (by_side % len(triangles))[np.repeat(count == 2, count)].reshape(-1, 2)
        gates = np.concatenate([np.stack([ends, ends], axis=1), corners[sides[count == 2]]])
        return cls(gates, beside, [_holder(triangles, end) for end in ends])

    @cached_property
    def _neighbours(self) -> defaultdict[int, dict[int, int]]:
        """By triangle: its gates and the triangle behind each, without those that lead into dead ends."""
        neighbours: defaultdict[int, dict[int, int]] = defaultdict(dict)
        for gate, (a, b) in enumerate(self.beside.tolist(), start=2):
            neighbours[a][gate] = b
            neighbours[b][gate] = a
        dead_ends = [triangle for triangle, ways in neighbours.items() if len(ways) == 1 and triangle not in self.homes]
        while dead_ends:
            ways = neighbours[dead_ends.pop()]
            for gate, behind in ways.items():
                del neighbours[behind][gate]
                if len(neighbours[behind]) == 1 and behind not in self.homes:
                    dead_ends.append(behind)
            ways.clear()
        return neighbours

    def runs(self) -> list[list[int]]:
        """Gates in a row, each run from one end or passage to the next, across one junction."""
        neighbours, homes = self._neighbours, self.homes
        ways_out: defaultdict[int, list[tuple[int, list[int]]]] = defaultdict(list)  # by junction: passage, gates up to it
        for end, home in enumerate(homes):
            ways_out[home].append((end, [end]))
        widths: list[float] = np.linalg.norm(self.gates[:, 1] - self.gates[:, 0], axis=1).tolist()
        for junction, ways in list(neighbours.items()):
            if len(ways) < 3 and junction not in homes:
                continue
            for gate in ways:
                chain, triangle = [gate], ways[gate]
                while len(neighbours[triangle]) == 2 and triangle not in homes:
                    (onward,) = neighbours[triangle].keys() - {chain[-1]}
                    chain.append(onward)
                    triangle = neighbours[triangle][onward]
                narrowest = min(chain, key=lambda gate: (widths[gate], gate))  # the same from both ends of the chain
                ways_out[junction].append((narrowest, chain[: chain.index(narrowest) + 1]))
        return [
            one[::-1] + other
            for ways in ways_out.values()
            for (passage, one), (other_passage, other) in combinations(ways, 2)
            if passage != other_passage
        ]


def _holder(triangles: FloatArray, place: FloatArray) -> int:
    """The triangle that contains a place, or to rounding."""
    a, b, c = triangles.transpose(1, 0, 2)

    def area(u: FloatArray, v: FloatArray) -> FloatArray:
        return (u[:, 0] - place[0]) * (v[:, 1] - place[1]) - (u[:, 1] - place[1]) * (v[:, 0] - place[0])

    parts = np.stack([area(a, b), area(b, c), area(c, a)])
    total = parts.sum(axis=0)
    shares = np.divide(parts, total, out=np.full_like(parts, -np.inf), where=total != 0)
    return int(np.argmax(shares.min(axis=0)))  # at least 0 within
