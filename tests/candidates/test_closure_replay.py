"""The hidden end of a drive as a model of the rest predicts it, and what the defaults predict on real graphs."""

from __future__ import annotations

import numpy as np
import pytest

import topobelief as tb
from data_files import RECORDED, data_file
from topobelief.candidates.closure_rate import closure_rate, predicted_rate
from topobelief.candidates.closure_replay import first_poses, replay_closures
from topobelief.errors import InvalidInputError

DATA_SETS = ("intel", "csail", "manhattan3500", "city10000", "ais2klinik", "kitti_05")


def laps(count: int) -> tb.PoseGraph:
    """Rounds of 20 poses, from the second on closing with every second pose of the one before."""
    angle = 2 * np.pi * np.arange(20 * count) / 20
    poses = np.column_stack([3 * np.cos(angle), 3 * np.sin(angle), angle + np.pi / 2])
    poses[:, :2] *= 1 + 0.01 * (np.arange(20 * count) // 20)[:, None]
    closures = [(i, i - 20) for i in range(20, 20 * count, 2)]
    return tb.PoseGraph(poses, [*((i, i + 1) for i in range(20 * count - 1)), *closures], None, np.eye(3))


def test_what_goes_on_as_before_is_predicted() -> None:
    replay = replay_closures(laps(10))
    assert replay.num_poses == 40
    assert replay.made == 20
    assert 0.8 < replay.ratio < 1.25
    assert replay.predicted == pytest.approx(replay.model.probability * replay.opportunities)


def test_the_beginning_knows_nothing_of_the_end() -> None:
    graph = laps(5)
    known = first_poses(graph, 80)
    assert known.poses.tolist() == graph.poses[:80].tolist()
    assert (known.edges < 80).all()
    assert known.num_edges == 79 + 30
    assert replay_closures(graph).model == tb.learn_closures(known)


@pytest.mark.parametrize("hidden", [0, 1, -0.1, np.nan])
def test_a_share_out_of_range_is_refused(hidden: float) -> None:
    with pytest.raises(InvalidInputError, match="expected hidden above 0 and below 1"):
        replay_closures(laps(2), hidden=hidden)


def test_a_single_pose_has_no_end() -> None:
    with pytest.raises(InvalidInputError, match="at least 2 poses"):
        replay_closures(tb.PoseGraph([(0, 0, 0)], np.zeros((0, 2), dtype=int), None, np.eye(3)))


@pytest.mark.parametrize("name", [RECORDED, *(f"{name}.g2o" for name in DATA_SETS)])
def test_by_default_no_path_gets_more_than_four_times_the_graphs_own_closures_a_pose(name: str) -> None:
    """Where most may be seen again: back along the end of the drive, along its beginning; 1 a pose where the graph has few."""
    graph = tb.read_g2o(data_file(name))
    if name != RECORDED:
        graph = tb.optimize(graph)
    most = 4 * closure_rate(graph) if closure_rate(graph) >= 0.25 else 1.0
    paths = [graph.positions[::-1][:120], graph.positions[:120], graph.positions[-1] + [[0, 0], [0, 1], [30, 1]]]
    for action in tb.predict_actions(graph, paths):
        assert predicted_rate([action]) <= most
