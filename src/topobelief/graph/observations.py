"""Observations of points by poses: their readings, and the information that these have on positions at an estimate.

An observation has the information J^T Omega J on the position of the point in the frame of the pose (`readings`), a k x k block
within kappa x kappa, and none on rotations. To first order its error moves, in the world frame, with

    R_i e = dp_l - dp_i + C(d) dphi_i,   d = p_l - p_i,

which is that of an edge between poses without its rows of rotations, turned by the rotation of the pose that sees instead of
the one that is seen. With twists of the world (the point moves by v + omega x p_l) the rows are R_i^T [I, -[p_l]x] at both
ends: but for the turn of the noise, which is nothing where it is isotropic, they depend on the point alone. So observations are
stored pose -> point, as closures are stored new -> old.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topobelief.arrays import BoolArray, FloatArray, IntArray, read_only
from topobelief.errors import InvalidGraphError
from topobelief.geometry import Group
from topobelief.graph.information import cholesky_roots, deficient, rounding_of_eigenvalues
from topobelief.graph.readings import READING_KINDS, RELATIVE_POSE, ReadingKind
from topobelief.symbols import node_name

ReadingCodes = NDArray[np.int8]
"""0 for a relative pose, else one more than the place in `READING_KINDS`; shape (m,)."""

_NAMES = (RELATIVE_POSE, *(kind.name for kind in READING_KINDS))


def checked_readings(readings: ArrayLike | None, observing: BoolArray) -> ReadingCodes:
    """Codes of readings by name.

    Parameters
    ----------
    readings : shape (m,), optional
        Default: positions of points, relative poses of the rest.
    observing : shape (m,)
        Which edges lead to a point.

    Raises
    ------
    InvalidGraphError
        Names the first edge whose reading is unknown or does not fit what it leads to.
    """
    if readings is None:
        return read_only(observing.astype(np.int8))
    names = np.asarray(readings)
    if names.shape != observing.shape:
        raise InvalidGraphError(f"expected a reading per edge, shape {observing.shape}, got {names.shape}")
    codes = np.full(len(names), -1, dtype=np.int8)
    for code, name in enumerate(_NAMES):
        codes[names == name] = code
    wrong = np.flatnonzero((codes < 0) | ((codes > 0) != observing))
    if wrong.size:
        edge = int(wrong[0])
        expected = f"one of {', '.join(_NAMES[1:])}" if observing[edge] else f'"{RELATIVE_POSE}" between poses'
        raise InvalidGraphError(f"expected the reading of edge {edge} to be {expected}, got {names[edge]!r}")
    return read_only(codes)


def names_of(codes: ReadingCodes) -> NDArray[np.str_]:
    """Names of readings, shape (m,)."""
    return np.array(_NAMES)[codes]


def observations_by_kind(codes: ReadingCodes) -> list[tuple[ReadingKind, IntArray]]:
    """Each kind of reading of points that there is, with its edges."""
    found = ((kind, np.flatnonzero(codes == code)) for code, kind in enumerate(READING_KINDS, start=1))
    return [(kind, edges) for kind, edges in found if edges.size]


def within_readings(information: ArrayLike, codes: ReadingCodes, group: Group) -> FloatArray:
    """Information matrices of which only the rows and columns of what is read are kept."""
    given = np.asarray(information, dtype=np.float64)
    kappa = group.tangent_dim
    if given.shape not in ((kappa, kappa), (len(codes), kappa, kappa)):
        return given  # refused later
    matrices = np.broadcast_to(given, (len(codes), kappa, kappa)).copy()
    for kind, edges in observations_by_kind(codes):
        read = np.arange(kappa) < kind.dimension(group.position_dim)
        matrices[edges] *= read[:, None] & read
    return matrices


def numbers_read(codes: ReadingCodes, group: Group) -> int:
    """Measured numbers of all edges."""
    total = group.tangent_dim * int(np.count_nonzero(codes == 0))
    return total + sum(kind.dimension(group.position_dim) * len(edges) for kind, edges in observations_by_kind(codes))


@np.errstate(over="ignore", invalid="ignore")  # of landmarks beyond all bounds, which are refused
def information_at(
    group: Group, poses: FloatArray, edges: IntArray, noise: FloatArray, codes: ReadingCodes, ids: IntArray
) -> FloatArray:
    """Information on positions and rotations at some poses: the noise itself, but for readings that are not linear.

    Raises
    ------
    InvalidGraphError
        Names a point that stands where the pose that sees it does, so that it has no bearing and no direction of a range.
    """
    nonlinear = [(kind, which) for kind, which in observations_by_kind(codes) if not kind.linear]
    if not nonlinear:
        return noise
    k, information = group.position_dim, noise.copy()
    for kind, which in nonlinear:
        d = kind.dimension(k)
        seen = seen_positions(group, poses, edges[which])
        here = np.flatnonzero(~(np.linalg.norm(seen, axis=1) > 0))
        if here.size:
            i, j = (node_name(int(name)) for name in ids[edges[which[here[0]]]])
            read = kind.name.replace("_", " and ")
            raise InvalidGraphError(f"expected landmark {j} away from pose {i}, which reads its {read}, got both at one place")
        jacobian = kind.jacobian(seen)
        block = jacobian.transpose(0, 2, 1) @ noise[which, :d, :d] @ jacobian
        information[which] = 0.0
        information[which, :k, :k] = (block + block.transpose(0, 2, 1)) / 2
    return read_only(information)


def seen_positions(group: Group, poses: FloatArray, edges: IntArray) -> FloatArray:
    """Positions of the second ends in the frames of the first, shape (m, k)."""
    i, j = edges.T
    offset = group.position(poses[j]) - group.position(poses[i])
    return np.einsum("mba,mb->ma", group.rotation_matrix(poses[i]), offset)


def roots_of_positions(blocks: FloatArray) -> tuple[FloatArray, BoolArray]:
    """U with U^T U = Omega_pp for positive semidefinite blocks, and which of them are not definite.

    Parameters
    ----------
    blocks : shape (m, k, k)

    Returns
    -------
    roots : shape (m, k, k)
        Upper triangular where the block is positive definite; else with a zero row for each direction that is not measured.
    partial : shape (m,)
    """
    partial = deficient(blocks)
    roots = np.empty_like(blocks)
    roots[~partial] = cholesky_roots(blocks[~partial])
    values, vectors = np.linalg.eigh(blocks[partial])
    least = rounding_of_eigenvalues(values)
    roots[partial] = (np.sqrt(np.where(values > least, values, 0.0))[:, :, None]) * vectors.transpose(0, 2, 1)
    return roots, partial


def observed_residuals(measured: FloatArray, seen: FloatArray, codes: ReadingCodes) -> FloatArray:
    """Residuals of the observations among some edges, zero elsewhere; shape (m, k).

    Parameters
    ----------
    measured, seen : shape (m, k)
        Positions in the frames of the first ends, as measurements store them and as the poses have them.
    codes
    """
    residuals = np.zeros_like(seen)
    for kind, which in observations_by_kind(codes):
        part = kind.residual(measured[which], seen[which])
        residuals[which, : part.shape[1]] = part
    return residuals
