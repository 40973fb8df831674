"""Threads may share a planner: nothing in it belongs to one decision."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from graphs import SE2_GROUP, Noise, random_action, random_pose_graph
from topobelief.planning.planner import Planner

NUM_THREADS = 8
NUM_DECISIONS = 5000


@pytest.fixture
def switching_often():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("switching_often")
@pytest.mark.parametrize(
    ("engine", "bounds", "share"), [("incremental", "chain", 0.4), ("scratch", "fischer", 0.2), ("incremental", "auto", 0.4)]
)
def test_decisions_in_threads_are_those_made_one_after_the_other(engine, bounds, share):
    rng = np.random.default_rng(0)
    graph = random_pose_graph(rng, Noise(SE2_GROUP, "full", 10.0, 0.5, 1.0), 8, 4)
    noise = Noise(SE2_GROUP, "full", 10.0, 0.5, 1.0)
    sessions = [[random_action(rng, graph, noise) for _ in range(2)] for _ in range(20)]
    alone = [Planner(graph, engine=engine, bounds=bounds).decide(actions) for actions in sessions]
    planner = Planner(graph, engine=engine, bounds=bounds)
    order = rng.integers(len(sessions), size=int(share * NUM_DECISIONS)).tolist()
    with ThreadPoolExecutor(NUM_THREADS) as pool:
        found = list(pool.map(lambda which: planner.decide(sessions[which]), order))
    for which, decision in zip(order, found, strict=True):
        expected = alone[which]
        assert decision.best == expected.best
        np.testing.assert_array_equal(decision.signatures, expected.signatures)
        np.testing.assert_array_equal(decision.lower, expected.lower)
        np.testing.assert_array_equal(decision.upper, expected.upper)
