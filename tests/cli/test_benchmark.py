"""`topobelief benchmark` measures, writes what it has after every part, and refuses what it cannot measure."""

import json

import numpy as np
import pytest

from topobelief import write_g2o
from topobelief.benchmark.run import SCHEMA, BenchmarkPlan
from topobelief.benchmark.sessions import city_drive
from topobelief.cli.app import run
from topobelief.graph.information import block_isotropic


@pytest.fixture
def tiny(monkeypatch):
    plan = BenchmarkPlan(
        sizes=(30,),
        num_actions=3,
        repetitions=1,
        num_seeds=1,
        bounds_size=40,
        bounds_actions=4,
        memory_sizes=(20,),
        small=None,
        predicted_actions=4,
    )
    monkeypatch.setattr(BenchmarkPlan, "quick", staticmethod(lambda: plan))


def test_a_benchmark_prints_tables_and_writes_its_numbers(tiny, tmp_path, capsys):
    assert run(["benchmark", "--quick", "--out", str(tmp_path / "new")]) == 0
    shown = capsys.readouterr().out
    for text in (
        "× GTSAM",
        "this engine: proven optimum",
        "Peak memory",
        "ΔJ_max",
        "generated, 30: 30 poses",
        "exact E of all",
        "benchmark.json",
    ):
        assert text in shown
    document = json.loads((tmp_path / "new" / "benchmark.json").read_text())
    assert document["schema"] == SCHEMA
    assert len(document["sessions"]) == len(document["memory"]) == 1
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["benchmark.json"]


def test_two_sizes_make_a_picture(tiny, tmp_path, capsys):
    assert run(["benchmark", "--quick", "--sizes", "20,30", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "benchmark.png").stat().st_size > 20_000
    assert "benchmark.png" in capsys.readouterr().out


def test_a_file_alone(tiny, tmp_path, capsys):
    graph = city_drive(30, block_isotropic(0.1, 0.035), rng=np.random.default_rng(0))
    write_g2o(graph, tmp_path / "mine.g2o")
    assert run(["benchmark", str(tmp_path / "mine.g2o"), "--quick", "--sizes", "", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [session["name"] for session in document["sessions"]] == ["mine"]
    assert document["error_bounds"] == []
    assert [row["name"] for row in document["memory"]] == ["mine"]
    assert len(document["proofs"]) == 9
    assert {row["candidates"] for row in document["candidates"]} == {"nearest", "learned", "paper"}


def test_options_go_before_the_quick_plan_and_json_is_all_that_is_printed(tiny, capsys):
    assert run(["benchmark", "--quick", "--sizes", "25,35", "--candidates", "2", "--seed", "3", "--cpu-time", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [session["num_poses"] for session in document["sessions"]] == [25, 35]
    assert (document["plan"]["num_actions"], document["plan"]["seed"], document["plan"]["cpu_time"]) == (2, 3, True)


def test_an_interrupted_benchmark_leaves_what_it_has(tiny, tmp_path, monkeypatch, capsys):
    from topobelief.benchmark import run as module

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "peak_gigabytes", interrupt)
    assert run(["benchmark", "--quick", "--out", str(tmp_path)]) == 130
    document = json.loads((tmp_path / "benchmark.json").read_text())
    assert len(document["sessions"]) == 1
    assert document["memory"] == []
    assert "interrupted" in capsys.readouterr().err


def test_the_search_beside_its_peers_is_kept_and_continued(tmp_path, capsys):
    options = ["--search", "--quick", "--objective", "map", "--paths", "3", "--seconds", "0.1", "--out", str(tmp_path / "new")]
    assert run(["benchmark", "grid-3", *options]) == 0
    shown = capsys.readouterr().out
    for text in (
        "grid-3: 9 poses, 4 m to the goal, map (nats), 1 seed",
        "recursive greedy",
        "this search, 0.1 s",
        "search.json",
    ):
        assert text in shown
    journal = (tmp_path / "new" / "journal.jsonl").read_text()
    assert run(["benchmark", "grid-3", *options, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document == json.loads((tmp_path / "new" / "search.json").read_text())
    assert {row["peer"] for row in document["rows"]} >= {"shortest way", "best of 3 diverse paths", "random restarts"}
    assert (tmp_path / "new" / "journal.jsonl").read_text() == journal


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--search", "nowhere.g2o"], "nowhere.g2o: expected a pose graph, a map, a data set or grid-N, got no such file"),
        (["--search", "grid-2"], "expected a grid from grid-3 to grid-40, got grid-2"),
        (["--search", "--paths", "many"], 'expected --paths as whole numbers by commas, such as 20,200, got "many"'),
        (["--search", "--seconds", "-1"], "expected deadlines of at least 0"),
        (["--search", "--objective", "beauty"], "beauty"),
        (["--search", "--goal", "1", "2"], "expected one place for a goal that is given, got 2"),
        (["--search", "--sizes", "100"], "expected --search or --sizes, got both"),
        (["--seeds", "2"], "expected --search together with --seeds, got --seeds alone"),
        (["no-such.g2o"], "no-such.g2o: expected a pose graph to read"),
        (["--sizes", "many"], 'expected --sizes as whole numbers by commas, such as 1000,10000, got "many"'),
        (["--sizes", "1"], "expected --sizes of at least 2, got 1"),
        (["--candidates", "1"], "--candidates"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(arguments, message, tmp_path, capsys):
    assert run(["benchmark", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
