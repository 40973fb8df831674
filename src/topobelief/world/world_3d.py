"""A world in space: cubes of an occupancy grid or of a point cloud, or all that lies within a width of a trajectory.

`Voxels` and `Tubes` are the two kinds of free space; `World3D` checks what it is asked and passes it on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray, IntArray, frozen_floats
from topobelief.errors import InvalidInputError, InvalidMapError, require_positive
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world.parts import Parts
from topobelief.world.space import checked_places, checked_radius
from topobelief.world.trajectory import default_width, odometry_steps
from topobelief.world.tubes import Tubes
from topobelief.world.voxels import MOST_CELLS, Voxels

DRIVING_HEIGHT = 1.0
"""Metres above and below its trajectory where a robot that drives may be, unless told otherwise: less than half a storey."""

_MARGIN = 2.0  # metres of free space kept around a point cloud


@dataclass(frozen=True, eq=False)
class World3D:
    """The places in space that are free, and answers to where a robot may move and what it can see among them.

    Parameters
    ----------
    space
        Cubes or tubes; the constructors below make them.

    Examples
    --------
    >>> wall = np.ones((10, 10, 5), dtype=bool)
    >>> wall[5, :8] = False
    >>> room = World3D.from_cells(wall, 1.0)
    >>> room.clearance([(2.5, 4, 2.5), (5.5, 4, 2.5)]).tolist()
    [2.5, -0.5]
    >>> room.visible([(2, 4, 2), (2, 9, 2)], [(8, 4, 2), (8, 9, 2)]).tolist()
    [False, True]
    """

    space: Voxels | Tubes

    def __repr__(self) -> str:
        size = " × ".join(f"{side:.1f}" for side in (self.corners[1] - self.corners[0]).tolist())
        kind = "around a trajectory" if isinstance(self.space, Tubes) else f"cubes of {self.space.resolution:g} m"
        return f"World3D({size} m, {kind})"

    @classmethod
    def from_cells(cls, free: ArrayLike, resolution: float, origin: ArrayLike = (0.0, 0.0, 0.0)) -> World3D:
        """An occupancy grid, its cells taken as the cubes they are.

        Parameters
        ----------
        free : shape (nx, ny, nz), bool
            Cell (0, 0, 0) is the lowest in x, y and z.
        resolution
            Side of a cell, metres.
        origin : (x, y, z)
            Lowest corner of cell (0, 0, 0), metres.

        Raises
        ------
        InvalidMapError
            Where shape, resolution or origin is wrong, there are more than 30 million cells, or none is free.
        """
        return cls(Voxels(np.asarray(free), resolution, np.asarray(origin, dtype=np.float64)))

    @classmethod
    def from_points(cls, points: ArrayLike, resolution: float = 0.2, *, bounds: ArrayLike | None = None) -> World3D:
        """A point cloud: cubes with a point in them are not free, all others are.

        Parameters
        ----------
        points : shape (N, 3)
            Metres, world frame; rows with nan (a lidar's missing returns) count as none.
        resolution
            Side of a cube, metres.
        bounds : shape (2, 3), optional
            Opposite corners of what is free at most. Default: the extent of the cloud and 2 m around it.

        Raises
        ------
        InvalidMapError
            Where there are no points, or their extent has more than 30 million cubes.
        """
        array = np.asarray(points, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != 3:
            raise InvalidMapError(f"expected points of shape (N, 3), got {array.shape}")
        array = array[np.isfinite(array).all(axis=1)]
        if len(array) == 0:
            raise InvalidMapError("expected at least one finite point, got none")
        if not (np.isfinite(resolution) and resolution > 0):
            raise InvalidMapError(f"expected a resolution above 0 m, got {resolution}")
        if bounds is None:
            low, high = array.min(axis=0) - _MARGIN, array.max(axis=0) + _MARGIN
        else:
            corners = frozen_floats(bounds, name="bounds")
            if corners.shape != (2, 3) or not np.isfinite(corners).all() or not (corners[0] < corners[1]).all():
                raise InvalidMapError(f"expected bounds as two opposite corners (x, y, z), got {corners.tolist()}")
            low, high = corners
        with np.errstate(over="ignore", invalid="ignore"):
            low = np.floor(low / resolution) * resolution
            sides = np.ceil((high - low) / resolution)
            fits = sides.prod() <= MOST_CELLS
        if not fits:
            size = " × ".join(f"{resolution * side:.4g}" for side in sides.tolist())
            raise InvalidMapError(
                f"expected points over at most {MOST_CELLS} cubes of {resolution:g} m, got an extent of {size} m; "
                "choose a larger resolution, or remove points that are far away"
            )
        free = np.ones(sides.astype(np.int64), dtype=bool)
        cells = np.floor((array - low) / resolution)
        inside = ((cells >= 0) & (cells < free.shape)).all(axis=1)
        free[tuple(cells[inside].astype(np.int64).T)] = False
        return cls(Voxels(free, resolution, low))

    @classmethod
    def from_trajectory(cls, graph: PoseGraph, width: float | None = None, height: float | None = None) -> World3D:
        """For a pose graph without a map: free within `width` of its odometry, and within `height` above and below it.

        Parameters
        ----------
        graph
            In SE(3), at its estimate. As for `World.from_trajectory`, edges other than odometry say nothing.
        width
            Metres to each side. Default: twice the length of the odometry edge on which it covered its median metre.
        height
            Metres up and down, at most the width. Where it is less than the width, the robot drives: it stays on the surface
            that its trajectory spans, and what is free on one floor has nothing to do with the floor above. Default: the
            width, for a robot that flies.

        Raises
        ------
        InvalidInputError
            For a graph in SE(2), a width or height that is not positive, a height above the width, and for the default width
            where no odometry edge has a length.
        """
        if graph.group.position_dim != 3:
            raise InvalidInputError(
                f"expected a graph in SE(3) for a world in space, got {graph.group.name}; use World.from_trajectory"
            )
        width = default_width(graph) if width is None else width
        height = width if height is None else height
        require_positive("a width", width, unit="m")
        require_positive("a height", height, unit="m")
        if height > width:
            raise InvalidInputError(f"expected a height of at most the width of {width:g} m, got {height:g} m")
        steps = odometry_steps(graph)
        alone = np.setdiff1d(np.arange(graph.num_poses), steps)
        first, second = np.concatenate([steps[:, 0], alone]), np.concatenate([steps[:, 1], alone])
        return cls(Tubes(graph.positions[first], graph.positions[second], float(width), float(height)))

    @property
    def dim(self) -> int:
        """3."""
        return 3

    @property
    def corners(self) -> FloatArray:
        """Opposite corners of all that may be free, shape (2, 3)."""
        return self.space.corners

    @property
    def is_surface(self) -> bool:
        """Whether it is for a robot that drives on the surface of its trajectory."""
        return isinstance(self.space, Tubes) and self.space.height < self.space.width

    def contains(self, points: ArrayLike) -> BoolArray:
        """Whether each point is free, shape (N,)."""
        return self.space.contains(checked_places(points, "points", 3))

    def clearance(self, points: ArrayLike) -> FloatArray:
        """Distance to what is not free, metres, shape (N,); negative where a point is not free.

        Exact among cubes. Around a trajectory it is how much further from the trajectory a place might be, measured across it:
        where two parts of it are near to each other, there may be more room than that.
        """
        return self.space.clearance(checked_places(points, "points", 3))

    def segments_free(self, starts: ArrayLike, ends: ArrayLike, radius: float) -> BoolArray:
        """Whether a ball may move along each segment: its centre stays more than `radius` from all that is not free.

        Parameters
        ----------
        starts, ends : shape (N, 3)
        radius
            Metres; 0 for a point. Around a trajectory it is measured across it.

        Returns
        -------
        shape (N,), bool
            Exact to 1e-9 of a cube or of the way.
        """
        a, b = checked_places(starts, "starts", 3), checked_places(ends, "ends", 3)
        if a.shape != b.shape:
            raise InvalidInputError(f"expected as many ends as starts, got {len(b)} and {len(a)}")
        return self.space.segments_free(a, b, checked_radius(radius))

    def visible(self, starts: ArrayLike, ends: ArrayLike) -> BoolArray:
        """Whether the line of sight from each start to its end is free, shape (N,)."""
        return self.segments_free(starts, ends, 0.0)

    def free_parts(self, starts: FloatArray, ends: FloatArray) -> Parts:
        """Which parts of straight ways are free; parts may overlap."""
        return self.space.free_parts(starts, ends)

    def nearest_free_place(self, place: FloatArray, radius: float) -> FloatArray | None:
        """About the nearest place with more clearance than a radius; None where there is none."""
        return self.space.nearest_free_place(place, radius)

    def drawn(
        self, count: int, radius: float, *, rng: np.random.Generator, centre: FloatArray | None = None, reach: float = np.inf
    ) -> FloatArray:
        """Random places where there may be room for a ball, shape (count, 3) or none; near a centre where one is given."""
        low, high = self.corners
        middle = (low + high) / 2 if centre is None else centre
        return self.space.drawn(count, radius, middle, min(reach, float(np.linalg.norm(high - low))), rng=rng)

    def backbone(self, radius: float) -> tuple[FloatArray, IntArray]:
        """Places that a roadmap should have, and pairs of them between which a ball may move: shapes (N, 3) and (M, 2)."""
        return self.space.backbone(radius)
