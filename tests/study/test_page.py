"""The page on studies and the example say what is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from topobelief.strategies.registry import STRATEGIES
from topobelief.study.rows import COLUMNS, UNREPEATABLE
from topobelief.study.session import play
from topobelief.study.specification import Rule, read_specification
from topobelief.study.tasks import tasks_of

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "study.md").read_text(encoding="utf-8")


def block_of_the_page() -> str:
    block = re.search(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert block is not None
    return block[1]


def test_the_page_names_every_column_in_order():
    table = PAGE[PAGE.index("| columns | what |") :]
    named = [name for row in re.findall(r"^\| (`.*?) \|", table, flags=re.MULTILINE) for name in re.findall(r"`(\w+)`", row)]
    assert len(named) == len(set(named))
    assert set(named) == set(COLUMNS)
    assert tuple(named[-4:]) == UNREPEATABLE


def test_the_specification_of_the_page_is_one(tmp_path):
    text = block_of_the_page().replace("../office/", f"{ROOT}/examples/office/").replace("maps/depot.yaml", "depot.yaml")
    (tmp_path / "depot.yaml").write_text(
        "image: depot.pgm\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    (tmp_path / "depot.pgm").write_bytes(b"P5\n2 2\n255\n\xff\xff\xff\xff")
    (tmp_path / "study.yaml").write_text(text)
    found = read_specification(tmp_path / "study.yaml")
    assert found.strategies == tuple(STRATEGIES)
    assert [names for _, names in found.sessions] == [("office",), ("office",)]


def test_the_rule_of_the_page_is_the_default(tmp_path):
    said = yaml.safe_load(block_of_the_page())["rule"]
    assert set(said) == set(Rule().content)
    for name, value in said.items():
        expected = Rule().content[name]
        assert value == (pytest.approx(expected, abs=1e-5) if isinstance(expected, float) else expected), name


def test_the_example_is_as_large_as_it_says_and_plays():
    tasks = tasks_of(read_specification(ROOT / "examples" / "study" / "office.yaml"))
    assert len(tasks) == 600
    for session in ("S2", "recorded"):
        row = play(next(task for task in tasks if task.session.name == session))
        assert row["num_candidates"] == 20
        assert row["loss"] <= row["error_bound"]


def test_links_lead_somewhere():
    for page in (ROOT / "docs" / "study.md", ROOT / "examples" / "study" / "README.md"):
        for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), target
