"""A played session tells what each strategy chose and what it lost, from one set of candidates."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.errors import PlanningError
from topobelief.strategies.registry import STRATEGIES, proposes
from topobelief.study.rows import COLUMNS, UNREPEATABLE
from topobelief.study.session import play

ALL = f"[{', '.join(STRATEGIES)}]"
RULE = "{num_vertices: 120, max_detour: none, closures: learned, line_of_sight: false, bounds: auto}"


@pytest.fixture(scope="module")
def rows(make_tasks_in, tmp_path_factory):
    """Of seed 0, by session, noise, strategy and objective."""
    varied = {"strategies": ALL, "objectives": "[joint, map, error]", "rule": RULE, "seeds": "1"}
    tasks = make_tasks_in(tmp_path_factory.mktemp("study"), **varied)
    return {(task.session.name, task.noise.xi, task.strategy, task.objective): play(task) for task in tasks}


def test_rows_fill_the_columns(rows):
    said_by_the_run = {"task", "world", "session", "sigma_p", "sigma_theta", "xi", "strategy", "objective", "seed"}
    said_by_the_run |= {"status", "error", "attempts"}
    for row in rows.values():
        assert set(row) == set(COLUMNS) - said_by_the_run


def test_strategies_choose_among_the_same_candidates(rows):
    for (session, xi, strategy, objective), row in rows.items():
        standard = rows[session, xi, "standard", objective]
        if not proposes(strategy):
            for name in ("candidate_lengths", "candidate_values", "num_poses", "num_edges", "best_value", "spread"):
                assert row[name] == standard[name]
        assert row["value"] == row["candidate_values"][row["chosen"]]
        assert row["loss"] == row["value"] - min(row["candidate_values"]) >= 0


def test_a_path_of_its_own_is_one_more_candidate(rows):
    for (session, xi, strategy, objective), row in rows.items():
        if strategy == "roadmap":
            standard = rows[session, xi, "standard", objective]
            assert row["chosen"] == standard["num_candidates"] == row["num_candidates"] - 1
            assert row["candidate_values"][:-1] == pytest.approx(standard["candidate_values"], rel=1e-9)
            assert row["length"] <= max(standard["candidate_lengths"]) + 1e-9
            assert row["value"] <= standard["value"] + 1e-3  # m or nats, of hundreds


def test_the_second_session_stands_on_the_first(rows):
    across, back = (rows[name, 0.09999999999999999, "standard", "joint"] for name in ("across", "back"))
    assert (across["num_poses"], across["num_edges"], across["num_candidates"]) == (1, 0, 4)
    assert back["num_poses"] > 10
    assert back["num_candidates"] == 5


def test_exact_strategies_lose_nothing_and_say_what_it_took(rows):
    for (_, _, strategy, _), row in rows.items():
        if strategy in ("optimum", "standard"):
            assert row["action_consistent"]
            assert row["proven_optimal"]
            assert row["signature"] is row["gamma"] is row["candidate_scores"] is None
        if strategy == "standard":
            assert row["num_evaluations"] == row["num_candidates"]


def test_bounds_hold_where_a_strategy_has_them(rows):
    seen = 0
    for row in rows.values():
        if row["lower"] is not None:
            seen += 1
            assert row["lower"] - 1e-9 <= row["value"] <= row["upper"] + 1e-9
            assert row["loss"] <= row["error_bound"] + 1e-9
    assert seen == 2 * 2 * 3 * 6


def test_the_error_is_in_metres_and_ranked_by_resistance(rows):
    back = rows["back", 0.09999999999999999, "resistance", "error"]
    assert 0 < back["best_value"] < back["value"] + 1e-9 < 1
    assert back["signature"] == pytest.approx(-back["value"], rel=0.7)  # its estimate of the error
    assert back["spearman"] > 0


def test_shortest_and_random_ignore_the_graph(rows):
    for (_, _, strategy, _), row in rows.items():
        if strategy == "shortest":
            assert row["length"] == min(row["candidate_lengths"])
        if strategy in ("shortest", "random"):
            assert row["num_evaluations"] == 0
            assert row["error_bound"] is None


def test_no_correlation_where_all_tie(rows):
    for (session, _, _, objective), row in rows.items():
        if session == "across" and objective != "joint":  # one pose, which nothing can improve
            assert row["spread"] < 1e-6
            assert row["spearman"] is None


def test_a_task_played_again_gives_the_same_row(make_tasks):
    for task in make_tasks(seeds="[2]"):
        once, again = play(task), play(task)
        assert {k: v for k, v in once.items() if k not in UNREPEATABLE} == {
            k: v for k, v in again.items() if k not in UNREPEATABLE
        }


def test_seeds_change_the_candidates(make_tasks):
    """Those at least that are more than one to a homotopy class: the shortest paths are the same for all seeds."""
    lengths = [play(task)["candidate_lengths"] for task in make_tasks(strategies="[shortest]", candidates="12}")[::4]]
    assert len(lengths) == 3
    assert not any(np.array_equal(lengths[0], other) for other in lengths[1:])


def test_a_goal_in_a_wall_is_an_error(make_tasks):
    task = make_tasks(across="{start: [1, 1], goals: [[5, 5]]}")[0]
    with pytest.raises(PlanningError, match="expected a goal with more clearance"):
        play(task)
