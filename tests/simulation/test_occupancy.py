"""Occupancy: walls where they are, unknown space by choice, sight, and files that ROS reads."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import topobelief as tb
from drives import LOOP, ROOMS, driven
from topobelief.errors import InvalidInputError
from topobelief.io.ros_map import write_ros_map
from topobelief.simulation.lidar import LidarSettings
from topobelief.simulation.occupancy import OccupancyMap
from topobelief.simulation.scan import Scan

DRIVE = driven(ROOMS, LOOP, seed=0)
POSES, SCANS = np.array([pose.truth for pose in DRIVE]), [pose.scan for pose in DRIVE]
MAP = OccupancyMap.from_scans(POSES, SCANS, bounds=ROOMS.bounds)


def centres(grid: OccupancyMap) -> np.ndarray:
    rows, columns = grid.hits.shape
    y, x = np.mgrid[:rows, :columns]
    return np.stack([x, y], axis=-1) * grid.resolution + grid.resolution / 2 + grid.origin


def test_occupied_cells_are_walls_and_free_cells_are_free() -> None:
    clearance = ROOMS.clearance(centres(MAP).reshape(-1, 2)).reshape(MAP.hits.shape)
    assert MAP.occupied.sum() > 500
    assert np.abs(clearance[MAP.occupied]).max() < 0.1
    assert clearance[MAP.free].min() > -0.1
    assert MAP.free[clearance > 0.1].mean() > 0.95


def test_what_nobody_saw_is_unknown() -> None:
    inside = tuple(np.argwhere((centres(MAP) > (8.1, 2.1)).all(-1) & (centres(MAP) < (8.4, 2.9)).all(-1)).T)
    assert (MAP.probability[inside] == 0.5).all()


def test_beams_without_an_answer_see_nothing_and_beams_into_the_open_see_free_space() -> None:
    angles = np.linspace(-np.pi, np.pi, 361)[:-1]
    ranges = np.where(angles > 0, np.nan, np.inf)
    grid = OccupancyMap.from_scans(np.zeros((1, 3)), [Scan(ranges, angles, 0.0, 3.0)], bounds=(-5, -5, 5, 5))
    y = centres(grid)[..., 1]
    assert not grid.occupied.any()
    assert grid.misses[y > 0.1].sum() == 0
    assert grid.misses.sum() * grid.resolution**2 == pytest.approx(np.pi * 3**2 / 2, rel=0.03)
    blind = OccupancyMap.from_scans(np.zeros((1, 3)), [Scan(np.full(360, np.nan), angles, 0.0, 3.0)], bounds=(-5, -5, 5, 5))
    assert not blind.misses.any()


def test_a_scan_may_see_beyond_the_map() -> None:
    whole = OccupancyMap.from_scans(POSES, SCANS, bounds=(0, 0, 10, 10))
    part = OccupancyMap.from_scans(POSES, SCANS, bounds=(2, 3, 6, 7))
    np.testing.assert_array_equal(part.hits, whole.hits[60:140, 40:120])
    assert np.mean(part.free == whole.free[60:140, 40:120]) > 0.995  # outlines are rasterised from another corner
    away = OccupancyMap.from_scans(POSES, SCANS, bounds=(100, 100, 101, 101))
    assert not away.misses.any()


def test_unknown_space_is_free_or_not_by_choice() -> None:
    grid = OccupancyMap.from_scans(POSES[:1], SCANS[:1], bounds=ROOMS.bounds)
    unseen, seen = [7.0, 8.0], POSES[0, :2]
    assert grid.to_world(unknown="optimistic").contains([unseen, seen]).tolist() == [True, True]
    assert grid.to_world(unknown="closed").contains([unseen, seen]).tolist() == [False, True]
    with pytest.raises(InvalidInputError, match="optimistic"):
        grid.to_world(unknown="free")  # type: ignore[arg-type]


def test_one_plans_in_the_map_as_in_the_world() -> None:
    world = MAP.to_world(unknown="optimistic")
    for start, end in itertools.pairwise(LOOP):
        roadmap = tb.build_roadmap(world, start, end, num_vertices=300, robot_radius=0.25, seed=0)
        (path,) = tb.diverse_paths(roadmap, start, end, num_paths=1, max_detour=1.3, seed=0)
        assert ROOMS.segments_free(path[:-1], path[1:], 0.15).all()


def test_sight_ends_at_walls_and_not_beyond_the_map() -> None:
    starts = np.array([(2.0, 2.0), (2.0, 3.0), (8.7, 2.5), (2.0, 2.0)])
    np.testing.assert_array_equal(MAP.line_of_sight(starts, np.array([7.0, 3.0])), [False, True, False, False])
    assert MAP.line_of_sight(np.array([(20.0, 20.0)]), np.array([30.0, 20.0])).all()
    assert MAP.line_of_sight(np.zeros((0, 2)), np.zeros(2)).shape == (0,)


def test_a_map_that_follows_the_estimate_is_the_map_drawn_anew() -> None:
    rng = np.random.default_rng(0)
    early = POSES[:20] + [0.3, -0.2, 0.05] * (0.2 + rng.random((20, 1))) * (np.arange(20)[:, None] % 2)
    before = OccupancyMap.from_scans(early, SCANS[:20], bounds=ROOMS.bounds)
    after = OccupancyMap.from_scans(POSES, SCANS, bounds=ROOMS.bounds, previous=before)
    np.testing.assert_array_equal(after.hits, MAP.hits)
    np.testing.assert_array_equal(after.misses, MAP.misses)
    slightly = OccupancyMap.from_scans(POSES + np.array([0.001, 0, 0]), SCANS, bounds=ROOMS.bounds, previous=MAP)
    np.testing.assert_array_equal(slightly.hits, MAP.hits)


def test_ros_reads_the_same_world(tmp_path: Path) -> None:
    MAP.write(tmp_path / "map.yaml")
    for unknown, choice in (("free", "optimistic"), ("occupied", "closed")):
        read = tb.read_ros_map(tmp_path / "map.yaml", unknown=unknown)  # type: ignore[arg-type]
        assert read.free.equals(MAP.to_world(unknown=choice).free)  # type: ignore[arg-type]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


def test_bad_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="a scan for each of 2 poses, got 1"):
        OccupancyMap.from_scans(POSES[:2], SCANS[:1], bounds=ROOMS.bounds)
    with pytest.raises(InvalidInputError, match="resolution above 0 m, got 0"):
        OccupancyMap.from_scans(POSES, SCANS, resolution=0.0, bounds=ROOMS.bounds)
    with pytest.raises(InvalidInputError, match="same grid"):
        OccupancyMap.from_scans(POSES, SCANS, bounds=(0, 0, 5, 5), previous=MAP)
    with pytest.raises(InvalidInputError, match="at most 3 scans"):
        OccupancyMap.from_scans(POSES[:3], SCANS[:3], bounds=ROOMS.bounds, previous=MAP)
    with pytest.raises(InvalidInputError, match="cells of -1, 0 and 100"):
        write_ros_map(tmp_path / "map.yaml", np.full((2, 2), 50), resolution=0.05)
    assert not list(tmp_path.iterdir())


def test_a_dead_sector_leaves_a_map_of_the_rest() -> None:
    drive = driven(ROOMS, LOOP[:4], seed=1, lidar=LidarSettings(dead_sector=(-2.0, 1.0), nan_share=0.1))
    grid = OccupancyMap.from_scans(np.array([p.truth for p in drive]), [p.scan for p in drive], bounds=ROOMS.bounds)
    assert np.abs(ROOMS.clearance(centres(grid)[grid.occupied])).max() < 0.1
