"""Engines as tests ask them, and one in dense NumPy, the reference of the others."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from references import alignment_reference
from topobelief.arrays import FloatArray
from topobelief.bounds.options import BoundOptions
from topobelief.forms.of_graph import GraphForms
from topobelief.forms.protocol import ClosureForms
from topobelief.graph.action import landmark_ends
from topobelief.graph.alignment import sample_of
from topobelief.graph.fisher import fisher_rows
from topobelief.linalg.estimate import Estimate
from topobelief.linalg.extensions import Extensions
from topobelief.planning.batch import Batch, Criteria
from topobelief.planning.engine import Engine
from topobelief.planning.incremental_engine import IncrementalEngine


@dataclass
class Judge:
    """Signatures, bounds and entropies by one engine, as arrays with their errors."""

    engine: Engine
    criteria: Criteria

    def batch(self, actions) -> Batch:
        return Batch(self.engine, self.criteria, list(actions))

    def signatures(self, actions) -> tuple[FloatArray, FloatArray]:
        found = self.batch(actions).signatures()
        return found.value, found.error

    def bounds(self, actions) -> tuple[FloatArray, FloatArray]:
        return self.batch(actions).bounds()

    def entropies(self, actions) -> tuple[FloatArray, FloatArray]:
        found = self.batch(actions).entropies()
        return found.value, found.error

    def extended(self, graph, anchor) -> Judge:
        return Judge(self.engine.extended(graph, anchor), self.criteria)


def judge(
    graph, kind=IncrementalEngine, *, anchor=None, determinant="cholesky", window=2, sample_size=500, **criteria
) -> Judge:
    engine = kind(graph, graph.last_pose if anchor is None else anchor, sample_size=sample_size)
    return Judge(engine, Criteria(options=BoundOptions(determinant, window), **criteria))


# An engine of one's own: log-determinants of dense matrices ------------------------------------------------------------


class DenseEngine(Engine):
    """Each action alone, by dense matrices."""

    batch_size = 1

    def groups(self, actions):
        return [(np.array([place]), DenseForms(self, action)) for place, action in enumerate(actions)]

    def extended(self, graph, anchor):
        return DenseEngine(graph, anchor)


class DenseForms(GraphForms, ClosureForms[float]):
    """Counts, topology and noise are the graph's; every determinant is dense."""

    def __init__(self, engine: DenseEngine, action) -> None:
        alone = engine.from_scratch(action)
        super().__init__(alone.graph, anchor=engine.anchor, prior=engine.graph, sample_size=engine.sample_size)
        n, m = engine.graph.num_nodes, engine.graph.num_edges
        stems = ~landmark_ends(engine.graph, action.edges)
        batch = Extensions.of(n, action.edges, np.array([0, len(action.edges)]), np.array([0, action.num_new_poses]), stems)
        rank = np.concatenate([np.zeros(n), 1 + np.argsort(batch.order)])  # along the path; 0 for poses that exist
        closures = m + np.flatnonzero(~batch.planted)
        self.in_base = np.concatenate([np.arange(m), m + np.flatnonzero(batch.planted)])
        self.closing = closures[np.argsort(rank[self.graph.edges[closures]].max(axis=1), kind="stable")]

    def rows(self, name, held, edges=slice(None)):
        graph = self.graph
        rows = replace(fisher_rows(graph), weights=None)
        rotations = name == "trees_r"
        form = rows.trees(self.weights[rotations], rotations=rotations) if "trees" in name else getattr(rows, name)()
        m, r, b = form.rows_i.shape
        rows = np.zeros((m, r, graph.num_nodes, b))
        rows[np.arange(m), :, graph.edges[:, 0]], rows[np.arange(m), :, graph.edges[:, 1]] = form.rows_i, form.rows_j
        rows = np.delete(rows, held, axis=2)[edges]
        return rows.reshape(len(rows), r, rows.shape[2] * b)

    def log_det(self, form, *, shift=0.0, part="all"):
        rows = self.rows(form, np.arange(self.num_existing) if part == "new" else self.anchor)
        return dense(np.einsum("mrx,mry->xy", rows, rows) + shift * np.eye(rows.shape[2]))

    def base(self):
        rows = self.rows("joint", self.anchor, self.in_base)
        return dense(np.einsum("mrx,mry->xy", rows, rows))

    def covariance(self, form, part=slice(None)):
        base, seen = self.rows(form, self.anchor, self.in_base), self.rows(form, self.anchor, self.closing)[:, part]
        seen = seen.reshape(seen.shape[0] * seen.shape[1], seen.shape[2])
        return np.eye(len(seen)) + seen @ np.linalg.solve(np.einsum("mrx,mry->xy", base, base), seen.T)

    def closures(self, form, rows="all"):
        k = self.split[0]
        return dense(self.covariance(form, {"all": slice(None), "positions": slice(k), "rotations": slice(k, None)}[rows]))

    def chained_closures(self, window):
        s, b = self.covariance("joint"), self.tangent_dim
        ends = range(b, len(s) + 1, b)
        parts = [dense(s[max(0, e - (window + 1) * b) : e, max(0, e - (window + 1) * b) : e]) for e in ends]
        before = [dense(s[max(0, e - (window + 1) * b) : e - b, max(0, e - (window + 1) * b) : e - b]) for e in ends]
        return Estimate(sum(p.value - q.value for p, q in zip(parts, before, strict=True)), 0.0)

    @property
    def increments(self):
        return self

    def solved(self, name, columns):
        """M^-1 C, zero at the pose that is held."""
        rows = self.rows(name, self.anchor)
        free = np.delete(columns, self.anchor, axis=0)
        found = np.linalg.solve(np.einsum("mrx,mry->xy", rows, rows), free.reshape(rows.shape[2], -1))
        return np.insert(found.reshape(free.shape), self.anchor, 0, axis=0)

    def mean_resistance(self):
        nodes = sample_of(self.num_existing, self._sample_size)
        columns = np.zeros((self.graph.num_nodes, 1, len(nodes)))
        columns[nodes, 0] = np.eye(len(nodes)) - 1 / len(nodes)
        return Estimate(float(np.sum(columns * self.solved("trees_p", columns))) / len(nodes), 0.0)

    def projection(self, b):
        nodes, k = sample_of(self.num_existing, self._sample_size), self.split[0]
        columns = np.zeros((self.graph.num_nodes, b, len(nodes) * k))
        columns[nodes, :k] = alignment_reference(self._prior.positions[nodes]).reshape(len(nodes), k, -1)
        return columns, len(nodes)

    def aligned_trace(self, form):
        columns, count = self.projection(self.split[0] if form == "positions" else self.tangent_dim)
        return Estimate(float(np.sum(columns * self.solved(form, columns))) / count, 0.0)

    def coupled_trace(self, rotations):
        k = self.split[0]
        columns, count = self.projection(k)
        rows = self.rows("joint", [])
        rows = rows.reshape(-1, self.graph.num_nodes, self.tangent_dim)
        moved = np.einsum("xnr,xmp,mps->nrs", rows[:, :, k:], rows[:, :, :k], self.solved("positions", columns), optimize=True)
        return Estimate(float(np.sum(moved * self.solved(rotations, moved))) / count, 0.0)


def dense(matrix) -> Estimate[float]:
    return Estimate(float(np.linalg.slogdet(matrix)[1]), 0.0)
