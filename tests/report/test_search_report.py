"""The result of a search as tables and as a picture: what is shown is what was found."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from rich.console import Console

import topobelief as tb
from small_roadmaps import OPEN, drive, small_roadmap
from topobelief.report.search_figure import draw_search
from topobelief.report.search_tables import certificate, front_rows, front_table, ways_table
from topobelief.report.style import BEST, PREDICTED_CLOSURE


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(3)
    graph = drive(rng)
    roadmap = small_roadmap(rng, graph)
    closures = tb.ClosureModel(radius=1.5, max_per_pose=2, probability=1.0, min_index_gap=3)
    found = tb.search_roadmap(graph, roadmap, goal=roadmap.vertices[1], max_detour=2.0, closures=closures, turn=100.0)
    return graph, found


def text_of(table) -> str:
    console = Console(width=100, file=io.StringIO())
    console.print(table)
    return console.file.getvalue()


def test_the_front_is_told_from_the_shortest_way_to_the_best(scene):
    _, found = scene
    rows = front_rows(found, 3)
    assert rows[0][0] == f"{found.shortest.length:.1f} m"
    assert rows[-1][2] == f"{100 * found.value:#.3g} cm"
    assert rows[-1][3] == "100 %"
    assert rows[0][0] in text_of(front_table(found, 3))


def test_the_ways_are_numbered_best_first(scene):
    _, found = scene
    lines = [line for line in text_of(ways_table(found)).splitlines() if " m " in line]
    assert len(lines) == 1 + len(found.alternatives)
    assert f"{found.length:.1f} m" in lines[0]


def test_the_certificate_says_what_is_proven(scene):
    _, found = scene
    assert certificate(found)[-1] == "Nothing is proven of other ways."
    bounded = replace(found, lower_bound=0.5 * found.value, covers="every walk")
    assert certificate(bounded)[-1] == f"No walk has less than {50 * found.value:#.3g} cm: every walk."


def test_the_picture_shows_the_way_found_and_its_closures(scene):
    graph, found = scene
    axes = draw_search(graph, OPEN, found).axes
    best = [line for line in axes[0].lines if line.get_color() == BEST]
    assert [line.get_xydata().tolist() for line in best] == [found.path.tolist()]
    closures = [c for c in axes[0].collections if c.get_color()[0][:3] == pytest.approx(rgb(PREDICTED_CLOSURE), abs=0.01)]
    assert sum(len(c.get_segments()) for c in closures) == found.action.num_closures


def rgb(colour: str) -> list[float]:
    return [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]


@pytest.mark.parametrize("share", [0.9, 0.2, -math.inf])
def test_the_front_is_drawn_on_the_axes_given_with_its_bound(scene, share):
    _, found = scene
    ax = Figure().add_subplot()
    bounded = replace(found, lower_bound=share * found.value)
    assert tb.draw_front(bounded, ax) is ax
    steps = ax.lines[0].get_xydata()
    np.testing.assert_allclose(steps[:-1], found.front * (1, 100))
    lines = [line for line in ax.lines if len(line.get_xydata()) == 2 and np.ptp(line.get_ydata()) == 0]
    said = [text.get_text() for text in ax.texts]
    assert bool(lines) + any("no walk is below" in text for text in said) >= (share > 0)
    assert share != -math.inf or not said
