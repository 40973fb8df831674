"""What the examples and the README show still runs, and gives what it says."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

import topobelief as tb

ROOT = Path(__file__).resolve().parents[1]
OFFICE = ROOT / "examples" / "office"


def test_driving_the_office_again_writes_the_same_graph(tmp_path, monkeypatch):
    written = tmp_path / "again.g2o"
    monkeypatch.setattr(sys, "argv", ["make_graph.py", "--out", str(written)])
    runpy.run_path(str(OFFICE / "make_graph.py"), run_name="__main__")
    again, filed = tb.read_g2o(written), tb.read_g2o(OFFICE / "office.g2o")
    assert again.edges.tolist() == filed.edges.tolist()
    np.testing.assert_allclose(again.poses, filed.poses, atol=1e-9)
    np.testing.assert_allclose(again.measurements, filed.measurements, atol=1e-9)


def test_the_office_stays_between_its_walls():
    """The estimate of the drive, and where it plans from, are places where the robot fits."""
    graph, world = tb.optimize(tb.read_g2o(OFFICE / "office.g2o")), tb.read_world(OFFICE / "office.csv")
    assert world.clearance(graph.positions).min() > 0
    assert world.clearance(graph.positions[-1:])[0] > 0.35
    assert world.clearance([(25.0, -2.95)])[0] > 0.35


def test_a_recorded_drive_can_be_planned_on():
    """The graph is at its estimate and claims no less noise than it has, its poses are free in its map, and a goal is seen."""
    graph, world = tb.read_g2o(OFFICE / "recorded.g2o"), tb.read_world(OFFICE / "recorded.yaml")
    estimate = tb.optimize(graph)
    assert 0.1 < graph.chi2 / graph.degrees_of_freedom < 1.2
    np.testing.assert_allclose(graph.poses, estimate.poses, atol=1e-3)
    assert world.clearance(graph.positions).min() > 0.15
    goal = (25.0, -2.95)
    roadmap = tb.build_roadmap(world, graph.poses[-1], goal)
    paths = tb.diverse_paths(roadmap, graph.poses[-1], goal, num_paths=6, max_detour=2.5)
    actions = tb.predict_actions(graph, paths, world=world)
    decision = tb.Planner(graph, objective="map").decide(actions, proof="optimal")
    assert decision.proven_optimal
    assert decision.candidates[decision.best].num_closures == max(each.num_closures for each in decision.candidates)


def test_the_code_in_the_readme_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 2
    names: dict[str, object] = {}
    for block in blocks:
        exec(block, names)
    decision = names["decision"]
    assert isinstance(decision, tb.Decision)
    assert decision.proven_optimal
    assert decision.summary() in capsys.readouterr().out


@pytest.mark.parametrize("page", ["README.md", "docs/README.md", "examples/office/README.md", "examples/study/README.md"])
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", text):
        if not target.startswith("https://"):
            assert ((ROOT / page).parent / target).exists(), target
