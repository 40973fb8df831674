"""`plan` searches the roadmap: its answer, certificate and front; trips without a goal, and whether any is worth driving."""

from __future__ import annotations

import json

import numpy as np
import pytest

import topobelief as tb
from topobelief.candidates.polyline import path_length
from topobelief.cli import plan_mode
from topobelief.forms import prior_factors
from topobelief.io.path_formats import read_path
from topobelief.search import roadmap_search

FEW = ("--vertices", 60, "--max-evaluations", 100)


def trip(office, *options: object) -> list[str]:
    files = [str(office.graph_file), "--map", str(office.map_file)]
    return ["plan", *files, *map(str, FEW), *map(str, options)]


def to_goal(office, *options: object) -> list[str]:
    return trip(office, "--goal", 0, 5, *options)


def document(topobelief, arguments: list[str]) -> dict:
    outcome = topobelief([*arguments, "--json"])
    assert (outcome.code, outcome.err) == (0, "")
    return json.loads(outcome.out)


def test_the_answer_comes_with_the_certificate_and_the_front(topobelief, office, tmp_path):
    outcome = topobelief(to_goal(office, "--write-path", "best.csv"))
    assert (outcome.code, outcome.err) == (0, "")
    told = (
        "searched: all walks",
        "Drive path ",
        "no walk of the roadmap to the goal, up to 15.0 m, is better",
        "what each further metre buys",
    )
    places = [outcome.out.index(text) for text in told]
    assert places == sorted(places)
    assert "chosen: the best way found" in outcome.out
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"paths.png", "decision.json"}
    plan = json.loads((tmp_path / "out" / "decision.json").read_text())
    assert np.allclose(read_path(tmp_path / "best.csv")[:, :2], plan["search"]["path"])


def test_the_graph_is_factored_once_for_all_goals_and_the_decision(topobelief, office, monkeypatch):
    """Before the time of the search begins; a search that made a planner of its own would fail here."""
    monkeypatch.setattr(roadmap_search, "Planner", None)
    plan = document(topobelief, to_goal(office, "--goal", 5, 10))
    assert {action["goal"] for action in plan["actions"]} == {0, 1}


def test_all_that_evaluations_need_of_a_large_map_is_made_before_the_time_of_the_search(topobelief, office, monkeypatch):
    """As on graphs whose errors are taken from blocks of the inverse until solutions are asked for."""
    monkeypatch.setattr(prior_factors, "COMPILED_SIZE", 0)
    made: list[str] = []
    search, solve = roadmap_search.search_roadmap, prior_factors.solutions

    def told(*given, **more):
        made.append("search")
        result = search(*given, **more)
        made.append("searched")
        return result

    monkeypatch.setattr(prior_factors, "solutions", lambda *given: (made.append("solutions"), solve(*given))[1])
    monkeypatch.setattr(roadmap_search, "search_roadmap", told)
    assert topobelief(to_goal(office)).code == 0
    assert made[:3] == ["solutions", "search", "searched"]


def test_the_document_is_what_the_library_finds(topobelief, office):
    plan = document(topobelief, to_goal(office, "--max-detour", 1.5))
    graph = tb.optimize(tb.read_g2o(office.graph_file))
    world = tb.read_world(office.map_file)
    roadmap = tb.build_roadmap(world, graph.positions[-1], (0, 5), num_vertices=60)
    found = tb.search_roadmap(
        graph, roadmap, goal=(0, 5), max_detour=1.5, world=world, max_evaluations=100, num_alternatives=5, refine=True
    )
    searched, best = plan["search"], plan["actions"][plan["best"]]
    assert searched["path"] == best["waypoints"] == found.path.tolist()
    assert (searched["value"], searched["lower_bound"]) == pytest.approx((found.value, found.lower_bound), rel=1e-12)
    assert searched["lower_bound"] <= searched["value"]
    assert best["lower"] == pytest.approx(found.value, rel=1e-9)
    assert searched["front"] == found.front.tolist()
    assert searched["value"] == pytest.approx(min(action["lower"] for action in plan["actions"]), rel=1e-9)
    lengths = [path_length(action["waypoints"]) for action in plan["actions"]]
    assert lengths == sorted(lengths)


def test_ways_of_the_front_are_candidates_that_can_be_explained(topobelief, office):
    out = topobelief(to_goal(office, "--max-detour", 1.5, "--why", 1)).out
    front = out[out.index("what each further metre buys") : out.index("Why, and why not")]
    assert 2 <= front.count("path ") <= 5
    assert "new poses; after it the map's expected error is" in out


def test_a_cost_of_metres_picks_a_shorter_way(topobelief, office):
    free, dear = (
        document(topobelief, to_goal(office, "--max-detour", 2, "--cost-per-metre", cost))["search"] for cost in (0, 1)
    )
    assert dear["length"] < free["length"]


def test_several_goals_are_searched_for_one_after_the_other(topobelief, office):
    plan = document(topobelief, to_goal(office, "--goal", "0", "9"))
    assert {action["goal"] for action in plan["actions"]} == {0, 1}
    assert plan["actions"][plan["best"]]["label"].endswith(" to (0.00, 5.00)") or plan["actions"][plan["best"]]["goal"] == 1
    assert "o walk of the roadmap to a goal " in topobelief(to_goal(office, "--goal", "0", "9")).out


def test_a_list_of_candidates_is_compared_where_it_is_asked_for(topobelief, office):
    for options in (["--candidates", 2], ["--as-paper"]):
        plan = document(topobelief, to_goal(office, *options))
        assert "search" not in plan
        assert plan["notes"] == []
    plan = document(topobelief, to_goal(office, "--proof", "none"))
    assert "search" not in plan
    assert "--proof is for a list of candidates" in plan["notes"][0]


def test_without_numba_candidates_are_compared_and_trips_refused(topobelief, office, monkeypatch):
    monkeypatch.setattr(plan_mode, "has_kernels", lambda: False)
    monkeypatch.setattr("topobelief.cli.extras.is_installed", lambda _: False)
    plan = document(topobelief, to_goal(office))
    assert "search" not in plan
    assert "pip install 'topobelief[fast]'" in plan["notes"][0]
    outcome = topobelief(trip(office, "--max-length", 10))
    assert outcome.code == 2
    assert "numba" in outcome.err


def test_a_trip_needs_no_goal_and_may_return(topobelief, office):
    plan = document(topobelief, trip(office, "--max-length", 12))
    assert plan["goals"] == []
    assert 0 < plan["search"]["length"] <= 12
    assert plan["search"]["value"] < plan["search"]["value_now"]
    back = document(topobelief, trip(office, "--max-length", 12, "--return"))["search"]
    assert back["path"][0] == back["path"][-1]
    outcome = topobelief(trip(office, "--max-length", 12, "--return"))
    assert ", back to the start): expected map error " in outcome.out
    assert " now.\n" in outcome.out
    assert "No walk of the roadmap back to the start, up to 12.0 m, leaves less than " in outcome.out


@pytest.mark.parametrize(
    ("enough", "verdict", "told"),
    [
        (1.0, "enough", "Enough: no trip of up to 8 m improves the expected map error by more than 100 cm."),
        (0.0, "drive on", "Not enough yet: a trip of up to 8 m improves the expected map error by "),
    ],
)
def test_the_bound_decides_whether_any_trip_is_worth_driving(topobelief, office, enough, verdict, told):
    arguments = trip(office, "--max-length", 8, "--enough", enough)
    assert document(topobelief, arguments)["search"]["enough"] == verdict
    outcome = topobelief(arguments)
    assert outcome.code == 0
    assert told in outcome.out


def test_between_bound_and_best_trip_it_is_undecided(topobelief, office):
    arguments = trip(office, "--max-length", 12)
    found = document(topobelief, arguments)["search"]
    between = found["value_now"] - (found["value"] + found["lower_bound"]) / 2
    outcome = topobelief([*arguments, "--enough", str(between)])
    assert "Undecided: the best trip of up to 12 m improves" in outcome.out


def test_where_nothing_is_seen_again_staying_is_the_answer(topobelief, office):
    no_closures = ("--closures", "by-hand", "--min-index-gap", 1000)
    outcome = topobelief(trip(office, "--max-length", 6, *no_closures))
    assert "Nothing to gain within 6.0 m: no place in reach sees the map again." in outcome.out
    assert "Stay: " in outcome.out
    assert document(topobelief, to_goal(office, *no_closures))["best"] == 0


def test_a_trip_too_short_for_any_other_place_is_proven_to_gain_nothing(topobelief, office):
    arguments = trip(office, "--max-length", 0.001)
    found = document(topobelief, arguments)["search"]
    assert (len(found["path"]), found["lower_bound"]) == (1, found["value"])
    assert "Nothing to gain within 0.0 m: no place in reach sees the map again." in topobelief(arguments).out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--goal", "0", "99", "--max-length", "50"], "expected a goal on the map"),
        (["--goal", "0", "5", "--max-length", "5"], "expected --max-length of at least 11.5"),
        (["--goal", "0", "5", "--max-length", "20", "--candidates", "3"], "got --candidates, which compares a list"),
        (["--goal", "0", "5", "--max-length", "20", "--as-paper"], "got --as-paper, which compares a list"),
        (["--goal", "0", "5", "--max-length", "20", "--max-detour", "2"], "expected one limit of length, got --max-detour too"),
        (["--goal", "0", "5", "--return"], "expected a trip without a goal, got --return with --goal"),
        (["--goal", "0", "5", "--enough", "0.01"], "expected a trip without a goal, got --enough with --goal"),
        (["--return"], "or --max-length M for a trip to anywhere"),
        (["--max-length", "0"], "expected a number above 0, got 0"),
        (["--max-length", "9", "--enough", "-1"], "expected a number of at least 0, got -1"),
        (["--max-length", "9", "--proof", "none"], "got --proof, which compares a list"),
    ],
)
def test_what_contradicts_itself_is_refused_in_one_line(topobelief, office, tmp_path, options, message):
    outcome = topobelief(trip(office, "--out", "result", *options))
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert message in outcome.err
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_search_gives_the_best_so_far(topobelief, office, monkeypatch):
    from topobelief.search.local_search import LocalSearch

    def interrupted(*_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr(LocalSearch, "step", interrupted)
    outcome = topobelief(to_goal(office))
    assert outcome.code == 0
    assert "ended: interrupted" in outcome.out
    assert "Nothing is proven of other walks in this time: give more --seconds, or compare a list of paths" in outcome.out
