"""Pictures on matplotlib axes: those that are given, or new ones; the layers are those of the command line's pictures."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import topobelief as tb
from topobelief.report.style import BEST

OMEGA = np.diag([100.0, 100.0, 400.0])
ROOM = tb.World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
GRAPH = tb.PoseGraph([[x, 2, 0] for x in range(1, 6)], [(0, 1), (1, 2), (2, 3), (3, 4), (0, 2)], None, OMEGA)
PATHS = [np.array([(5, 2), (3, 5), (5, 8)], float), np.array([(5, 2), (7, 5), (5, 8)], float)]
ACTIONS = [
    tb.Action([(3, 5, 2), (5, 8, 1)], [(4, 5), (5, 6), (5, 1), (5, 2)], OMEGA, label="left"),
    tb.Action([(7, 5, 1), (5, 8, 2)], [(4, 5), (5, 6)], OMEGA, label="right"),
]
DECISION = tb.Planner(GRAPH).decide(ACTIONS)
SOLID = tb.PoseGraph([[0, 0, 0, 0, 0, 0, 1], [1, 0, 5, 0, 0, 0, 1]], [(0, 1)], None, np.eye(6))

PICTURES = {
    "paths": lambda axes: tb.draw_paths(GRAPH, PATHS, ACTIONS, DECISION, world=ROOM, axes=axes),
    "paths without a world": lambda axes: tb.draw_paths(GRAPH, PATHS, ACTIONS, DECISION, axes=axes),
    "bounds": lambda axes: tb.draw_bounds(DECISION, axes=axes),
    "graph": lambda axes: tb.draw_graph(GRAPH, world=ROOM, axes=axes),
    "graph in space": lambda axes: tb.draw_graph(SOLID, axes=axes),
}


@pytest.fixture(autouse=True)
def _no_figure_stays_open():
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    yield
    plt.close("all")


@pytest.mark.parametrize("name", PICTURES)
def test_given_axes_are_drawn_on_and_returned(name):
    axes = Figure().subplots()
    settings = dict(mpl.rcParams)
    assert PICTURES[name](axes) is axes
    assert axes.has_data()
    assert dict(mpl.rcParams) == settings


@pytest.mark.parametrize("name", PICTURES)
def test_new_axes_hold_all_of_the_picture(name):
    """The key too, which stands beside them."""
    figure = PICTURES[name](None).figure
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    for box in (axes.get_tightbbox(), axes.get_legend().get_window_extent()):
        assert figure.bbox.x0 - 1 <= box.x0 < box.x1 <= figure.bbox.x1 + 1
        assert figure.bbox.y0 - 1 <= box.y0 < box.y1 <= figure.bbox.y1 + 1


def test_the_goal_is_where_the_chosen_path_ends_unless_it_is_given():
    def goal(**given):
        axes = PICTURES["paths"](None) if not given else tb.draw_paths(GRAPH, PATHS, ACTIONS, DECISION, **given)
        return next(line.get_xydata().tolist() for line in axes.lines if line.get_marker() == "*")

    assert goal() == [[5, 8]]
    assert goal(goal=(1, 9, 0)) == [[1, 9]]


def test_the_chosen_path_is_drawn_where_it_goes():
    best = [line for line in PICTURES["paths"](None).lines if line.get_color() == BEST]
    assert [line.get_xydata().tolist() for line in best] == [PATHS[DECISION.best].tolist()]


def test_rows_of_the_bounds_are_named_in_ranking_order():
    names = [text.get_text() for text in PICTURES["bounds"](None).get_yticklabels()]
    assert names == [DECISION.name(action) for action in DECISION.ranking]
