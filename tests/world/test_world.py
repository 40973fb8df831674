"""World: exact distances and collision tests, against formulas written out here."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon, box

from topobelief.errors import InvalidInputError, InvalidMapError
from topobelief.world import World

BOUNDS = (0.0, 0.0, 10.0, 8.0)
BOXES = np.array([(2.0, 1.0, 3.0, 5.0), (5.0, 3.0, 8.0, 4.0), (5.5, 3.5, 6.0, 7.0)])


@pytest.fixture(scope="module")
def world() -> World:
    return World.from_boxes(BOXES, BOUNDS)


def distance_to_all(points: np.ndarray) -> np.ndarray:
    """Distance of each point to the boxes and, with its sign, to the bounds, by the formula for one box."""
    outside = np.maximum(np.maximum(BOXES[:, :2] - points[:, None], points[:, None] - BOXES[:, 2:]), 0)
    to_boxes = np.linalg.norm(outside, axis=2).min(axis=1)
    to_bounds = np.minimum(points - BOUNDS[:2], np.array(BOUNDS[2:]) - points).min(axis=1)
    return np.minimum(to_boxes, to_bounds)


class TestClearance:
    @given(st.lists(st.tuples(st.floats(-2, 12), st.floats(-2, 10)), min_size=1, max_size=20))
    def test_is_the_distance_to_the_nearest_box_or_bound(self, points: list[tuple[float, float]]) -> None:
        world, places = World.from_boxes(BOXES, BOUNDS), np.array(points)
        expected, clearance = distance_to_all(places), world.clearance(places)
        free = expected > 1e-9
        np.testing.assert_allclose(clearance[free], expected[free], atol=1e-12)
        assert (clearance[~free] <= 1e-9).all()

    def test_is_negative_in_obstacles_and_out_of_bounds_by_how_far_the_free_space_is(self, world: World) -> None:
        np.testing.assert_allclose(world.clearance([(2.5, 3), (-1, 4), (11, 9)]), [-0.5, -1, -np.sqrt(2)], atol=1e-12)

    def test_of_no_points_is_empty(self, world: World) -> None:
        assert world.clearance(np.zeros((0, 2))).shape == (0,)

    def test_where_walls_touch_there_is_no_gap(self) -> None:
        """Boxes that share an edge, or only its line to rounding, leave no free sliver between them."""
        world = World.from_boxes([(0.1, 0, 0.1 + 0.2, 1), (0.3, 0, 0.7, 1)], (0, 0, 1, 2))
        assert world.clearance([(0.3, 0.5)])[0] < 0
        assert not world.visible([(0.3, 0.9)], [(0.3, 1.5)])[0]


class TestSegments:
    @given(
        st.tuples(st.floats(0, 10), st.floats(0, 8)),
        st.tuples(st.floats(0, 10), st.floats(0, 8)),
        st.floats(0.01, 1.5),
    )
    def test_are_free_exactly_where_every_point_on_them_is(
        self, start: tuple[float, float], end: tuple[float, float], radius: float
    ) -> None:
        world = World.from_boxes(BOXES, BOUNDS)
        shares = np.linspace(0, 1, 400)[:, None]
        points = (1 - shares) * np.array(start) + shares * np.array(end)
        least = distance_to_all(points).min()
        step = np.hypot(end[0] - start[0], end[1] - start[1]) / 399
        free = bool(world.segments_free([start], [end], radius)[0])
        if least <= radius - 1e-9:
            assert not free
        if least > radius + step / 2 + 1e-9:  # distances change by no more than the way between two points
            assert free

    def test_a_disc_that_touches_is_not_free(self) -> None:
        world = World.from_boxes([(4, 0, 5, 2)], (0, 0, 10, 10))
        ends = [(9.0, 2.5)]
        assert not world.segments_free([(1.0, 2.5)], ends, 0.5)[0]
        assert world.segments_free([(1.0, 2.5)], ends, 0.5 - 1e-12)[0]

    def test_a_segment_that_is_a_point_is_free_where_the_point_is(self, world: World) -> None:
        place = [(4.0, 4.0)]
        clearance = world.clearance(place)[0]
        assert world.segments_free(place, place, clearance - 1e-9)[0]
        assert not world.segments_free(place, place, clearance + 1e-9)[0]

    def test_sight_ends_at_walls_at_corners_and_at_the_bounds(self) -> None:
        world = World.from_boxes([(4, 4, 6, 6)], (0, 0, 10, 10))
        starts = [(1, 5), (1, 1), (1, 6.9), (1, 1), (5, 5)]
        ends = [(9, 5), (9, 1), (7, 1), (11, 1), (5, 5)]
        assert world.visible(starts, ends).tolist() == [False, True, True, False, False]
        assert not world.visible([(2, 6)], [(8, 6)])[0], "along a wall it touches"
        assert not world.visible([(3, 5)], [(5, 3)])[0], "through a corner it touches"

    def test_none_is_free_that_lies_in_an_obstacle_far_from_its_outline(self) -> None:
        world = World.from_boxes([(10, 10, 90, 90)], (0, 0, 100, 100))
        assert not world.segments_free([(50, 50)], [(51, 50)], 0.1)[0]


class TestComponent:
    def test_has_a_hole_for_each_obstacle_that_can_be_rounded(self) -> None:
        """Of a pillar, a wall at the fence and two pillars too close to pass between, two can be rounded."""
        world = World.from_boxes(
            [(2, 2, 3, 3), (0, 6, 4, 7), (6, 2, 7, 3), (7.5, 2, 8.5, 3)],
            (0, 0, 10, 10),
        )
        assert len(world.component((5, 5), 0.35).interiors) == 2
        assert len(world.component((5, 5), 0.1).interiors) == 3

    def test_leaves_out_nothing_that_can_be_reached_and_little_else(self) -> None:
        world = World.from_boxes([(4, 4, 6, 6)], (0, 0, 10, 10))
        component = world.component((1, 1), 0.5)
        exact = 81 - (4 + 4 * 2 * 0.5 + np.pi * 0.25)
        assert exact < component.area < 1.02 * exact

    def test_is_the_room_of_the_point(self) -> None:
        world = World.from_boxes([(4.9, 0, 5.1, 10)], (0, 0, 10, 10))
        assert world.component((1, 1), 0.3).bounds[2] < 4.9
        assert world.component((9, 1), 0.3).bounds[0] > 5.1

    def test_needs_room(self) -> None:
        with pytest.raises(InvalidMapError, match="room for a disc of radius 3 m, got none"):
            World.from_boxes([], (0, 0, 4, 4)).component((2, 2), 3.0)


class TestConstruction:
    def test_polygons_that_are_boxes_make_the_world_of_the_boxes(self, world: World) -> None:
        """As shapely polygons and as corners, closed or not."""
        corners = [(2, 1), (3, 1), (3, 5), (2, 5)]
        polygons = [np.array(corners), box(*BOXES[1]), np.array([*Polygon(box(*BOXES[2])).exterior.coords])]
        assert World.from_polygons(polygons, BOUNDS).free.equals(world.free)

    def test_bounds_default_to_the_extent_of_the_walls(self) -> None:
        assert World.from_boxes([(0, 0, 1, 5), (4, 4, 5, 5)]).bounds == (0, 0, 5, 5)

    def test_walls_out_of_bounds_do_not_matter(self, world: World) -> None:
        assert World.from_boxes([*BOXES, (20, 20, 30, 30)], BOUNDS).free.equals(world.free)

    @pytest.mark.parametrize(
        ("boxes", "bounds", "message"),
        [
            ([(0, 0, 1)], BOUNDS, r"shape \(N, 4\)"),
            ([(0, 0, 1, 1), (3, 0, 2, 1)], BOUNDS, "at box 1"),
            ([(0, 0, np.nan, 1)], BOUNDS, "at box 0"),
            ([(0, 0, 1, 1)], (0, 0, 0, 1), "min < max"),
            ([(0, 0, 1, 1)], (0, 0, 1), "bounds"),
            ([(0, 0, 1, 1)], (0, 0, np.inf, 1), "bounds"),
            ([(-1, -1, 11, 11)], BOUNDS, "free space, got none"),
            ([], None, "bounds .* without walls"),
        ],
    )
    def test_refuses_boxes_and_bounds_that_are_none(self, boxes: list, bounds: tuple | None, message: str) -> None:
        with pytest.raises(InvalidMapError, match=message):
            World.from_boxes(boxes, bounds)

    @pytest.mark.parametrize(
        ("polygon", "message"),
        [
            ([(0, 0), (1, 1)], "3 finite corners .* at polygon 1"),
            ([(0, 0), (1, 1), (2, 0), (0, 1)], "cross itself, got Self-intersection.* at polygon 1"),
            ([(0, 0), (1, 1), (2, 2)], "at polygon 1"),
        ],
    )
    def test_refuses_polygons_that_are_none(self, polygon: list, message: str) -> None:
        with pytest.raises(InvalidMapError, match=message):
            World.from_polygons([box(4, 4, 5, 5), polygon], BOUNDS)

    def test_refuses_points_and_radii_that_are_none(self, world: World) -> None:
        with pytest.raises(InvalidInputError, match=r"points of shape \(N, 2\), got \(1, 3\)"):
            world.clearance([(1, 2, 3)])
        with pytest.raises(InvalidInputError, match="nan or inf in row 1"):
            world.clearance([(1, 2), (np.nan, 3)])
        with pytest.raises(InvalidInputError, match="as many ends as starts, got 1 and 2"):
            world.visible([(1, 1), (2, 2)], [(1, 1)])
        with pytest.raises(InvalidInputError, match="radius of at least 0 m, got -1"):
            world.segments_free([(1, 1)], [(1, 1)], -1)

    def test_refuses_a_region_that_is_not_one(self) -> None:
        with pytest.raises(InvalidMapError, match="valid free region"):
            World(Polygon([(0, 0), (1, 1), (1, 0), (0, 1)]))
