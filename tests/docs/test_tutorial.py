"""The tutorial and the how-to pages run as they stand, and the tutorial's answer is the one that it explains."""

from __future__ import annotations

import doctest
import re
import shutil
from pathlib import Path

import pytest

import topobelief as tb
from topobelief.cli.app import run

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
TUTORIAL = (DOCS / "tutorial.md").read_text(encoding="utf-8")
SENTENCE = r"expected map error ([\d.]+) cm instead of ([\d.]+)"


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Where the commands of the pages are run: a folder with the files of the office under their names."""
    shutil.copytree(ROOT / "examples" / "office", tmp_path / "examples" / "office")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands(page: str) -> list[list[str]]:
    """The commands of a page's blocks of shell, without comments; a backslash joins lines."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)
    return [line.split("#")[0].split() for block in blocks for line in block.replace("\\\n", " ").splitlines()]


def words(text: str) -> str:
    return " ".join(text.split())


def test_the_commands_of_the_tutorial_give_the_answer_that_it_explains(checkout, capsys):
    look, ask, thrifty, own = commands(TUTORIAL)
    answers = []
    for program, *arguments in (look, ask, thrifty, own):
        assert program == "topobelief"
        assert run(arguments) == 0, capsys.readouterr().err
        answers.append(words(capsys.readouterr().out))
    for fact in ("connected", "9.642", "0.9716", "free, 1.29 m from the nearest obstacle"):
        assert fact in answers[0]
        assert fact in TUTORIAL
    printed = re.findall(r"^```text\n(examples.*?)^```$", TUTORIAL, flags=re.DOTALL | re.MULTILINE)[0]
    for line in printed.splitlines()[:5]:
        assert words(line) in answers[1]
    explained, given = (re.search(SENTENCE, words(text)).groups() for text in (printed, answers[1]))
    assert [float(value) for value in given] == pytest.approx([float(value) for value in explained], rel=0.03)
    assert float(re.search(SENTENCE, answers[2])[1]) == pytest.approx(14.9, rel=0.03)
    assert (checkout / "graph.png").stat().st_size > 0
    for file in ("paths.png", "decision.json", "best.csv"):
        assert (checkout / "out" / "tutorial" / file).stat().st_size > 0


def test_the_python_of_the_tutorial_runs(checkout, capsys):
    (block,) = re.findall(r"```python\n(.*?)```", TUTORIAL, flags=re.DOTALL)
    names: dict[str, object] = {}
    exec(block, names)
    found = names["found"]
    assert isinstance(found, tb.SearchResult)
    assert found.lower_bound < found.value < found.shortest.value
    assert capsys.readouterr().out


def test_the_graph_that_the_tutorial_writes_out_is_read(tmp_path):
    text = re.findall(r"^```text\n(VERTEX.*?)^```$", TUTORIAL, flags=re.DOTALL | re.MULTILINE)[0]
    (tmp_path / "mine.g2o").write_text(text)
    graph = tb.read_g2o(tmp_path / "mine.g2o")
    assert (graph.num_poses, graph.num_edges) == (3, 3)
    assert graph.chi2 < 1


def test_the_example_of_own_candidates_gives_what_the_page_prints():
    results = doctest.testfile(str(DOCS / "own_candidates.md"), module_relative=False, encoding="utf-8")
    assert results.attempted > 0
    assert results.failed == 0


@pytest.mark.parametrize("page", ["check_graph.md", "improve_map.md", "own_candidates.md"])
def test_the_commands_of_a_how_to_page_run(page, checkout, capsys):
    """On the office in place of the reader's files, shorter trips, and few evaluations."""
    ours = {"GRAPH.g2o": "examples/office/recorded.g2o", "MAP.yaml": "examples/office/recorded.yaml", "30": "6"}
    (checkout / "mine.csv").write_text("x,y\n25.86,7.98\n24,7.98\n22,8\n")
    (checkout / "theirs.yaml").write_text(NAV_PATH)
    for program, *arguments in commands((DOCS / page).read_text(encoding="utf-8")):
        assert program == "topobelief"
        few = ["--max-evaluations", "10"] if "--max-length" in arguments else []
        assert run([ours.get(each, each) for each in arguments] + few) == 0, capsys.readouterr().err


NAV_PATH = "header: {frame_id: map}\nposes:\n" + "".join(
    f"- pose: {{position: {{x: {x}, y: 7.98, z: 0}}, orientation: {{x: 0, y: 0, z: 1, w: 0}}}}\n" for x in (25.86, 24.5, 23)
)
