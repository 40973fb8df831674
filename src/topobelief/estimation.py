"""The maximum-likelihood estimate of a pose graph: the poses that minimise chi^2 = sum of r^T Omega r over its measurements.

Most public files hold dead reckoning, far from the minimum. The search therefore starts from the measurements alone:

1. Rotations by chordal relaxation (Martinec and Pajdla, CVPR 2007; Carlone, Tron, Daniilidis and Dellaert, ICRA 2015):
   R_j = R_i R_ij is linear in the entries of the matrices, so one sparse solve gives them up to a projection to rotations.
   Weights are those of the rotation with the position marginalised, |O_r|p|^(1/q).
2. Positions by linear least squares, exact for given rotations.
3. Gauss-Newton on all poses, with exact Jacobians of the residual that `PoseGraph.chi2` squares. Its step is a direction of
   descent; it is made longer or shorter as a parabola through chi^2 says, and halved until chi^2 falls. After each, positions
   are solved for again (variable projection, Golub and Pereyra 1973), so that a rotation is not held back by positions that
   would have to move with it.

Landmarks take part as points: their observations have no rows of rotations, and where these read bearings and ranges the
estimate grows from the first pose on, and step 2 is left out. Ranges or bearings alone have no linear start: the given poses
serve.

All of it rests on one sparse L D L^T, which takes any information. GTSAM's optimiser, which the tests compare with, refuses
some of these graphs: its planar initialisation (LAGO) wants diagonal noise, which csail and intel do not have, and its default
elimination calls intel indeterminate because of one edge with information 2.7e12 and makes no step.
"""

from __future__ import annotations

import math
import warnings
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order
from scipy.spatial.transform import Rotation

from topobelief.arrays import FloatArray
from topobelief.errors import EstimationError, NotOptimizedWarning
from topobelief.geometry import Group
from topobelief.graph.dead_reckoning import dead_reckoned_poses
from topobelief.graph.information import cholesky_roots, scalar_weights
from topobelief.graph.observations import observations_by_kind, observed_residuals, roots_of_positions, seen_positions
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.readings import BEARING_RANGE
from topobelief.graph.well_posed import require_determined
from topobelief.linalg.least_squares import LeastSquaresSolver

_CONVERGED = 1e-10  # fall of chi^2 that the linear model still promises: 1e-5 standard deviations from the minimum
_ROUGH = 1e-3  # the same, as a share of chi^2, where the estimate is but a start
_ROUNDED, _ROUNDED_RELATIVE = 1e-6, 1e-12  # the same and a share of chi^2, where rounding lets it fall no more
_SUFFICIENT = 1e-4  # share of the promised fall that a step must bring (Nocedal and Wright, section 3.1)
_SHORTEST_STEP, _LONGEST_STEP = 2.0**-20, 2.0
_FEWEST_MORE, _GROWTH = 50, 1.3  # poses by which a growing estimate grows: at least so many, or by this factor
_MOST_BENT = 4.0  # times as much as the linear model says
_NEARLY_WHOLE = 0.2  # of ln of the best length: closer to a whole step no other is tried
_PATIENCE, _FLAT = 50, 1e-2  # iterations, and share of chi^2: ranges alone may lead along a valley that is all but flat
_SMALL_ANGLE = 1e-3  # below it the series of the Jacobian is exact in double precision


def optimize(graph: PoseGraph, *, max_iterations: int = 300) -> PoseGraph:
    """The graph at its maximum-likelihood estimate.

    Parameters
    ----------
    graph
        Connected. Its first pose is kept; the others matter only where they fit better than what the measurements
        alone lead to: then the search starts again from them.
    max_iterations
        Of Gauss-Newton. Real graphs take 3 to 15, those with rotation noise near a radian hundreds.

    Returns
    -------
    PoseGraph
        The same edges, measurements and ids at poses whose chi^2 is a minimum and not above that of `graph`; on a tree it is
        0 up to rounding. As always with rotations, the minimum is local in principle.

    Raises
    ------
    DisconnectedGraphError
        Names poses that the first one does not reach.
    EstimationError
        If Gauss-Newton does not converge, or the graph is too ill-conditioned for it.

    Warns
    -----
    NotOptimizedWarning
        Where ranges or bearings leave a valley so flat that the search ends in it before it converges.

    Examples
    --------
    >>> corner = [1.0, 0.0, np.pi / 2]
    >>> square = PoseGraph(np.zeros((4, 3)), [(0, 1), (1, 2), (2, 3), (3, 0)], [corner] * 4, np.eye(3))
    >>> np.allclose(optimize(square).positions, [[0, 0], [1, 0], [1, 1], [0, 1]])
    True
    """
    require_determined(graph, anchor=int(graph.pose_indices[0]))
    problem = _Problem(graph)
    found: PoseGraph | None = None
    with suppress(EstimationError):  # the search may still succeed from the given poses
        start = problem.chordal_start() if problem.linear else _grown_start(graph, max_iterations)
        if start is not None:
            found = graph.with_poses(problem.minimum_from(start, max_iterations))
    if found is not None and found.chi2 <= graph.chi2:
        return found
    refined = graph.with_poses(problem.minimum_from(graph.poses, max_iterations))
    return min((candidate for candidate in (graph, found, refined) if candidate is not None), key=lambda each: each.chi2)


def _grown_start(graph: PoseGraph, max_iterations: int) -> FloatArray | None:
    """The estimate of more and more of the graph, each from the one before; None where a landmark's position is not read.

    Begins at the first pose and takes on others in the order of how many measurements between poses away they are, and the
    landmarks that they see. So landmarks that were seen before correct the heading before it is far off, as in incremental
    estimation.
    """
    if any(not kind.linear and kind is not BEARING_RANGE for kind, _ in observations_by_kind(graph.reading_codes)):
        return None
    group, poses, held = graph.group, graph.poses.copy(), int(graph.pose_indices[0])
    observed = graph.reading_codes > 0
    odometry, shape = graph.edges[~observed], (graph.num_nodes, graph.num_nodes)
    links = sparse.coo_array((np.ones(len(odometry)), odometry.T), shape=shape).tocsr()
    order = breadth_first_order(links, held, directed=False, return_predecessors=False)
    if len(order) < graph.num_poses:
        return None  # landmarks alone join some of them
    known, end = np.array([held]), 1
    while end < len(order):
        end = min(len(order), max(end + _FEWEST_MORE, int(_GROWTH * end)))
        inside = np.isin(graph.edges, order[:end])
        ends, seen = ~observed & inside.all(axis=1), np.flatnonzero(observed & inside[:, 0])
        reckoned = dead_reckoned_poses(
            group, graph.num_nodes, graph.edges[ends], graph.measurements[ends], known=known, known_poses=poses[known]
        )
        landmarks, first = np.unique(graph.edges[seen, 1], return_index=True)
        new, by = ~np.isin(landmarks, known), seen[first]
        reckoned[landmarks[new]] = group.compose(reckoned[graph.edges[by[new], 0]], graph.measurements[by[new]])
        known = np.sort(np.concatenate([order[:end], landmarks])).astype(np.int64)
        part = graph.part(known).with_poses(reckoned[known])
        poses[known] = _Problem(part).minimum_from(part.poses, max_iterations, precision=_ROUGH)
    return poses


class _Trial(NamedTuple):
    """Poses that a step leads to, and what they leave of the measurements."""

    poses: FloatArray
    errors: FloatArray
    residuals: FloatArray
    chi2: float


class _Problem:
    """The least-squares problem of one graph, its first pose held.

    Residuals are whitened by the root of Omega = root^T root, upper triangular, positions first.
    """

    def __init__(self, graph: PoseGraph) -> None:
        self.graph = graph
        self.group = graph.group
        self.tails, self.heads = graph.edges.T
        self.measured_rotations = self.group.rotation_matrix(graph.measurements)
        self.observing = np.flatnonzero(graph.reading_codes)
        self.linear = all(kind.linear for kind, _ in observations_by_kind(graph.reading_codes))
        self.roots = self._roots()
        self.held = int(graph.pose_indices[0])
        self.pose_solver = LeastSquaresSolver(graph.edges, graph.num_nodes, graph.tangent_dim, held=self.held)
        self.position_solver = LeastSquaresSolver(graph.edges, graph.num_nodes, self.group.position_dim, held=self.held)

    def _roots(self) -> FloatArray:
        """Of the noise, observations with rows of positions alone."""
        k, noise = self.group.position_dim, self.graph.noise
        if not self.observing.size:
            return cholesky_roots(noise)
        between = np.flatnonzero(self.graph.reading_codes == 0)
        roots = np.zeros(noise.shape)
        roots[between] = cholesky_roots(noise[between])
        roots[self.observing, :k, :k] = roots_of_positions(noise[self.observing, :k, :k])[0]
        return roots

    def chordal_start(self) -> FloatArray:
        """Poses with the rotations of the chordal relaxation, all at the position of the first."""
        graph, group = self.graph, self.group
        k = group.position_dim
        weights = np.sqrt(scalar_weights(graph.information)[1])[:, None, None]
        rows_i = -weights * self.measured_rotations.transpose(0, 2, 1)  # R_j^T = R_ij^T R_i^T
        rows_j = weights * np.eye(k)
        rows_j[graph.carries_pad] = np.eye(k)  # landmarks, which have no rotation, stay as they are
        transposed = np.zeros((graph.num_nodes, k, k))
        transposed[self.held] = group.rotation_matrix(graph.poses[self.held]).T
        residuals = rows_i @ transposed[self.tails] + rows_j @ transposed[self.heads]
        transposed += _solved(self.position_solver, rows_i, rows_j, residuals)[0]
        rotations = _nearest_rotations(transposed.transpose(0, 2, 1))
        poses = _pose_rows(group, np.tile(graph.positions[self.held], (graph.num_nodes, 1)), rotations)
        poses[self.held] = graph.poses[self.held]
        poses[graph.is_landmark, k:] = group.identity()[k:]
        return poses

    def minimum_from(self, poses: FloatArray, max_iterations: int, *, precision: float = 0.0) -> FloatArray:
        """Poses at a minimum of chi^2, to a share of it, by Gauss-Newton with a search along its step and variable projection.

        Far from the minimum or with large residuals a whole step goes too far, or not far enough. The parabola through chi^2
        and its slope here and chi^2 there says which step is best.
        """
        poses = self._settled(poses)
        errors, residuals = self._residuals(poses)
        chi2 = _sum_of_squares(residuals)
        before = [chi2]
        for _ in range(max_iterations):
            step, promised = _solved(self.pose_solver, *self._rows(poses, errors), residuals)
            length, found = 1.0, self._moved(poses, step, 1.0)
            best = _best_length(chi2, promised, found.chi2)
            if abs(math.log(best)) > _NEARLY_WHOLE:
                other = self._moved(poses, step, best)
                length, found = (best, other) if other.chi2 < found.chi2 else (1.0, found)
            while not found.chi2 <= chi2 - _SUFFICIENT * min(length, 1.0) * promised:
                if promised <= _ROUNDED + _ROUNDED_RELATIVE * chi2:
                    return poses
                length /= 2
                if length < _SHORTEST_STEP:
                    raise EstimationError(
                        f"expected chi^2 to fall along the Gauss-Newton step, got stuck at {chi2:.6g}; "
                        "check the units and the information matrices for extreme ratios"
                    )
                found = self._moved(poses, step, length)
            poses, errors, residuals, chi2 = found
            if promised <= _CONVERGED + precision * chi2:
                return poses
            before.append(chi2)
        if not self.linear and len(before) > _PATIENCE and before[-_PATIENCE] - chi2 <= _FLAT * chi2:
            warnings.warn(
                f"chi^2 = {chi2:.6g} fell by less than {100 * _FLAT:g} % in {_PATIENCE} of {max_iterations} iterations: "
                "ranges or bearings leave a flat valley, along which the estimate may still move; what is computed holds at "
                "these poses. For better ones, give poses to start from, measurements between poses, or more iterations",
                NotOptimizedWarning,
                stacklevel=3,
            )
            return poses
        raise EstimationError(
            f"expected Gauss-Newton to converge in {max_iterations} iterations, got chi^2 = {chi2:.6g} still falling; "
            "look for wrong loop closures or allow more iterations"
        )

    def _moved(self, poses: FloatArray, step: FloatArray, length: float) -> _Trial:
        trial = self._settled(self.group.compose(poses, self.group.exp(length * step)))
        errors, residuals = self._residuals(trial)
        return _Trial(trial, errors, residuals, _sum_of_squares(residuals))

    def _settled(self, poses: FloatArray) -> FloatArray:
        """The same rotations with the positions that minimise chi^2 for them, where that is a linear problem."""
        if not self.linear:
            return poses
        k = self.group.position_dim
        _, residuals = self._residuals(poses)
        turn = self.group.rotation_matrix(poses[self.tails]) @ self.measured_rotations
        rows = self.roots[:, :k, :k] @ turn.transpose(0, 2, 1)
        moves, _ = _solved(self.position_solver, -rows, rows, residuals[:, :k])
        settled = poses.copy()
        settled[:, :k] += moves
        return settled

    def _residuals(self, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
        """E = measured^-1 predicted of each edge, and its whitened tangent (`Group.residual`)."""
        predicted = self.group.between(poses[self.tails], poses[self.heads])
        errors = self.group.between(self.graph.measurements, predicted)
        tangent = np.concatenate([self.group.position(errors), self.group.rotation_vector(errors)], axis=1)
        if self.observing.size:
            k, seen = self.group.position_dim, self.group.position(predicted[self.observing])
            tangent[self.observing] = 0.0
            measured, codes = self.graph.measurements[self.observing, :k], self.graph.reading_codes[self.observing]
            tangent[self.observing, :k] = observed_residuals(measured, seen, codes)
        return errors, (self.roots @ tangent[:, :, None])[:, :, 0]

    def _rows(self, poses: FloatArray, errors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened Jacobians of the residuals for steps X_i exp(d_i) and X_j exp(d_j).

        The latter turns E into E exp(d_j), which moves its translation by R_E v and its rotation vector phi by
        J_r^-1(phi) omega; the former into E exp(-Ad(P^-1) d_i), P = X_i^-1 X_j.
        """
        k = self.group.position_dim
        jacobian = np.zeros_like(self.roots)
        jacobian[:, :k, :k] = self.group.rotation_matrix(errors)
        jacobian[:, k:, k:] = _inverse_right_jacobian(self.group, self.group.rotation_vector(errors))
        if self.observing.size:
            self._observe(poses, jacobian)
        rows_j = self.roots @ jacobian
        rows_i = -rows_j @ self.group.adjoint(self.group.between(poses[self.heads], poses[self.tails]))
        rows_j[self.graph.carries_pad, k:, k:] = np.eye(self.group.rotation_dim)
        return rows_i, rows_j

    def _observe(self, poses: FloatArray, jacobian: FloatArray) -> None:
        """Enter the Jacobians of readings: the position that a pose sees moves by R_i^T v where the point moves by v."""
        k = self.group.position_dim
        for kind, which in observations_by_kind(self.graph.reading_codes):
            read = kind.jacobian(seen_positions(self.group, poses, self.graph.edges[which]))
            turn = self.group.rotation_matrix(poses[self.tails[which]]).transpose(0, 2, 1)
            jacobian[which] = 0.0
            jacobian[which, : read.shape[1], :k] = read @ turn


def _best_length(chi2: float, promised: float, after: float) -> float:
    """Where the parabola is least that has chi^2 and its slope at the beginning of a step, and chi^2 at its end; 1 is the end.

    1 too where chi^2 is far from a parabola: along a bent valley halved steps get further than the best ones.
    """
    bend = after - chi2 + 2 * promised
    if not promised > _ROUNDED_RELATIVE * chi2 or not bend <= _MOST_BENT * promised:
        return 1.0
    return promised / max(bend, promised / _LONGEST_STEP)


def _solved(
    solver: LeastSquaresSolver, rows_i: FloatArray, rows_j: FloatArray, residuals: FloatArray
) -> tuple[FloatArray, float]:
    solution, fall = solver.solve(rows_i, rows_j, residuals)
    if not fall >= 0:  # nan or rounded below zero
        raise EstimationError(
            "expected positive definite normal equations, got ones that are singular in double precision; "
            "check the units and the information matrices for extreme ratios"
        )
    return solution, fall


def _sum_of_squares(values: FloatArray) -> float:
    return float(np.sum(values**2))


def _inverse_right_jacobian(group: Group, rotation_vectors: FloatArray) -> FloatArray:
    """J_r^-1 with log(exp(phi) exp(omega)) = phi + J_r^-1(phi) omega + O(omega^2), shape (m, q, q)."""
    q = group.rotation_dim
    if q == 1:
        return np.ones((len(rotation_vectors), 1, 1))
    cross = group.lever(rotation_vectors)  # [phi]_x
    angle = np.linalg.norm(rotation_vectors, axis=1)[:, None, None]
    small = angle < _SMALL_ANGLE
    half = np.where(small, 1.0, angle) / 2
    factor = np.where(small, 1 / 12 + angle**2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
    return np.eye(q) + cross / 2 + factor * (cross @ cross)


def _nearest_rotations(matrices: FloatArray) -> FloatArray:
    """The rotation next to each matrix in the Frobenius norm, shape (n, k, k)."""
    u, _, vt = np.linalg.svd(matrices)
    u[:, :, -1] *= np.linalg.det(u @ vt)[:, None]
    return u @ vt


def _pose_rows(group: Group, positions: FloatArray, rotations: FloatArray) -> FloatArray:
    """Poses from positions and rotation matrices."""
    if group.rotation_dim == 1:
        stored = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])[:, None]
    else:
        stored = Rotation.from_matrix(rotations).as_quat()
    return np.concatenate([positions, stored], axis=1)
