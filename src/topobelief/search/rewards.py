"""What the arcs of the layers are worth to a gain's slopes, and the plan that a path through them is.

A new pose anywhere on a piece of a way is covered in two steps. It closes loops with poses that its piece sees, and observes
landmarks likewise: with all of them or, where at most k are allowed, with k of them; slopes are never negative, so the k
largest are an upper bound. Its odometry

    V(u) = (A_0 + u N A_0)^T Omega (A_0 + u N A_0),   A_0 = Ad(x)^-1 at the beginning of the way, N = Ad(exp(-d)) - I,

d the direction of travel in the frame of the robot, which is not turned along the way,
u metres further along the way, is a convex function of u: it lies below the chord between the ends of the piece. So a
mixture of two plans, one with each end's odometry, has no less information than the walk, and one of the two is worth as
much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.geometry import Group
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.search.information_gain import Slopes
from topobelief.search.layers import Arcs, Layers
from topobelief.search.plans import Background, Plan
from topobelief.search.record_kernels import add_records, all_allowed, mark_records, value_arcs, value_records
from topobelief.search.reduced_prior import world_to_body
from topobelief.search.tolls import slack
from topobelief.search.ways import Sightings, Ways

_MOST_IN_BACKGROUND = 100  # seen poses that it closes loops with


@dataclass(frozen=True, slots=True)
class Course:
    """A path through the layers and the plan that it is.

    Attributes
    ----------
    arcs, records : shape (L,), (T',)
        Its arcs; the poses that it drops.
    plan
    """

    arcs: IntArray
    records: IntArray
    plan: Plan


@dataclass(frozen=True, slots=True)
class Rewards:
    """What is needed to value arcs.

    Attributes
    ----------
    layers, ways, sightings
    delta
        Length of a piece, metres.
    powers : shape (3, E, kappa, kappa)
        Coefficients of V(u) along each way.
    idle : shape (kappa, kappa)
        Odometry of idle poses; 0 where they do not count. Where they do, there is one cell.
    earliest : shape (m,)
        The first new pose that may close a loop with each seen pose.
    most
        Closures of a new pose at most; 0: no limit.
    num_poses
        How many of the seen are poses, the first ones; the others are landmarks.
    most_landmarks
        Of which a new pose observes at most so many; 0: no limit.
    num_new
        T.
    driven : shape (E,)
        Metres that count as length, along each way.
    prices : shape (E,)
        What driving each way costs, in the unit of the objective.
    cells : shape (P,)
        Of each piece, from 0 on.
    """

    layers: Layers
    ways: Ways
    sightings: Sightings
    delta: float
    powers: FloatArray
    idle: FloatArray
    earliest: IntArray
    most: int
    num_new: int
    driven: FloatArray
    prices: FloatArray
    cells: Int32Array
    num_poses: int
    most_landmarks: int

    def of_records(self, slopes: Slopes, used: Int32Array) -> FloatArray:
        """Worth of some records, in a table of all of them."""
        worth = np.empty(len(self.layers.records.number))
        sightings, records = self.sightings, self.layers.records
        value_records(
            used, records.number, records.way, records.piece, records.before, self.cells, self.ways.lengths, self.delta,
            slopes.odometry, self.powers, slopes.closures, sightings.first, sightings.start, sightings.poses, self.earliest,
            self.num_poses, self.most, self.most_landmarks, worth,
        )  # fmt: skip
        return worth

    def of_arcs(self, worth: FloatArray, which: Int32Array, slopes: Slopes, price: float, at_end: FloatArray) -> FloatArray:
        """Weights of some arcs.

        Parameters
        ----------
        worth
            Of the records.
        which
        slopes
        price
            Worth of one unit of cost.
        at_end : shape (T + 1,)
            What ends a walk after each number of poses.
        """
        idle = np.einsum("tab,ab->t", slopes.odometry[:, 0, 0], self.idle)
        remaining = np.concatenate([np.cumsum(idle[::-1])[::-1], np.zeros(1)])
        return arc_weights(self.layers.arcs, which, worth, price * self.prices, remaining + at_end)

    def course(self, path: IntArray, slopes: Slopes) -> Course:
        """The plan of a path, with the closures and odometry that the slopes prefer."""
        layers, arcs = self.layers, self.layers.arcs
        taken: list[int] = []
        for arc in path.tolist():
            taken.extend(range(int(arcs.record[arc]), int(arcs.record[arc] + arcs.count[arc])))
            if arcs.end[arc] >= 0:
                taken.append(int(arcs.end[arc]))
        records = np.array(taken, dtype=np.int64)
        num_poses = int(arcs.last[path[-1]])
        count = self.num_new if self.idle.any() else num_poses
        closures = np.zeros((count, slopes.closures.shape[1]))
        odometry = np.broadcast_to(self.idle, (count, *self.idle.shape)).copy()
        cells = np.zeros(count, dtype=np.int64)
        sightings = self.sightings
        for record in taken:
            t, e, piece = (int(column[record]) for column in (layers.records.number, layers.records.way, layers.records.piece))
            place = int(sightings.first[e]) + piece
            before, cell = int(layers.records.before[record]), int(self.cells[place])
            seen = sightings.poses[sightings.start[place] : sightings.start[place + 1]]
            seen = seen[self.earliest[seen] <= t]
            slope = slopes.closures[(t - 1) * layers.num_labels + cell]
            for kind, most in ((seen[seen < self.num_poses], self.most), (seen[seen >= self.num_poses], self.most_landmarks)):
                chosen = kind[np.argsort(-slope[kind], kind="stable")[:most]] if most and len(kind) > most else kind
                closures[t - 1, chosen] = 1.0
            ends = np.array(self._odometry_at(e, piece))
            odometry[t - 1] = ends[np.argmax(np.tensordot(ends, slopes.odometry[t - 1, before, cell], 2))]
            cells[t - 1] = cell
        ways = ways_along(layers, path)
        length, cost = float(self.driven[ways].sum()), float(self.prices[ways].sum())
        plan = Plan(closures, odometry, float(num_poses), length, cost, cells)
        return Course(path, records, plan)

    def walk(self, path: IntArray, vertices: IntArray, max_length: float) -> IntArray | None:
        """The vertices of the roadmap along a path, or None where it is too long.

        Parameters
        ----------
        path
            Arcs.
        vertices
            Of the roadmap, by those of the ways; -1 for the pose where the robot is.
        max_length
            Metres.
        """
        ways = ways_along(self.layers, path)
        if self.driven[ways].sum() > max_length + slack(max_length):
            return None
        along = vertices[np.concatenate([[self.layers.first_vertex], self.ways.target[ways]])]
        return along[along >= 0]

    def background(self) -> Background:
        """The mean of what the records of each pose in each cell add, and of the odometry from each cell to each other.

        Of many seen poses that follow each other one takes the closures of all.
        """
        layers, sightings = self.layers, self.sightings
        records, cells = layers.records, layers.num_labels
        shape = (self.num_new * cells, len(self.earliest))
        closures, links = np.zeros(shape), np.zeros((self.num_new, cells, cells, *self.idle.shape))
        add_records(
            records.number, records.way, records.piece, records.before, self.cells, sightings.first, sightings.start,
            sightings.poses, self.earliest, self.powers[0], closures, links,
        )  # fmt: skip
        parts = np.array_split(np.arange(shape[1]), min(shape[1], _MOST_IN_BACKGROUND))
        few = np.zeros(shape)
        few[:, [part[len(part) // 2] for part in parts]] = np.add.reduceat(closures, [part[0] for part in parts], axis=1)
        if self.idle.any():
            links[:] += self.idle
        t, before, cell = np.nonzero(links.any(axis=(3, 4)))
        source = np.where(t > 0, (t - 1) * cells + before, -1)
        return Background(cells, few, source, t * cells + cell, links[t, before, cell])

    def _odometry_at(self, way: int, piece: int) -> list[FloatArray]:
        length = float(self.ways.lengths[way])
        is_end = piece == self.sightings.first[way + 1] - self.sightings.first[way] - 1
        places = [length] if is_end else [piece * self.delta, min((piece + 1) * self.delta, length)]
        return [self.powers[0, way] + u * self.powers[1, way] + u * u * self.powers[2, way] for u in places]

    def places(self, which: IntArray) -> tuple[FloatArray, FloatArray]:
        """Where the pieces of some records begin and end, metres, shape (number of records, 2) each."""
        ways, way, piece = self.ways, self.layers.records.way[which], self.layers.records.piece[which]
        length = ways.lengths[way]
        along = (ways.end - ways.begin)[way] / length[:, None]
        begin = np.minimum(piece * self.delta, length)
        end = np.minimum(begin + self.delta, length)
        return ways.begin[way] + begin[:, None] * along, ways.begin[way] + end[:, None] * along


def odometry_powers(group: Group, ways: Ways, origin: FloatArray, information: FloatArray) -> FloatArray:
    """Coefficients of V(u) for ways, shape (3, E, kappa, kappa); twists are about the origin."""
    k = group.position_dim
    step = np.zeros((len(ways.poses), group.tangent_dim))
    step[:, :k] = -np.einsum("eji,ej->ei", group.rotation_matrix(ways.poses), ways.directions)
    shear = group.adjoint(group.exp(step)) - np.eye(group.tangent_dim)
    at_begin = world_to_body(group, ways.poses, origin)
    turned, flipped = at_begin.transpose(0, 2, 1), shear.transpose(0, 2, 1)
    middle = flipped @ information + information @ shear
    return np.stack([turned @ matrix @ at_begin for matrix in (information, middle, flipped @ information @ shear)])


def ways_along(layers: Layers, path: IntArray) -> IntArray:
    """The ways that a path through layers drives."""
    ways = layers.arcs.way[path].astype(np.int64)
    return ways[ways >= 0]


def arc_weights(arcs: Arcs, which: Int32Array, worth: FloatArray, charge: FloatArray, at_end: FloatArray) -> FloatArray:
    """Weights of some arcs: the worth of their records, less a charge for each way, and what ends a walk after each number."""
    return value_arcs(which, arcs.way, arcs.record, arcs.count, arcs.end, arcs.last, worth, charge, at_end)


def used_records(arcs: Arcs, which: Int32Array, num_records: int) -> Int32Array:
    """Records of some arcs, each once."""
    return np.flatnonzero(mark_records(which, arcs.record, arcs.count, arcs.end, num_records)).astype(np.int32)


def allowed_arcs(arcs: Arcs, which: Int32Array, allowed: BoolArray) -> Int32Array:
    """Those arcs all of whose records are allowed."""
    return which[all_allowed(which, arcs.record, arcs.count, arcs.end, allowed)]
