"""Components of a pose graph are pose graphs that add up to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from graphs import pose_graphs
from topobelief.graph.components import components
from topobelief.graph.pose_graph import PoseGraph


@given(graph=pose_graphs())
def test_two_graphs_side_by_side_come_apart_again(graph: PoseGraph):
    """The same graph twice and one pose alone: both copies are returned as they were, in order of their first pose."""
    n = graph.num_poses
    both = PoseGraph(
        np.concatenate([graph.poses, graph.poses[:1], graph.poses]),
        np.concatenate([graph.edges + n + 1, graph.edges]),
        np.concatenate([graph.measurements, graph.measurements]),
        np.concatenate([graph.information, graph.information]),
        ids=10 * np.arange(2 * n + 1),
        fixed=(0, n, n + 1),
    )
    parts = components(both)
    assert [part.ids[0] for part in parts] == ([0, 10 * (n + 1), 10 * n] if n > 1 else [0, 10, 20])
    assert all(part.fixed == (0,) for part in parts)
    for part in parts[:2] if n > 1 else []:
        for name in ("poses", "edges", "measurements", "information"):
            assert np.array_equal(getattr(part, name), getattr(graph, name))
    assert sum(part.chi2 for part in parts) == pytest.approx(both.chi2)
