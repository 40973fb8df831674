"""Laws of planning in space, on random worlds, roadmaps and graphs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.spatial.transform import Rotation

import topobelief as tb
from drives_3d import flight, ramp
from graphs import noises, random_pose_graph
from topobelief.candidates.polyline import path_length
from topobelief.errors import PlanningError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.projection import is_planar, projected_to_plane

grids = arrays(bool, array_shapes(min_dims=3, max_dims=3, max_side=6)).filter(np.any)
seeds = st.integers(0, 2**32 - 1)
PLANAR = np.array([0, 1, 5])  # x, y and yaw in the tangent of SE(3)


def to_cubes(places: np.ndarray, cubes: np.ndarray, resolution: float) -> np.ndarray:
    """Distance from each place to the nearest of the cubes with these lowest corners."""
    outside = np.maximum(np.maximum(cubes - places[:, None], places[:, None] - cubes - resolution), 0.0)
    return np.linalg.norm(outside, axis=2).min(axis=1)


@given(grids, seeds, st.floats(0.01, 10))
def test_clearance_is_the_distance_to_the_nearest_cube_of_the_other_kind(free, seed, resolution):
    """Measured to all cubes one by one; outside of the grid nothing is free."""
    rng = np.random.default_rng(seed)
    origin, size = rng.uniform(-50, 50, 3), resolution * np.array(free.shape)
    world = tb.World3D.from_cells(free, resolution, origin)
    places = origin + rng.uniform(-0.5, 1.5, (30, 3)) * size
    around = np.pad(free, 4 * max(free.shape))[tuple(slice(3 * max(free.shape), -3 * max(free.shape)) for _ in range(3))]
    corner = origin - resolution * max(free.shape)
    blocked, open_ = (corner + resolution * np.argwhere(around == kind) for kind in (False, True))
    expected = np.where(world.contains(places), to_cubes(places, blocked, resolution), -to_cubes(places, open_, resolution))
    np.testing.assert_allclose(world.clearance(places), expected, rtol=1e-9, atol=1e-9 * resolution)


@given(grids, seeds, st.floats(0, 0.6))
def test_what_sees_is_seen_and_ways_may_be_gone_back(free, seed, radius):
    rng = np.random.default_rng(seed)
    cubes, tube = tb.World3D.from_cells(free, 1.0), tb.World3D.from_trajectory(flight(seed % 1000), 0.7, rng.uniform(0.2, 0.7))
    for world in (cubes, tube):
        low, high = world.corners
        starts, ends = rng.uniform(low, high, (2, 40, 3))
        ends[:20] = starts[:20] + rng.normal(0, 0.3, (20, 3))
        np.testing.assert_array_equal(world.visible(starts, ends), world.visible(ends, starts))
        there, back = world.segments_free(starts, ends, radius), world.segments_free(ends, starts, radius)
        np.testing.assert_array_equal(there, back)
        assert world.visible(starts[there], ends[there]).all()


@settings(max_examples=15)
@given(seeds, st.floats(0.05, 0.4), st.booleans())
def test_roadmaps_keep_clear_and_no_way_is_shorter_than_the_straight_line(seed, radius, in_cubes):
    """Every place of every edge; nor is any of the candidates, which begin and end where they should."""
    rng = np.random.default_rng(seed)
    if in_cubes:
        world = tb.World3D.from_cells(rng.uniform(size=(10, 8, 6)) > 0.08, 1.0)
        low, high = world.corners
        places = rng.uniform(low, high, (400, 3))
    else:
        world = tb.World3D.from_trajectory(ramp(rounds=1), 3.0, 1.0)
        places = rng.permutation(ramp(rounds=1).positions)
    start, goal = places[world.clearance(places) > radius][:2]
    try:
        roadmap = tb.build_roadmap(world, start, goal, 40, radius, seed % 1000)
    except PlanningError:
        return  # an island
    a, b = roadmap.vertices[roadmap.edges].transpose(1, 0, 2)
    for share in np.linspace(0, 1, 21):
        assert world.clearance(a + share * (b - a)).min() > radius - 1e-9
    straight = float(np.linalg.norm(goal - start))
    paths = tb.diverse_paths(roadmap, start, goal, 4, 1.5)
    for path in (roadmap.vertices[roadmap.shortest_path()], *paths):
        np.testing.assert_allclose(path[[0, -1]], [start, goal])
        assert path_length(path) >= straight * (1 - 1e-12)
        assert world.segments_free(path[:-1], path[1:], radius).all()


def in_space(poses: np.ndarray, height: float) -> np.ndarray:
    return np.column_stack([poses[:, :2], np.full(len(poses), height), Rotation.from_euler("z", poses[:, 2:]).as_quat()])


@settings(max_examples=30)
@given(noises(groups=(SE2_GROUP,)), seeds, st.floats(-100, 100))
def test_a_planar_graph_saved_in_3d_gives_the_answer_of_its_planar_twin(noise, seed, height):
    """Whatever it says of heights and tilts: the same bounds, entropies and choice."""
    rng = np.random.default_rng(seed)
    twin = random_pose_graph(rng, noise, 7, 3)
    information = np.zeros((twin.num_edges, 6, 6))
    information[:, PLANAR[:, None], PLANAR] = twin.information
    information[:, [2, 3, 4], [2, 3, 4]] = rng.uniform(0.1, 10, (twin.num_edges, 3))
    saved = tb.PoseGraph(in_space(twin.poses, height), twin.edges, in_space(twin.measurements, 0.0), information)
    assert is_planar(saved)
    step = noise.length
    paths = [twin.positions[-1] + step * np.vstack([(0, 0), np.cumsum(rng.normal(size=(3, 2)), axis=0)]) for _ in range(3)]
    decisions = []
    for graph in (twin, projected_to_plane(saved)[0]):
        actions = tb.predict_actions(graph, paths, spacing=step, closure_radius=2 * step)
        decisions.append(tb.Planner(graph, objective="error").decide(actions, proof="optimal"))
    one, other = decisions
    np.testing.assert_allclose([one.lower, one.upper], [other.lower, other.upper], rtol=1e-6)
    assert one.best == other.best or one.lower[one.best] == pytest.approx(one.lower[other.best], rel=1e-6)
