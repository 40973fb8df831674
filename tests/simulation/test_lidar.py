"""The lidar: exact ranges on polygons, noise, range, and what a broken one returns."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import topobelief as tb
from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.simulation.lidar import Lidar, LidarSettings

ROOM = tb.World.from_boxes([(4, 1, 5, 2), (1, 4, 1.5, 6)], bounds=(0, 0, 10, 8))


def exact(**settings: object) -> Lidar:
    return Lidar(ROOM, LidarSettings(range_noise=0.0, **settings))  # type: ignore[arg-type]


def range_by_shapely(world: tb.World, place: FloatArray, direction: float, reach: float) -> float:
    beam = shapely.LineString([place, place + reach * np.array([math.cos(direction), math.sin(direction)])])
    return shapely.Point(place).distance(beam.intersection(world.free.boundary))


def test_ranges_in_an_empty_room_are_its_distances() -> None:
    lidar = Lidar(tb.World.from_boxes([], bounds=(0, 0, 4, 2)), LidarSettings(num_beams=4, range_noise=0.0))
    np.testing.assert_allclose(lidar.ranges(np.array([1.0, 0.5, 0.0])), [1.0, 0.5, 3.0, 1.5])  # back, right, ahead, left
    np.testing.assert_allclose(lidar.ranges(np.array([1.0, 0.5, np.pi / 2])), [0.5, 3.0, 1.5, 1.0])


@pytest.mark.parametrize("x", [2.0, 3.0, 6.0])
@pytest.mark.parametrize("y", [1.0, 2.0, 6.0])
def test_beams_along_a_wall_pass_it(x: float, y: float) -> None:
    """Level with the edge of a box a beam runs beside it, to what stands behind."""
    lidar = Lidar(ROOM, LidarSettings(num_beams=4, range_noise=0.0, max_range=20.0))
    for quarter in range(-4, 5):
        ranges = lidar.ranges(np.array([x, y, quarter * math.pi / 2]))
        assert ((ranges > 0) & (ranges <= 10.0)).all()


@given(st.floats(0.1, 9.9), st.floats(0.1, 7.9), st.floats(-10, 10))
def test_ranges_are_those_of_exact_intersections_and_no_beam_slips_through(x: float, y: float, theta: float) -> None:
    place = np.array([x, y])
    if not ROOM.contains([place])[0]:
        return
    lidar = exact(num_beams=36, max_range=20.0)
    scan = lidar.scan(np.array([x, y, theta]), 0.0, rng=np.random.default_rng(0))
    expected = [range_by_shapely(ROOM, place, theta + angle, 20.0) for angle in scan.angles.tolist()]
    np.testing.assert_allclose(scan.ranges, expected, rtol=1e-9, atol=1e-9)


def test_beams_that_meet_a_corner_do_not_slip_through() -> None:
    square = Lidar(tb.World.from_boxes([], bounds=(-1, -1, 1, 1)), LidarSettings(num_beams=8, range_noise=0.0))
    np.testing.assert_allclose(square.ranges(np.zeros(3)), np.tile([1, math.sqrt(2)], 4))


def test_ranges_agree_with_the_ray_casting_of_the_physics() -> None:
    mujoco = pytest.importorskip("mujoco")
    from topobelief.simulation.mujoco_world import build_model
    from topobelief.simulation.robot_settings import RobotSettings

    model = build_model(ROOM, RobotSettings())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lidar, place = exact(num_beams=90, max_range=20.0), np.array([7.0, 3.3, 0.3])
    scan = lidar.scan(place, 0.0, rng=np.random.default_rng(0))
    directions = scan.angles + place[2]
    rays = np.stack([np.cos(directions), np.sin(directions), np.zeros(90)], axis=1).ravel()
    hits, distances = np.zeros(90, np.int32), np.zeros(90)
    base = model.body("base").id
    mujoco.mj_multiRay(model, data, np.array([7.0, 3.3, 0.2]), rays, None, 1, base, hits, distances, None, 90, 30.0)
    np.testing.assert_allclose(scan.ranges, distances, atol=1e-9)


def test_nothing_within_range_is_inf() -> None:
    ranges = exact(max_range=3.0).ranges(np.array([7.0, 4.0, 0.0]))
    assert np.isinf(ranges).any()
    assert ranges[np.isfinite(ranges)].max() <= 3.0


def test_noise_has_the_deviation_asked_for_and_stays_within_range() -> None:
    lidar = Lidar(ROOM, LidarSettings(range_noise=0.05, max_range=4.0))
    rng, pose = np.random.default_rng(1), np.array([7.0, 4.0, 0.0])
    scans = np.array([lidar.scan(pose, 0.0, rng=rng).ranges for _ in range(50)])
    sure = lidar.ranges(pose) < 3.7
    deviations = scans[:, sure] - lidar.ranges(pose)[sure]
    assert np.std(deviations) == pytest.approx(0.05, rel=0.05)
    assert abs(np.mean(deviations)) < 0.002
    assert scans[np.isfinite(scans)].max() <= 4.0


def test_a_share_of_the_beams_gives_no_answer() -> None:
    lidar = exact(nan_share=0.2)
    rng, pose = np.random.default_rng(2), np.array([7.0, 4.0, 0.0])
    silent = np.isnan([lidar.scan(pose, 0.0, rng=rng).ranges for _ in range(50)])
    assert np.mean(silent) == pytest.approx(0.2, abs=0.01)
    assert 0 < silent.mean(axis=0).min() < silent.mean(axis=0).max() < 1  # any beam, not always the same
    assert np.isnan(exact(nan_share=1.0).scan(pose, 0.0, rng=rng).ranges).all()


@pytest.mark.parametrize(
    ("sector", "dead"),
    [((0.0, 1.0), (0.5,)), ((3.0, -3.0), (math.pi - 0.05, -math.pi + 0.05)), ((-1.0, 5 * math.pi), (0.0, 3.0))],
)
def test_a_dead_sector_is_nan_counter_clockwise_from_first_to_second(
    sector: tuple[float, float], dead: tuple[float, ...]
) -> None:
    scan = exact(dead_sector=sector).scan(np.array([7.0, 4.0, 1.0]), 0.0, rng=np.random.default_rng(0))
    for angle in dead:
        assert np.isnan(scan.ranges[np.argmin(np.abs(scan.angles - angle))])
    width = sector[1] - sector[0]
    width = width if 0 <= width < 2 * math.pi else width % (2 * math.pi)
    assert np.isnan(scan.ranges).sum() == pytest.approx(width / (2 * math.pi) * 360, abs=1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_beams": 3}, "num_beams of at least 4, got 3"),
        ({"rate": 0.0}, "lidar rate above 0, got 0.0"),
        ({"max_range": math.inf}, "lidar max_range above 0, got inf"),
        ({"range_noise": -0.1}, "range_noise of at least 0 m, got -0.1"),
        ({"nan_share": 1.5}, "nan_share from 0 to 1, got 1.5"),
        ({"dead_sector": (0.0, math.nan)}, "dead_sector of two finite angles"),
    ],
)
def test_settings_that_no_lidar_has_are_refused(settings: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        LidarSettings(**settings)  # type: ignore[arg-type]
