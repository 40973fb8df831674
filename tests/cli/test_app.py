"""The program as a whole: help at once, exit codes, one line for what is not a bug."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.metadata import version
from typing import get_args

import pytest

from topobelief.bounds.entropy_bounds import Determinant
from topobelief.cli import app, main, plan_candidates, plan_options, reading, world_options
from topobelief.io import reading as io_reading
from topobelief.io import ros_map
from topobelief.planning import planner
from topobelief.planning.registry import AUTO, BOUNDS, OBJECTIVES, SIGNATURES


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


@pytest.mark.parametrize("command", ["plan", "info", "simulate", "simulate-compare", "reproduce", "study", "benchmark"])
def test_help_is_whole_in_a_terminal_of_80_columns(topobelief, monkeypatch, command):
    """No option, choice or text is cut off, which the help marks by an ellipsis behind a letter."""
    monkeypatch.setenv("COLUMNS", "80")
    shown = topobelief([command, "--help"]).out
    assert max(map(len, shown.splitlines())) <= 80
    assert not re.search(r"[\w-]…", shown)
    words = set(re.split(r"[\s,;:.]+", shown))
    if command == "plan":
        kinds = (plan_options.Determinant, plan_options.Proof, world_options.Unknown)
        assert {"--no-line-of-sight", "--allow-dense-spectrum", "--max-evaluations"} <= words
        assert {choice for kind in kinds for choice in get_args(kind)} <= words
        assert {*OBJECTIVES, *SIGNATURES, *BOUNDS, AUTO} <= words


def test_a_shell_completes_options(office):
    """As bash asks for it once `--install-completion` has run."""
    code = "import sys; from topobelief.cli import main; main()"
    asked = {"_TOPOBELIEF_COMPLETE": "complete_bash", "COMP_WORDS": "topobelief plan --clos", "COMP_CWORD": "2"}
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, **asked})
    assert result.stdout.split() == ["--closures", "--closure-radius", "--closure-angle"]
    assert result.stderr == ""


def test_help_loads_nothing_heavy():
    code = """
import sys
import topobelief.cli.app
print(sorted({"numpy", "scipy", "matplotlib", "gtsam", "shapely", "PIL", "qdldl"} & set(sys.modules)))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_package_runs_as_a_module():
    result = subprocess.run([sys.executable, "-m", "topobelief", "--version"], capture_output=True, text=True, check=True)
    assert version("topobelief") in result.stdout


def test_the_entry_point_exits_with_the_code(capsys):
    with pytest.raises(SystemExit) as exit_info:
        main(["info", "nowhere.g2o"])
    assert exit_info.value.code == app.BAD_INPUT
    assert capsys.readouterr().err.startswith("topobelief: nowhere.g2o: ")


@pytest.mark.parametrize(
    ("offered", "known"),
    [
        (plan_options.Determinant, get_args(Determinant)),
        (plan_options.Proof, get_args(planner.Proof)),
        (world_options.Unknown, get_args(ros_map.Unknown)),
        (reading.Edge2Order, get_args(io_reading.Edge2Order)),
    ],
)
def test_the_options_offer_exactly_the_choices_of_the_library(offered, known):
    assert set(get_args(offered)) == set(known)


@pytest.mark.parametrize("command", ["plan", "info"])
def test_help_names_all_that_can_be_dropped(topobelief, command):
    output = topobelief([command, "--help"]).out
    assert {word for word in get_args(io_reading.Droppable) if word not in output} == set()


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

    monkeypatch.setattr(plan_candidates, "find_candidates", interrupted)
    outcome = topobelief(office.plan("--candidates", 2, "--out", "result"))
    assert outcome.code == app.INTERRUPTED
    assert outcome.err == "topobelief: interrupted; nothing was left half-written\n"
    assert list(tmp_path.iterdir()) == []


def test_a_bug_keeps_its_traceback(topobelief, office, monkeypatch):
    monkeypatch.setattr(plan_candidates, "find_candidates", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        topobelief(office.plan("--candidates", 2))


@pytest.mark.filterwarnings("default")
def test_a_warning_is_one_line(topobelief, office, tmp_path):
    """Here of a map in whose grey the robot stands; the goal outside ends the command."""
    (tmp_path / "map.pgm").write_bytes(b"P5\n2 2\n255\n" + bytes([205, 205, 254, 254]))
    (tmp_path / "map.yaml").write_text(
        "image: map.pgm\nresolution: 2\norigin: [8, 8, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    arguments = [str(office.graph_file), "--map", "map.yaml", "--goal", "0", "5"]
    warning, error = topobelief(["plan", *arguments]).err.splitlines()
    assert warning.startswith("topobelief: warning: map.yaml: free_thresh 0.25 makes the grey 205 free")
    assert error.startswith("topobelief: ")
