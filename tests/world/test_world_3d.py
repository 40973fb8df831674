"""Worlds in space: what cubes and tubes say is what measuring them place by place says."""

import numpy as np
import pytest

import topobelief as tb
from drives_3d import ramp
from topobelief.errors import InvalidInputError, InvalidMapError
from topobelief.geometry.segments import distances_to_segments
from topobelief.world.free_places import nearest_free_place
from topobelief.world.sight import seen_parts
from topobelief.world.tubes import Tubes

STEPS = np.linspace(0, 1, 401)[:, None]


@pytest.fixture(scope="module")
def cubes():
    """A few random cubes of 0.5 m that are not free; and the centres of all that are not, the layer outside among them."""
    free = np.random.default_rng(0).uniform(size=(9, 8, 7)) > 0.05
    world = tb.World3D.from_cells(free, 0.5, (1, 2, 3))
    return world, np.array([1, 2, 3]) + 0.5 * (np.argwhere(~np.pad(free, 1)) - 0.5)


def to_cubes(places, centres):
    outside = np.maximum(np.abs(places[:, None] - centres) - 0.25, 0.0)
    return np.linalg.norm(outside, axis=2).min(axis=1)


class TestCubes:
    def test_clearance_is_the_distance_to_the_nearest_cube(self, cubes):
        world, centres = cubes
        places = np.random.default_rng(1).uniform((1, 2, 3), (5.5, 6, 6.5), (300, 3))
        free = world.contains(places)
        assert 0.8 < free.mean() < 1
        np.testing.assert_allclose(world.clearance(places)[free], to_cubes(places[free], centres), rtol=0, atol=1e-12)
        assert (world.clearance(places)[~free] <= 0).all()
        assert world.clearance([(0.0, 4, 4)]) == pytest.approx(-1.0)

    @pytest.mark.parametrize("radius", [0.0, 0.15, 0.4])
    def test_a_ball_may_move_where_no_place_of_the_way_is_too_near(self, cubes, radius):
        world, centres = cubes
        starts, ends = np.random.default_rng(2).uniform((1, 2, 3), (5.5, 6, 6.5), (2, 50, 3))
        least = np.array([to_cubes(a + STEPS * (b - a), centres).min() for a, b in zip(starts, ends, strict=True)])
        between = np.linalg.norm(ends - starts, axis=1) / (2 * (len(STEPS) - 1))  # how much nearer it may come unseen
        free = world.segments_free(starts, ends, radius)
        assert free[least - between > radius].all()
        assert not free[least <= radius].any()
        assert (least - between > radius).any()
        assert (least <= radius).any()

    def test_a_ray_is_cut_at_the_faces(self):
        free = np.ones((10, 3, 3), dtype=bool)
        free[4, :, :] = free[7, 1, 1] = False
        parts = tb.World3D.from_cells(free, 1.0).free_parts(np.array([[0.5, 1.5, 1.5]]), np.array([[9.5, 1.5, 1.5]]))
        inside = np.zeros(90, dtype=bool)
        for low, high in zip(parts.lower, parts.upper, strict=True):
            inside |= (np.arange(90) + 0.5 > 90 * low) & (np.arange(90) + 0.5 < 90 * high)
        blocked = np.r_[35:45, 65:75]
        np.testing.assert_array_equal(np.flatnonzero(~inside), blocked)

    def test_points_fill_their_cubes(self):
        world = tb.World3D.from_points([(0.5, 0.5, 0.5), (np.nan, 0, 0)], 1.0)
        assert world.corners.tolist() == [[-2, -2, -2], [3, 3, 3]]
        assert world.contains([(0.1, 0.9, 0.5), (1.1, 0.5, 0.5)]).tolist() == [False, True]
        assert tb.World3D.from_points([(5, 5, 5)], 1.0, bounds=[(0, 0, 0), (2, 2, 2)]).space.walls.shape[0] > 0

    def test_what_is_no_map_is_refused(self):
        with pytest.raises(InvalidMapError, match="at least one finite point"):
            tb.World3D.from_points([(np.nan, 0, 0)])
        with pytest.raises(InvalidMapError, match="choose a larger resolution"):
            tb.World3D.from_points([(0, 0, 0), (1e9, 0, 0)])
        with pytest.raises(InvalidMapError, match="expected free cells"):
            tb.World3D.from_cells(np.zeros((2, 2, 2), dtype=bool), 1.0)
        with pytest.raises(InvalidMapError, match="boolean cells"):
            tb.World3D.from_cells(np.zeros((2, 2), dtype=bool), 1.0)
        world = tb.World3D.from_cells(np.ones((2, 2, 2), dtype=bool), 1.0)
        with pytest.raises(InvalidInputError, match=r"shape \(N, 3\)"):
            world.contains([(1, 2)])
        with pytest.raises(InvalidInputError, match="finite points, got nan or inf in row 0"):
            world.clearance([(1, 2, np.inf)])


class TestTubes:
    @pytest.mark.parametrize("height", [1.0, 0.4])
    def test_agree_with_places_along_the_way(self, height):
        rng = np.random.default_rng(3)
        path, scale = np.cumsum(rng.normal(size=(25, 3)), axis=0), np.array([1, 1, 1 / height])
        tubes = Tubes(path[:-1], path[1:], 1.0, height)

        def depths(places):
            return 1 - distances_to_segments((places * scale)[:, None], path[:-1] * scale, path[1:] * scale).min(axis=1)

        starts = path[rng.integers(25, size=150)] + 0.6 * rng.normal(size=(150, 3))
        ends = starts + 0.6 * rng.normal(size=(150, 3))
        np.testing.assert_allclose(tubes.clearance(starts), depths(starts), rtol=0, atol=1e-12)
        for radius in (0.0, 0.3):
            least = np.array([depths(a + STEPS * (b - a)).min() for a, b in zip(starts, ends, strict=True)])
            between = np.linalg.norm((ends - starts) * scale, axis=1) / (2 * (len(STEPS) - 1))
            free = tubes.segments_free(starts, ends, radius)
            assert free.any()
            assert free[least - between > radius].all()
            assert not free[least <= radius].any()
        places, links = tubes.backbone(0.3)
        assert tubes.segments_free(places[links[:, 0]], places[links[:, 1]], 0.3).all()

    def test_floors_are_not_joined(self):
        """3 m apart, half as much as the tube is wide: a robot that drives stays on its floor, one that flies does not."""
        graph = ramp()
        below, above = graph.positions[[3]], graph.positions[[27]]
        assert not tb.World3D.from_trajectory(graph, 6.0, 1.0).visible(below, above)[0]
        assert tb.World3D.from_trajectory(graph, 6.0).visible(below, above)[0]
        assert tb.World3D.from_trajectory(graph, 6.0, 1.0).is_surface

    def test_what_makes_no_tube_is_refused(self):
        planar = tb.PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3))
        with pytest.raises(InvalidInputError, match=r"SE\(3\).*World.from_trajectory"):
            tb.World3D.from_trajectory(planar)
        with pytest.raises(InvalidInputError, match="height of at most the width of 2 m"):
            tb.World3D.from_trajectory(ramp(), 2.0, 3.0)


@pytest.mark.parametrize("kind", ["cubes", "tubes"])
def test_nothing_that_is_seen_is_left_out(cubes, kind):
    """Of a way from a place; and what a wall hides is not seen."""
    rng = np.random.default_rng(4)
    world = cubes[0] if kind == "cubes" else tb.World3D.from_trajectory(ramp(), 4.0, 1.0)
    if kind == "cubes":
        places, starts, ends = rng.uniform((1, 2, 3), (5.5, 6, 6.5), (3, 120, 3))
    else:
        places, starts = ramp().positions[rng.integers(49, size=(2, 120))]
        ends = starts + rng.normal(size=(120, 3)) * [1, 1, 0.1]
    parts = seen_parts(world, places, starts, ends)
    at = rng.uniform(size=120)
    on_way = starts + at[:, None] * (ends - starts)
    seen = world.visible(places, on_way)
    covered = np.zeros(120, dtype=bool)
    covered[parts.which[(parts.lower <= at[parts.which]) & (at[parts.which] <= parts.upper)]] = True
    assert seen.any()
    assert covered[seen].all()
    assert (~covered[~seen]).mean() > 0.5


def test_the_nearest_free_place_has_room(cubes):
    world, _ = cubes
    taken = world.space.walls[:20]
    for place in taken:
        found = nearest_free_place(world, place, 0.2)
        assert found is not None
        assert world.clearance(found[None])[0] > 0.2
        assert np.linalg.norm(found - place) < 2
    tube = tb.World3D.from_trajectory(ramp(), 2.0, 1.0)
    found = nearest_free_place(tube, np.array([20.0, 0, 0]), 0.5)
    assert found is not None
    assert tube.clearance(found[None])[0] > 0.5
    assert np.linalg.norm(found - [12, 0, 0]) < 1
    assert nearest_free_place(tube, np.zeros(3), 2.5) is None
