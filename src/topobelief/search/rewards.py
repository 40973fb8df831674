"""What the arcs of the layers are worth to a gain's slopes, and the plan that a path through them is.

A new pose anywhere on a piece of a way is covered in two steps. It closes loops with poses that its piece sees: with all of
them or, where at most k are allowed, with k of them; slopes are never negative, so the k largest are an upper bound. Its
odometry

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
from topobelief.linalg.compiled import compiled
from topobelief.search.information_gain import Slopes
from topobelief.search.layers import Arcs, Layers
from topobelief.search.plans import Background, Plan
from topobelief.search.reduced_prior import world_to_body
from topobelief.search.ways import Sightings, Ways


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

    def of_records(self, slopes: Slopes, used: Int32Array) -> FloatArray:
        """Worth of some records, in a table of all of them."""
        worth = np.empty(len(self.layers.records.number))
        sightings, records = self.sightings, self.layers.records
        _value_records(
            used, records.number, records.way, records.piece, records.before, self.cells, self.ways.lengths, self.delta,
            slopes.odometry, self.powers, slopes.closures, sightings.first, sightings.start, sightings.poses, self.earliest,
            self.most, worth,
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
        arcs, charge = self.layers.arcs, price * self.prices
        return _value_arcs(which, arcs.way, arcs.record, arcs.count, arcs.end, arcs.last, worth, charge, remaining + at_end)

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
            if self.most and len(seen) > self.most:
                slope = slopes.closures[(t - 1) * layers.num_labels + cell, seen]
                seen = seen[np.argsort(-slope, kind="stable")[: self.most]]
            closures[t - 1, seen] = 1.0
            ends = np.array(self._odometry_at(e, piece))
            odometry[t - 1] = ends[np.argmax(np.tensordot(ends, slopes.odometry[t - 1, before, cell], 2))]
            cells[t - 1] = cell
        ways = arcs.way[path]
        ways = ways[ways >= 0]
        length, cost = float(self.driven[ways].sum()), float(self.prices[ways].sum())
        plan = Plan(closures, odometry, float(num_poses), length, cost, cells)
        return Course(path, records, plan)

    def background(self) -> Background:
        """The mean of what the records of each pose in each cell add, and of the odometry from each cell to each other."""
        layers, sightings = self.layers, self.sightings
        records, cells = layers.records, layers.num_labels
        shape = (self.num_new * cells, len(self.earliest))
        closures, links = np.zeros(shape), np.zeros((self.num_new, cells, cells, *self.idle.shape))
        _add_records(
            records.number, records.way, records.piece, records.before, self.cells, sightings.first, sightings.start,
            sightings.poses, self.earliest, self.powers[0], closures, links,
        )  # fmt: skip
        if self.idle.any():
            links[:] += self.idle
        t, before, cell = np.nonzero(links.any(axis=(3, 4)))
        source = np.where(t > 0, (t - 1) * cells + before, -1)
        return Background(cells, closures, source, t * cells + cell, links[t, before, cell])

    def _odometry_at(self, way: int, piece: int) -> list[FloatArray]:
        length = float(self.ways.lengths[way])
        is_end = piece == self.sightings.first[way + 1] - self.sightings.first[way] - 1
        places = [length] if is_end else [piece * self.delta, min((piece + 1) * self.delta, length)]
        return [self.powers[0, way] + u * self.powers[1, way] + u * u * self.powers[2, way] for u in places]

    def places(self) -> tuple[FloatArray, FloatArray]:
        """Where the pieces of all records begin and end, metres, shape (R, 2) each."""
        records, ways = self.layers.records, self.ways
        length = ways.lengths[records.way]
        along = (ways.end - ways.begin)[records.way] / length[:, None]
        begin = np.minimum(records.piece * self.delta, length)
        end = np.minimum(begin + self.delta, length)
        origin = ways.begin[records.way]
        return origin + begin[:, None] * along, origin + end[:, None] * along


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


def used_records(arcs: Arcs, which: Int32Array, num_records: int) -> Int32Array:
    """Records of some arcs, each once."""
    return np.flatnonzero(_marked(which, arcs.record, arcs.count, arcs.end, num_records)).astype(np.int32)


def allowed_arcs(arcs: Arcs, which: Int32Array, allowed: BoolArray) -> Int32Array:
    """Those arcs all of whose records are allowed."""
    return which[_all_allowed(which, arcs.record, arcs.count, arcs.end, allowed)]


@compiled
def _marked(which: Int32Array, record: Int32Array, count: Int32Array, end: Int32Array, num_records: int) -> BoolArray:
    marked = np.zeros(num_records, np.bool_)
    for a in which:
        for r in range(record[a], record[a] + count[a]):
            marked[r] = True
        if end[a] >= 0:
            marked[end[a]] = True
    return marked


@compiled
def _all_allowed(which: Int32Array, record: Int32Array, count: Int32Array, end: Int32Array, allowed: BoolArray) -> BoolArray:
    result = np.zeros(len(which), np.bool_)
    for i in range(len(which)):
        a = which[i]
        kept = end[a] < 0 or allowed[end[a]]
        for r in range(record[a], record[a] + count[a]):
            kept = kept and allowed[r]
        result[i] = kept
    return result


@compiled
def _value_records(
    used: Int32Array,
    number: Int32Array,
    way: Int32Array,
    piece: Int32Array,
    before: Int32Array,
    cells: Int32Array,
    lengths: FloatArray,
    delta: float,
    odometry: FloatArray,
    powers: FloatArray,
    closures: FloatArray,
    first: IntArray,
    start: IntArray,
    poses: IntArray,
    earliest: IntArray,
    most: int,
    worth: FloatArray,
) -> None:
    """Worth of the records used: closures, and odometry at the better end of the piece."""
    largest = np.zeros(most + 1)
    kappa = odometry.shape[3]
    for r in used:
        t, e = number[r] - 1, way[r]
        p = first[e] + piece[r]
        begin = min(piece[r] * delta, lengths[e])
        end = min((piece[r] + 1) * delta, lengths[e])
        if p == first[e + 1] - 1:
            begin = lengths[e]
        cell = cells[p]
        constant = linear = square = 0.0
        for i in range(kappa):
            for j in range(kappa):
                slope = odometry[t, before[r], cell, i, j]
                constant += slope * powers[0, e, i, j]
                linear += slope * powers[1, e, i, j]
                square += slope * powers[2, e, i, j]
        row = t * odometry.shape[1] + cell
        value = max(constant + begin * (linear + begin * square), constant + end * (linear + end * square))
        if most == 0:
            for q in range(start[p], start[p + 1]):
                if earliest[poses[q]] <= number[r]:
                    value += closures[row, poses[q]]
        else:
            for c in range(most):
                largest[c] = 0.0
            for q in range(start[p], start[p + 1]):
                if earliest[poses[q]] <= number[r]:
                    slope, c = closures[row, poses[q]], most - 1
                    if slope > largest[c]:
                        while c > 0 and largest[c - 1] < slope:
                            largest[c] = largest[c - 1]
                            c -= 1
                        largest[c] = slope
            for c in range(most):
                value += largest[c]
        worth[r] = value


@compiled
def _add_records(
    number: Int32Array,
    way: Int32Array,
    piece: Int32Array,
    before: Int32Array,
    cells: Int32Array,
    first: IntArray,
    start: IntArray,
    poses: IntArray,
    earliest: IntArray,
    odometry: FloatArray,
    closures: FloatArray,
    links: FloatArray,
) -> None:
    """Means of the closures of each pose in each cell, and of the odometry between cells, into tables of zeros."""
    num_cells = links.shape[1]
    count, times = np.zeros(len(closures)), np.zeros(links.shape[:3])
    for r in range(len(number)):
        t, p = number[r] - 1, first[way[r]] + piece[r]
        row = t * num_cells + cells[p]
        for q in range(start[p], start[p + 1]):
            if earliest[poses[q]] <= number[r]:
                closures[row, poses[q]] += 1.0
        links[t, before[r], cells[p]] += odometry[way[r]]
        count[row] += 1.0
        times[t, before[r], cells[p]] += 1.0
    for row in range(len(count)):
        closures[row] /= max(count[row], 1.0)
    for t in range(links.shape[0]):
        for i in range(num_cells):
            for j in range(num_cells):
                links[t, i, j] /= max(times[t, i, j], 1.0)


@compiled
def _value_arcs(
    which: Int32Array,
    way: Int32Array,
    record: Int32Array,
    count: Int32Array,
    end: Int32Array,
    last: Int32Array,
    worth: FloatArray,
    charge: FloatArray,
    remaining: FloatArray,
) -> FloatArray:
    values = np.empty(len(which))
    for i in range(len(which)):
        a = which[i]
        value = -charge[way[a]] if way[a] >= 0 else 0.0
        for r in range(record[a], record[a] + count[a]):
            value += worth[r]
        if end[a] >= 0:
            value += worth[end[a]]
        if last[a] >= 0:
            value += remaining[last[a]]
        values[i] = value
    return values
