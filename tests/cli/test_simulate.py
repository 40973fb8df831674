"""`topobelief simulate` and `simulate-compare` as a shell sees them."""

from __future__ import annotations

import csv
import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest

from topobelief.cli.interruption import stop_on_interrupt
from topobelief.io.g2o import read_g2o
from topobelief.io.ros_map import read_ros_map
from topobelief.planning.decision import SCHEMA

ROOM = """map: walls.csv
start: [1.5, 1.5]
goals: [[6.5, 1.5], [6.5, 6.5]]
candidates: 3
"""


@pytest.fixture
def room(tmp_path) -> Path:
    (tmp_path / "walls.csv").write_text("# bounds: 0 0 8 8\nx_min,y_min,x_max,y_max\n3,3,5,5\n0,5.5,1,6\n6,0,6.4,0.4\n")
    path = tmp_path / "room.yaml"
    path.write_text(ROOM)
    return path


def test_a_run_leaves_everything(topobelief, room, tmp_path):
    pytest.importorskip("mcap")
    outcome = topobelief(["simulate", str(room), "--noise", "0.35", "--out", "run", "--recording"])
    assert outcome.code == 0, outcome.err
    assert "goals reached" in outcome.out
    assert "2 of 2" in outcome.out
    run = tmp_path / "run"
    assert {path.name for path in run.iterdir()} == {
        *("run.json", "metrics.csv", "key_poses.csv", "graph.g2o", "registered.g2o", "sensors.npz", "map.yaml", "map.pgm"),
        *("leg-1.json", "leg-2.json", "leg-1.png", "leg-2.png", "run.png", "run.mcap"),
    }
    document = json.loads((run / "run.json").read_text())
    graph = read_g2o(run / "graph.g2o")
    with (run / "key_poses.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert document["outcome"] == "arrived"
    assert [document["options"][name] for name in ("objective", "strategy")] == ["error", "resistance"]
    assert document["unit"] == json.loads((run / "leg-2.json").read_text())["unit"] == "m"
    assert 0 < document["legs"][1]["predicted_value"] < document["legs"][1]["prior_value"] < 1
    assert " cm on all poses" in outcome.out
    assert graph.num_poses == document["metrics"]["poses"] == len(rows)
    np.testing.assert_allclose([float(row["graph_x"]) for row in rows], graph.poses[:, 0], atol=1e-6)
    assert json.loads((run / "leg-2.json").read_text())["decision"]["schema"] == SCHEMA
    world = read_ros_map(run / "map.yaml")
    true_places = np.array([[float(row["true_x"]), float(row["true_y"])] for row in rows])
    assert world.contains(true_places).all()
    assert not world.contains([(4.0, 4.0)]).any()
    assert topics_of(run / "run.mcap") == {"/world", "/graph", "/candidates", "/tf", "/scan", "/map"}


def topics_of(path: Path) -> set[str]:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return {channel.topic for _, channel, _ in make_reader(file).iter_messages()}


def test_json_is_the_run(topobelief, room, tmp_path):
    arguments = ["simulate", str(room), "--strategy", "shortest", "--no-pictures", "--out", "run", "--json"]
    outcome = topobelief(arguments)
    assert outcome.code == 0
    assert json.loads(outcome.out) == json.loads((tmp_path / "run" / "run.json").read_text())
    assert not list((tmp_path / "run").glob("*.png"))


def test_the_paper_decides_by_one_option(topobelief, room, tmp_path):
    """All at once; options that are given beside it count."""
    outcome = topobelief(["simulate", str(room), "--as-paper", "--strategy", "optimum", "--no-pictures", "--out", "run"])
    assert outcome.code == 0, outcome.err
    document = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [document["options"][name] for name in ("objective", "strategy")] == ["joint", "optimum"]
    assert document["unit"] == "nats"
    assert json.loads((tmp_path / "run" / "leg-2.json").read_text())["decision"]["objective"] == "joint"
    assert "joint entropy" in outcome.out


def test_an_interrupted_run_can_be_resumed(topobelief, room, tmp_path, monkeypatch):
    """Ctrl-C after the first leg: what was driven is there, and --resume drives the rest."""
    from topobelief.cli import simulation_files

    write = simulation_files.RunFiles.write

    def write_then_interrupt(files, record):
        write(files, record)
        if len(record.legs) == 1:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(simulation_files.RunFiles, "write", write_then_interrupt)
    arguments = ["simulate", str(room), "--out", "run", "--no-pictures"]
    outcome = topobelief(arguments)
    assert outcome.code == 130
    assert "interrupted" in outcome.err
    legs = json.loads((tmp_path / "run" / "run.json").read_text())["legs"]
    assert [leg["outcome"] for leg in legs] == ["arrived", "interrupted"]
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    outcome = topobelief([*arguments, "--resume", "--displaced", "0.2"])
    assert outcome.code == 0, outcome.err
    document = json.loads((tmp_path / "run" / "run.json").read_text())
    assert document["metrics"]["goals_reached"] == 2
    assert document["legs"][0] == legs[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ofice"], "expected a scenario of office, lab, corridors"),
        (["office", "--strategy", "best"], "expected a strategy of spanning_trees"),
        (["office", "--strategy", ""], "expected a strategy of spanning_trees"),
        (["office", "--closures", "all"], "'all' is not one of"),
        (["office", "--noise", "loud"], "expected --noise as"),
        (["office", "--max-detour", "0.5"], "expected a detour limit of at least 1"),
        (["office", "--explore"], "expected --max-length M with --explore"),
        (["office", "--trips", "3"], "expected --trips together with --explore"),
        (["office", "--explore", "--max-length", "-1"], "expected --max-length as a finite number of metres above 0, got -1"),
        (["office", "--displaced", "0.3"], "--displaced together with --resume"),
        (["office", "--resume", "--out", "nowhere"], "run.json: expected a file to read"),
        (["nowhere.yaml"], "nowhere.yaml: expected a file to read"),
    ],
)
def test_bad_input_is_one_line(topobelief, tmp_path, arguments, message):
    outcome = topobelief(["simulate", *arguments])
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_paths_narrower_than_the_chassis_are_refused_before_anything_moves(topobelief, room, tmp_path):
    room.write_text(ROOM + "robot_radius: 0.15\n")
    outcome = topobelief(["simulate", str(room), "--out", "run"])
    assert outcome.code == 2
    assert "room.yaml:5: robot_radius: expected at least the radius of the chassis, 0.25 m, got 0.15" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_paths_close_by_walls_are_warned_of(topobelief, room):
    room.write_text(ROOM.replace("[6.5, 1.5], ", "") + "robot_radius: 0.3\n")
    outcome = topobelief(["simulate", str(room), "--no-pictures", "--out", "run"])
    assert outcome.code == 0
    assert outcome.err.startswith("topobelief: robot_radius 0.3 m leaves 0.05 m beside the chassis of 0.25 m")
    assert outcome.err.count("\n") == 1


def test_another_run_is_not_continued(topobelief, room):
    arguments = ["simulate", str(room), "--no-pictures", "--out", "run"]
    assert topobelief(arguments).code == 0
    outcome = topobelief([*arguments, "--resume", "--seed", "1"])
    assert outcome.code == 2
    assert "expected a run with seed 1 to continue, got 0" in outcome.err


def test_a_comparison_is_continued(topobelief, room, tmp_path):
    arguments = ["simulate-compare", str(room), "--seeds", "1", "--redraws", "3", "--out", "compared"]
    arguments += ["--strategies", "shortest,path-2"]
    outcome = topobelief(arguments)
    assert outcome.code == 0, outcome.err
    first = (tmp_path / "compared" / "comparison.csv").read_text()
    assert len(first.splitlines()) == 3
    assert (tmp_path / "compared" / "comparison.png").exists()
    again = topobelief([*arguments, "--json"])
    found = json.loads(again.out)
    assert [each["strategy"] for each in found["strategies"]] == ["shortest", "path-2"]
    assert found["runs"][0]["num_shared"] == found["runs"][1]["num_shared"]
    assert (tmp_path / "compared" / "comparison.csv").read_text() == first
    other = topobelief([*arguments[:-1], "shortest,random"])
    assert other.code == 2
    assert "expected a run with the same settings, strategies" in other.err


def test_physical_noise_cannot_be_redrawn(topobelief, room):
    outcome = topobelief(["simulate-compare", str(room), "--noise", "physical"])
    assert outcome.code == 2
    assert "expected injected noise to redraw" in outcome.err


def test_what_cannot_be_compared_is_one_line(topobelief, room):
    outcome = topobelief(["simulate-compare", str(room), "--strategies", "shortest,spanning_trees:entropy"])
    assert outcome.code == 2
    assert 'expected --objective to be one of "joint"' in outcome.err
    assert outcome.err.count("\n") == 1


def test_a_second_interrupt_is_not_asked_for():
    with stop_on_interrupt() as should_stop:
        assert not should_stop()
        os.kill(os.getpid(), signal.SIGINT)
        assert should_stop()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
