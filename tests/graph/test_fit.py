"""A graph that is far from its estimate is noticed, once, and no other is."""

import warnings

import numpy as np
import pytest

from topobelief import Action, Planner, PoseGraph, joint_entropy, optimize, posterior
from topobelief.errors import NotOptimizedWarning
from topobelief.graph.fit import misfit

OMEGA = np.diag([100.0, 100.0, 400.0])
SQUARE = np.array([[0, 0, 0], [5, 0, np.pi / 2], [5, 5, np.pi], [0, 5, -np.pi / 2]])
LOOP = [(0, 1), (1, 2), (2, 3), (3, 0)]
FITS = PoseGraph(SQUARE, LOOP, None, OMEGA)
FAR = PoseGraph(SQUARE * [1, 3, 1], LOOP, FITS.measurements, OMEGA)  # stretched to a rectangle
TREE = PoseGraph(SQUARE, LOOP[:3], 3 * FITS.measurements[:3], OMEGA)


def warnings_of(call, count: int) -> list[str]:
    """Messages of so many calls from one place, as Python shows them by default."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        for _ in range(count):
            call()
    return [str(each.message) for each in caught if each.category is NotOptimizedWarning]


@pytest.mark.parametrize("call", [lambda: joint_entropy(FAR), lambda: Planner(FAR)], ids=["entropy", "planner"])
def test_a_graph_far_from_its_estimate_warns_once(call):
    (message,) = warnings_of(call, 3)
    assert f"χ² per degree of freedom is about {FAR.chi2 / FAR.degrees_of_freedom:.0e}" in message
    assert "topobelief.optimize" in message


@pytest.mark.parametrize("call", [joint_entropy, Planner])
def test_the_warning_names_the_line_of_the_caller(call):
    with pytest.warns(NotOptimizedWarning) as caught:
        call(FAR)
    assert caught[0].filename == __file__


def test_candidates_on_such_a_graph_do_not_each_warn():
    """Closures change chi^2 per degree of freedom a little, and with it no digit of the message."""
    after = [posterior(FAR, Action([[0, y, 0]], [(3, 4), (4, 0)], OMEGA)) for y in (4, 5, 6)]
    assert len(warnings_of(lambda: [joint_entropy(graph) for graph in after], 2)) == 1


def test_at_the_estimate_measurements_are_to_blame():
    assert "optimise the graph first" in misfit(FAR)
    assert "false loop closures" in misfit(FAR, optimized=True)


@pytest.mark.parametrize(
    "graph",
    [
        FITS,
        optimize(FAR),
        TREE,
        PoseGraph([[0, 0, 0]], [], None, OMEGA),
    ],
    ids=["fits", "optimised", "tree", "single"],
)
def test_others_do_not(graph):
    assert misfit(graph) is None
    assert warnings_of(lambda: (joint_entropy(graph), Planner(graph)), 1) == []
