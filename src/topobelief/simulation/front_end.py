"""The front end: key poses, odometry factors from wheels and scans, and loop closures.

An odometry factor fuses two independent measurements of the same motion, wheel odometry with its slip and the match of the two
scans. In the tangent at the wheels' pose it is the product of two Gaussians: the laser decides nearly everything, but for the
direction of a bare corridor, of which its walls say nothing and its information knows.

Between key poses the robot is tracked: every few centimetres its scan is matched with that of the last key pose, starting from
where the scan before put it. So a match never starts far from its optimum, and wheels that spin are noticed within those few
centimetres. Where a good match and the wheels contradict each other, the wheels slipped: their covariance is widened until the
disagreement is what it expects, and the laser decides. Where the scans do not match, what was tracked so far and the wheels
since then remain, and the factor says why.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from topobelief.arrays import FloatArray
from topobelief.candidates.closures import ClosureModel
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.information import block_isotropic
from topobelief.simulation.factor import CLOSURE, ODOMETRY, Factor
from topobelief.simulation.loop_closures import PairwiseConsistency, closure_candidates
from topobelief.simulation.occupancy import OccupancyMap
from topobelief.simulation.registration import Registration, RegistrationSettings, ScanCloud, register
from topobelief.simulation.scan import Scan

__all__ = ["Factor", "FrontEnd", "FrontEndSettings", "wheel_covariance"]

_DIMENSION = 3  # of the tangent
_MATCHED_SHARE = 0.80  # of the closures that its rule predicts along a path, in ten runs each of `office` and `corridors`
_TYPICAL_POSITION, _TYPICAL_ANGLE = 0.0015, 0.0005  # standard deviations, m and rad
_WHEEL_GATE = float(chi2.ppf(0.9999, _DIMENSION))  # of what the laser says against the wheels


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontEndSettings:
    """When a key pose is made, and what is believed.

    Parameters
    ----------
    key_pose_distance, key_pose_angle
        Motion after which there is a new key pose, metres and radians.
    track_distance, track_angle
        Motion by the wheels after which a scan is matched between key poses, metres and radians.
    search_radius, min_index_gap
        Of candidates for a loop closure, metres and key poses.
    max_rmse, min_matched_share
        Of a loop closure's match, metres and share of the points.
    min_odometry_share, min_odometry_wall_share
        The same and `min_wall_share` for consecutive scans, as long as the wheels agree with their match: turning a corner
        brings much into view. A match that contradicts the wheels must be as good as a loop closure's to be believed.
    min_wall_share
        Of a loop closure's match, see `registration.Registration`.
    max_correction
        Distance of a match from the estimate, metres.
    max_turn_correction
        The same of the heading, radians.
    pair_confidence, min_agreeing, consistency_window
        Of pairwise consistency, see `loop_closures.PairwiseConsistency`.
    wheel_slip, track_width, encoder_sigma
        The front end's model of wheel odometry: metres per root metre for each wheel, metres, and metres for a reading.
    odometry_correspondence_distance
        `max_correspondence_distance` of consecutive scans, metres: tracking starts them near where they belong, and further
        points pull a match into a wrong place where equal things stand in a row, as in a store.
    registration
    """

    key_pose_distance: float = 1.0
    key_pose_angle: float = math.radians(15)
    track_distance: float = 0.15
    track_angle: float = 0.1
    search_radius: float = 2.0
    min_index_gap: int = 5
    max_rmse: float = 0.3
    min_matched_share: float = 0.8
    min_odometry_share: float = 0.5
    min_odometry_wall_share: float = 0.7
    min_wall_share: float = 0.85
    max_correction: float = 1.0
    max_turn_correction: float = math.radians(20)
    pair_confidence: float = 0.9999
    min_agreeing: int = 2
    consistency_window: int = 10
    wheel_slip: float = 0.008
    track_width: float = 0.33
    encoder_sigma: float = 0.001
    odometry_correspondence_distance: float = 0.3
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)

    def __post_init__(self) -> None:
        for name in (
            "key_pose_distance",
            "key_pose_angle",
            "track_distance",
            "track_angle",
            "search_radius",
            "max_rmse",
            "track_width",
            "encoder_sigma",
            "odometry_correspondence_distance",
        ):
            if not (math.isfinite(value := getattr(self, name)) and value > 0):
                raise InvalidInputError(f"expected {name} above 0, got {value}")
        if self.min_index_gap < 2:
            raise InvalidInputError(f"expected min_index_gap of at least 2, got {self.min_index_gap}")

    @property
    def expected_information(self) -> FloatArray:
        """Of a factor among walls on all sides, shape (3, 3): the median of some 1400 matches in `office` and `lab`."""
        return block_isotropic(_TYPICAL_POSITION, _TYPICAL_ANGLE)

    @property
    def expected_closures(self) -> ClosureModel:
        """Closures that it makes: with all poses in sight within its search radius, as often as in 4900 chances so far."""
        return ClosureModel(
            radius=self.search_radius, min_index_gap=self.min_index_gap, max_per_pose=None, probability=_MATCHED_SHARE
        )

    @property
    def gate_information(self) -> FloatArray:
        """What a closure is known by if its walls say nothing, shape (3, 3): it stays within the largest corrections."""
        return block_isotropic(self.max_correction, self.max_turn_correction)


class _Track(NamedTuple):
    """Motion since the last key pose as it was tracked, and the wheel odometry up to which it goes."""

    wheel: FloatArray
    motion: FloatArray
    covariance: FloatArray


class _Fused(NamedTuple):
    """A motion by wheels and laser."""

    motion: FloatArray
    information: FloatArray
    note: str


class FrontEnd:
    """Turns wheel odometry and scans into factors; it never sees the true pose.

    Parameters
    ----------
    settings
    """

    def __init__(self, *, settings: FrontEndSettings | None = None) -> None:
        self.settings = settings or FrontEndSettings()
        self.scans: list[Scan] = []
        self._clouds: list[ScanCloud] = []
        self._wheel = SE2_GROUP.identity()  # wheel odometry at the last key pose
        self._track = _Track(SE2_GROUP.identity(), SE2_GROUP.identity(), np.zeros((3, 3)))
        self._consistency = PairwiseConsistency(
            confidence=self.settings.pair_confidence,
            min_agreeing=self.settings.min_agreeing,
            window=self.settings.consistency_window,
        )

    def wants_key_pose(self, wheel_odometry: FloatArray) -> bool:
        """Whether the robot has moved enough since the last key pose, or there is none yet."""
        if not self.scans:
            return True
        return _exceeds(self.motion(wheel_odometry), self.settings.key_pose_distance, self.settings.key_pose_angle)

    def wants_scan(self, wheel_odometry: FloatArray) -> bool:
        """Whether the wheels have turned enough since the last scan that was matched."""
        step = SE2_GROUP.between(self._track.wheel, wheel_odometry)
        return bool(self.scans) and _exceeds(step, self.settings.track_distance, self.settings.track_angle)

    def motion(self, wheel_odometry: FloatArray) -> FloatArray:
        """Motion since the last key pose, shape (3,): as far as scans were matched by them, from there on by the wheels."""
        return SE2_GROUP.compose(self._track.motion, SE2_GROUP.between(self._track.wheel, wheel_odometry))

    def track(self, wheel_odometry: FloatArray, scan: Scan) -> None:
        """Match a scan between key poses with that of the last one.

        Parameters
        ----------
        wheel_odometry : shape (3,)
            Pose by the wheels, in the frame of `add`.
        scan
            Made there.
        """
        step = SE2_GROUP.between(self._track.wheel, wheel_odometry)
        motion = SE2_GROUP.compose(self._track.motion, step)
        adjoint = SE2_GROUP.adjoint(SE2_GROUP.inverse(step))
        covariance = adjoint @ self._track.covariance @ adjoint.T + wheel_covariance(step, self.settings)
        match = self._odometry_match(motion, ScanCloud(scan))
        fused = match if isinstance(match, str) else self._fused(motion, covariance, match)
        if not isinstance(fused, str):
            motion, covariance = fused.motion, _inverse(fused.information)
        self._track = _Track(np.array(wheel_odometry, dtype=np.float64), motion, covariance)

    def add(self, wheel_odometry: FloatArray, scan: Scan, *, motion: FloatArray | None = None) -> Factor | None:
        """A key pose.

        Parameters
        ----------
        wheel_odometry : shape (3,)
            Pose by the wheels, in any fixed frame.
        scan
            Made there.
        motion : shape (3,), optional
            What `motion` said in an earlier run that is played again. Default: what it says now.

        Returns
        -------
        Factor or None
            From the last key pose to this one; None for the first.
        """
        cloud = ScanCloud(scan)
        factor = None
        if self.scans:
            tracked = self.motion(wheel_odometry) if motion is None else motion
            factor = self._odometry(SE2_GROUP.between(self._wheel, wheel_odometry), tracked, cloud)
            self._consistency.chain.append(factor)
        self.scans.append(scan)
        self._clouds.append(cloud)
        self._wheel = np.array(wheel_odometry, dtype=np.float64)
        self._track = _Track(self._wheel, SE2_GROUP.identity(), np.zeros((3, 3)))
        return factor

    def closures(self, poses: FloatArray, occupancy: OccupancyMap | None) -> list[Factor]:
        """Loop closures that can be believed now: of the newest key pose, and earlier ones that it confirms.

        Parameters
        ----------
        poses : shape (n, 3)
            Current estimate of all key poses.
        occupancy
            The map so far; None: no test of the line of sight.
        """
        settings, newest = self.settings, len(self.scans) - 1
        if len(poses) != len(self.scans):
            raise InvalidInputError(f"expected an estimate of all {len(self.scans)} key poses, got {len(poses)}")
        earlier = closure_candidates(
            poses, occupancy, search_radius=settings.search_radius, min_index_gap=settings.min_index_gap
        )
        matches: list[Factor] = []
        for i in earlier.tolist():
            guess = SE2_GROUP.between(poses[i], poses[-1])
            match = self._match(
                i, self._clouds[-1], guess, settings.registration, settings.min_matched_share, settings.min_wall_share
            )
            if isinstance(match, Registration) and self._is_near(match, guess):
                matches.append(Factor(i, newest, match.pose, match.information + settings.gate_information, CLOSURE))
        return self._consistency.believed(matches)

    def _odometry(self, wheels: FloatArray, tracked: FloatArray, cloud: ScanCloud) -> Factor:
        """The factor of the motion since the last key pose, by the wheels, as it was tracked, and by the new scan."""
        newest = len(self.scans) - 1
        covariance = wheel_covariance(wheels, self.settings)
        match = self._odometry_match(tracked, cloud)
        fused = match if isinstance(match, str) else self._fused(wheels, covariance, match)
        if isinstance(fused, str):
            strayed = SE2_GROUP.log(SE2_GROUP.between(wheels, tracked))
            widened = covariance * _widening(float(strayed @ np.linalg.solve(covariance, strayed)))
            return Factor(newest, newest + 1, tracked, _inverse(widened), ODOMETRY, fused)
        return Factor(newest, newest + 1, fused.motion, fused.information, ODOMETRY, fused.note)

    def _odometry_match(self, guess: FloatArray, cloud: ScanCloud) -> Registration | str:
        """A match with the scan of the last key pose, or why there is none."""
        settings = self.settings
        registration = replace(settings.registration, max_correspondence_distance=settings.odometry_correspondence_distance)
        return self._match(
            len(self.scans) - 1, cloud, guess, registration, settings.min_odometry_share, settings.min_odometry_wall_share
        )

    def _fused(self, motion: FloatArray, covariance: FloatArray, match: Registration) -> _Fused | str:
        """A motion by the wheels and its match, the product of two Gaussians; why not, where one cannot be believed."""
        information = _inverse(covariance)
        correction = SE2_GROUP.log(SE2_GROUP.between(motion, match.pose))
        share = _share(information, match.information, correction)
        # (correction)^T (Sigma_wheels + Sigma_laser)^-1 (correction), written for a singular laser
        squared, note = float(correction @ information @ share), ""
        if squared > _WHEEL_GATE:
            apart = f"laser and wheels apart by {math.hypot(*correction[:2]):.2f} m, {math.degrees(correction[2]):.1f} deg"
            if match.matched_share < self.settings.min_matched_share or match.wall_share < self.settings.min_wall_share:
                return apart
            note = f"wheels slipped: {apart}"
            information = information / _widening(squared)
            share = _share(information, match.information, correction)
        return _Fused(SE2_GROUP.compose(motion, SE2_GROUP.exp(share)), information + match.information, note)

    def _match(
        self,
        i: int,
        cloud: ScanCloud,
        guess: FloatArray,
        registration: RegistrationSettings,
        min_share: float,
        min_wall_share: float,
    ) -> Registration | str:
        """A match with the scan of key pose i, or why there is none."""
        match = register(self._clouds[i], cloud, guess, registration)
        if match is None:
            return "too few points to match"
        if match.rmse > self.settings.max_rmse or match.matched_share < min_share or match.wall_share < min_wall_share:
            return (
                f"poor match: {100 * match.matched_share:.0f} % of points, {100 * match.wall_share:.0f} % of them on walls, "
                f"RMSE {match.rmse:.2f} m"
            )
        return match

    def _is_near(self, match: Registration, guess: FloatArray) -> bool:
        x, y, theta = SE2_GROUP.between(guess, match.pose).tolist()
        return math.hypot(x, y) <= self.settings.max_correction and abs(theta) <= self.settings.max_turn_correction


def _exceeds(motion: FloatArray, distance: float, angle: float) -> bool:
    x, y, theta = motion.tolist()
    return math.hypot(x, y) >= distance or abs(theta) >= angle


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.linalg.inv(matrix).astype(np.float64)


def _share(information: FloatArray, other: FloatArray, correction: FloatArray) -> FloatArray:
    """What is left of a correction when a measurement that says none is fused with another that says all of it."""
    return np.linalg.solve(information + other, other @ correction).astype(np.float64)


def _widening(squared: float) -> float:
    """By what to multiply a covariance so that an error of this squared Mahalanobis distance is what it expects."""
    return max(1.0, squared / _DIMENSION)


def wheel_covariance(motion: FloatArray, settings: FrontEndSettings) -> FloatArray:
    """Covariance of wheel odometry over a motion, in the tangent at its end, shape (3, 3).

    Each wheel is off by a random walk in the distance that it rolled. Its mean moves the robot ahead, its difference turns
    it; turns on the way swing the end sideways, by half the distance per radian and on the average of their squares a third.

    Parameters
    ----------
    motion : shape (3,)
    settings
    """
    distance, turn = math.hypot(motion[0], motion[1]), abs(float(motion[2]))
    rolled = distance + turn * settings.track_width / 2
    wheel = settings.wheel_slip**2 * rolled + settings.encoder_sigma**2
    angle = 2 * wheel / settings.track_width**2
    covariance = np.diag([wheel / 2, angle * distance**2 / 3, angle]) + settings.encoder_sigma**2 * np.diag([1.0, 1.0, 0.0])
    covariance[1, 2] = covariance[2, 1] = angle * float(motion[0]) / 2
    return covariance
