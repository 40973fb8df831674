"""Independent references: the determinants of the theory from body-frame Jacobians, in double precision and in 80 digits.

The edge i -> j has the residual r = T_ij^-1 T_i^-1 T_j; under body-frame perturbations T exp(t) at T_ij = T_i^-1 T_j it moves
by t_j - Ad(T_j^-1 T_i) t_i. (The package perturbs in the world frame; determinants are the same.) Parts of the tangent
give the matrices of the theory:

    "joint" I,   "positions" I_pp,   "rotations" I_rr,   "rotations_given_positions" L_r|p

Double precision goes through a dense QR of the whitened rows. Exact values go through block elimination in `decimal`, whose
arithmetic is ten times as fast as mpmath's; sines and cosines are mpmath's.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from decimal import Decimal, localcontext

import mpmath
import numpy as np
from numpy.typing import NDArray

from topobelief.graph.pose_graph import PoseGraph

DIGITS = 80
LOG_2_PI_E = math.log(2 * math.pi * math.e)
Held = int | Iterable[int]


def entropy_reference(graph: PoseGraph, *, anchor: int = 0) -> float:
    """J by dense QR."""
    return entropy_from(log_det_reference(graph, "joint", held=anchor), graph)


def entropy_from(log_det: float, graph: PoseGraph) -> float:
    """J of all poses but one where ln det I is `log_det`."""
    return (graph.num_poses - 1) * graph.tangent_dim / 2 * LOG_2_PI_E - log_det / 2


def log_det_reference(graph: PoseGraph, part: str, *, held: Held = 0) -> float:
    """ln det of one of the four matrices, the held nodes' variables removed, by dense QR in double precision."""
    rows_i, rows_j, information = _rows(graph, part, _float_frames(graph))
    num_edges, r, b = rows_i.shape
    free = _free_nodes(graph.num_poses, held)
    if not free:
        return 0.0
    root = np.linalg.cholesky(information).transpose(0, 2, 1)
    dense = np.zeros((num_edges, r, graph.num_poses, b))
    edge = np.arange(num_edges)
    dense[edge, :, graph.edges[:, 0]] = root @ rows_i
    dense[edge, :, graph.edges[:, 1]] = root @ rows_j
    matrix = dense[:, :, free].reshape(num_edges * r, -1)
    norms = np.linalg.norm(matrix, axis=0)
    triangle = np.linalg.qr(matrix / norms, mode="r")
    return 2 * float(np.sum(np.log(np.abs(np.diagonal(triangle)))) + np.sum(np.log(norms)))


def covariance_reference(graph: PoseGraph, *, held: int = 0) -> NDArray:
    """Dense covariance with one pose held, positions and rotations in the world frame, shape (n, kappa, n, kappa).

    The rows of `_rows` take perturbations in the frames of the poses; both parts of those are turned into the world.
    """
    rows_i, rows_j, information = _rows(graph, "joint", _float_frames(graph))
    n, kappa, m = graph.num_poses, graph.tangent_dim, graph.num_edges
    root = np.linalg.cholesky(information).transpose(0, 2, 1)
    rows = np.zeros((m, kappa, n, kappa))
    rows[np.arange(m), :, graph.edges[:, 0]] = root @ rows_i
    rows[np.arange(m), :, graph.edges[:, 1]] = root @ rows_j
    free = _free_nodes(n, held)
    triangle = np.linalg.qr(rows[:, :, free].reshape(m * kappa, len(free) * kappa), mode="r")
    inverse = np.linalg.inv(triangle)
    covariance = np.zeros((n, kappa, n, kappa))
    covariance[np.ix_(free, range(kappa), free, range(kappa))] = (inverse @ inverse.T).reshape(
        len(free), kappa, len(free), kappa
    )
    turn, k = np.zeros((n, kappa, kappa)), graph.group.position_dim
    turn[:, :k, :k] = _float_frames(graph)[0]
    turn[:, k:, k:] = _float_frames(graph)[0] if kappa == 6 else 1.0
    return np.einsum("iab,ibjc,jdc->iajd", turn, covariance, turn)


def alignment_reference(positions: NDArray) -> NDArray:
    """Pi, which takes out what a rigid motion does to positions, shape (n k, n k)."""
    n, k = positions.shape
    centred = positions - positions.mean(axis=0)
    planes = [(a, b) for a in range(k) for b in range(a)]
    motions = [np.tile(axis, n) for axis in np.eye(k)]
    for a, b in planes:
        turned = np.zeros_like(centred)
        turned[:, a], turned[:, b] = -centred[:, b], centred[:, a]
        motions.append(turned.ravel() / max(np.abs(centred).max(), 1e-300))
    left, sizes, _ = np.linalg.svd(np.array(motions).T, full_matrices=False)
    left = left[:, sizes > 1e-9 * sizes[0]]
    return np.eye(n * k) - left @ left.T


def error_reference(
    graph: PoseGraph, after: PoseGraph, *, held: int = 0, covariance: NDArray | None = None, sample: NDArray | None = None
) -> float:
    """E of the poses of `graph`, or of a sample of them, where the covariance is that of the graph `after`; metres."""
    k = graph.group.position_dim
    nodes = np.arange(graph.num_poses) if sample is None else sample
    covariance = covariance_reference(after, held=held) if covariance is None else covariance
    positions = covariance[np.ix_(nodes, range(k), nodes, range(k))].reshape(len(nodes) * k, -1)
    projection = alignment_reference(graph.positions[nodes])
    return math.sqrt(max(0.0, np.trace(projection @ positions @ projection)) / len(nodes))


def log_det_exact(graph: PoseGraph, part: str, *, held: Held = 0) -> Decimal:
    """The same in 80 digits, the numbers of the graph taken as they stand."""
    with localcontext(prec=DIGITS):
        return _exact_log_det(graph.edges, *exact_rows(graph, part), _free_nodes(graph.num_nodes, held))


def exact_rows(graph: PoseGraph, part: str) -> tuple[NDArray, NDArray, NDArray]:
    """Rows on both ends of each edge, not whitened, and their information, as decimals."""
    with localcontext(prec=DIGITS):
        return _rows(graph, part, _decimal_frames(graph))


def laplacian_log_det_exact(
    num_nodes: int, edges: NDArray, weights: NDArray, *, held: Held = 0, shift: float | Decimal = 0.0
) -> Decimal:
    """ln det of a weighted reduced Laplacian plus `shift` times I, in 80 digits."""
    with localcontext(prec=DIGITS):
        one = np.full((len(edges), 1, 1), Decimal(1), dtype=object)
        information = as_decimals(np.asarray(weights)).reshape(-1, 1, 1)
        return _exact_log_det(np.asarray(edges), -one, one, information, _free_nodes(num_nodes, held), shift=Decimal(shift))


def as_decimals(array: NDArray) -> NDArray:
    """Each double as the number that it is, nothing rounded."""
    flat = [value if isinstance(value, Decimal) else Decimal(float(value)) for value in np.ravel(array)]
    result = np.empty(len(flat), dtype=object)
    result[:] = flat
    return result.reshape(np.shape(array))


def _free_nodes(num_nodes: int, held: Held) -> list[int]:
    held_nodes = {held} if isinstance(held, int | np.integer) else {int(node) for node in held}
    return [node for node in range(num_nodes) if node not in held_nodes]


def _rows(graph: PoseGraph, part: str, frames: tuple[NDArray, NDArray]) -> tuple[NDArray, NDArray, NDArray]:
    """Unwhitened rows on both ends of each edge, and their information.

    An observation sees R_i^T (p_l - p_i). The first of each landmark has unit rows for its missing rotation: ln 1 = 0.
    """
    rotations, positions = frames
    exact = rotations.dtype == object
    information = as_decimals(graph.information) if exact else graph.information
    information = (information + information.transpose(0, 2, 1)) / 2
    k, kappa = graph.group.position_dim, graph.tangent_dim
    i, j = graph.edges.T
    R_j_i = rotations[j].transpose(0, 2, 1) @ rotations[i]
    t_j_i = (rotations[j].transpose(0, 2, 1) @ (positions[i] - positions[j])[..., None])[..., 0]
    rows_i = -_adjoint(R_j_i, t_j_i)
    rows_j = np.zeros_like(rows_i) + (as_decimals(np.eye(kappa)) if exact else np.eye(kappa))
    seen = set()
    for edge in np.flatnonzero(graph.is_landmark[j]).tolist():
        assert part == "joint"
        inverse = rotations[i[edge]].T
        rows_i[edge], rows_j[edge] = 0 * rows_i[edge], 0 * rows_j[edge]
        rows_i[edge, :k, :k], rows_j[edge, :k, :k] = -np.eye(k, dtype=int), inverse
        at = inverse @ (positions[j[edge]] - positions[i[edge]])
        if k == 2:
            rows_i[edge, 0, 2], rows_i[edge, 1, 2] = at[1], -at[0]
        else:
            x, y, z = at
            rows_i[edge, :k, k:] = [[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]]
        if j[edge] not in seen:
            rows_j[edge, k:, k:] = information[edge, k:, k:] = np.eye(kappa - k, dtype=int)
            seen.add(j[edge])
    if part == "joint":
        return rows_i, rows_j, information
    if part == "positions":
        return rows_i[:, :k, :k], rows_j[:, :k, :k], information[:, :k, :k]
    if part == "rotations":
        return rows_i[:, :, k:], rows_j[:, :, k:], information
    if part == "rotations_given_positions":
        schur = np.zeros_like(information[:, k:, k:])
        for edge, omega in enumerate(information):
            schur[edge] = _schur_complement(omega, k)
        return rows_i[:, k:, k:], rows_j[:, k:, k:], schur
    raise ValueError(part)


def _adjoint(rotation: NDArray, translation: NDArray) -> NDArray:
    k = rotation.shape[-1]
    kappa = 3 if k == 2 else 6
    result = np.zeros((len(rotation), kappa, kappa), dtype=rotation.dtype) + 0 * rotation[:, :1, :1]
    result[:, :k, :k] = rotation
    if k == 2:
        result[:, 0, 2], result[:, 1, 2] = translation[:, 1], -translation[:, 0]
        result[:, 2, 2] = rotation[:, 0, 0] * 0 + 1
        return result
    x, y, z = translation.T
    cross = np.zeros_like(rotation) + 0 * rotation
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross[:, 1, 0], cross[:, 2, 0], cross[:, 2, 1] = z, -y, x
    result[:, k:, k:] = rotation
    result[:, :k, k:] = cross @ rotation
    return result


def _float_frames(graph: PoseGraph) -> tuple[NDArray, NDArray]:
    return np.array([_rotation(pose, math.cos, math.sin) for pose in graph.poses.tolist()]), graph.positions


def _decimal_frames(graph: PoseGraph) -> tuple[NDArray, NDArray]:
    def exactly(function):
        def of(angle: float) -> Decimal:
            with mpmath.workdps(DIGITS):
                return Decimal(mpmath.nstr(function(mpmath.mpf(angle)), DIGITS))

        return of

    rotations = [_rotation(pose, exactly(mpmath.cos), exactly(mpmath.sin)) for pose in graph.poses.tolist()]
    return as_decimals(np.array(rotations, dtype=object)), as_decimals(graph.positions)


def _rotation(pose, cos, sin):
    """R_world_body of one pose; numbers stay in the arithmetic of `cos` and `sin`."""
    if len(pose) == 3:
        c, s = cos(pose[2]), sin(pose[2])
        return [[c, -s], [s, c]]
    number = type(cos(0.0))
    x, y, z, w = (number(value) for value in pose[3:])
    square = x * x + y * y + z * z + w * w
    return [
        [1 - 2 * (y * y + z * z) / square, 2 * (x * y - z * w) / square, 2 * (x * z + y * w) / square],
        [2 * (x * y + z * w) / square, 1 - 2 * (x * x + z * z) / square, 2 * (y * z - x * w) / square],
        [2 * (x * z - y * w) / square, 2 * (y * z + x * w) / square, 1 - 2 * (x * x + y * y) / square],
    ]


def _schur_complement(omega: NDArray, k: int) -> NDArray:
    """Omega_rr - Omega_rp Omega_pp^-1 Omega_pr, in the arithmetic of omega."""
    inverse, _ = _inverse_and_det(omega[:k, :k])
    return omega[k:, k:] - omega[k:, :k] @ inverse @ omega[:k, k:]


def _inverse_and_det(matrix: NDArray) -> tuple[NDArray, Decimal]:
    """Gauss-Jordan of a positive definite matrix, in its own arithmetic."""
    n = len(matrix)
    work = np.concatenate([matrix, np.eye(n, dtype=int).astype(matrix.dtype)], axis=1)
    det = 1
    for row in range(n):
        pivot = work[row, row]
        det = det * pivot
        work[row] = work[row] / pivot
        for other in range(n):
            if other != row:
                work[other] = work[other] - work[other, row] * work[row]
    return work[:, n:], det


def _exact_log_det(
    edges: NDArray, rows_i: NDArray, rows_j: NDArray, information: NDArray, free: list[int], *, shift: Decimal = Decimal(0)
) -> Decimal:
    """Block elimination, the node with the fewest neighbours first."""
    blocks: dict[int, dict[int, NDArray]] = {node: {} for node in free}

    def add(a: int, b: int, block: NDArray) -> None:
        if a in blocks and b in blocks:
            blocks[a][b] = blocks[a][b] + block if b in blocks[a] else block

    if shift:
        identity = as_decimals(np.eye(rows_i.shape[2]))
        for node in free:
            add(node, node, shift * identity)
    for (i, j), a_i, a_j, omega in zip(edges.tolist(), rows_i, rows_j, information, strict=True):
        weighted_i, weighted_j = omega @ a_i, omega @ a_j
        add(i, i, a_i.T @ weighted_i)
        add(j, j, a_j.T @ weighted_j)
        cross = a_i.T @ weighted_j
        add(i, j, cross)
        add(j, i, cross.T)
    total = Decimal(0)
    while blocks:
        node = min(blocks, key=lambda candidate: (len(blocks[candidate]), candidate))
        row = blocks.pop(node)
        inverse, det = _inverse_and_det(row.pop(node))
        total += det.ln()
        for a in row:
            blocks[a].pop(node)
        for a, block_a in row.items():
            pulled = block_a.T @ inverse
            for b, block_b in row.items():
                add(a, b, -(pulled @ block_b))
    return total
