"""Threads share a planner, and each gets its own answer: nothing in it belongs to one decision."""

import random
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from graphs import SE2_GROUP, Noise, random_action, random_pose_graph
from topobelief.planning.planner import Planner

NUM_THREADS = 8
ENGINES = ("incremental", "scratch")


def session(num_actions, *, num_poses=50):
    rng, noise = np.random.default_rng(0), Noise(SE2_GROUP, "equal", 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, num_poses, num_poses // 4)
    return graph, [random_action(rng, graph, noise, max_new=8, max_closures=6) for _ in range(num_actions)]


@pytest.fixture
def switching():
    """Threads take turns as often as the interpreter allows."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


@pytest.fixture
def lingering(switching):
    """And at the end of one function of planning in ten."""

    def linger(frame, event, argument):
        if event == "return" and "planning" in frame.f_code.co_filename and random.random() < 0.1:
            time.sleep(0.002)

    threading.setprofile(linger)
    yield
    threading.setprofile(None)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.usefixtures("lingering")
def test_each_thread_gets_the_bounds_of_its_own_actions(engine):
    """Two threads ask for the same action, the others for others."""
    graph, (a, b, c) = session(3)
    lists = [[a], [a], [b], [c]]
    expected = [Planner(graph, engine=engine).decide(actions).to_dict() for actions in lists]
    shared = Planner(graph, engine=engine)

    def answers(number):
        return [shared.decide(lists[number]).to_dict() for _ in range(20)]

    with ThreadPoolExecutor(len(lists)) as pool:
        for number, found in enumerate(pool.map(answers, range(len(lists)))):
            assert found == 20 * [expected[number]]


@pytest.mark.usefixtures("switching")
@pytest.mark.parametrize(("bounds", "engine", "count"), [("chain", ENGINES[0], 4000), ("fischer", ENGINES[1], 1000)])
def test_5000_decisions_in_8_threads(bounds, engine, count):
    graph, actions = session(40, num_poses=8)
    lists = [actions[n : n + 2] for n in range(0, 40, 2)]
    expected = [Planner(graph, bounds=bounds, engine=engine).decide(each).to_dict() for each in lists]
    planner = Planner(graph, bounds=bounds, engine=engine)
    order = np.random.default_rng(1).integers(len(lists), size=count).tolist()
    with ThreadPoolExecutor(NUM_THREADS) as pool:
        found = list(pool.map(lambda which: planner.decide(lists[which]).to_dict(), order))
    assert found == [expected[which] for which in order]


def test_a_planner_may_be_used_while_it_reports_progress():
    graph, actions = session(3)
    planner = Planner(graph)
    expected = planner.decide(actions, proof="optimal").to_dict()
    choices = []
    found = planner.decide(actions, proof="optimal", on_progress=lambda *_: choices.append(planner.decide(actions[:1]).best))
    assert found.to_dict() == expected
    assert set(choices) == {0}
