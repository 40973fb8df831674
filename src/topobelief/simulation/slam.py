"""Simultaneous localisation and mapping as a robot runs it: one key pose after the other, and what is known after each.

Two back ends share one front end: one on the registered factors, which the robot drives by, and one on the same factors with
injected noise, on which it decides. Without injected noise they are one.
"""

from __future__ import annotations

import math

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.geometry import SE2_GROUP
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.back_end import BackEnd
from topobelief.simulation.front_end import FrontEnd, FrontEndSettings
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.occupancy import OccupancyMap
from topobelief.simulation.registration import ScanCloud, register
from topobelief.simulation.scan import Scan
from topobelief.world.world import Extent

_MAP_PERIOD = 5  # key poses after which the map is rebuilt even if no loop closed
_STILL = 0.05  # metres and radians


class Slam:
    """The robot's knowledge, from wheel odometry and scans alone.

    Parameters
    ----------
    start : shape (3,)
        The first pose, which is known.
    bounds : (x_min, y_min, x_max, y_max)
        What the map shows.
    noise
        To add to each registered factor of the graph that decisions are made on; None: none.
    rng
        Of that noise.
    settings
        Of the front end.
    """

    def __init__(
        self,
        start: FloatArray,
        *,
        bounds: Extent,
        noise: InjectedNoise | None,
        rng: np.random.Generator,
        settings: FrontEndSettings | None = None,
    ) -> None:
        self.settings = settings or FrontEndSettings()
        self._start, self._bounds, self._noise, self._rng = start, bounds, noise, rng
        self._front = FrontEnd(settings=self.settings)
        self._driving = BackEnd(start)
        self._deciding = BackEnd(start) if noise is not None else self._driving
        self._map: OccupancyMap | None = None
        self._map_is_stale = True
        self.num_closures = 0

    @property
    def num_poses(self) -> int:
        """Key poses so far."""
        return len(self._front.scans)

    @property
    def poses(self) -> FloatArray:
        """The estimate that the robot drives by, shape (n, 3)."""
        return self._driving.poses

    @property
    def position_error(self) -> float:
        """By how much the position at the newest key pose may be wrong, metres.

        Two standard deviations in the direction that is known worst.
        """
        return 2 * math.sqrt(float(np.linalg.eigvalsh(self._driving.newest_covariance[:2, :2])[-1]))

    @property
    def registered(self) -> PoseGraph:
        """The graph of the registered factors, at its estimate."""
        return self._driving.pose_graph()

    @property
    def graph(self) -> PoseGraph:
        """The graph with injected noise, at its own estimate; the registered one where there is none."""
        return self._deciding.pose_graph()

    @property
    def belief(self) -> PoseGraph:
        """What decisions are made on: the factors of `graph` at the poses that the robot drives by, where its map is too."""
        graph = self.graph
        return graph if self._noise is None else PoseGraph(self.poses, graph.edges, None, graph.information)

    @property
    def scans(self) -> list[Scan]:
        """One per key pose."""
        return self._front.scans

    def wants_key_pose(self, wheel_odometry: FloatArray) -> bool:
        """Whether the robot has moved enough since the last one."""
        return self._front.wants_key_pose(wheel_odometry)

    def wants_scan(self, wheel_odometry: FloatArray) -> bool:
        """Whether the wheels have turned enough since the last scan for `track` to match another."""
        return self._front.wants_scan(wheel_odometry)

    def track(self, wheel_odometry: FloatArray, scan: Scan) -> None:
        """Follow the motion since the last key pose by a scan."""
        self._front.track(wheel_odometry, scan)

    def motion(self, wheel_odometry: FloatArray) -> FloatArray:
        """Motion since the last key pose, by scans and wheels, shape (3,)."""
        return self._front.motion(wheel_odometry)

    def pose_now(self, wheel_odometry: FloatArray) -> FloatArray:
        """Where the robot believes to be between key poses, shape (3,)."""
        return SE2_GROUP.compose(self.poses[-1], self.motion(wheel_odometry))

    def add_key_pose(self, wheel_odometry: FloatArray, scan: Scan, *, motion: FloatArray | None = None) -> None:
        """Register a key pose, look for loop closures, and update the estimate once.

        Parameters
        ----------
        wheel_odometry : shape (3,)
        scan
        motion : shape (3,), optional
            Where a run is played again: what `motion` said then.
        """
        odometry = self._front.add(wheel_odometry, scan, motion=motion)
        if odometry is None:
            return
        newest = SE2_GROUP.compose(self.poses[-1], odometry.measurement)
        predicted = np.concatenate([self.poses, newest[None]])
        closures = self._front.closures(predicted, self._map_so_far(predicted))
        self.num_closures += len(closures)
        factors = [odometry, *closures]
        self._driving.add(factors)
        if self._noise is not None:
            self._deciding.add([self._noise.added_to(factor, rng=self._rng) for factor in factors])
        self._map_is_stale |= bool(closures)

    def put_down(self, scan: Scan) -> FloatArray:
        """Where a robot that was carried stands relative to the last key pose, by its laser alone, shape (3,).

        Parameters
        ----------
        scan
            Made where it stands now, within about half a metre.

        Returns
        -------
        shape (3,)
            The identity where it was hardly moved, or where the scans do not match.
        """
        settings = self.settings
        nowhere = SE2_GROUP.identity()
        match = register(ScanCloud(self.scans[-1]), ScanCloud(scan), nowhere, settings.registration)
        if match is None or match.rmse > settings.max_rmse or match.matched_share < settings.min_matched_share:
            return nowhere
        if match.wall_share < settings.min_wall_share:
            return nowhere
        x, y, theta = match.pose.tolist()
        return nowhere if math.hypot(x, y) < _STILL and abs(theta) < _STILL else match.pose

    def settle(self) -> None:
        """At a goal: find the outliers among the closures, and drop them."""
        for back_end in dict.fromkeys((self._driving, self._deciding)):
            back_end.robustify()
        self._map_is_stale = True

    def occupancy(self) -> OccupancyMap:
        """The map by the scans so far at the estimate that the robot drives by."""
        return OccupancyMap.from_scans(self.poses, self.scans, bounds=self._bounds, previous=self._map)

    def _map_so_far(self, poses: FloatArray) -> OccupancyMap:
        if self._map is None or self._map_is_stale or len(poses) >= len(self._map.poses) + _MAP_PERIOD:
            self._map = OccupancyMap.from_scans(poses, self.scans, bounds=self._bounds, previous=self._map)
            self._map_is_stale = False
        return self._map
