"""Scan matching: where one scan was made in the frame of another, how well they fit, and how accurate the match is.

Planar scans are extruded to a few levels in z, so that generalized ICP (Segal, Haehnel and Thrun, "Generalized-ICP", RSS 2009;
here small_gicp) sees upright walls: it aligns plane to plane and comes out ten times closer than on flat scans. Its Hessian
is not calibrated, and along a bare corridor it sees structure where there are only beams. Information is therefore computed
anew, from the fit of points to the lines of their neighbours (Censi, "On achievable accuracy for range-finder localization",
ICRA 2007),

    A = sum_p w_p^T w_p / sigma²,   w_p = (n_x, n_y, p x n),     Omega = A (1 + F A)^-1 = (A^-1 + F)^-1,

with the normal n of the wall that p lies on and a variance floor F for what the model leaves out. The second form of Omega
holds for a singular A too: a direction in which walls say nothing gets no information.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from topobelief.arrays import FloatArray, IntArray
from topobelief.optional import load
from topobelief.simulation.scan import Scan

_LEVELS = (-0.1, 0.0, 0.1)  # m
_NEIGHBOURS = 15  # of a point among its extruded ones, for its covariance
_LINE_NEIGHBOURS = 11  # of a point in the plane, for the normal of its wall
_MIN_POINTS = 30
_MAX_ITERATIONS = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """How scans are matched, and how accurate a match is taken to be.

    Parameters
    ----------
    max_correspondence_distance, final_correspondence_distance
        Of two points that may be the same place, metres: at first, and in the end, by way of twice that, so that what only one
        scan has seen does not pull.
    match_distance
        A point of one scan is matched where the other has one nearer than this, metres.
    wall_distance
        A matched point is on its wall where it is nearer to the wall's line than this, metres; some three times a lidar's
        range noise.
    range_sigma
        Standard deviation of a lidar's range, metres.
    point_sigma
        Standard deviation of a point's distance to its wall, metres; larger than a lidar's range noise, as neighbouring
        points err together.
    floor_position, floor_angle
        Standard deviations of the variance floor, metres and radians. Fitted: see `tests/simulation/test_registration.py`.
    """

    max_correspondence_distance: float = 1.0
    final_correspondence_distance: float = 0.1
    match_distance: float = 0.3
    wall_distance: float = 0.03
    range_sigma: float = 0.01
    point_sigma: float = 0.011
    floor_position: float = 0.001
    floor_angle: float = math.radians(0.01)

    @property
    def floor(self) -> FloatArray:
        """F, shape (3, 3)."""
        return np.diag([self.floor_position**2, self.floor_position**2, self.floor_angle**2])


class Walls(NamedTuple):
    """The line through each point of a scan and its neighbours.

    Attributes
    ----------
    normals : shape (k, 2)
        Of either sign.
    lengths : shape (k,)
        Sum of squares of what the neighbours lie apart along the line, m².
    widths : shape (k,)
        Root mean square distance of the neighbours from the line, metres; large in corners and where points are sparse.
    """

    normals: FloatArray
    lengths: FloatArray
    widths: FloatArray


class ScanCloud:
    """A scan made ready to be matched, once for all its matches.

    Parameters
    ----------
    scan
    """

    def __init__(self, scan: Scan) -> None:
        self.points = scan.points

    @property
    def can_match(self) -> bool:
        """Whether there are enough points."""
        return len(self.points) >= _MIN_POINTS

    @cached_property
    def _tree(self) -> Any:
        return KDTree(self.points)

    def nearest(self, places: FloatArray, count: int) -> tuple[FloatArray, IntArray]:
        """Distances and indices of the points nearest to each place, shapes (N, count)."""
        distances, indices = self._tree.query(places, k=np.arange(1, count + 1))
        return distances, indices

    @cached_property
    def walls(self) -> Walls:
        """The lines on which the points lie."""
        near = self.nearest(self.points, _LINE_NEIGHBOURS)[1]
        offsets = self.points[near] - self.points[near].mean(axis=1, keepdims=True)
        xx, yy = (offsets**2).sum(axis=1).T
        xy = offsets.prod(axis=2).sum(axis=1)
        along = np.arctan2(2 * xy, xx - yy) / 2  # direction of the larger eigenvector of [[xx, xy], [xy, yy]]
        spread = np.hypot((xx - yy) / 2, xy)
        return Walls(
            normals=np.stack([-np.sin(along), np.cos(along)], axis=1),
            lengths=(xx + yy) / 2 + spread,
            widths=np.sqrt(np.maximum((xx + yy) / 2 - spread, 0.0) / _LINE_NEIGHBOURS),
        )

    @cached_property
    def extruded(self) -> tuple[Any, Any]:
        """small_gicp's cloud with covariances, and its tree."""
        small_gicp = load_small_gicp()
        levels = np.repeat(_LEVELS, len(self.points))
        ones = np.ones_like(levels)
        cloud: Any = small_gicp.PointCloud(np.column_stack([np.tile(self.points, (len(_LEVELS), 1)), levels, ones]))
        tree: Any = small_gicp.KdTree(cloud, 1)
        small_gicp.estimate_covariances(cloud, tree, _NEIGHBOURS, 1)
        return cloud, tree


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """A match of two scans.

    Attributes
    ----------
    pose : shape (3,)
        Of the source in the frame of the target.
    information : shape (3, 3)
        In the tangent at that pose; singular where walls leave a direction open.
    rmse
        Root mean square distance of matched points, metres; inf without any.
    matched_share
        Of the source's points.
    wall_share
        Share of matched points that are on their walls. A match stuck in a wrong place has rarely more than 0.8, a right one
        hardly ever less than 0.85: this tells them apart where the RMSE, which holds the spacing of points, does not.
    """

    pose: FloatArray
    information: FloatArray
    rmse: float
    matched_share: float
    wall_share: float


def register(target: ScanCloud, source: ScanCloud, guess: FloatArray, settings: RegistrationSettings) -> Registration | None:
    """The pose of one scan in the frame of another.

    Parameters
    ----------
    target, source
    guess : shape (3,)
        Of the source in the frame of the target; GICP finds the local optimum near it.
    settings

    Returns
    -------
    Registration or None
        None where a scan has too few points or GICP comes to no finite pose.

    Raises
    ------
    InvalidInputError
        Where small_gicp is not installed.
    """
    if not (target.can_match and source.can_match):
        return None
    align = load_small_gicp().align
    (target_cloud, target_tree), (source_cloud, _) = target.extruded, source.extruded
    matrix = _homogeneous(guess)
    final = settings.final_correspondence_distance
    for distance in (settings.max_correspondence_distance, 2 * final, final):
        matrix: FloatArray = align(
            target_cloud,
            source_cloud,
            target_tree,
            matrix,
            max_correspondence_distance=distance,
            num_threads=1,  # sums in one order: the same scans give the same bits
            max_iterations=_MAX_ITERATIONS,
        ).T_target_source
        if not np.isfinite(matrix).all():
            return None
    pose = np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])
    return _judged(target, source, pose, settings)


def _judged(target: ScanCloud, source: ScanCloud, pose: FloatArray, settings: RegistrationSettings) -> Registration:
    """The match with its fit and information."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    R_target_source = np.array([[cosine, -sine], [sine, cosine]])
    moved = source.points @ R_target_source.T + pose[:2]
    distances, nearest = target.nearest(moved, 1)
    distances, nearest = distances[:, 0], nearest[:, 0]
    matched = distances < settings.match_distance
    if not matched.any():
        return Registration(pose, np.zeros((3, 3)), rmse=math.inf, matched_share=0.0, wall_share=0.0)
    walls = target.walls
    flat = matched & (walls.widths[nearest] < settings.wall_distance)
    points, nearest = source.points[flat], nearest[flat]
    off_wall = np.abs(((moved[flat] - target.points[nearest]) * walls.normals[nearest]).sum(axis=1))
    A = _wall_information(points, walls.normals[nearest] @ R_target_source, walls.lengths[nearest], settings)
    information = A @ np.linalg.inv(np.eye(3) + settings.floor @ A)
    return Registration(
        pose,
        (information + information.T) / 2,
        rmse=float(np.sqrt(np.mean(distances[matched] ** 2))),
        matched_share=float(matched.mean()),
        wall_share=float((off_wall < settings.wall_distance).mean()) if flat.any() else 0.0,
    )


def _wall_information(
    points: FloatArray, normals: FloatArray, lengths: FloatArray, settings: RegistrationSettings
) -> FloatArray:
    """A, shape (3, 3), free of what it would get from noise in the normals.

    A normal that is off by a small angle a has a share a² of its wall's direction t, so that a bare corridor seems to hold
    the robot along it. The variance of a is known, range_sigma² / length, and so is what to take away: its share of t t^T.
    """
    directions = np.stack([normals[:, 1], -normals[:, 0]], axis=1)
    seen, spurious = (
        np.column_stack([axes, points[:, 0] * axes[:, 1] - points[:, 1] * axes[:, 0]]) for axes in (normals, directions)
    )
    variances = settings.range_sigma**2 / lengths
    A = (seen.T @ seen - (spurious * variances[:, None]).T @ spurious) / settings.point_sigma**2
    values, vectors = np.linalg.eigh(A)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


def _homogeneous(pose: FloatArray) -> FloatArray:
    x, y, theta = pose.tolist()
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]]
    matrix[:2, 3] = x, y
    return matrix


def load_small_gicp() -> Any:
    """The scan matcher, which ships no types; loaded when first used.

    Raises
    ------
    InvalidInputError
        Where it is not installed.
    """
    return load("small_gicp", "sim")
