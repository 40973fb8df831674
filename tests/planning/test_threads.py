"""Threads share a planner, and each gets its own answer."""

import random
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from graphs import SE2_GROUP, Noise, random_action, random_pose_graph
from topobelief.planning import planner as planner_module
from topobelief.planning.planner import Planner

NUM_THREADS = 4


def session(num_actions):
    rng, noise = np.random.default_rng(0), Noise(SE2_GROUP, "equal", 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, 50, 12)
    return graph, [random_action(rng, graph, noise, max_new=8, max_closures=6) for _ in range(num_actions)]


@pytest.fixture
def interleaved():
    """Threads take turns as often as the interpreter allows, and at the end of one function of planning in ten."""

    def linger(frame, event, argument):
        if event == "return" and "planning" in frame.f_code.co_filename and random.random() < 0.1:
            time.sleep(0.002)

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    threading.setprofile(linger)
    yield
    threading.setprofile(None)
    sys.setswitchinterval(interval)


@pytest.mark.parametrize(("work", "repetitions"), [(np.inf, 20), (0, 30)], ids=["from scratch", "by increments"])
def test_each_thread_gets_the_bounds_of_its_own_actions(monkeypatch, interleaved, work, repetitions):
    """Two threads ask for the same action, the others for others."""
    monkeypatch.setattr(planner_module, "_INCREMENTAL_WORK", work)
    graph, (a, b, c) = session(3)
    lists = [[a], [a], [b], [c]]
    expected = [Planner(graph).decide(actions).to_dict() for actions in lists]
    shared = Planner(graph)

    def answers(number):
        return [shared.decide(lists[number]).to_dict() for _ in range(repetitions)]

    with ThreadPoolExecutor(NUM_THREADS) as pool:
        for number, found in enumerate(pool.map(answers, range(NUM_THREADS))):
            assert found == repetitions * [expected[number]]


def test_a_planner_may_be_asked_while_it_tells_of_progress():
    graph, actions = session(3)
    planner = Planner(graph)
    expected = planner.decide(actions, proof="optimal").to_dict()
    told = []
    found = planner.decide(actions, proof="optimal", on_progress=lambda *_: told.append(planner.decide(actions[:1]).best))
    assert found.to_dict() == expected
    assert set(told) == {0}
