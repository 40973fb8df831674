"""The engine's kernels one by one, on a generated graph of 10 000 poses: `make bench`, or pytest with pytest-benchmark.

`pytest -o addopts= benchmarks/kernels.py --benchmark-autosave`, later with `--benchmark-compare`, tells what a change did.
"""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.benchmark.certificates import block_isotropic
from topobelief.benchmark.sessions import candidate_paths, city_drive
from topobelief.forms.action_batch import ActionBatch
from topobelief.forms.degree_sums import DegreeSums
from topobelief.graph.action import check_actions
from topobelief.graph.fisher import fisher_rows
from topobelief.linalg.edge_form import laplacian_form
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.elimination_tree import EliminationTree
from topobelief.linalg.increments import log_det_increments

HELD = 9_999
RNG = np.random.default_rng(0)
GRAPH = city_drive(10_000, block_isotropic(0.1, 0.035), rng=RNG)
ACTIONS = candidate_paths(GRAPH, 1000, rng=RNG)
FORMS = {
    "Laplacian": lambda rows: laplacian_form(rows.edges, np.ones(len(rows.edges))),
    "information": lambda rows: rows.joint(),
}


@pytest.fixture(scope="module")
def tree():
    return EliminationTree.build(GRAPH.edges, GRAPH.num_poses, HELD)


def test_order_and_symbolic_factor(benchmark):
    benchmark(EliminationTree.build, GRAPH.edges, GRAPH.num_poses, HELD)


def test_symbolic_factor_in_a_known_order(benchmark, tree):
    benchmark(tree.adapted, GRAPH.edges, GRAPH.num_poses, HELD)


@pytest.mark.parametrize("name", FORMS)
def test_factor_with_error_estimate(benchmark, tree, name):
    benchmark(FormFactor.of, tree, FORMS[name](fisher_rows(GRAPH)))


@pytest.mark.parametrize("name", FORMS)
def test_paths_of_all_touched_poses(benchmark, tree, name):
    edges = np.concatenate([action.edges.ravel() for action in ACTIONS])
    places = np.unique(tree.position[edges[edges < GRAPH.num_poses]])
    factor = FormFactor.of(tree, FORMS[name](fisher_rows(GRAPH)))
    benchmark(factor.paths, places[places >= 0])


@pytest.mark.parametrize("name", FORMS)
def test_increments_of_1000_actions_with_their_paths(benchmark, tree, name):
    batch = ActionBatch(GRAPH, ACTIONS)
    factor = FormFactor.of(tree, FORMS[name](fisher_rows(GRAPH)))
    benchmark(log_det_increments, factor, batch.extensions, FORMS[name](batch.rows))


def test_degrees_of_1000_actions(benchmark):
    batch, sums = ActionBatch(GRAPH, ACTIONS), DegreeSums(GRAPH.topology)
    benchmark(sums.of_extensions, batch.edges, batch.edge_start, batch.num_new)


def test_whitened_rows_of_1000_actions(benchmark):
    benchmark(lambda: ActionBatch(GRAPH, ACTIONS).rows)


def test_checks_of_1000_actions(benchmark):
    benchmark(check_actions, GRAPH, ACTIONS)
