"""The pages say what the code does: their examples run, their links lead somewhere, and they leave nothing public out."""

from __future__ import annotations

import dataclasses
import doctest
import importlib.util
import inspect
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import get_args

import numpy as np
import pytest
from scipy import stats

from topobelief import errors
from topobelief.bounds.entropy_bounds import Determinant
from topobelief.planning.decision import Decision
from topobelief.planning.planner import Proof
from topobelief.planning.registry import BOUNDS, ENGINES, OBJECTIVES, SIGNATURES

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
MATHEMATICS = (DOCS / "mathematics.md").read_text(encoding="utf-8")
CONVENTIONS = (DOCS / "conventions.md").read_text(encoding="utf-8")


def headings(page: str) -> set[str]:
    """The anchors that a code host makes of a page's headings."""
    titles = re.findall(r"^#+ (.*)$", without_code(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def without_code(page: str) -> str:
    """A page without its blocks of code and of mathematics."""
    return re.sub(r"```.*?```", "", page, flags=re.DOTALL)


@pytest.fixture(scope="module")
def make_objectives() -> ModuleType:
    """The script that makes the figure of section 11."""
    spec = importlib.util.spec_from_file_location("make_objectives", DOCS / "figures" / "make_objectives.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["mathematics.md", "conventions.md", "search.md"])
def test_the_examples_of_a_page_give_what_it_prints(name: str) -> None:
    results = doctest.testfile(str(DOCS / name), module_relative=False, encoding="utf-8")
    assert results.attempted > 0
    assert results.failed == 0


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", without_code(text)):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        linked = page.parent / file if file else page
        assert linked.is_file(), target
        if anchor:
            assert anchor in headings(linked.read_text(encoding="utf-8")), target


def test_every_section_that_the_code_cites_is_there() -> None:
    sections = set(re.findall(r"^## (\d+)\. ", MATHEMATICS, flags=re.MULTILINE))
    cited = {
        number
        for module in (ROOT / "src").rglob("*.py")
        for number in re.findall(r"the mathematics,\s+section (\d+)", module.read_text(encoding="utf-8"))
    }
    assert cited
    assert cited <= sections


def test_every_equation_that_a_page_cites_is_numbered_once() -> None:
    tags = re.findall(r"\\tag\{(\d+\.\d+)\}", MATHEMATICS)
    cited = set(re.findall(r"\((\d{1,2}\.\d)\)", MATHEMATICS + CONVENTIONS))
    assert len(tags) == len(set(tags))
    assert cited <= set(tags)


def test_formulas_survive_markdown() -> None:
    """Markdown takes for itself a backslash before punctuation, stars, and an underscore after a bracket."""
    for text in map(without_code, (MATHEMATICS, CONVENTIONS)):
        assert all(line.count("$") % 2 == 0 for line in text.splitlines())
        for formula in re.findall(r"\$[^$]+\$", text):
            assert not re.search(r"\\[,;:!{}|\\ ]|[*<>]|[)\]}]_", formula), formula


def test_the_conventions_name_every_field_choice_and_error() -> None:
    fields = {field.name for field in dataclasses.fields(Decision)} - {
        "objective",
        "signature",
        "bounds",
        "determinant",
    }
    assert {name for name in fields if f"`{name}`" not in CONVENTIONS} == set()
    choices = [OBJECTIVES, SIGNATURES, BOUNDS, ENGINES, *(get_args(kind) for kind in (Determinant, Proof))]
    assert {choice for kind in choices for choice in kind if f'"{choice}"' not in CONVENTIONS} == set()
    raised = {name for name, kind in inspect.getmembers(errors, inspect.isclass) if issubclass(kind, errors.TopobeliefError)}
    assert {name for name in raised if f"`{name}`" not in CONVENTIONS} == set()


def test_the_figure_shows_what_its_caption_says(make_objectives: ModuleType) -> None:
    scene = make_objectives.make_scene(7)
    assert len(scene.actions) == 60
    change = {
        (unit, objective): make_objectives.changes(make_objectives.in_units(scene, per_metre), objective)
        for unit, per_metre in make_objectives.UNITS.items()
        for objective in make_objectives.OBJECTIVES
    }
    metres, millimetres = change["metres", "joint"], change["millimetres", "joint"]
    assert f"correlation −{-stats.spearmanr(scene.lengths, metres).statistic:.2f}" in MATHEMATICS
    assert f"+{stats.spearmanr(scene.lengths, millimetres).statistic:.2f}. Over seeds" in " ".join(MATHEMATICS.split())
    assert np.argmin(metres) == np.argmax(scene.lengths)
    for objective in ("map", "per_pose"):
        np.testing.assert_allclose(change["metres", objective], change["millimetres", objective], atol=1e-6)
    no_closure = scene.closures == 0
    assert no_closure.any()
    np.testing.assert_allclose(change["metres", "map"][no_closure], 0, atol=1e-6)
    assert (change["metres", "map"][~no_closure] < 0).all()
    assert (change["metres", "per_pose"][no_closure] > 0).all()


def test_the_figure_is_drawn_by_one_command(
    make_objectives: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(make_objectives, "NUM_PATHS", 8)
    make_objectives.main(["--seed", "1", "--out", str(tmp_path / "figure.png")])
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
