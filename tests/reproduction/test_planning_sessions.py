"""The sessions follow the paper's rules, and rows hold what the public functions give."""

from __future__ import annotations

import numpy as np
import pytest

import topobelief as tb
from topobelief.reproduction.planning_sessions import action_rows, office_session, session_information
from topobelief.reproduction.trajectory_uncertainty import best_and_worst


@pytest.mark.parametrize(("name", "start", "goal", "count"), [("S1", (20, 0), (26, 8), 9), ("S2", (26, 8), (25, -2.95), 20)])
def test_sessions_are_those_of_the_paper(name: str, start: tuple[float, float], goal: tuple[float, float], count: int) -> None:
    session = office_session(name, 0, 0.35)  # type: ignore[arg-type]
    assert session.graph.positions[-1] == pytest.approx(start)
    assert len(session.paths) == len(session.actions) == count
    n = session.graph.num_poses
    for action in session.actions:
        assert action.poses[-1, :2] == pytest.approx(goal)
        after = tb.posterior(session.graph, action)
        steps = np.linalg.norm(np.diff(after.positions[n - 1 :], axis=0), axis=1)
        assert (steps <= 1 + 1e-9).all()  # along the path; shorter across its corners
        new, old = action.edges[action.num_new_poses :].T
        assert (new - old >= 2).all()
        assert (np.linalg.norm(after.positions[new] - after.positions[old], axis=1) < 2.0).all()
        turned = after.poses[new, 2] - after.poses[old, 2]
        assert (np.abs((turned + np.pi) % (2 * np.pi) - np.pi) <= 1.0 + 1e-9).all()
        assert np.array_equal(after.information[-1], session_information(0.35))


def test_the_second_session_plans_on_what_the_first_has_left() -> None:
    first, second = office_session("S1", 0, 0.35), office_session("S2", 0, 0.35)
    signatures = tb.Planner(first.graph).decide(first.actions, proof="none").signatures
    expected = tb.posterior(first.graph, first.actions[int(np.argmax(signatures))])
    assert np.array_equal(second.graph.poses, expected.poses)
    assert np.array_equal(second.graph.edges, expected.edges)


def test_rows_hold_what_the_public_functions_give() -> None:
    session = office_session("S1", 0, 0.85)
    for row, action in zip(action_rows(session), session.actions, strict=True):
        after = tb.posterior(session.graph, action)
        assert row.joint == pytest.approx(tb.joint_entropy(after), abs=1e-9)
        assert row.spanning_trees == pytest.approx(tb.spanning_tree_signature(after.topology, after.information[0]), abs=1e-9)
        assert row.von_neumann == pytest.approx(tb.von_neumann_entropy(after.topology), abs=1e-9)
        assert row.von_neumann_approx == pytest.approx(tb.von_neumann_entropy_approx(after.topology), abs=1e-9)
        paper = tb.entropy_bounds(after, family="paper", anchor=0)  # S1's last pose is its first
        assert (row.paper_lower, row.paper_upper) == pytest.approx((paper.lower, paper.upper), abs=1e-6)
        assert row.paper_hadamard <= row.paper_lower <= row.fischer_lower + 1e-9
        assert row.fischer_lower <= row.joint <= row.fischer_upper
        assert row.anchored_lower <= row.joint <= row.anchored_upper


def test_best_and_worst_are_known_as_well_as_their_entropies_say() -> None:
    best, worst = best_and_worst(office_session("S1", 0, 0.35))
    assert best.entropy < worst.entropy
    assert best.covariances.shape == (best.graph.num_poses, 2, 2)
    assert np.all(best.covariances[0] == 0)
    trace = [np.trace(each.covariances[-1]) for each in (best, worst)]  # both end at the goal
    assert trace[0] < trace[1]
