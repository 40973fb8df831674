"""A run's folder: what is written can be read again, and nothing else is taken for a run."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simulation_records import made_record
from topobelief.errors import FileError
from topobelief.io.g2o import read_g2o
from topobelief.planning.decision import Decision
from topobelief.simulation.metrics import run_metrics
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import Record
from topobelief.simulation.results import read_history, run_document, writers

NOISE = InjectedNoise.of_ratio(0.35)


@pytest.fixture
def record() -> Record:
    return made_record(noise=NOISE)


@pytest.fixture
def folder(record, tmp_path) -> Path:
    for name, write in writers(record).items():
        write(tmp_path / name)
    return tmp_path


def test_a_history_returns_bit_for_bit(record, folder):
    history = read_history(folder, scenario="room", options=record.options)
    for name in ("times", "truth", "wheel_odometry"):
        np.testing.assert_array_equal(getattr(history.key_poses, name), getattr(record.history.key_poses, name))
    np.testing.assert_array_equal(history.track, record.history.track)
    for read, written in zip(history.key_poses.scans, record.history.key_poses.scans, strict=True):
        np.testing.assert_array_equal(read.ranges, written.ranges)
        assert (read.time, read.max_range) == (written.time, written.max_range)
    assert history.legs[1] == record.legs[1]
    assert np.isnan(history.legs[0].predicted_value)


def test_files_agree_with_the_record(record, folder):
    assert read_g2o(folder / "graph.g2o").poses.tolist() == record.graph.poses.tolist()
    with (folder / "metrics.csv").open() as file:
        metrics = {row["metric"]: float(row["value"]) for row in csv.DictReader(file)}
    assert metrics == pytest.approx(run_metrics(record))
    decision = json.loads((folder / "leg-2.json").read_text())
    assert Decision.from_dict(decision["decision"]).best == record.deliberations[0].choice.index
    assert [each["num_closures"] for each in decision["candidates"]] == [1, 0]
    json.dumps(run_document(record), allow_nan=False)


def test_metrics_by_hand(record):
    metrics = run_metrics(record)
    assert (metrics["poses"], metrics["poses_before"], metrics["closures"], metrics["goals_reached"]) == (8, 4, 1, 2)
    assert metrics["distance"] == pytest.approx(15.3)
    assert metrics["error_scan_odometry"] < 1e-9 < metrics["error_slam"] < metrics["error_wheel_odometry"]


@pytest.mark.parametrize(
    ("changes", "scenario", "message"),
    [
        ({"seed": 4}, "room", "expected a run with seed 4 to continue, got 3"),
        ({"noise": None}, "room", "expected a run with noise None to continue, got InjectedNoise"),
        ({"unknown": True}, "room", "expected a run with unknown True"),
        ({}, "office", "expected a run with scenario office to continue, got room"),
    ],
)
def test_another_run_is_not_taken_for_this_one(record, folder, changes, scenario, message):
    with pytest.raises(FileError, match=message):
        read_history(folder, scenario=scenario, options=replace(record.options, **changes))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("run.json", "{}", "expected a run of schema"),
        ("run.json", "[1", "expected a run as"),
        ("run.json", '{"schema": "topobelief.run/2"}', "expected a run as"),
        ("sensors.npz", "nothing", "sensors.npz: expected the sensor data of a run"),
    ],
)
def test_damaged_files_are_named(record, folder, name, content, message):
    (folder / name).write_text(content)
    with pytest.raises(FileError, match=message):
        read_history(folder, scenario="room", options=record.options)


def test_a_missing_run_is_named(tmp_path, record):
    with pytest.raises(FileError, match=r"run\.json: expected a file to read"):
        read_history(tmp_path, scenario="room", options=record.options)
