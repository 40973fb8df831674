"""Roadmaps, diverse paths and predicted factors in space."""

import math

import numpy as np
import pytest

import topobelief as tb
from drives_3d import flight, ramp
from topobelief.candidates.attitude import Legs, waypoint_poses
from topobelief.candidates.detours import Balls
from topobelief.candidates.polyline import path_length
from topobelief.candidates.propose import CandidateRule, propose
from topobelief.candidates.start import find_start
from topobelief.errors import InvalidInputError, PlanningError

GRAPH = ramp()
WORLD = tb.World3D.from_trajectory(GRAPH, 3.0, 1.0)


@pytest.fixture(scope="module")
def roadmap():
    return tb.build_roadmap(WORLD, GRAPH.positions[-1], GRAPH.positions[2], 200, 0.3)


def room(*, door=True):
    """Two rooms with a door in the wall between them."""
    free = np.ones((20, 10, 10), dtype=bool)
    free[10] = False
    free[10, 4:6, 4:6] = door
    return tb.World3D.from_cells(free, 0.5)


def test_a_robot_that_drives_goes_down_the_ramp(roadmap):
    """Not through the floor, though that is 6 m below and the way round is 120 m."""
    path = roadmap.vertices[roadmap.shortest_path()]
    assert path_length(path) > 50
    assert WORLD.segments_free(path[:-1], path[1:], 0.3).all()
    steps = np.diff(path, axis=0)
    assert (np.abs(steps[:, 2]) < 0.3 * np.linalg.norm(steps, axis=1)).all()


def test_every_edge_is_free_and_a_seed_repeats(roadmap):
    a, b = roadmap.vertices[roadmap.edges].transpose(1, 0, 2)
    assert WORLD.segments_free(a, b, 0.3).all()
    again = tb.build_roadmap(WORLD, GRAPH.positions[-1], GRAPH.positions[2], 200, 0.3)
    assert np.array_equal(again.vertices, roadmap.vertices)


def test_a_door_is_found_and_a_wall_is_told():
    """The roadmap grows until start and goal are connected."""
    start, goal = (1, 1, 1), (9, 4, 4)
    path = tb.build_roadmap(room(), start, goal, 30, 0.2)
    assert path.shortest_path() is not None
    with pytest.raises(PlanningError, match="places have no way"):
        tb.build_roadmap(room(door=False), start, goal, 10, 0.2)
    with pytest.raises(PlanningError, match=r"goal on the map, x 0 to 10, y 0 to 5 and z 0 to 5, got \(9, 4, 7\); choose"):
        tb.build_roadmap(room(), start, (9, 4, 7), 30, 0.2)
    with pytest.raises(PlanningError, match="start with more clearance than the robot's radius"):
        tb.build_roadmap(room(), (0.1, 1, 1), goal, 30, 0.2)
    with pytest.raises(InvalidInputError, match=r"finite goal \(x, y, z\)"):
        tb.build_roadmap(room(), start, (9, 4), 30, 0.2)


@pytest.mark.parametrize("world", [tb.World3D.from_cells(np.ones((20, 10, 10), dtype=bool), 0.5), room()], ids=["hall", "door"])
def test_the_shortest_way_is_straightened(world):
    """Through random places alone it would be a sixth too long."""
    start, goal = (1, 1, 1), (9, 4, 4)
    roadmap = tb.build_roadmap(world, start, goal, 60, 0.2)
    assert path_length(roadmap.vertices[roadmap.shortest_path()]) == pytest.approx(math.dist(start, goal))


def test_trips_have_a_far_place_as_second_vertex():
    roadmap = tb.build_roadmap(WORLD, GRAPH.positions[-1], None, 100, 0.3)
    assert np.linalg.norm(roadmap.vertices[1] - roadmap.vertices[0]) > 10
    assert roadmap.between(GRAPH.positions[-1], GRAPH.positions[20]).shortest_path() is not None


def test_diverse_paths_keep_apart():
    """Around a pillar that floats, paths go by on all sides, each further from the others than the last ball's radius."""
    free = np.ones((30, 16, 16), dtype=bool)
    free[12:18, 5:11, 5:11] = False
    world = tb.World3D.from_cells(free, 0.5)
    start, goal = (1, 4, 4), (14, 4, 4)
    roadmap = tb.build_roadmap(world, start, goal, 400, 0.3)
    paths = tb.diverse_paths(roadmap, start, goal, 6, 1.5)
    assert len(paths) == 6
    assert all(world.segments_free(path[:-1], path[1:], 0.3).all() for path in paths)
    middles = np.array([path[np.argmin(np.abs(path[:, 0] - 7.5))][1:] - 4 for path in paths])
    sides = {(bool(y > abs(z)), bool(y < -abs(z)), bool(z > abs(y))) for y, z in middles}
    assert len(sides) >= 3
    assert Balls.none(3).clear_of(paths[0][:-1], paths[0][1:]).all()


class TestAttitude:
    def test_upright_or_as_the_ramp_is_tilted(self):
        path = GRAPH.positions[8:11]
        along, upright = (waypoint_poses(GRAPH, path, attitude) for attitude in ("along", "upright"))
        rotation = GRAPH.group.rotation_matrix(along)
        leg = np.diff(path, axis=0) / np.linalg.norm(np.diff(path, axis=0), axis=1)[:, None]
        np.testing.assert_allclose(rotation[1:, :, 0], leg, atol=1e-12)
        np.testing.assert_allclose(GRAPH.group.rotation_matrix(upright)[:, 2, 2], 1, atol=1e-12)
        turned = GRAPH.group.rotation_vector(GRAPH.group.between(along[1:], GRAPH.poses[9:11]))
        assert np.linalg.norm(turned, axis=1).max() < 0.2
        assert Legs(GRAPH).attitude == "upright"
        assert Legs(flight(0)).attitude == "along"

    def test_a_leg_along_the_axis_that_would_be_up_has_another_one(self):
        graph = tb.PoseGraph([[0, 0, 0, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0, 1]], [(0, 1)], None, np.eye(6))
        poses = waypoint_poses(graph, graph.positions, "along")
        rotation = graph.group.rotation_matrix(poses)
        np.testing.assert_allclose(rotation[:, :, 0], [[0, 0, 1]] * 2, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(rotation), 1)
        assert waypoint_poses(graph, graph.positions[:1]).tolist() == [[0, 0, 0, 0, 0, 0, 1]]

    def test_sharp_corners_have_poses_in_between(self):
        """Each turned by at most the limit from the one before it."""
        graph = flight(1)
        end = graph.positions[-1]
        path = end + np.array([(0, 0, 0), (3, 0, 0), (3, 0, 3), (0, 0, 3)])
        (action,) = tb.predict_actions(graph, [path], spacing=1.0, turn=0.5, attitude="along")
        poses = np.vstack([graph.poses[-1:], action.poses])
        turned = np.linalg.norm(graph.group.rotation_vector(graph.group.between(poses[:-1], poses[1:])), axis=1)
        assert turned.max() <= 0.5 + 1e-9
        assert np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1).max() <= 1 + 1e-9
        (without,) = tb.predict_actions(graph, [path], spacing=1.0, turn=None)
        assert without.num_new_poses == 9
        np.testing.assert_allclose(without.poses[-1, :3], path[-1])


def test_candidates_close_loops_on_their_own_floor():
    """From the top to the foot of the ramp: every floor is seen again, none through the floor above it."""
    rule = CandidateRule(num_paths=2, num_vertices=150, robot_radius=0.3, spacing=2.0, closures=tb.ClosureModel(radius=4.0))
    found = propose(GRAPH, WORLD, find_start(GRAPH), GRAPH.positions[2], rule)
    positions = np.concatenate([GRAPH.positions, found.actions[0].poses[:, :3]])
    ends = positions[found.actions[0].edges[found.actions[0].num_new_poses :]]
    assert len(ends) > 5
    assert np.abs(ends[:, 0, 2] - ends[:, 1, 2]).max() < 1.5


def test_worlds_and_graphs_of_other_dimensions_are_refused():
    planar = tb.PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3))
    with pytest.raises(InvalidInputError, match=r"planar world for a graph in SE\(2\)"):
        tb.predict_actions(planar, [[(1, 0), (2, 0)]], world=WORLD)
    with pytest.raises(InvalidInputError, match=r"path 0 in the plane for a graph in SE\(2\)"):
        tb.predict_actions(planar, [[(1, 0, 0), (2, 0, 0)]])
    with pytest.raises(InvalidInputError, match=r"\(x, y, z\) in a graph in SE\(3\)"):
        find_start(GRAPH, (1, 2))
    assert find_start(GRAPH, GRAPH.positions[5] + 0.01, world=WORLD).pose == 5
