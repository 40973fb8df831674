"""Information matrices of edges: checked, and described by what the theory asks of them.

Notation (docs, the mathematics, sections 3 to 5): Omega = [[O_pp, O_pr], [O_rp, O_rr]] on the tangent
(translation, rotation); k and q the dimensions of positions and rotations;
O_r|p = O_rr - O_rp O_pp^-1 O_pr the rotation's information with the position marginalised.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray, frozen_floats, read_only
from topobelief.errors import InvalidGraphError

_SPLITS = {3: (2, 1), 6: (3, 3)}
_SYMMETRY_TOLERANCE = 1e-9
SAME_NOISE = 4 * float(np.finfo(np.float64).eps)  # relative; information closer than this is one and the same


def tangent_split(tangent_dim: int) -> tuple[int, int]:
    """(k, q): how many of the kappa tangent dimensions are positions, and how many rotations.

    Raises
    ------
    InvalidGraphError
        Where kappa is neither 3 (SE(2)) nor 6 (SE(3)).
    """
    if tangent_dim not in _SPLITS:
        raise InvalidGraphError(f"expected information matrices of size 3 (SE(2)) or 6 (SE(3)), got {tangent_dim}")
    return _SPLITS[tangent_dim]


def block_isotropic(sigma_position: float, sigma_rotation: float, *, tangent_dim: int = 3) -> FloatArray:
    """Information matrix of independent noise, the same along all axes of position and about all axes of rotation.

    Parameters
    ----------
    sigma_position, sigma_rotation
        Standard deviations, metres and radians.
    tangent_dim
        3 in SE(2), 6 in SE(3).

    Returns
    -------
    FloatArray, shape (tangent_dim, tangent_dim)
        diag(sigma_position^-2, ..., sigma_rotation^-2, ...), in tangent order (translation, rotation).

    Raises
    ------
    InvalidGraphError
        Where tangent_dim is neither 3 nor 6.

    Examples
    --------
    >>> block_isotropic(0.5, 0.25).diagonal().tolist()
    [4.0, 4.0, 16.0]
    """
    num_positions, num_rotations = tangent_split(tangent_dim)
    return np.diag([sigma_position**-2] * num_positions + [sigma_rotation**-2] * num_rotations)


def checked_information(
    information: ArrayLike, *, num_edges: int, tangent_dim: int, points: BoolArray | None = None
) -> FloatArray:
    """Information matrices of shape (num_edges, kappa, kappa), read-only, exactly symmetric; one is shared by all edges.

    Parameters
    ----------
    information, num_edges, tangent_dim
    points : shape (num_edges,), optional
        Edges that say nothing of rotations. Of their matrices the block of positions counts, positive semidefinite and not
        zero; the rest is returned as zero. Default: those whose matrix has no block of rotations.

    Raises
    ------
    InvalidGraphError
        Names the first edge whose matrix is not finite, symmetric and positive definite.
    """
    array = frozen_floats(information, name="information")
    shape = (num_edges, tangent_dim, tangent_dim)
    if points is None and array.shape == shape:
        points = ~measures_rotations(array) & array.any(axis=(1, 2))
    if points is not None and points.any():
        return _checked_with_points(array, points, shape)
    if array.ndim == 2 and array.shape == shape[1:]:
        if num_edges:
            _require_positive_definite(array[None])
        return np.broadcast_to(_symmetric(array), shape)
    if array.size == 0 and num_edges == 0:
        return np.broadcast_to(np.eye(tangent_dim), shape)
    if array.shape != shape:
        raise InvalidGraphError(
            f"expected information of shape {shape} or {shape[1:]} (one matrix for all edges), got {array.shape}"
        )
    _require_positive_definite(array)
    return _symmetric(array)


def _checked_with_points(array: FloatArray, points: BoolArray, shape: tuple[int, int, int]) -> FloatArray:
    """Information matrices some of which are of positions alone."""
    if array.shape == shape[1:]:
        array = np.broadcast_to(array, shape)
    if array.shape != shape:
        raise InvalidGraphError(
            f"expected information of shape {shape} or {shape[1:]} (one matrix for all edges), got {array.shape}"
        )
    k, _ = tangent_split(shape[1])
    whole = np.where(points[:, None, None], np.eye(shape[1]), array)
    _require_positive_definite(whole)
    blocks = np.where(points[:, None, None], array[:, :k, :k], np.eye(k))
    scale = np.abs(blocks).max(axis=(1, 2), initial=0.0)
    skew = np.abs(blocks - blocks.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0)
    with np.errstate(invalid="ignore"):
        plain = np.isfinite(scale) & (scale > 0) & (skew <= _SYMMETRY_TOLERANCE * scale)
    plain[plain] = np.linalg.eigvalsh(blocks[plain])[:, 0] >= -_SYMMETRY_TOLERANCE * scale[plain]
    if not plain.all():
        raise InvalidGraphError(
            "expected a symmetric positive semidefinite block of positions, not all zero, in the information matrix of an "
            f"observation, got another at edge {np.flatnonzero(~plain)[0]}"
        )
    checked = np.array(_symmetric(whole))
    checked[points] = 0.0
    checked[points, :k, :k] = (blocks / 2 + blocks.transpose(0, 2, 1) / 2)[points]
    return read_only(checked)


def cholesky_roots(information: FloatArray) -> FloatArray:
    """U with U^T U = Omega, upper triangular, positions first; positive definite matrices, shape (m, kappa, kappa)."""
    return np.asarray(np.linalg.cholesky(information), dtype=np.float64).transpose(0, 2, 1)


def of_positions(information: FloatArray, points: BoolArray) -> FloatArray:
    """The same matrices, those of the edges to points without what they say of rotations."""
    if not points.any() or not measures_rotations(information)[points].any():
        return information
    k, _ = tangent_split(information.shape[-1])
    read: FloatArray = np.asarray(np.arange(information.shape[-1]) < k, dtype=np.float64)
    return np.where(points[:, None, None], information * np.outer(read, read), information)


def measures_rotations(information: FloatArray) -> BoolArray:
    """Which matrices, shape (m, kappa, kappa), say something of rotations; observations of points do not."""
    k, _ = tangent_split(information.shape[-1])
    if len(information) and information.strides[0] == 0:
        return np.broadcast_to(information[0, k:, k:].any(), len(information))
    return np.asarray(information[:, k:, k:].any(axis=(1, 2)))


def positive_definite(information: FloatArray) -> BoolArray:
    """Which of some symmetric matrices are finite and positive definite to rounding, whatever the units; shape (num_edges,)."""
    definite: BoolArray = np.asarray(np.isfinite(information).all(axis=(1, 2)))
    definite &= (np.diagonal(information, axis1=1, axis2=2) > 0).all(axis=1)
    smallest = np.linalg.eigvalsh(_scaled(information[definite]))[:, 0]
    definite[definite] = smallest > np.finfo(float).eps * information.shape[1]
    return definite


def _scaled(information: FloatArray) -> FloatArray:
    """Matrices of positive diagonals brought to diagonals of ones; others of their entries beyond 2, which none has that is
    positive definite, to 2.
    """
    scale = 1 / np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    with np.errstate(over="ignore"):
        return np.clip(information * scale[:, :, None] * scale[:, None, :], -2.0, 2.0)


def _symmetric(matrices: FloatArray) -> FloatArray:
    """The mean of each matrix and its transpose, where they differ in the last digits."""
    transposed = np.swapaxes(matrices, -1, -2)
    if np.array_equal(matrices, transposed):
        return matrices
    return read_only(matrices / 2 + transposed / 2)


def _require_positive_definite(information: FloatArray) -> None:
    not_finite = np.flatnonzero(~np.isfinite(information).all(axis=(1, 2)))
    if not_finite.size:
        raise InvalidGraphError(f"expected a finite information matrix, got nan or inf at edge {not_finite[0]}")
    if (np.diagonal(information, axis1=1, axis2=2) > 0).all():
        scaled = _scaled(information)
        asymmetric = np.flatnonzero(
            np.abs(scaled - scaled.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0) > _SYMMETRY_TOLERANCE
        )
        if asymmetric.size:
            raise InvalidGraphError(f"expected a symmetric information matrix, got an asymmetric one at edge {asymmetric[0]}")
    flat = np.flatnonzero(~positive_definite(information))
    if flat.size:
        raise InvalidGraphError(
            f"expected a positive definite information matrix, got an indefinite or singular one at edge {flat[0]}"
        )


def shared_information(information: FloatArray) -> FloatArray | None:
    """The one matrix that all edges share, or None."""
    if len(information) == 0:
        return None
    first = information[0]
    same = np.allclose(information, first, rtol=SAME_NOISE, atol=0) if information.strides[0] else True
    return first if same else None


def _repeats_one(information: FloatArray) -> bool:
    """Whether several edges have the very same matrix."""
    return len(information) > 1 and bool(information.strides[0] == 0 or (information == information[0]).all())


@np.errstate(over="ignore")  # entries of a matrix may be further apart than the range of numbers
def isotropic_weights(information: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """(w_p, w_r), each of shape (num_edges,), where every Omega is blkdiag(w_p I_k, w_r I_q); None elsewhere."""
    if _repeats_one(information):
        shared = isotropic_weights(information[:1])
        return shared and (np.broadcast_to(shared[0], len(information)), np.broadcast_to(shared[1], len(information)))
    k, q = tangent_split(information.shape[-1])
    w_p, w_r = information[:, 0, 0], information[:, k, k]
    block = np.zeros(information.shape[1:])
    block[:k, :k] = np.eye(k)
    rotation = np.zeros_like(block)
    rotation[k:, k:] = np.eye(q)
    expected = w_p[:, None, None] * block + w_r[:, None, None] * rotation
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    sizes = scale[:, :, None] * scale[:, None, :]
    deviation = np.abs(information - expected) / np.where(sizes > 0, sizes, 1.0)
    if deviation.max(initial=0.0) > SAME_NOISE:
        return None
    return w_p, w_r


def rotation_information_given_position(information: FloatArray) -> FloatArray:
    """O_r|p = O_rr - O_rp O_pp^-1 O_pr, shape (num_edges, q, q); zero where nothing is said of rotations."""
    k, _ = tangent_split(information.shape[-1])
    o_pp, o_pr, o_rr = information[:, :k, :k], information[:, :k, k:], information[:, k:, k:]
    if not o_pr.any():
        return o_rr
    invertible = np.where(measures_rotations(information)[:, None, None], o_pp, np.eye(k))
    return o_rr - o_pr.transpose(0, 2, 1) @ np.linalg.solve(invertible, o_pr)


def scalar_weights(information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """w_p = |O_pp|^(1/k) and w_r = |O_r|p|^(1/q), each of shape (num_edges,): noise as one number per part.

    An observation of a point has w_r = 0. One of fewer than k numbers (a range, a bearing), whose |O_pp| is 0, has
    w_p = tr(O_pp)/k, what it says along a direction on average.
    """
    if _repeats_one(information):
        w_p, w_r = scalar_weights(information[:1])
        return np.broadcast_to(w_p, len(information)), np.broadcast_to(w_r, len(information))
    k, q = tangent_split(information.shape[-1])
    turning = measures_rotations(information)
    log_det_p = np.linalg.slogdet(information[:, :k, :k])[1]
    w_p, w_r = np.exp(log_det_p / k), np.zeros(len(information))
    if not turning.all():
        partial = ~turning
        partial[partial] = deficient(information[partial, :k, :k])
        w_p[partial] = np.trace(information[partial, :k, :k], axis1=1, axis2=2) / k
    w_r[turning] = np.exp(np.linalg.slogdet(rotation_information_given_position(information[turning]))[1] / q)
    return w_p, w_r


def deficient(blocks: FloatArray) -> BoolArray:
    """Which positive semidefinite matrices are singular to rounding, shape (m,)."""
    eigenvalues: FloatArray = np.asarray(np.linalg.eigvalsh(blocks), dtype=np.float64)
    return eigenvalues[:, 0] <= rounding_of_eigenvalues(eigenvalues)[:, 0]


def rounding_of_eigenvalues(eigenvalues: FloatArray) -> FloatArray:
    """Below what eigenvalues, shape (m, k) in ascending order, are rounding; shape (m, 1)."""
    return eigenvalues.shape[1] * 8 * np.finfo(float).eps * eigenvalues[:, -1:]


def log_dets_of_noise(information: FloatArray) -> FloatArray:
    """ln |Omega| of each edge, shape (m,); of an observation that of its block of positions, as `scalar_weights` has it."""
    turning = measures_rotations(information)
    if turning.all():
        return np.linalg.slogdet(information)[1]
    k, _ = tangent_split(information.shape[-1])
    log_dets = k * np.log(scalar_weights(information)[0])
    log_dets[turning] = np.linalg.slogdet(information[turning])[1]
    return log_dets
