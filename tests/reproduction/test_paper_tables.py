"""Random graphs, anytime curves, path lengths and what bounds are worth: laws that their rows obey."""

from __future__ import annotations

import math
from itertools import permutations

import numpy as np
import pytest

import topobelief as tb
from topobelief.reproduction.anytime import anytime_rows, best_so_far, best_so_far_at_random
from topobelief.reproduction.bounds_quality import bounds_rows
from topobelief.reproduction.path_length import UNITS, length_rows
from topobelief.reproduction.planning_sessions import action_rows, office_session
from topobelief.reproduction.random_graphs import random_graph, random_graph_row


@pytest.mark.parametrize("degree_increase", [0.1, 0.75, 2.0])
def test_closures_raise_the_average_degree_by_what_was_asked(degree_increase: float) -> None:
    n = 200
    graph = random_graph(n, degree_increase, rng=np.random.default_rng(1))
    odometry, closures = graph.edges[: n - 1], graph.edges[n - 1 :]
    assert len(closures) == round(degree_increase * n / 2)
    assert 2 * len(closures) / n == pytest.approx(degree_increase, abs=1 / n)
    assert len(np.unique(closures, axis=0)) == len(closures)
    assert (closures[:, 0] - closures[:, 1] >= 2).all()
    assert np.linalg.norm(np.diff(graph.positions, axis=0), axis=1) == pytest.approx(np.ones(n - 1))
    assert np.array_equal(odometry[:, 0] + 1, odometry[:, 1])


def test_a_random_graph_is_the_same_whenever_it_is_drawn() -> None:
    first, again = (random_graph_row(50, 1.0, 3, 0, largest_spectrum=10) for _ in range(2))
    assert (first.joint, first.spanning_trees) == (again.joint, again.spanning_trees)
    assert math.isnan(first.von_neumann)
    assert random_graph_row(50, 1.0, 4, 0, largest_spectrum=10).joint != first.joint
    assert -first.spanning_trees >= first.joint  # UB


def test_the_expectation_over_random_orders_is_the_mean_over_all_of_them() -> None:
    values = [3.0, -1.0, 2.5, 7.0, -1.0]
    mean = np.mean([best_so_far(values, order) for order in permutations(range(5))], axis=0)
    assert best_so_far_at_random(values) == pytest.approx(mean)


def test_curves_fall_to_nothing_and_begin_at_what_the_signature_loses() -> None:
    rows = action_rows(office_session("S1", 2, 0.85))
    curves = anytime_rows(rows, [])
    for order in {row.order for row in curves}:
        losses = [row.loss for row in curves if row.order == order]
        assert losses == sorted(losses, reverse=True)
        assert losses[-1] == 0
    quality = tb.decision_quality([row.joint for row in rows], [row.von_neumann_approx for row in rows])
    assert next(row.loss for row in curves if row.order == "von_neumann_approx") == pytest.approx(quality.error)


def test_only_the_joint_entropy_depends_on_the_unit_of_length() -> None:
    rows = length_rows(0, 0.35, 5)
    changes = {
        (unit, objective): np.array([row.change for row in rows if (row.unit, row.objective) == (unit, objective)])
        for unit in UNITS
        for objective in ("joint", "map")
    }
    new_poses = np.array([action.num_new_poses for action in office_session("S2", 0, 0.35, num_paths=5).actions])
    assert changes["millimetres", "map"] == pytest.approx(changes["metres", "map"], abs=1e-6)
    shift = changes["millimetres", "joint"] - changes["metres", "joint"]
    assert shift == pytest.approx(2 * math.log(1000) * new_poses)
    assert sum(row.chosen for row in rows) == len(UNITS) * 3


def test_bounds_keep_their_promises_and_tighter_ones_are_worth_more() -> None:
    session = office_session("S2", 1, 0.85)
    rows = {row.bounds: row for row in bounds_rows("S2", 0.85, 1, session.graph, session.actions, ["joint"])}
    assert list(rows) == ["paper, Hadamard", "paper", "Fischer, Hadamard", "Fischer", "anchored"]
    assert all(row.true_error <= row.error_bound + 1e-6 for row in rows.values())
    for looser, tighter in (("paper, Hadamard", "paper"), ("paper", "Fischer"), ("Fischer, Hadamard", "Fischer")):
        assert rows[looser].num_eliminated <= rows[tighter].num_eliminated
        assert rows[looser].error_bound >= rows[tighter].error_bound - 1e-6
    assert all(row.num_evaluations <= row.num_actions - row.num_eliminated for row in rows.values())


def test_the_papers_bounds_are_left_out_where_noise_differs() -> None:
    session = office_session("S1", 0, 0.35)
    actions = [
        tb.Action(action.poses, action.edges, np.diag([50.0, 100.0, 900.0]), label=action.label) for action in session.actions
    ]
    names = [row.bounds for row in bounds_rows("S1", math.nan, 0, session.graph, actions, ["joint"])]
    assert names == ["Fischer, Hadamard", "Fischer", "anchored"]
