"""Strategies choose what they say they choose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.candidates.propose import CandidateRule, predict_along
from topobelief.candidates.roadmap import build_roadmap
from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.planning.registry import OBJECTIVES, SIGNATURES, imported
from topobelief.strategies import choose as choose_module
from topobelief.strategies.choice import Reasons
from topobelief.strategies.choose import choose
from topobelief.strategies.question import Ground, Question
from topobelief.strategies.registry import STRATEGIES, checked_strategy, proposes
from topobelief.world import World

INFORMATION = np.diag([100.0, 100.0, 800.0])


@pytest.fixture(scope="module")
def question():
    """A drive out, and three ways to a place beside it: straight, along the drive, and far around."""
    poses = [(float(x), 0.0, 0.0) for x in range(11)]
    graph = PoseGraph(poses, [(i, i + 1) for i in range(10)], None, INFORMATION)
    paths = [
        np.array([(10, 0), (10, 5), (1, 5), (1, 1.5)], dtype=float),
        np.array([(10, 0), (9, 1), (1, 1), (1, 1.5)], dtype=float),
        np.array([(10, 0), (10, 9), (1, 9), (1, 1.5)], dtype=float),
    ]
    actions = predict_actions(graph, paths)
    return graph, actions, np.array([path_length(path) for path in paths])


WORLD = World.from_boxes([(4, 2, 6, 4)], bounds=(-2, -2, 12, 10))
RULE = CandidateRule(max_detour=1.5, turn=None)
AMONG_CANDIDATES = [name for name in STRATEGIES if not proposes(name)]


@pytest.fixture(scope="module")
def ground():
    goal = (1.0, 1.5)
    return Ground(build_roadmap(WORLD, (10, 0), goal, 100, 0.3), goal, WORLD, RULE)


def chosen(question, strategy, *, objective="joint", seed=0, ground=None):
    return choose(strategy, Question(*question, np.random.default_rng(seed).random(3), objective, ground=ground))


@pytest.mark.parametrize("objective", list(OBJECTIVES))
def test_those_that_evaluate_find_the_least_objective(question, objective):
    graph, actions, _ = question
    best = int(np.argmin(Planner(graph, objective=objective).entropies(actions)))
    assert chosen(question, "standard", objective=objective).index == best
    optimum = chosen(question, "optimum", objective=objective)
    assert optimum.index == best
    assert optimum.decision.proven_optimal
    assert optimum.reasons.proven_optimal
    assert optimum.reasons.scores is None


@pytest.mark.parametrize("objective", list(OBJECTIVES))
def test_reasons_hold(question, objective):
    """The bounds of a choice contain its objective, and no candidate is better by more than the error bound."""
    graph, actions, _ = question
    values = Planner(graph, objective=objective).entropies(actions)
    with_reasons = [*SIGNATURES, "optimum", "standard"]
    for strategy in AMONG_CANDIDATES:
        choice = chosen(question, strategy, objective=objective)
        reasons, value = choice.reasons, values[choice.index]
        if strategy in with_reasons:
            assert reasons.lower - 1e-9 <= value <= reasons.upper + 1e-9
            assert value - values.min() <= reasons.error_bound + 1e-9
        else:
            assert (reasons.lower, reasons.error_bound, reasons.num_evaluations) == (None, None, 0)
    assert chosen(question, "standard", objective=objective).reasons.num_evaluations == len(actions)


@pytest.mark.parametrize("strategy", ["shortest", "random", *SIGNATURES])
def test_the_largest_score_is_chosen(question, strategy):
    choice = chosen(question, strategy)
    assert choice.index == int(np.argmax(choice.reasons.scores))


@pytest.mark.parametrize("strategy", [*STRATEGIES, "path-2"])
def test_seconds_end_with_the_answer(question, ground, strategy, monkeypatch):
    """The clock runs from the question to the index for every strategy alike; the reasons are worked out after it stops."""
    events = []

    class Clock:
        @staticmethod
        def perf_counter():
            events.append("clock")
            return float(len(events))

    def timed(place):
        function = load(place)

        def strategy_seen(name, question):
            index, reasons = function(name, question)
            events.append("answer")

            def reasons_seen():
                events.append("reasons")
                return reasons()

            return index, reasons_seen

        return strategy_seen

    load = choose_module.imported
    monkeypatch.setattr(choose_module, "time", Clock)
    monkeypatch.setattr(choose_module, "imported", timed)
    choice = chosen(question, strategy, ground=ground)
    assert events == ["clock", "answer", "clock", "reasons"]
    assert choice.seconds == 2.0


def test_a_ranking_computes_bounds_only_as_reasons(question, monkeypatch):
    proofs = []
    decide = Planner.decide

    def seen(self, actions, *, proof="bounded", **options):
        proofs.append(proof)
        return decide(self, actions, proof=proof, **options)

    monkeypatch.setattr(Planner, "decide", seen)
    _, reasons = imported(STRATEGIES["spanning_trees"])("spanning_trees", Question(*question, np.zeros(3), "joint"))
    assert proofs == ["none"]
    assert isinstance(reasons(), Reasons)
    assert proofs == ["none", "bounded"]


def test_a_question_knows_its_signature_and_unit(question):
    asked = Question(*question, np.zeros(3), "error")
    assert asked.unit == "m"
    assert asked.planner().decide(asked.actions).signature == "resistance"
    assert chosen(question, "optimum", objective="joint").decision.signature == "spanning_trees"


@pytest.mark.parametrize("signature", ["spanning_trees", "von_neumann", "von_neumann_approx"])
def test_a_signature_takes_the_first_of_its_ranking(question, signature):
    choice = chosen(question, signature)
    assert choice.index == choice.decision.ranking[0]
    assert choice.decision.signature == signature
    assert np.isfinite(choice.decision.error_bound)


def test_lengths_alone(question):
    lengths = question[2]
    order = np.argsort(lengths).tolist()
    assert chosen(question, "shortest").index == order[0]
    assert [chosen(question, f"path-{k}").index for k in range(4)] == [*order, order[-1]]
    assert chosen(question, "shortest").decision is None


def test_random_draws_all_of_them_and_repeats_itself(question):
    draws = [chosen(question, "random", seed=seed).index for seed in range(30)]
    assert set(draws) == {0, 1, 2}
    assert draws == [chosen(question, "random", seed=seed).index for seed in range(30)]


def test_unknown_strategies_are_refused():
    assert [checked_strategy(name) for name in STRATEGIES] == list(STRATEGIES)
    for name in ("spanning", "path-", "path-01", "path-1x"):
        with pytest.raises(InvalidInputError, match="spanning_trees"):
            checked_strategy(name)


@pytest.mark.parametrize("limit", [1.5, None])
def test_roadmap_finds_a_path_of_its_own(question, ground, limit):
    """No longer than candidates may be, and as good as any path of the roadmap that was made otherwise."""
    graph, actions, lengths = question
    rule = replace(ground.rule, max_detour=limit)
    on_roadmap = diverse_paths(ground.roadmap, (10, 0), ground.goal, 20, limit or 2.0)
    lengths = np.array([path_length(path) for path in on_roadmap])
    actions = predict_along(graph, WORLD, on_roadmap, rule)
    asked = Question(graph, actions, lengths, np.zeros(len(actions)), "error", ground=replace(ground, rule=rule))
    choice = choose("roadmap", asked)
    assert choice.index == len(actions)
    joined = asked.joined_by(choice.proposal)
    values = joined.values()
    assert len(joined.actions) == len(joined.lengths) == len(joined.random_scores) == len(actions) + 1
    assert values[-1] <= values.min() + 1e-9
    assert joined.lengths[-1] <= lengths.max() + 1e-9 if limit is None else joined.lengths[-1] <= 1.5 * lengths.min() + 1e-9
    assert asked.joined_by(None) is asked


def test_roadmap_needs_one(question):
    with pytest.raises(InvalidInputError, match='expected a roadmap for the strategy "roadmap" to search'):
        chosen(question, "roadmap")
