"""Kernels over the arcs and records of layers: worths, weights, means, and which arcs are allowed (`rewards`)."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import BoolArray, FloatArray, IntArray
from topobelief.linalg.block_cholesky import Int32Array
from topobelief.linalg.compiled import compiled


@compiled
def mark_records(which: Int32Array, record: Int32Array, count: Int32Array, end: Int32Array, num_records: int) -> BoolArray:
    """Which records some arcs have."""
    marked = np.zeros(num_records, np.bool_)
    for a in which:
        for r in range(record[a], record[a] + count[a]):
            marked[r] = True
        if end[a] >= 0:
            marked[end[a]] = True
    return marked


@compiled
def all_allowed(which: Int32Array, record: Int32Array, count: Int32Array, end: Int32Array, allowed: BoolArray) -> BoolArray:
    """Whether all records of each arc are allowed."""
    result = np.zeros(len(which), np.bool_)
    for i in range(len(which)):
        a = which[i]
        kept = end[a] < 0 or allowed[end[a]]
        for r in range(record[a], record[a] + count[a]):
            kept = kept and allowed[r]
        result[i] = kept
    return result


@compiled
def value_records(
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
    num_poses: int,
    most_poses: int,
    most_landmarks: int,
    worth: FloatArray,
) -> None:
    """Worth of the records used: closures and observations, and odometry at the better end of the piece."""
    largest = np.zeros(max(most_poses, most_landmarks) + 1)
    num_kinds = 2 if len(earliest) > num_poses else 1
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
        for kind in range(num_kinds):
            most = most_poses if kind == 0 else most_landmarks
            for c in range(most):
                largest[c] = 0.0
            for q in range(start[p], start[p + 1]):
                if earliest[poses[q]] > number[r] or (poses[q] >= num_poses) != (kind == 1):
                    continue
                slope, c = closures[row, poses[q]], most - 1
                if most == 0:
                    value += slope
                elif slope > largest[c]:
                    while c > 0 and largest[c - 1] < slope:
                        largest[c] = largest[c - 1]
                        c -= 1
                    largest[c] = slope
            for c in range(most):
                value += largest[c]
        worth[r] = value


@compiled
def add_records(
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
def value_arcs(
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
    """Weights of arcs; see `rewards.arc_weights`."""
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
