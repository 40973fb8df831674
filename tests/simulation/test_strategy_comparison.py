"""Compared runs in files, seeds in processes, and seeds that fail."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from topobelief.errors import FileError, InvalidInputError
from topobelief.simulation.comparison import ComparedRun
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import RunOptions
from topobelief.simulation.strategy_comparison import ComparisonTask, play, played, read_runs, write_runs

RUN = ComparedRun(
    seed=3,
    strategy="spanning_trees",
    outcome="arrived",
    planned=10.0,
    shortest=9.0,
    num_poses=30,
    num_shared=20,
    num_closures=4,
    entropy=float("nan"),
    error_shared=0.1234567890123456,
    error_all=0.2,
    spread_shared=0.1,
    error_before=0.5,
)


@pytest.fixture
def task(tmp_path: Path) -> ComparisonTask:
    """One goal behind a pillar, and two ways to it."""
    (tmp_path / "walls.csv").write_text("# bounds: 0 0 6 6\nx_min,y_min,x_max,y_max\n2.5,2.5,3.5,3.5\n")
    (tmp_path / "room.yaml").write_text("map: walls.csv\nstart: [1, 1]\ngoals: [[5, 5]]\ncandidates: 2\n")
    return ComparisonTask(
        scenario=str(tmp_path / "room.yaml"),
        max_detour=0,
        strategies=("shortest", "path-2"),
        options=RunOptions(noise=InjectedNoise.of_ratio(0.35)),
        num_redraws=2,
    )


def test_runs_return_bit_for_bit(tmp_path):
    runs = [RUN, replace(RUN, seed=0, strategy="random", outcome="stuck: at (1, 2), really", entropy=-4.5)]
    write_runs(tmp_path / "runs.csv", runs)
    first, second = read_runs(tmp_path / "runs.csv")
    assert first == runs[1]
    assert math.isnan(second.entropy)
    assert replace(second, entropy=0.0) == replace(RUN, entropy=0.0)


@pytest.mark.parametrize(("old", "new"), [("0.2,", "much,"), ("planned", "length")])
def test_damaged_files_are_named_with_the_line(tmp_path, old, new):
    path = tmp_path / "runs.csv"
    write_runs(path, [RUN])
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(FileError, match=r"runs\.csv:2: expected a compared run"):
        read_runs(path)


def test_strategies_of_a_seed_share_the_start(task):
    """With one goal they share the first pose alone, on which no error is left."""
    shortest, second = play(task, 0)
    assert (shortest.seed, shortest.strategy, second.strategy) == (0, "shortest", "path-2")
    assert shortest.outcome == second.outcome == "arrived"
    assert shortest.planned == shortest.shortest < second.planned
    assert shortest.num_shared == 1
    assert shortest.error_shared < 1e-9 < shortest.error_all


def test_physical_noise_is_refused(task):
    with pytest.raises(InvalidInputError, match="expected injected noise"):
        play(replace(task, options=RunOptions()), 0)


def test_processes_give_what_one_gives(task):
    (alone,) = played(task, [0], num_workers=1)
    (apart,) = played(task, [0], num_workers=2)
    assert alone == apart
