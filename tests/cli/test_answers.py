"""Answers for the page and for ROS: what is published, and what later situations take over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

import topobelief as tb
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.start import find_start
from topobelief.io.floor_plan import read_world
from topobelief.page.question import Question

pytest.importorskip("numba")
from topobelief.cli.answers import Answers

QUESTION = Question((0.0, 5.0), False, None, "error", "learned", 0, "auto")


def answered(answers: Answers, question: Question = QUESTION) -> Mapping[str, Any]:
    said: dict[str, Any] = {}
    answers(question, said.update, lambda: False)
    return said


def answers_of(graph: tb.PoseGraph, world: tb.World) -> Answers:
    return Answers(graph, world, find_start(graph), CandidateRule(num_vertices=150), 1.6, 60.0, max_evaluations=60)


def test_the_values_of_an_answer_are_those_of_a_planner(office: Any) -> None:
    graph, world = office.graph, read_world(office.map_file)
    said = answered(answers_of(graph, world))
    best = said["ways"][said["best"]]
    paths = [way["path"] for way in said["ways"]]
    actions = tb.predict_actions(graph, paths, world=world, turn=None)
    values = tb.Planner(graph, objective="error").entropies(actions)
    assert values.argmin() == said["best"]
    assert best["value"] == f"{100 * values.min():.2f} cm"
    assert best["rank"] == 0
    assert said["front_bounds"][-1]["value"] <= values.min() + 1e-9


def test_a_situation_that_has_grown_takes_over_planners_and_roadmap_and_answers_alike(office: Any) -> None:
    graph, world = office.graph, read_world(office.map_file)
    earlier = answers_of(graph.part(range(18)), world)
    answered(earlier)
    later = answers_of(graph, world).continuing(earlier)
    assert len(later.roadmap.vertices) == len(earlier.roadmap.vertices) + 2
    assert (later.roadmap.vertices[0] == later.start.place).all()
    said, fresh = answered(later), answered(answers_of(graph, world))
    shortest = [min(way["length"] for way in each["ways"]) for each in (said, fresh)]
    assert shortest[0] == pytest.approx(shortest[1], rel=0.01)
    assert answers_of(graph, read_world(office.map_file)).continuing(earlier).roadmap is not later.roadmap


def test_candidates_are_compared_with_bounds_and_reasons(office: Any) -> None:
    answers = answers_of(office.graph, read_world(office.map_file))
    said = answered(answers, Question((0.0, 5.0), False, None, "joint", "paper", 20, "fischer"))
    assert said["front"] == []
    assert len(said["ways"]) > 1
    assert {way["standing"] for way in said["ways"]} <= {"best", "possible", "ruled-out"}
    assert all(way["why"].startswith(way["name"]) for way in said["ways"])
