"""Pictures and tables of runs show what the record holds."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from simulation_records import made_record
from topobelief.report.canvas import save_figure
from topobelief.report.simulation_figures import draw_comparison, draw_run, draw_topologies
from topobelief.report.simulation_tables import comparison_table, leg_line, metrics_table
from topobelief.simulation.comparison import ComparedRun, summarised
from topobelief.simulation.metrics import run_metrics
from topobelief.simulation.noise import InjectedNoise


def texts(figure) -> str:
    """All words of a figure."""
    found = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        found += [text.get_text() for text in axes.texts]
    for legend in figure.legends:
        found += [text.get_text() for text in legend.get_texts()]
    return "\n".join(found)


def lines_of(figure, colour: str) -> list:
    return [line for axes in figure.axes for line in axes.lines if line.get_color() == colour]


def shown(table) -> str:
    text = io.StringIO()
    Console(file=text, width=160).print(table)
    return text.getvalue()


def test_a_run_shows_its_tracks(tmp_path):
    record = made_record()
    figure = draw_run(record)
    words = texts(figure)
    assert "2 of 2 goals reached, 15 m, 8 key poses; tracks begin at the true start" in words
    assert "physical noise, seed 3" in words
    for label in ("true track", "wheel odometry", "estimate", "loop closures (1)", "95 % of a position"):
        assert label in words
    assert "odometry of the graph alone" not in words
    assert "not reached" not in words
    save_figure(figure, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 20_000


def test_errors_begin_at_zero():
    """The start is known to the wheels as well as to the estimate."""
    errors = draw_run(made_record()).axes[-1]
    curves = [line.get_ydata() for line in errors.lines if len(line.get_ydata()) == 8]
    assert len(curves) == 2
    for curve in curves:
        assert curve[0] == pytest.approx(0, abs=1e-9)
        assert curve[-1] > 0.01


def test_injected_noise_shows_what_it_was_added_to():
    assert "odometry of the graph alone" in texts(draw_run(made_record(noise=InjectedNoise.of_ratio(0.85))))


def test_a_goal_not_reached_is_marked():
    words = texts(draw_run(made_record(outcome="stuck: no progress")))
    assert "goal, not reached" in words
    assert "1 of 2 goals" in words


def test_the_best_and_the_worst_topology():
    record = made_record()
    each = record.deliberations[0]
    figure = draw_topologies(each, record.scenario.world, name="room, leg 2")
    words = texts(figure)
    best = int(each.values.argmin())
    assert f"Path {best} of 2, least map error, chosen" in words
    assert f"Path {1 - best} of 2, greatest map error" in words
    assert f"{100 * each.values.max():.2f} cm" in words
    assert "room, leg 2" in words


def test_entropies_are_shown_in_nats():
    record = made_record(objective="joint")
    each = record.deliberations[0]
    words = texts(draw_topologies(each, record.scenario.world, name="room"))
    assert "least joint entropy" in words
    assert f"{each.values.min():.2f} nats" in words
    assert "joint entropy, last leg" in shown(metrics_table(record))


def test_candidates_that_leave_the_same_are_not_called_best_and_worst():
    record = made_record()
    each = replace(record.deliberations[0], values=np.zeros(2))
    words = texts(draw_topologies(each, record.scenario.world, name="room"))
    assert "Path 0 of 2, equal map error, chosen" in words
    assert "Path 1 of 2, equal map error" in words


def test_errors_are_shown_in_centimetres():
    record = made_record()
    predicted = 100 * record.legs[1].predicted_value
    assert re.search(rf"expected error of the map, last leg.*predicted {predicted:.2f}, .* cm", shown(metrics_table(record)))


def test_what_strategies_are_called(runs):
    others = {"shortest": "shortest", "spanning_trees": "spanning_trees:joint", "random": "hindsight"}
    changed = [replace(run, strategy=others[run.strategy]) for run in runs]
    words = texts(draw_comparison(changed, summarised(changed), baseline="shortest"))
    assert "spanning trees (joint)" in words
    assert "best in hindsight" in words


@pytest.fixture
def runs() -> list[ComparedRun]:
    common = {"outcome": "arrived", "shortest": 9.0, "num_poses": 30, "num_shared": 20, "num_closures": 4}
    return [
        ComparedRun(
            seed=seed,
            strategy=strategy,
            chosen=1,
            num_candidates=2,
            planned=10.0,
            predicted=0.1,
            error_shared=error + seed / 100,
            error_all=error,
            spread_shared=0.1,
            error_before=0.5,
            **common,
        )
        for seed in range(4)
        for strategy, error in (("shortest", 0.4), ("spanning_trees", 0.3), ("random", 0.5))
    ]


def test_strategies_side_by_side(runs):
    figure = draw_comparison(runs, summarised(runs), baseline="shortest")
    words = texts(figure)
    assert "better in 100%" in words
    assert "better in 0%" in words
    assert "spanning trees" in words
    table = shown(comparison_table(summarised(runs, baseline="shortest"), baseline="shortest", unit="m"))
    assert "4/4" in table
    assert "10.00" in table  # 0.1 m predicted
    assert "41.5" in table
    assert "24%" in table  # (0.415 - 0.315) / 0.415


def test_a_run_in_words():
    record = made_record()
    metrics = run_metrics(record)
    table = shown(metrics_table(record))
    assert f"{100 * metrics['error_slam']:.2f} cm on all poses" in table
    assert "0.036% of the time driven" in table
    assert leg_line(record.legs[1]) == (
        "goal 2: path 0 of 2 (10.0 m); arrived after 10.2 m in 20 s with 1 loop closures, "
        "0.21 m from the goal (0.11 m as the robot believes)"
    )
    assert "at most 0.21 m, as the robot believes 0.12 m" in table
