"""Values keep their arrays read-only, whichever way they are copied."""

import copy
import operator
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import topobelief as tb
from topobelief.simulation.scan import Scan

OMEGA = np.diag([100.0, 100.0, 400.0])
GRAPH = tb.PoseGraph([[0, 0, 0], [1, 0, 0], [1, 1, 2]], [(0, 1), (1, 2), (2, 0)], None, OMEGA, ids=[3, 5, 9], fixed=(1,))
SPATIAL = tb.PoseGraph([[0, 0, 0, 0, 0, 0, 1], [1, 0, 0, 0, 0, 0, 1]], [(0, 1)], None, [np.eye(6)])
ACTION = tb.Action([[2, 1, 0]], [(2, 3), (3, 0)], OMEGA, label="there", cost=1.5)
VALUES = {
    "pose graph": GRAPH,
    "pose graph in space": SPATIAL,
    "posterior": tb.posterior(GRAPH, ACTION),
    "action": ACTION,
    "stay": tb.Action([], [], OMEGA),
    "topology": GRAPH.topology,
    "decision": tb.Planner(GRAPH, engine="scratch").decide([ACTION, ACTION], proof="optimal"),
    "scan": Scan([2.0, np.inf, np.nan], [0.0, 1.0, 2.0], time=0.5, max_range=10.0),
}
WAYS = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "the oldest pickle": lambda value: pickle.loads(pickle.dumps(value, protocol=0)),
    "copy": copy.copy,
    "deep copy": copy.deepcopy,
    "twice": lambda value: copy.deepcopy(pickle.loads(pickle.dumps(value))),
}


def arrays_of(value):
    """Arrays among the attributes of a value, computed ones included, by name."""
    found = {}
    for name in (name for name in dir(value) if not name.startswith("__")):
        attribute = getattr(value, name)
        if isinstance(attribute, np.ndarray) and np.shares_memory(attribute, getattr(value, name)):
            found[name] = attribute
    return found


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", VALUES)
def test_copies_are_equal_and_read_only(name, way):
    value = VALUES[name]
    expected = arrays_of(value)
    copied = WAYS[way](value)
    assert type(copied) is type(value)
    found = arrays_of(copied)
    assert found.keys() == expected.keys()
    for attribute, array in found.items():
        np.testing.assert_array_equal(array, expected[attribute])
        if array.size:
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0


def test_a_copy_means_the_same():
    graph, action = copy.deepcopy((GRAPH, ACTION))
    assert (graph.fixed, action.label, action.cost) == ((1,), "there", 1.5)
    assert graph.edges is graph.topology.edges
    assert graph.topology.component_labels.tolist() == [0, 0, 0]
    decided = tb.Planner(graph, engine="scratch").decide([action, action], proof="optimal")
    assert decided.to_dict() == VALUES["decision"].to_dict() == copy.deepcopy(decided).to_dict()


def test_arrays_are_read_only_in_another_process_and_back():
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert not pool.submit(operator.attrgetter("poses.flags.writeable"), GRAPH).result()
        graph = pool.submit(operator.attrgetter("topology"), GRAPH).result()
    assert not graph.edges.flags.writeable
