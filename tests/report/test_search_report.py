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


@pytest.mark.parametrize("share", [0.9, 0.2])
def test_the_front_is_drawn_on_the_axes_given_with_its_bounds(scene, share):
    """Bounds far below the front are told in words, with as much of the line as the picture has room for."""
    _, found = scene
    ax = Figure().add_subplot()
    bounds = np.array([[found.front[0, 0], share * found.front[0, 1]], [found.max_length, share * found.front[-1, 1]]])
    assert tb.draw_front(replace(found, front_bounds=bounds), ax) is ax
    np.testing.assert_allclose(ax.lines[0].get_xydata()[:-1], found.front * (1, 100))
    np.testing.assert_allclose(ax.lines[1].get_xydata()[1:], bounds * (1, 100))
    assert bool(ax.texts) == (ax.get_ylim()[0] > 100 * bounds[-1, 1])
    assert tb.draw_front(found, Figure().add_subplot()).lines[1].get_label() == "chosen"


def test_the_bound_of_each_length_is_told_beside_the_front(scene):
    _, found = scene
    assert "none below" not in text_of(front_table(found, 3))
    middle, least = float(found.front[:2, 0].mean()), 0.5 * found.front[-1, 1]
    bounded = replace(found, front_bounds=np.array([[middle, 2 * least], [found.max_length, least]]))
    assert [bounded.bound_within(length) for length in (middle, middle + 1e-6)] == [2 * least, least]
    assert bounded.bound_within(2 * found.max_length) == -math.inf
    told = front_rows(bounded, 3)
    assert [row[3] for row in (told[0], told[-1])] == [f"{100 * bound:#.3g} cm" for bound in (2 * least, least)]
    assert "none below" in text_of(front_table(bounded, 3))
