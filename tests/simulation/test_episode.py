"""The loop from sensors to wheels: goals reached, runs that repeat, resume, and end with a reason."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from data_files import case_file
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.learned_closures import learn_closures
from topobelief.simulation.decisions import value_after
from topobelief.simulation.episode import Episode
from topobelief.simulation.front_end import FrontEndSettings
from topobelief.simulation.lidar import LidarSettings
from topobelief.simulation.metrics import run_metrics, trajectory_error
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import ARRIVED, INTERRUPTED, History, KeyPoses, Record, RunOptions
from topobelief.simulation.robot_settings import RobotSettings
from topobelief.simulation.scenario import Goal, Scenario
from topobelief.simulation.scenario_file import scenario_of
from topobelief.world import World

WALLS = [(3, 3, 3.4, 6.5), (3, 3, 6, 3.4), (7.6, 0, 8, 2.2), (9.6, 5.4, 12, 5.8), (6, 6.4, 6.4, 10), (10, 8, 10.5, 8.5)]


@pytest.fixture(scope="module")
def house() -> Scenario:
    """Some rooms of 12 by 10 m, two goals: across, and back again."""
    world = World.from_boxes(WALLS, bounds=(0, 0, 12, 10))
    return Scenario("house", world, (1.5, 1.5, 0.0), (Goal((10.5, 3.0), num_paths=4), Goal((1.5, 8.5), num_paths=4)))


@pytest.fixture(scope="module")
def seen() -> list[tuple[int, str]]:
    """Legs and outcome each time that a leg of the physical run was done."""
    return []


@pytest.fixture(scope="module")
def physical(house, seen) -> Record:
    return Episode(house, RunOptions(seed=1)).run(on_leg=lambda record: seen.append((len(record.legs), record.outcome)))


@pytest.fixture(scope="module")
def injected(house) -> Record:
    return Episode(house, RunOptions(seed=1, noise=InjectedNoise.of_ratio(0.35))).run()


def test_all_goals_are_reached_without_contact(physical, seen):
    assert seen == [(1, ARRIVED), (2, ARRIVED)]
    metrics = run_metrics(physical)
    assert physical.outcome == ARRIVED
    assert [leg.goal for leg in physical.legs] == [1, 2]
    assert metrics["contacts"] == 0
    for leg in physical.legs:
        miss = np.linalg.norm(physical.truth[leg.last_pose, :2] - physical.scenario.goals[leg.goal - 1].place)
        assert miss < 0.35


def test_closures_are_predicted_as_the_front_end_makes_them(physical):
    """The first decision knows no closures; the second has learned from those of the first leg."""
    first, second = physical.deliberations
    rule = FrontEndSettings().expected_closures
    for deliberation in (first, second):
        model = learn_closures(deliberation.question.graph, world=physical.scenario.world, rule=rule)
        for action in deliberation.question.actions:
            if action.probabilities is not None:
                assert action.probabilities[-1] == pytest.approx(model.probability)
            turns = np.diff(np.unwrap(action.poses[:, 2]))
            assert np.abs(turns).max(initial=0.0) <= FrontEndSettings().key_pose_angle * (1 + 1e-6)
    assert any(action.num_closures for action in second.question.actions)


def test_the_papers_closures_are_a_choice(house):
    scenario = replace(
        house, goals=house.goals[:1], rule=replace(house.rule, closures=ClosureModel.paper(), line_of_sight=False)
    )
    episode = Episode(scenario, RunOptions(seed=1))
    record = episode.run(should_stop=lambda: True)
    (deliberation,) = record.deliberations
    assert all(action.probabilities is None for action in deliberation.question.actions)


def test_slam_is_better_than_wheels(physical):
    metrics = run_metrics(physical)
    assert metrics["error_slam"] < 0.2 * metrics["error_wheel_odometry"]
    assert metrics["error_slam"] < 0.1


def test_the_record_is_of_one_piece(physical):
    n = len(physical.truth)
    assert physical.graph.num_poses == len(physical.estimate) == len(physical.history.key_poses.scans) == n
    assert [leg.first_pose for leg in physical.legs[1:]] == [leg.last_pose for leg in physical.legs[:-1]]
    assert physical.legs[-1].last_pose == n - 1
    for each in physical.deliberations:
        leg = physical.legs[each.leg]
        assert each.question.graph.num_poses == leg.first_pose + 1
        assert leg.predicted_value == each.values[leg.chosen]
        assert leg.planned == pytest.approx(each.question.lengths[leg.chosen])


def test_the_same_seed_is_the_same_run(house, injected):
    again = Episode(house, RunOptions(seed=1, noise=InjectedNoise.of_ratio(0.35))).run()
    np.testing.assert_array_equal(again.history.track, injected.history.track)
    np.testing.assert_array_equal(again.graph.poses, injected.graph.poses)
    np.testing.assert_array_equal(again.graph.measurements, injected.graph.measurements)
    np.testing.assert_array_equal(again.occupancy.log_odds, injected.occupancy.log_odds)
    other = Episode(house, RunOptions(seed=2)).run(last_goal=1)
    assert not np.array_equal(other.truth[1], injected.truth[1])


def test_injected_noise_changes_the_graph_and_not_the_driving_to_the_first_goal(physical, injected):
    """On one pose and no edge both rank the same; from there on decisions may differ."""
    assert injected.deliberations[0].choice.index == physical.deliberations[0].choice.index
    n = physical.legs[0].last_pose
    np.testing.assert_array_equal(injected.truth[: n + 1], physical.truth[: n + 1])
    np.testing.assert_array_equal(injected.registered.measurements[:n], physical.registered.measurements[:n])
    np.testing.assert_array_equal(injected.graph.information[0], InjectedNoise.of_ratio(0.35).information)
    assert trajectory_error(injected.graph.poses, injected.truth) > trajectory_error(injected.estimate, injected.truth)


def before_goal(history: History, goal: int) -> History:
    """The part that ends where the first leg to a goal began."""
    begun = next(number for number, leg in enumerate(history.legs) if leg.goal == goal)
    whole, count = history.key_poses, history.legs[begun].first_pose + 1
    key_poses = KeyPoses(
        times=whole.times[:count],
        truth=whole.truth[:count],
        wheel_odometry=whole.wheel_odometry[:count],
        motions=whole.motions[:count],
        scans=whole.scans[:count],
    )
    return History(
        key_poses=key_poses, legs=history.legs[:begun], track=history.track[history.track[:, 0] <= key_poses.times[-1]]
    )


def test_a_run_continues_where_another_ended(house, injected):
    """What was sensed gives the same graph again, and the decision at the first goal is the same."""
    part = before_goal(injected.history, 2)
    continued = Episode(house, injected.options, history=part).run()
    assert continued.outcome == ARRIVED
    assert continued.legs[0] == injected.legs[0]
    again, before = continued.deliberations[0], injected.deliberations[1]
    np.testing.assert_array_equal(again.question.graph.poses, before.question.graph.poses)
    np.testing.assert_array_equal(again.values, before.values)


def test_a_run_continues_from_where_it_is_not(house, physical):
    """Put down 0.3 m beside where it believes to be, the robot finds out by its laser."""
    part = before_goal(physical.history, 2)
    continued = Episode(house, physical.options, history=part, displaced=(0.3, 0.0, 0.0)).run()
    assert continued.outcome == ARRIVED
    assert trajectory_error(continued.estimate, continued.truth) < 0.1


def test_an_interrupted_run_is_complete_and_can_be_continued(house):
    calls = iter(range(10**6))
    stopped = Episode(house, RunOptions(seed=1)).run(should_stop=lambda: next(calls) > 60)
    assert stopped.outcome == INTERRUPTED
    assert stopped.legs[-1].outcome == INTERRUPTED
    assert stopped.graph.num_poses == len(stopped.truth)
    rest = Episode(house, RunOptions(seed=1), history=stopped.history).run()
    assert rest.outcome == ARRIVED
    assert [leg.goal for leg in rest.legs] == [1, 1, 2]


def test_an_unknown_house_is_found_out(house):
    record = Episode(house, RunOptions(seed=3, unknown=True)).run()
    assert record.outcome == ARRIVED
    assert run_metrics(record)["contacts"] == 0


def test_a_goal_that_turns_out_to_be_walled_in_ends_the_run_with_a_reason(house):
    """Nothing is known at first, so there seems to be a way."""
    walled = World.from_boxes([*WALLS, (8, 6.4, 8.2, 10), (8, 6.4, 12, 6.6)], bounds=(0, 0, 12, 10))
    scenario = Scenario("walled", walled, (1.5, 1.5, 0.0), (Goal((9.2, 9.2), num_paths=3), Goal((1.5, 8.5), num_paths=2)))
    record = Episode(scenario, RunOptions(unknown=True)).run()
    assert record.outcome.startswith("unreachable: expected")
    assert record.num_goals_reached == 0
    assert record.graph.num_poses > 3


@pytest.mark.parametrize(
    "lidar", [LidarSettings(nan_share=0.3), LidarSettings(dead_sector=(-0.8, 0.9))], ids=["nan", "dead sector"]
)
def test_a_damaged_laser_does_not_stop_the_robot(house, lidar):
    record = Episode(replace(house, lidar=lidar), RunOptions(seed=1)).run(last_goal=1)
    assert record.outcome == ARRIVED
    assert trajectory_error(record.estimate, record.truth) < 0.15


@pytest.mark.parametrize("seed", range(3))
def test_the_end_of_a_blind_robot_is_reported_truly(house, seed):
    record = Episode(replace(house, lidar=LidarSettings(nan_share=1.0)), RunOptions(seed=seed)).run(last_goal=1)
    (leg,) = record.legs
    kind = leg.outcome.split(":")[0]
    assert record.outcome == leg.outcome
    assert kind == ("contact" if leg.contacts else "arrived" if leg.goal_distance <= 0.3 else "missed")
    assert record.num_goals_reached == (kind == "arrived")
    assert record.graph.num_poses == len(record.truth)


def test_a_contact_ends_the_leg_and_the_run_with_its_reason(house):
    """An approach straight through a wall."""
    scenario = replace(house, approach=((1.5, 3.5), (6.0, 3.2)))
    record = Episode(scenario, RunOptions()).run()
    (leg,) = record.legs
    assert record.outcome == leg.outcome
    assert re.fullmatch(r"contact: touched a wall at \(2\.7\d, 3\.\d\d\), believed itself at \(2\.\d\d, 3\.\d\d\)", leg.outcome)
    assert 0 < leg.contacts <= 20  # physics steps of one control period
    assert 3 < leg.goal_distance < 3.5
    assert record.num_goals_reached == 0
    assert not leg.arrived
    assert not leg.believed_arrived


@pytest.mark.parametrize(("name", "seed"), [("depot", 7108), ("tb3_sandbox", 7105)])
def test_a_robot_among_table_legs_and_pillars_arrives_where_it_believes_to_be(name, seed):
    """It once caught on a leg, let its wheels spin, and was reported as arrived, 7.6 and 0.7 m from the goal."""
    record = Episode(scenario_of(str(case_file(f"scenarios/{name}.yaml"))), RunOptions(seed=seed)).run()
    assert [leg.outcome for leg in record.legs] == [ARRIVED, ARRIVED]
    for leg in record.legs:
        assert leg.contacts == 0
        assert leg.goal_distance <= 0.3
        assert leg.goal_distance == pytest.approx(leg.believed_goal_distance, abs=0.15)


def test_an_arrival_that_never_was_does_not_count(house):
    """Blind, with wheels that slip more than the robot thinks: it goes on to its next goal, and so does a later run."""
    hall = World.from_boxes([], bounds=(-30, -30, 40, 30))
    scenario = Scenario(
        "hall",
        hall,
        (0.0, 0.0, 0.0),
        (Goal((6.0, 0.0), num_paths=1), Goal((0.0, 4.0), num_paths=1)),
        robot=RobotSettings(wheel_slip=0.05),
        lidar=LidarSettings(nan_share=1.0),
    )
    record = Episode(scenario, RunOptions(seed=1)).run()
    first, second = record.legs
    assert first.outcome.startswith("missed: ")
    assert first.goal_distance > 0.3 > first.believed_goal_distance
    assert (first.goal, second.goal) == (1, 2)
    assert record.outcome.startswith("missed")
    assert record.num_goals_reached == second.arrived
    again = Episode(scenario, RunOptions(seed=1), history=record.history).run()
    assert len(again.legs) == 2
    np.testing.assert_array_equal(again.graph.poses, record.graph.poses)


def test_a_leg_is_worth_what_its_factors_are(physical):
    """The achieved entropy of the joint objective is that of the graph."""
    from topobelief.entropy import joint_entropy

    n = physical.legs[-1].first_pose + 1
    assert value_after(physical.graph, n, "joint") == pytest.approx(joint_entropy(physical.graph), abs=1e-6)
    assert value_after(physical.graph, n, "map") != pytest.approx(joint_entropy(physical.graph), abs=1)
