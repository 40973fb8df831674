"""Decisions on a graph in which a few edges are far stronger than the others."""

import numpy as np
import pytest

from topobelief import Action, Planner, PoseGraph
from topobelief.linalg import log_det


def winding(num_poses, start, rng):
    heading = start[2] + np.cumsum(rng.normal(0, 0.3, num_poses))
    positions = start[:2] + np.cumsum(np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    return np.column_stack([positions, heading])


@pytest.mark.parametrize("bounds", ["fischer", "anchored"])
def test_three_strong_edges_among_300_poses_change_no_bound_and_need_no_qr(bounds, monkeypatch):
    """Strong edges hold their poses together: the same graph with weaker ones differs by what these edges know alone."""
    monkeypatch.setattr(log_det, "log_det_by_qr", lambda *arguments: pytest.fail("QR"))
    rng = np.random.default_rng(0)
    n, strong = 300, {75: 1.3e10, 150: 1.7e12, 225: 1.1e13}
    edges = [(i, i + 1) for i in range(n - 1)]
    edges += [tuple(rng.choice(n, 2, replace=False).tolist()) for _ in range(60)]
    poses, usual = winding(n, np.zeros(3), rng), np.diag([100.0, 100.0, 400.0])
    actions = []
    for _ in range(6):
        chain = [(n - 1, n)] + [(n + i, n + i + 1) for i in range(7)]
        closures = [(n + int(rng.integers(8)), int(rng.integers(n - 5))) for _ in range(4)] + [(n + 7, 75), (n + 5, 76)]
        actions.append(Action(winding(8, poses[-1], rng), chain + closures, usual))

    def decided(factor):
        information = np.tile(usual, (len(edges), 1, 1))
        for edge, strength in strong.items():
            information[edge] = factor * strength * np.eye(3)
        planner = Planner(PoseGraph(poses, edges, None, information), bounds=bounds)
        decision = planner.decide(actions, proof="bounded")
        return np.stack([decision.signatures, decision.lower, decision.upper]), planner.entropies(actions)

    (rows, entropies), (rows_of_weaker, entropies_of_weaker) = decided(1.0), decided(1e-3)
    known = 3 * 1.5 * np.log(1e-3)
    assert np.allclose(entropies - entropies_of_weaker, known, atol=1e-3)
    assert np.allclose(rows[0] - rows_of_weaker[0], -known, atol=1e-3)
    assert (rows[1] <= entropies + 1e-6).all()
    assert (entropies <= rows[2] + 1e-6).all()
