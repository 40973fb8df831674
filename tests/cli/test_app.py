"""The program as a whole: help at once, exit codes, one line for what is not a bug."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import version
from typing import get_args

import pytest

from topobelief.bounds.entropy_bounds import Determinant
from topobelief.cli import app, main, plan, plan_stages, reading
from topobelief.io import reading as io_reading
from topobelief.io import ros_map
from topobelief.planning import evaluation, objectives, planner


def test_version_is_that_of_the_distribution(topobelief):
    assert topobelief(["--version"]).out == f"topobelief {version('topobelief')}\n"


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_names_the_commands(topobelief, arguments):
    outcome = topobelief(arguments)
    assert outcome.code == 0
    assert {"plan", "info"} <= set(outcome.out.split())


@pytest.mark.parametrize("command", ["plan", "info"])
def test_every_command_has_help(topobelief, command):
    outcome = topobelief([command, "--help"])
    assert outcome.code == 0
    assert "GRAPH" in outcome.out


def test_help_loads_nothing_heavy():
    code = """
import sys
import topobelief.cli.app
print(sorted({"numpy", "scipy", "matplotlib", "gtsam", "shapely", "PIL", "qdldl"} & set(sys.modules)))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_entry_point_exits_with_the_code(capsys):
    with pytest.raises(SystemExit) as exit_info:
        main(["info", "nowhere.g2o"])
    assert exit_info.value.code == app.BAD_INPUT
    assert capsys.readouterr().err.startswith("topobelief: nowhere.g2o: ")


@pytest.mark.parametrize(
    ("offered", "known"),
    [
        (plan.Objective, objectives.ObjectiveName),
        (plan.Signature, evaluation.SignatureName),
        (plan.Family, planner.BoundsName),
        (plan.Determinant, Determinant),
        (plan.Proof, planner.Proof),
        (plan.Unknown, ros_map.Unknown),
        (reading.Edge2Order, io_reading.Edge2Order),
    ],
)
def test_the_options_offer_exactly_the_choices_of_the_library(offered, known):
    assert set(get_args(offered)) == set(get_args(known))


@pytest.mark.parametrize("command", ["plan", "info"])
def test_help_names_all_that_can_be_dropped(topobelief, command):
    told = topobelief([command, "--help"]).out
    assert {word for word in get_args(io_reading.Droppable) if word not in told} == set()


def test_a_terminal_without_greek_letters_is_no_bug(office):
    command = [sys.executable, "-c", "from topobelief.cli import main; main()", "info", str(office.graph_file)]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    result = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert result.returncode == 0
    assert "per degree of freedom, as filed" in result.stdout
    assert result.stderr == ""


def test_an_interrupt_is_one_line_and_leaves_no_file(topobelief, office, tmp_path, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(plan_stages, "find_candidates", interrupted)
    outcome = topobelief(office.plan("--out", "result"))
    assert outcome.code == app.INTERRUPTED
    assert outcome.err == "topobelief: interrupted; nothing was left half-written\n"
    assert list(tmp_path.iterdir()) == []


def test_a_bug_keeps_its_traceback(topobelief, office, monkeypatch):
    monkeypatch.setattr(plan_stages, "find_candidates", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        topobelief(office.plan())
