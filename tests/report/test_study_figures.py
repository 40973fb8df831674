"""Figures of a study show what its summary says, also where values are missing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from topobelief.report.study_figures import FIGURES, draw_choices, draw_losses, draw_times
from topobelief.study.summary import Share, Spread, Summary


def summary(**changes) -> Summary:
    values = {
        "world": "office",
        "session": "S1",
        "objective": "joint",
        "strategy": "spanning_trees",
        "sigma_p": 0.1,
        "sigma_theta": 0.01,
        "xi": 0.1,
        "num_ok": 10,
        "num_failed": 0,
        "action_consistent": Share.of(9, 10),
        "order_consistent": Share.of(2, 10),
        "loss": Spread.of(np.array([0.0, 0.0, 0.0, 2.0, 30.0])),
        "spearman": Spread.of(np.array([0.9, 1.0])),
        "evaluations": Spread.of(np.array([0.0])),
        "survivors": Spread.of(np.array([3.0])),
        "seconds": Spread.of(np.array([0.01, 0.02])),
    }
    return Summary(**{**values, **changes})


def lines(figure, panel: int = 0) -> list[np.ndarray]:
    return [line.get_xydata() for line in figure.axes[panel].lines]


def test_a_panel_for_each_session_and_objective():
    found = [summary(session=session, objective=objective) for session in ("S1", "S2") for objective in ("joint", "map")]
    figure = draw_losses(found)
    assert len(figure.axes) == 4
    texts = {text.get_text() for text in figure.texts}
    assert {"S1 in office, joint entropy", "S2 in office, map entropy", "spanning trees"} <= texts


def test_losses_of_error_are_centimetres():
    figure = draw_losses([summary(objective="error"), summary()])
    assert [axes.get_xlabel() for axes in figure.axes] == ["loss (nats)", "loss (cm)"]
    assert lines(figure, 1)[2][0, 0] == pytest.approx(640)


def test_shares_are_percent_with_their_interval():
    interval, _, _, dot = lines(draw_choices([summary()]))
    share = Share.of(9, 10)
    assert interval[:, 0] == pytest.approx([100 * share.low, 100 * share.high])
    assert dot[0, 0] == pytest.approx(90)


def test_losses_show_quantiles_and_mean():
    thin, thick, mean, dot = lines(draw_losses([summary()]))
    loss = summary().loss
    assert thin[:, 0] == pytest.approx([loss.low, loss.high])
    assert thick[:, 0] == pytest.approx([0.0, 2.0])
    assert mean[0, 0] == pytest.approx(6.4)
    assert dot[0, 0] == 0.0
    assert draw_losses([summary()]).axes[0].get_xlim()[1] >= loss.high


def test_times_are_milliseconds():
    *_, dot = lines(draw_times([summary()]))
    assert dot[0, 0] == pytest.approx(15)


def test_noises_lie_beside_each_other_within_a_strategy():
    found = [summary(xi=xi, strategy=strategy) for strategy in ("random", "optimum") for xi in (0.1, 0.85)]
    heights = [line[0, 1] for line in lines(draw_choices(found))[3::4]]
    assert [round(height) for height in heights] == [1, 1, 0, 0]  # the optimum stands above
    assert heights[0] < heights[1]


@pytest.mark.parametrize("draw", FIGURES.values(), ids=FIGURES)
def test_nothing_known_is_nothing_drawn(draw):
    nothing, none = Spread.of(np.array([])), Share.of(0, 0)
    empty = summary(num_ok=0, loss=nothing, spearman=nothing, seconds=nothing, action_consistent=none)
    figure = draw([empty])
    assert lines(figure) == []
    assert len(draw([empty, summary(session="S2")]).axes) == 2


def test_names_are_no_mathematics():
    figure = draw_losses([summary(session="$x^", world="a_b")])
    assert "$x^ in a_b, joint entropy" in {text.get_text() for text in figure.texts}
    figure.canvas.draw()


def test_wilson_intervals():
    share = Share.of(0, 10)
    assert (share.value, share.low) == (0, 0)
    assert share.high == pytest.approx(0.2775, abs=1e-4)  # published tables
    assert math.isnan(Share.of(0, 0).value)
