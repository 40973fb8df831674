"""What a plan answers: centimetres first, then why, and why not; the paper's choices by one flag."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from topobelief.cli.plan_candidates import Proposals
from topobelief.cli.plan_draws import finalists
from topobelief.cli.plan_ends import Goal
from topobelief.cli.plan_errors import PlanErrors, answer, centimetres
from topobelief.estimation import optimize
from topobelief.graph.action import Action
from topobelief.io.g2o import read_g2o
from topobelief.planning.decision import Candidate, Decision
from topobelief.position_errors import ExpectedErrors, expected_errors


def document(topobelief, arguments: list[str]) -> dict:
    outcome = topobelief([*arguments, "--json"])
    assert (outcome.code, outcome.err) == (0, "")
    return json.loads(outcome.out)


def decision_of(lower: list[float], upper: list[float], exact: list[float], *, best: int, lengths: list[float]) -> Decision:
    count = len(lower)
    return Decision(
        best=best,
        ranking=np.arange(count),
        signatures=np.zeros(count),
        lower=np.array(lower),
        upper=np.array(upper),
        entropies=np.array(exact),
        survivors=np.array([best]),
        error_bound=0.0,
        margin_met=None,
        num_evaluations=count,
        proven_optimal=True,
        candidates=tuple(Candidate(f"path {index}", 5, 2, length, 0.0) for index, length in enumerate(lengths)),
        objective="error",
        signature="resistance",
        bounds="fischer",
        determinant="cholesky",
    )


def proposals_of(goals: list[int | None]) -> Proposals:
    stay = Action(np.zeros((0, 3)), [], np.eye(3))
    return Proposals([np.zeros((2, 2))] * len(goals), [stay] * len(goals), goals)


KITCHEN, HALL = Goal(np.array([1.0, 2.0]), "(1.00, 2.00)"), Goal(np.array([3.0, 0.0]), "pose 7")
NOW, CHOSEN, SHORTEST = ExpectedErrors(0.131, 0.0), ExpectedErrors(0.084, 0.04), ExpectedErrors(0.119, 0.09)
TWO = decision_of([0.1, 0.084], [0.119, 0.084], [0.119, 0.084], best=1, lengths=[12.1, 14.3])


def test_the_first_sentence_says_what_to_drive_and_what_it_does():
    told = answer(proposals_of([0, 0]), TWO, PlanErrors(0, NOW, CHOSEN, SHORTEST), [KITCHEN])
    assert told.startswith(
        "Drive path 1 (14.3 m, 2.2 m more than the shortest): expected map error 8.4 cm instead of 11.9; "
        "at the goal 4.0 cm instead of 9.0. "
    )
    assert told.endswith("That is against path 0, the shortest; now the map's expected error is 13.1 cm.")


def test_where_the_shortest_is_chosen_the_comparison_is_with_now():
    best = decision_of([0.084, 0.1], [0.084, 0.119], [0.084, np.nan], best=0, lengths=[12.1, 14.3])
    told = answer(proposals_of([0, 0]), best, PlanErrors(0, NOW, CHOSEN, CHOSEN), [KITCHEN])
    assert told == "Drive path 0 (12.1 m, the shortest): expected map error 8.4 cm instead of 13.1 now; at the goal 4.0 cm."


def test_of_several_goals_the_shortest_is_named_with_its_own():
    told = answer(proposals_of([1, 1]), TWO, PlanErrors(0, NOW, CHOSEN, SHORTEST), [KITCHEN, HALL])
    assert "Drive path 1 (14.3 m, 2.2 m more than the shortest to pose 7)" in told
    assert "That is against path 0, the shortest to pose 7;" in told
    elsewhere = answer(proposals_of([None, None]), TWO, PlanErrors(0, NOW, CHOSEN, SHORTEST), [KITCHEN, HALL])
    assert "2.2 m more than the shortest of those to none of the goals)" in elsewhere


def test_each_goal_has_its_own_shortest_path():
    found = proposals_of([1, 0, None, 0, 1])
    assert [found.shortest(index) for index in range(5)] == [0, 1, 2, 1, 0]


def test_errors_in_centimetres_are_those_of_the_library(topobelief, office):
    """Whatever the objective; the action is rebuilt from the document's path."""
    graph = optimize(read_g2o(office.graph_file))
    for objective in ("error", "map"):
        plan = document(topobelief, office.plan("--candidates", 4, "--objective", objective))
        errors = plan["expected_errors"]
        assert errors["now"]["map_rmse"] == pytest.approx(expected_errors(graph).map_rmse)
        assert errors["chosen"]["map_rmse"] <= errors["shortest"]["map_rmse"] < errors["now"]["map_rmse"]
        outcome = topobelief(office.plan("--candidates", 4, "--objective", objective))
        assert f"expected map error {centimetres(errors['chosen']['map_rmse'])[0]}" in outcome.out


def test_the_default_is_the_error_of_the_map_and_its_value_is_the_error_told(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 4))
    assert (plan["objective"], plan["signature"], plan["proven_optimal"]) == ("error", "resistance", True)
    best = plan["actions"][plan["best"]]
    assert best["lower"] == pytest.approx(plan["expected_errors"]["chosen"]["map_rmse"], rel=1e-6)


def test_the_paper_is_one_flag(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 4, "--as-paper"))
    chosen = (plan["objective"], plan["signature"], plan["bounds"], plan["num_evaluations"], plan["proven_optimal"])
    assert chosen[:4] == ("joint", "spanning_trees", "fischer", 0)
    assert plan["options"]["closures"]["max_per_pose"] is None
    other = document(topobelief, office.plan("--candidates", 4, "--as-paper", "--objective", "map", "--proof", "optimal"))
    assert (other["objective"], other["proven_optimal"]) == ("map", True)


def test_every_candidate_has_a_sentence(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 6, "--max-detour", 2))
    for action in plan["actions"]:
        assert action["why"].startswith(f"{action['label']} sees ")
    assert "chosen: proven to have the least expected error of the map" in plan["actions"][plan["best"]]["why"]
    out = topobelief(office.plan("--candidates", 6, "--max-detour", 2)).out
    assert all(action["why"] in out for action in plan["actions"])


def test_one_is_explained_on_request_by_number_or_label(topobelief, office):
    by_number = topobelief(office.plan("--candidates", 4, "--max-detour", 2, "--why", 3)).out
    told = by_number[by_number.index("Why, and why not:") :]
    assert re.search(r"path 3 sees .*\n    \d+\.\d m, \d+ new poses; rank \d of 4 by signature; after it", told)
    assert "path 2 sees" not in told
    assert told.partition("Pictures")[0] in topobelief(office.plan("--candidates", 4, "--max-detour", 2, "--why", "path 3")).out


def test_equals_go_to_the_shorter_path(topobelief, office, tmp_path):
    """Without closures every way there is worth nothing."""
    arguments = office.plan("--candidates", 6, "--max-detour", 2, "--closures", "by-hand", "--min-index-gap", 1000)
    plan = document(topobelief, arguments)
    assert {action["num_closures"] for action in plan["actions"]} == {0}
    assert plan["best"] == 0
    assert "as good as path 0, and " in plan["actions"][5]["why"]


def test_draws_of_closures_are_told_for_the_finalists(topobelief, office):
    arguments = office.plan("--candidates", 4)
    plan = document(topobelief, arguments)
    draws = plan["closure_draws"]
    assert plan["best"] == draws[0]["action"]
    assert all(row["mean"] > plan["actions"][row["action"]]["lower"] and row["std"] > 0 for row in draws)  # Jensen
    assert "If each closure is made or not, by its probability (30 draws)" in topobelief(arguments).out
    assert document(topobelief, [*arguments, "--closures", "paper"])["closure_draws"] == []


def test_finalists_are_the_chosen_the_next_best_and_the_shortest():
    three = decision_of([0.3, 0.1, 0.4, 0.2], [0.3, 0.1, 0.4, 0.2], [np.nan] * 4, best=1, lengths=[1, 2, 3, 4])
    assert finalists(three, 0) == [1, 3, 0]
    assert finalists(three, 1) == [1, 3]


def test_a_rule_by_hand_that_predicts_too_many_closures_is_pointed_out(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 4, "--closure-radius", 4))
    assert any("closures a new pose" in note for note in plan["notes"])
