"""Predicted factors: where the new poses stand, which closures they make, and with what noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topobelief import Action, PoseGraph, posterior
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import closure_information, default_information, predict_actions
from topobelief.errors import InvalidInputError, PlanningError
from topobelief.world import World

OMEGA = np.diag([100.0, 100.0, 800.0])


def drive(positions: list[tuple[float, float]], theta: float = 0.0) -> PoseGraph:
    poses = np.column_stack([np.array(positions, dtype=float), np.full(len(positions), theta)])
    chain = np.array([(i, i + 1) for i in range(len(poses) - 1)]).reshape(-1, 2)
    return PoseGraph(poses, chain, None, OMEGA)


def closures(action: Action) -> set[tuple[int, int]]:
    return {(int(a), int(b)) for a, b in action.edges[action.num_new_poses :]}


def predict(graph: PoseGraph, path: list[tuple[float, float]] | np.ndarray, **rules: object) -> Action:
    """The action of a path by a rule by hand, with poses by distance only unless a turn is given."""
    by_hand = {"closure_radius": 2.0} if not {"closures", "closure_radius"} & rules.keys() else {}
    return predict_actions(graph, [path], **{"turn": None, **by_hand, **rules})[0]


ORIGIN = drive([(0, 0)])
coordinates = st.integers(-20, 20).map(lambda value: value / 4)


class TestPoses:
    def test_stand_a_metre_apart_head_along_the_path_and_end_at_its_end(self) -> None:
        poses = predict(ORIGIN, [(0, 0), (2.5, 0), (2.5, 2)], information=OMEGA).poses
        expected = [(1, 0, 0), (2, 0, 0), (2.5, 0.5, np.pi / 2), (2.5, 1.5, np.pi / 2), (2.5, 2, np.pi / 2)]
        np.testing.assert_allclose(poses, expected, atol=1e-12)

    def test_at_a_corner_head_as_they_came(self) -> None:
        assert predict(ORIGIN, [(0, 0), (2, 0), (2, 1)], information=OMEGA).poses[1].tolist() == [2, 0, 0]

    @given(
        st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=6),
        st.sampled_from([0.25, 0.3, 1.0, 2.5]),
    )
    def test_are_a_spacing_apart_along_the_path_but_for_the_last(self, points: list, spacing: float) -> None:
        path = np.array([(0.0, 0.0), *points])
        poses = predict(ORIGIN, path, information=OMEGA, spacing=spacing).poses
        length = path_length(path)
        assert len(poses) == math.ceil(length / spacing - 1e-9)
        if len(poses):
            assert poses[-1, :2].tolist() == path[-1].tolist()
        dense = np.linspace(0, 1, 2001)[:, None, None]
        on_path = ((1 - dense) * path[:-1] + dense * path[1:]).reshape(-1, 2)
        for pose in poses:
            assert np.linalg.norm(on_path - pose[:2], axis=1).min() < 0.01
        steps = np.linalg.norm(np.diff(np.vstack([[(0, 0)], poses[:, :2]]), axis=0), axis=1)
        assert (steps <= spacing + 1e-9).all()

    @given(st.integers(1, 60), st.sampled_from([0.1, 0.3, 1.0, 0.7]), st.floats(0, 6.28))
    def test_a_path_of_whole_steps_ends_without_a_tiny_one(self, count: int, spacing: float, angle: float) -> None:
        end = count * spacing * np.array([np.cos(angle), np.sin(angle)])
        poses = predict(ORIGIN, np.array([(0, 0), end]), information=OMEGA, spacing=spacing).poses
        assert len(poses) == count
        np.testing.assert_allclose(poses[-1, :2], end, atol=1e-12)

    def test_a_path_that_begins_elsewhere_is_led_there_straight(self) -> None:
        poses = predict(drive([(5, 0), (0, 0)]), [(0, 2), (2, 2)], information=OMEGA).poses
        np.testing.assert_allclose(poses[:, :2], [(0, 1), (0, 2), (1, 2), (2, 2)], atol=1e-12)

    def test_a_path_that_goes_nowhere_adds_nothing(self) -> None:
        for path in ([(0, 0)], [(0, 0), (0, 0)]):
            action = predict(ORIGIN, path, information=OMEGA)
            assert action.num_new_poses == len(action.edges) == 0
            assert posterior(ORIGIN, action).num_poses == 1

    def test_in_space_are_upright_at_the_height_of_the_last_pose(self) -> None:
        """The first odometry factor turns the robot upright; with a closure it measures what the poses predict."""
        tilt = [0, 0, 0, 0, 0, np.sin(0.1), np.cos(0.1)]
        poses = np.array([[x, 0, 3, 0, 0, 0, 1] for x in range(6)], dtype=float)
        poses[-1, 3:] = tilt[3:]
        graph = PoseGraph(poses, [(i, i + 1) for i in range(5)], None, np.eye(6))
        action = predict(graph, [(5, 0), (5, 1), (0, 1)])
        np.testing.assert_allclose(action.poses[:, 2], 3)
        np.testing.assert_allclose(action.poses[0, 3:], [0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)], atol=1e-12)
        assert (11, 0) in closures(action)
        assert posterior(graph, action).chi2 == pytest.approx(0, abs=1e-18)


class TestEdges:
    def test_odometry_leads_from_the_last_pose_from_new_to_new(self) -> None:
        action = predict(drive([(-1, 0), (0, 0)]), [(0, 0), (3, 0)])
        assert action.edges.tolist() == [[1, 2], [2, 3], [3, 4]]

    def test_a_way_back_closes_loops_new_to_old(self) -> None:
        """Out along y = 0 to x = 6, back along y = 1: closures where the gap allows, nearer than 2 m."""
        graph = drive([(x, 0) for x in range(7)])
        action = predict(graph, [(6, 0), (6, 1), (3, 1)])  # new poses 7 to 10 at x = 6, 5, 4, 3
        assert closures(action) == {(9, 4), (9, 3), (10, 3), (10, 2), (10, 4)}

    @given(st.integers(0, 50), st.sampled_from([0.5, 1.0, 3.1416]), st.integers(2, 8), st.floats(0.5, 3.0))
    def test_closures_are_those_of_the_rule_taken_literally(self, seed: int, angle: float, gap: int, radius: float) -> None:
        rng = np.random.default_rng(seed)
        poses = np.column_stack([np.cumsum(rng.normal(size=(30, 2)), axis=0), rng.uniform(-3, 3, 30)])
        graph = PoseGraph(poses, [(i, i + 1) for i in range(29)], None, OMEGA)
        world = World.from_boxes([(-1, -1, 0.5, 0.5)], (-50, -50, 50, 50))
        path = poses[-1, :2] + np.cumsum(np.vstack([[(0, 0)], rng.normal(size=(5, 2))]), axis=0)
        angle = min(angle, math.pi)
        action = predict(graph, path, closure_radius=radius, closure_angle=angle, min_index_gap=gap, world=world)
        every = np.vstack([poses, action.poses])
        expected = set()
        for i in range(30, len(every)):
            for j in range(i - gap + 1):
                turn = abs((every[i, 2] - every[j, 2] + np.pi) % (2 * np.pi) - np.pi)
                near = np.linalg.norm(every[i, :2] - every[j, :2]) < radius
                if near and turn <= angle and world.visible(every[i : i + 1, :2], every[j : j + 1, :2])[0]:
                    expected.add((i, j))
        assert closures(action) == expected
        assert action.num_closures == len(expected)

    @given(st.floats(0, 6.28), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
    def test_two_poses_back_on_a_straight_path_are_never_a_closure_by_rounding(self, angle: float, x: float, y: float) -> None:
        """The paper's rule, gap 2 and below 2 m, at exactly 2 m."""
        way = 20 * np.array([(0, 0), (np.cos(angle), np.sin(angle))])
        action = predict(drive([(x, y)], theta=angle), way + np.array([x, y]), information=OMEGA, min_index_gap=2)
        assert closures(action) == set()

    def test_walls_hide_what_lies_behind_them(self) -> None:
        graph = drive([(x, 0) for x in range(7)])
        path = [(6, 0), (6, 1), (3, 1)]
        world = World.from_boxes([(-1, 0.4, 5.5, 0.6)], (-1, -1, 8, 2))
        assert closures(predict(graph, path)) != set()
        assert closures(predict(graph, path, world=world)) == set()

    def test_each_path_makes_an_action_of_its_own(self) -> None:
        graph = drive([(0, 0), (1, 0)])
        actions = predict_actions(graph, [[(1, 0), (4, 0)], np.array([(1.0, 0.0), (1.0, 2.0)])], turn=None)
        assert [action.label for action in actions] == ["path 0", "path 1"]
        assert [action.num_new_poses for action in actions] == [3, 2]
        assert predict_actions(graph, []) == []


class TestTurns:
    """New poses where the path turns, on a drive along x that ends at the origin."""

    GRAPH = drive([(-1, 0), (0, 0)])
    QUARTER = np.pi / 2

    def test_a_sharp_corner_has_a_pose_for_each_turn_and_distances_count_from_the_last(self) -> None:
        poses = predict(self.GRAPH, [(0, 0), (2.5, 0), (2.5, 2)], turn=np.pi / 6).poses
        corner = [(2.5, 0, np.pi / 6), (2.5, 0, np.pi / 3), (2.5, 0, self.QUARTER)]
        expected = [(1, 0, 0), (2, 0, 0), *corner, (2.5, 1, self.QUARTER), (2.5, 2, self.QUARTER)]
        np.testing.assert_allclose(poses, expected, atol=1e-12)

    def test_slight_bends_add_up_to_a_turn_since_the_last_pose(self) -> None:
        """Three bends of 10 degrees, 0.2 m apart: the second makes 20, the third 10 again."""
        headings = np.radians([0, 10, 20, 30])
        path = np.vstack([(0, 0), np.cumsum(0.2 * np.column_stack([np.cos(headings), np.sin(headings)]), axis=0)])
        poses = predict(self.GRAPH, path, turn=math.radians(15)).poses
        np.testing.assert_allclose(np.degrees(poses[:, 2]), [15, 30, 30], atol=1e-9)
        np.testing.assert_allclose(poses[:, :2], [path[2], path[3], path[4]], atol=1e-12)

    def test_bends_to_and_fro_cancel(self) -> None:
        path = [(0, 0), (0.4, 0.05), (0.8, 0), (1.2, 0.05), (1.6, 0)]
        assert len(predict(self.GRAPH, path, turn=math.radians(15)).poses) == 2

    def test_the_robot_turns_into_the_path_where_it_stands(self) -> None:
        poses = predict(self.GRAPH, [(0, 0), (-1, 0)], turn=self.QUARTER).poses
        np.testing.assert_allclose(np.abs(poses[:, 2]), [self.QUARTER, np.pi, np.pi], atol=1e-12)
        np.testing.assert_allclose(poses[:, :2], [(0, 0), (0, 0), (-1, 0)], atol=1e-12)

    def test_in_space_as_in_the_plane(self) -> None:
        poses = np.array([[x, 0, 3, 0, 0, np.sin(0.4), np.cos(0.4)] for x in (-1, 0)])
        graph = PoseGraph(poses, [(0, 1)], None, np.eye(6))
        path = [(0, 0), (2.5, 0), (2.5, 2)]
        flat = predict(drive([(-1, 0), (0, 0)], theta=0.8), path, turn=0.3).poses
        action = predict(graph, path, turn=0.3)
        np.testing.assert_allclose(action.poses[:, :2], flat[:, :2], atol=1e-12)
        np.testing.assert_allclose(2 * np.arctan2(action.poses[:, 5], action.poses[:, 6]), flat[:, 2], atol=1e-12)

    @pytest.mark.parametrize("turn", [0, -1, math.nan])
    def test_a_turn_that_is_none_is_refused(self, turn: float) -> None:
        with pytest.raises(InvalidInputError, match="expected turn above 0"):
            predict(self.GRAPH, [(0, 0), (1, 0)], turn=turn)


class TestClosureModel:
    """Out along y = 0 to x = 10 and back along y = 1."""

    GRAPH = drive([(x, 0) for x in range(11)])
    BACK = ((10, 0), (10, 1), (0, 1))

    def test_limits_the_closures_of_each_new_pose_and_weighs_them(self) -> None:
        action = predict(self.GRAPH, list(self.BACK), closures=ClosureModel(max_per_pose=2, probability=0.25))
        made = action.edges[action.num_new_poses :]
        assert np.bincount(made[:, 0])[13:].tolist() == [2] * 9
        assert action.probabilities is not None
        assert action.probabilities.tolist() == [1.0] * action.num_new_poses + [0.25] * len(made)
        assert (action.information[: action.num_new_poses] == OMEGA).all()
        assert (action.information[action.num_new_poses :] == 0.25 * OMEGA).all()

    def test_is_learned_from_the_graph_where_none_is_given(self) -> None:
        graph = PoseGraph(
            np.column_stack([np.r_[0:11, 10:-1:-1], np.r_[[0] * 11, [1] * 11], np.zeros(22)]),
            [*((i, i + 1) for i in range(21)), *((21 - i, i) for i in range(8))],
            None,
            OMEGA,
        )
        path = [(0, 1), (0, 0.5), (10, 0.5)]
        learned = predict_actions(graph, [path])[0]
        stated = predict_actions(graph, [path], closures=learn_closures(graph))[0]
        assert learned.edges.tolist() == stated.edges.tolist()
        assert learned.num_closures > 0
        assert np.array_equal(learned.information, stated.information)

    def test_prior_poses_come_first_then_new_ones_up_to_the_limit(self) -> None:
        """There and back where the prior has one pose: it, then what the robot has left on its way out."""
        path = [(0, 0), (8, 0), (0, 0.5)]
        graph = drive([(-1, 0), (0, 0)])
        for limit, most in ((1, 1), (2, 2), (3, 3)):
            model = ClosureModel(max_per_pose=limit, probability=1.0, min_index_gap=4)
            action = predict(graph, path, closures=model)
            made = action.edges[action.num_new_poses :]
            assert np.bincount(made[:, 0]).max() == most
            last = made[made[:, 0] == made[:, 0].max(), 1]
            assert (last < 2).any()
            assert (made[:, 1] >= 2).any()
            assert (made[:, 0] - made[:, 1] >= 4).all()

    def test_and_a_rule_by_hand_are_one_too_many(self) -> None:
        with pytest.raises(InvalidInputError, match="closures or a rule by hand, got both; leave out min_index_gap"):
            predict(self.GRAPH, list(self.BACK), closures=ClosureModel(), min_index_gap=3)


class TestStart:
    """The robot need not stand at the last pose: here it is at (2, 0), index 2 of 6."""

    GRAPH = drive([(0, 0), (1, 0), (2, 0), (2, 4), (2, 5), (2, 6)])

    def test_new_poses_are_joined_to_the_pose_that_is_chosen(self) -> None:
        action = predict(self.GRAPH, [(2, 0), (2, -3)], start=2)
        assert action.edges.tolist() == [[2, 6], [6, 7], [7, 8]]
        np.testing.assert_allclose(action.poses[:, :2], [(2, -1), (2, -2), (2, -3)])
        assert posterior(self.GRAPH, action).num_poses == 9

    def test_the_last_pose_is_the_default_and_may_be_counted_from_the_end(self) -> None:
        for start in (5, -1, np.int64(5)):
            action, default = (predict(self.GRAPH, [(2, 6), (2, 8)], **rule) for rule in ({"start": start}, {}))
            assert action.edges.tolist() == default.edges.tolist()

    def test_poses_that_led_to_the_start_are_no_loop_but_those_behind_it_are(self) -> None:
        """Up from (2, 0) past the poses at y = 4 to 6; pose 0 is three steps from the first new pose."""
        action = predict(self.GRAPH, [(2, 0), (2, 5)], start=2, min_index_gap=4, closure_radius=2.5)
        assert not {(6, 0), (6, 1), (6, 2), (7, 2)} & closures(action)
        assert (7, 0) not in closures(action)  # too far; four steps would do
        assert {(7, 3), (8, 3), (8, 4), (9, 3), (9, 4), (9, 5), (10, 3)} <= closures(action)
        assert (6, 0) in closures(predict(self.GRAPH, [(2, 0), (2, 5)], start=2, min_index_gap=3, closure_radius=2.5))

    def test_a_place_is_joined_to_the_nearest_pose_in_sight(self) -> None:
        """(2, 2.5) is nearest to pose 3; a wall between them leaves pose 2."""
        wall = World.from_boxes([(-3, 2.9, 5, 3.1)], (-3, -3, 5, 8))
        for world, pose in ((None, 3), (wall, 2)):
            action = predict(self.GRAPH, [(2, 2.5), (4, 2.5)], start=(2, 2.5), world=world)
            assert action.edges[0].tolist() == [pose, 6]
            assert action.length == pytest.approx(2)
        np.testing.assert_allclose(action.poses[:, :2], [(2, 1), (2, 2), (2.5, 2.5), (3.5, 2.5), (4, 2.5)])

    def test_a_place_where_a_pose_is_is_that_pose_the_last_of_several(self) -> None:
        graph = drive([(0, 0), (1, 0), (1, 0), (3, 0)])
        assert predict(graph, [(1, 0), (1, 2)], start=(1, 0)).edges[0].tolist() == [2, 4]
        assert predict(graph, [(1, 0), (1, 2)], start=graph.poses[1]).edges[0].tolist() == [2, 4]

    def test_a_place_that_no_pose_sees_is_refused(self) -> None:
        cell = World.from_boxes([(3, 3, 3.1, 5), (3, 3, 5, 3.1)], (-3, -3, 5, 5))
        with pytest.raises(PlanningError, match=r"in sight of a pose of the graph, got \(4, 4\)"):
            predict(self.GRAPH, [(4, 4), (4.5, 4.5)], start=(4, 4), world=cell)

    @pytest.mark.parametrize("start", [6, -7, (1.0,), (math.nan, 0.0), "here"])
    def test_what_is_no_start_is_refused(self, start: object) -> None:
        with pytest.raises(InvalidInputError, match="expected start"):
            predict(self.GRAPH, [(2, 0), (2, -3)], start=start)

    def test_in_space_a_place_has_a_height(self) -> None:
        graph = PoseGraph([[0, 0, z, 0, 0, 0, 1] for z in range(2)], [(0, 1)], None, np.eye(6))
        assert predict(graph, [(0, 0), (1, 0)], start=0).poses[0, 2] == 0
        with pytest.raises(InvalidInputError, match=r"\(x, y, z\) in a graph in SE\(3\)"):
            predict(graph, [(0, 0), (1, 0)], start=(0, 0))


class TestLength:
    def test_is_that_of_the_path_whatever_the_spacing(self) -> None:
        path = [(0, 0), (3, 0), (3, 4), (0, 4)]
        assert [predict(ORIGIN, path, information=OMEGA, spacing=step).length for step in (0.3, 1, 100)] == [10, 10, 10]

    def test_counts_the_way_to_a_path_that_begins_elsewhere(self) -> None:
        assert predict(ORIGIN, [(3, 0), (3, 4)], information=OMEGA).length == 7


class TestWalls:
    WORLD = World.from_boxes([(2, -1, 2.2, 1)], (-5, -5, 5, 5))

    def test_a_path_through_one_is_refused_by_name(self) -> None:
        clear, through = [(0, 0), (1, 0)], [(0, 0), (1, 0), (3, 0)]
        with pytest.raises(PlanningError, match=r"path 1 in the free space .* between \(1.00, 0.00\) and \(3.00, 0.00\)"):
            predict_actions(ORIGIN, [clear, through], information=OMEGA, world=self.WORLD)
        assert predict(ORIGIN, through, information=OMEGA).num_new_poses == 3

    @pytest.mark.parametrize("path", [[(3, 0), (4, 0)], [(9, 0)], [(0, 0), (0, 6)]], ids=["on the way there", "beyond", "out"])
    def test_so_is_one_that_is_reached_through_one_or_leaves_the_map(self, path: list) -> None:
        with pytest.raises(PlanningError, match="path 0 in the free space"):
            predict(ORIGIN, path, information=OMEGA, world=self.WORLD)

    def test_from_a_pose_that_the_map_has_in_a_wall_a_path_may_begin_beside_it(self) -> None:
        inside = drive([(0, 0), (2.1, 0)])
        assert predict(inside, [(2.5, 0), (4, 0)], world=self.WORLD).num_new_poses == 2
        with pytest.raises(PlanningError, match="path 0 in the free space"):
            predict(inside, [(2.1, 0), (4, 0)], world=self.WORLD)


class TestInformation:
    def test_is_the_one_that_all_edges_share(self) -> None:
        assert (default_information(drive([(0, 0), (1, 0), (2, 0)])) == OMEGA).all()

    def test_is_else_the_median_over_the_odometry_chain(self) -> None:
        """Closures and one edge of absurd certainty change nothing."""
        scales = [1.0, 2.0, 3.0, 4.0, 1e12]
        edges = [(i, i + 1) for i in range(5)] + [(5, 0), (4, 0), (3, 0)]
        information = np.array([scale * OMEGA for scale in (*scales, 0.1, 0.1, 0.1)])
        graph = PoseGraph(np.eye(6, 3), edges, None, information)
        assert (default_information(graph) == 3 * OMEGA).all()
        assert (predict(graph, [(0, 0), (3, 0)]).information == 3 * OMEGA).all()

    def test_is_of_all_edges_where_none_is_consecutive(self) -> None:
        graph = PoseGraph(np.eye(3), [(0, 2)], None, OMEGA)
        assert (default_information(graph) == OMEGA).all()

    def test_is_a_matrix_of_the_chain_where_the_median_is_not_positive_definite(self) -> None:
        """Three correlation matrices whose entries have the medians 0.9, 0.9 and -0.9, which no noise can have."""
        correlations = [(0.9, 0.9, 0.7), (0.9, -0.7, -0.9), (-0.7, 0.9, -0.9)]
        chain = np.array([[(1, a, b), (a, 1, c), (b, c, 1)] for a, b, c in correlations]) * [[[1]], [[2]], [[3]]]
        median = np.median(chain, axis=0)
        assert np.linalg.eigvalsh(median)[0] < 0
        graph = PoseGraph(np.eye(4, 3), [(0, 1), (1, 2), (2, 3)], None, chain)
        assert (default_information(graph) == chain[1]).all()

    def test_of_closures_is_the_median_over_those_that_there_are(self) -> None:
        """From ten on; the odometry's where there are fewer."""
        graph = drive([(x, 0) for x in range(30)])
        for count, scale in ((9, 1.0), (11, 0.25)):
            edges = [*graph.edges.tolist(), *((i + 15, i) for i in range(count))]
            information = np.concatenate([graph.information, np.repeat(OMEGA[None] / 4, count, axis=0)])
            with_closures = PoseGraph(graph.poses, edges, None, information)
            np.testing.assert_allclose(closure_information(with_closures), scale * OMEGA)
            action = predict(with_closures, [(29, 0), (29, 1), (20, 1)], closures=ClosureModel(probability=0.5))
            np.testing.assert_allclose(action.information[: action.num_new_poses], OMEGA[None].repeat(action.num_new_poses, 0))
            assert action.num_closures > 0
            for matrix in action.information[action.num_new_poses :]:
                np.testing.assert_allclose(matrix, scale / 2 * OMEGA)

    def test_given_is_taken(self) -> None:
        assert (predict(drive([(0, 0), (1, 0)]), [(1, 0), (3, 0)], information=2 * OMEGA).information == 2 * OMEGA).all()

    def test_of_a_graph_without_edges_must_be_given(self) -> None:
        with pytest.raises(InvalidInputError, match="give `information`"):
            predict_actions(ORIGIN, [[(0, 0), (1, 0)]])


@pytest.mark.parametrize(
    ("rules", "message"),
    [
        ({"spacing": 0}, "spacing above 0, got 0"),
        ({"spacing": math.inf}, "spacing above 0, got inf"),
        ({"closure_radius": -1}, "closure_radius above 0, got -1"),
        ({"closure_angle": 4}, "closure_angle above 0 and at most 3.14159, got 4"),
        ({"closure_angle": 60}, "got 60; angles are in radians, and 60 degrees are 1.047 radians"),
        ({"closure_angle": math.nan}, "closure_angle .* got nan"),
        ({"min_index_gap": 1}, "min_index_gap of at least 2"),
    ],
)
def test_rules_out_of_range_are_refused(rules: dict, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        predict_actions(drive([(0, 0), (1, 0)]), [[(1, 0), (2, 0)]], **rules)


def test_a_path_that_is_none_is_named() -> None:
    with pytest.raises(InvalidInputError, match="expected path 1 as finite waypoints"):
        predict_actions(drive([(0, 0), (1, 0)]), [[(1, 0), (2, 0)], [(1, 0), (math.nan, 0)]])
