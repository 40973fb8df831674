"""The picture of the bounds shows the numbers of the decision, each in its row."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from topobelief.report.bounds_figure import draw_bounds
from topobelief.report.style import BEST, INK, RULED_OUT, SURVIVOR


def intervals(figure: Figure) -> dict[int, tuple[float, float, str]]:
    """Row -> (left end, right end, colour) of each bar."""
    bars = [line for line in figure.axes[0].lines if line.get_linewidth() == 5]
    return {int(bar.get_ydata()[0]): (*map(float, bar.get_xdata()), bar.get_color()) for bar in bars}


def marks(figure: Figure, fill: str) -> np.ndarray:
    """(value, row) of the diamonds with a filling, without those that are nowhere."""
    found = [line for line in figure.axes[0].lines if line.get_marker() == "D" and line.get_markerfacecolor() == fill]
    points = np.concatenate([np.zeros((0, 2)), *(line.get_xydata() for line in found)])
    return points[~np.isnan(points).any(axis=1)]


def key(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_each_row_holds_the_interval_of_its_action_in_ranking_order(make_decision):
    decision = make_decision(6)
    shown = intervals(draw_bounds(decision))
    assert sorted(shown) == list(range(6))
    for row, action in enumerate(decision.ranking):
        assert shown[row][:2] == (decision.lower[action], decision.upper[action])


def test_colours_tell_the_best_the_survivors_and_the_ruled_out(make_decision):
    shown = intervals(draw_bounds(make_decision(6)))
    assert [shown[row][2] for row in range(6)] == [BEST, SURVIVOR, SURVIVOR, RULED_OUT, RULED_OUT, RULED_OUT]


def test_the_dashed_line_is_the_upper_bound_of_the_best(make_decision):
    decision = make_decision(4)
    dashed = [line for line in draw_bounds(decision).axes[0].lines if line.get_linestyle() == "--"]
    assert [list(line.get_xdata()) for line in dashed] == [[decision.upper[3], decision.upper[3]]]


def test_exact_values_have_their_cost_added_as_the_bounds_have(make_decision):
    decision = make_decision(3, cost=4.0)
    figure = draw_bounds(decision, entropies=[-100.0, -110.0, -120.0])
    assert marks(figure, "white").tolist() == [[-116.0, 0], [-106.0, 1], [-96.0, 2]]
    assert figure.axes[0].get_xlabel().endswith(", plus cost (nats)")


def test_values_that_the_decision_needed_are_told_from_those_that_it_did_not(make_decision):
    decision = make_decision(3, entropies=[np.nan, np.nan, -120.0], num_evaluations=1)
    figure = draw_bounds(decision, entropies=[-100.0, np.nan, -120.0])
    assert marks(figure, INK).tolist() == [[-120.0, 0]]
    assert marks(figure, "white").tolist() == [[-100.0, 2]]
    assert "least value found" in key(figure)


def test_missing_bounds_leave_rows_empty_and_no_dashed_line(make_decision):
    nothing = np.full(4, np.nan)
    figure = draw_bounds(make_decision(4, lower=nothing, upper=nothing, error_bound=np.inf))
    assert intervals(figure) == {}
    assert key(figure) == []


def test_a_single_candidate_is_compared_with_nothing(make_decision):
    figure = draw_bounds(make_decision(1), entropies=[-100.0])
    assert key(figure) == ["chosen", "exact"]
    assert [text.get_text() for text in figure.texts[-2:]] == [
        "path 0, the only candidate",
        "there is nothing to compare it with",
    ]


def test_the_title_counts_what_was_ruled_out(make_decision):
    texts = [text.get_text() for text in draw_bounds(make_decision(5)).texts]
    assert "2 of 5 candidates cannot be the best: their lower bound exceeds the dashed line" in texts


@pytest.mark.parametrize(("count", "objective"), [(1, "joint"), (2, "map"), (3, "per_pose"), (50, "joint")])
def test_all_text_lies_within_the_picture_whatever_the_labels(make_decision, count, objective):
    decision = make_decision(count, label="a rather long name for a path that goes far", objective=objective)
    figure = draw_bounds(decision, entropies=np.linspace(-123456.7, -123450.1, count))
    FigureCanvasAgg(figure).draw()
    picture = figure.bbox
    for text in [*figure.texts, figure.axes[0].xaxis.label, *figure.legends[0].get_texts()]:
        box = text.get_window_extent()
        assert picture.x0 <= box.x0 <= box.x1 <= picture.x1, text.get_text()
        assert picture.y0 <= box.y0 <= box.y1 <= picture.y1, text.get_text()


def test_the_columns_of_a_row_do_not_run_into_each_other(make_decision):
    figure = draw_bounds(make_decision(3, label="a rather long name for a path"))
    FigureCanvasAgg(figure).draw()
    rows: dict[float, list[tuple[float, float]]] = {}
    for text in figure.texts[:-2]:  # the last two are the title
        box = text.get_window_extent()
        rows.setdefault(text.get_position()[1], []).append((box.x0, box.x1))
    for row in rows.values():
        ends = [end for box in sorted(row) for end in box]
        assert ends == sorted(ends)
