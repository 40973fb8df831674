"""Decisions judged by entropy and by error: rows hold what the public functions give, whatever the place."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import topobelief as tb
from reproductions import smallest_reproduction
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.propose import CandidateRule, propose
from topobelief.reproduction import entropy_or_error as experiment
from topobelief.reproduction.claims.entropy_or_error import choice_claims
from topobelief.reproduction.entropy_or_error import CHOOSERS, CLOSURES, DETOURS, ChoiceRow, choice_rows, summaries
from topobelief.reproduction.planning_sessions import NOISES, office_session, session_information

ROW = ChoiceRow(
    *("lab", 0, 0.35, 2.5, "single", 100, 20, 4.0),
    *(0.5, 0.2, 0.4, "resistance", 0.001, 3.0, 5.0, 0.9, 0.8, 0.7, 0.001),
)


def test_every_decision_is_judged_for_every_way_to_choose() -> None:
    rows = smallest_reproduction().choices
    assert len(rows) == len(CHOOSERS) * len(CLOSURES) * len(DETOURS) * len(NOISES)
    for row in rows:
        assert min(row.error_lost, row.map_lost, row.joint_lost) >= 0
        assert row.least_error <= min(row.shortest_error, row.error_before) + 1e-9
        if row.chooser == "shortest":
            assert row.error_lost == pytest.approx(row.shortest_error - row.least_error, abs=1e-8)
        for objective, lost, correlation in (
            ("error", row.error_lost, row.error_correlation),
            ("map", row.map_lost, row.map_correlation),
            ("joint", row.joint_lost, row.joint_correlation),
        ):
            if row.chooser == objective:
                assert lost == 0
                assert math.isnan(correlation) or correlation == pytest.approx(1)


def test_rows_hold_what_the_public_functions_give() -> None:
    session, information = office_session("S2", 0, 0.35), session_information(0.85)
    graph = experiment.with_noise(session.graph, information)
    rule = CandidateRule(num_paths=4, max_detour=2.5, turn=None, line_of_sight=False, information=information)
    rule = replace(rule, closures=ClosureModel.paper())
    actions = propose(graph, session.world, graph.positions[-1], session.goal, rule).actions
    errors = [tb.expected_errors(graph, action).map_rmse for action in actions]
    topologies = [tb.posterior(graph, action).topology for action in actions]
    chosen = int(np.argmax([tb.resistance_signature(after, information, graph.num_poses) for after in topologies]))
    (row,) = (
        row
        for row in smallest_reproduction().choices
        if (row.xi, row.max_detour, row.closures, row.chooser) == (0.85, 2.5, "paper", "resistance")
    )
    assert row.num_actions == len(actions) == 4
    assert row.num_closures == np.mean([action.num_closures for action in actions])
    assert row.error_before == pytest.approx(tb.expected_errors(graph).map_rmse)
    assert row.least_error == pytest.approx(min(errors))
    assert row.error_lost == pytest.approx(errors[chosen] - min(errors), abs=1e-8)


def test_a_drive_ends_at_one_place_and_closes_loops_as_its_kind_says() -> None:
    situation = experiment._on_map("office", 3)
    ends = [graph.positions[-1] for graph in situation.graphs.values()]
    for end in ends:
        assert end == pytest.approx(situation.start)
    closures = {kind: graph.num_edges - graph.num_poses + 1 for kind, graph in situation.graphs.items()}
    assert 0.3 < closures["learned"] / closures["single"] < 0.7
    most = {}
    for kind, graph in situation.graphs.items():
        late, early = graph.edges.max(axis=1), graph.edges.min(axis=1)
        most[kind] = int(np.bincount(late[late - early > 1]).max())
    assert most["learned"] == most["single"] == 1 < most["paper"]


def test_recorded_graphs_keep_their_own_noise_too(tmp_path: Path) -> None:
    angles = np.linspace(0, 2 * np.pi, 41)
    poses = np.column_stack([6 * np.cos(angles), 6 * np.sin(angles), angles + np.pi / 2])
    edges = [*zip(range(40), range(1, 41), strict=True), (40, 0)]
    path = tmp_path / "round.g2o"
    tb.write_g2o(tb.PoseGraph(poses, edges, None, np.diag([50.0, 50.0, 200.0])), path)
    rows = choice_rows(path, 0, 3, largest=41)
    assert {row.place for row in rows} == {"round"}
    assert {row.xi for row in rows if not math.isnan(row.xi)} == set(NOISES)
    assert any(math.isnan(row.xi) for row in rows)
    assert choice_rows(path, 0, 3, largest=40) == []


def test_summaries_are_means_and_medians_by_case() -> None:
    rows = [ROW, replace(ROW, seed=1, error_lost=0.003, error_correlation=math.nan), replace(ROW, chooser="map")]
    first, second = summaries(rows)
    assert (first.chooser, first.num_decisions, second.chooser, second.num_decisions) == ("resistance", 2, "map", 1)
    assert (first.mean_error_lost, first.max_error_lost) == pytest.approx((0.2, 0.3))  # centimetres
    assert (first.mean_share_lost, first.max_share_lost) == pytest.approx((1.0, 1.5))  # per cent
    assert first.error_correlation == 0.9
    assert first.milliseconds == pytest.approx(1.0)


def test_claims_hold_where_every_decision_has_it_so() -> None:
    other = replace(ROW, chooser="map_spanning_trees", error_lost=0.01, error_correlation=0.5)
    verdicts = [claim.holds for claim in choice_claims([ROW, other])]
    assert verdicts == [True, False, True]  # 0.5 % and 5 % lost; 0.9 against 0.5
    again = [replace(each, seed=1) for each in (ROW, replace(other, error_correlation=0.95))]
    (_, _, ranks) = choice_claims([ROW, other, *again])
    assert (ranks.holding, ranks.cases, ranks.holds) == (1, 2, False)
    ties = [replace(each, error_correlation=math.nan) for each in (ROW, other)]
    (_, _, ranks) = choice_claims([ROW, ties[1], *ties])
    assert (ranks.holding, ranks.cases) == (1, 1)  # where all candidates are equally good, there is nothing to rank
