"""Small roadmaps on which every walk can be enumerated, and the exact values of their walks from scratch."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from shapely import box

import topobelief as tb
from topobelief.arrays import FloatArray, IntArray
from topobelief.graph.action import Action
from topobelief.graph.fisher import fisher_rows
from topobelief.search.plans import Plan
from topobelief.search.reduced_prior import world_to_body


@dataclass(frozen=True)
class Case:
    """A graph, a small roadmap, and what is asked."""

    graph: tb.PoseGraph
    roadmap: tb.Roadmap
    world: tb.World | None
    goal: int | None
    max_length: float
    spacing: float
    information: FloatArray
    rule: tb.ClosureModel
    return_to_start: bool
    cost_per_metre: float
    observations: tb.ObservationModel | None = None

    def arguments(self) -> dict:
        """Of `walk_bounds`, but for the objective."""
        return {
            "start": 0,
            "goal": self.goal,
            "max_length": self.max_length,
            "closures": self.rule,
            "observations": self.observations,
            "spacing": self.spacing,
            "information": self.information,
            "world": self.world,
            "cost_per_metre": self.cost_per_metre,
            "return_to_start": self.return_to_start,
        }

    def walks(self, limit: int = 1500) -> list[IntArray]:
        """Every walk within the length, or nothing where there are more than `limit`."""
        neighbours: dict[int, list[tuple[int, float]]] = {v: [] for v in range(len(self.roadmap.vertices))}
        for (a, b), length in zip(self.roadmap.edges.tolist(), self.roadmap.lengths.tolist(), strict=True):
            neighbours[a].append((b, length))
            neighbours[b].append((a, length))
        end = 0 if self.return_to_start else self.goal
        found: list[list[int]] = []
        stack: list[tuple[list[int], float]] = [([0], 0.0)]
        while stack and len(found) <= limit and len(stack) < 100 * limit:
            walk, length = stack.pop()
            if end is None or walk[-1] == end:
                found.append(walk)
            for vertex, more in neighbours[walk[-1]]:
                if length + more <= self.max_length:
                    stack.append(([*walk, vertex], length + more))
        return [] if stack else [np.array(walk) for walk in found]

    def action(self, walk: IntArray) -> Action:
        """What the walk adds, without closures among its own new poses."""
        n = self.graph.num_nodes
        (action,) = tb.predict_actions(
            self.graph,
            [self.roadmap.vertices[walk]],
            information=self.information,
            spacing=self.spacing,
            turn=None,
            closures=self.rule,
            observations=self.observations,
            world=self.world,
        )
        counted = (action.edges[:, 1] < n) | (np.arange(len(action.edges)) < action.num_new_poses)
        return Action(action.poses, action.edges[counted], action.information[counted], length=action.length)

    def values(self, objective: str, walks: list[IntArray]) -> FloatArray:
        """Exact values, cost included."""
        actions = [self.action(walk) for walk in walks]
        if objective == "error":
            values = np.array([map_error(self.graph, action) for action in actions])
        else:
            values = tb.Planner(self.graph, objective=objective, engine="scratch").entropies(actions)
        return values + self.cost_per_metre * np.array([self.length(walk) for walk in walks])

    def length(self, walk: IntArray) -> float:
        """Metres."""
        return float(np.linalg.norm(np.diff(self.roadmap.vertices[walk], axis=0), axis=1).sum())


def map_error(graph: tb.PoseGraph, action: Action) -> float:
    """Expected root mean square error of the positions that exist, after the best rigid alignment; dense, from scratch."""
    after = tb.posterior(graph, action)
    form, kappa, n, k = fisher_rows(after).joint(), graph.tangent_dim, graph.num_nodes, graph.group.position_dim
    size = kappa * after.num_nodes
    information = np.zeros((size, size))
    for (i, j), rows_i, rows_j in zip(form.edges, form.rows_i, form.rows_j, strict=True):
        row = np.zeros((len(rows_i), size))
        row[:, kappa * i : kappa * (i + 1)] += rows_i
        row[:, kappa * j : kappa * (j + 1)] += rows_j
        information += row.T @ row
    covariance = np.linalg.inv(information[kappa:, kappa:])
    positions = np.zeros((size, n * k))
    for i in range(n):
        positions[kappa * i : kappa * i + k, k * i : k * (i + 1)] = np.eye(k)
    part = positions[kappa:].T @ covariance @ positions[kappa:]
    centred = graph.positions - graph.positions.mean(axis=0)
    motions = [np.tile(axis, n) for axis in np.eye(k)]
    for a in range(k):
        for b in range(a + 1, k):
            turn = np.zeros((n, k))
            turn[:, a], turn[:, b] = -centred[:, b], centred[:, a]
            motions.append(turn.ravel())
    basis, scale, _ = np.linalg.svd(np.array(motions).T, full_matrices=False)
    basis = basis[:, scale > 1e-9 * scale[0]]
    projection = np.eye(n * k) - basis @ basis.T
    return math.sqrt(np.trace(projection @ part @ projection) / n)


def plan_of(graph: tb.PoseGraph, action: Action, seen: IntArray, num_idle: int = 0) -> Plan:
    """An action along a path from the last pose as a plan; idle poses repeat its last odometry."""
    count, n = action.num_new_poses, graph.num_poses
    adjoint = world_to_body(graph.group, action.poses, graph.positions[-1])
    odometry = adjoint.transpose(0, 2, 1) @ action.information[:count] @ adjoint
    closures = np.zeros((count + num_idle, len(seen)))
    for new, old in action.edges[count:]:
        closures[new - n, np.searchsorted(seen, old)] += 1
    return Plan(
        closures, np.concatenate([odometry, np.repeat(odometry[-1:], num_idle, axis=0)]), count, action.length or 0.0, 0.0
    )


def random_case(seed: int) -> Case:
    """A drive with loops, a roadmap of a few vertices around its end, and random choices of everything else."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(10, 22))
    steps = rng.uniform(-1.2, 1.2, n)
    headings = np.cumsum(steps)
    positions = np.cumsum(np.stack([np.cos(headings), np.sin(headings)], axis=1) * rng.uniform(0.7, 1.3, (n, 1)), axis=0)
    chain = [(i, i + 1) for i in range(n - 1)]
    loops = [tuple(rng.choice(n, 2, replace=False).tolist()) for _ in range(int(rng.integers(0, 4)))]
    root = rng.normal(size=(3, 3)) + 2 * np.eye(3)
    scale = np.diag(np.r_[rng.uniform(3, 15, 2), rng.uniform(10, 60)])
    information = scale @ (root @ root.T) @ scale / 4 if rng.random() < 0.7 else np.diag([100.0, 100.0, 400.0])
    information = (information + information.T) / 2
    graph = tb.PoseGraph(np.column_stack([positions, headings]), chain + loops, None, information)
    size = int(rng.integers(5, 9))
    vertices = positions[-1] + rng.uniform(-2.5, 2.5, (size, 2))
    vertices[0] = positions[-1] if rng.random() < 0.8 else positions[-1] + 0.3
    if rng.random() < 0.3:
        vertices = vertices[0] + np.round(vertices - vertices[0])
        vertices = np.unique(vertices, axis=0)
        first = int(np.argmin(np.linalg.norm(vertices - positions[-1], axis=1)))
        vertices[[0, first]] = vertices[[first, 0]]
    size = len(vertices)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2) + 100 * np.eye(size)
    pairs = {tuple(sorted((i, int(j)))) for i in range(size) for j in np.argsort(distance[i])[:2]}
    pairs |= {tuple(sorted(rng.choice(size, 2, replace=False).tolist())) for _ in range(2)}
    low, high = positions.min(axis=0) - 6, positions.max(axis=0) + 6
    world = tb.World.from_boxes([], bounds=(*low, *high))
    edges = np.array(sorted(pairs))
    if rng.random() < 0.5:
        places = rng.uniform(positions[-1] - 3, positions[-1] + 3, (4, 2))
        walls = [box(x, y, x + rng.uniform(0.1, 0.8), y + rng.uniform(0.1, 0.8)) for x, y in places]
        candidate = tb.World.from_polygons(walls, bounds=(*low, *high))
        inside = candidate.contains(vertices) & (candidate.clearance(vertices) > 0)
        free = candidate.segments_free(vertices[edges[:, 0]], vertices[edges[:, 1]], 0.0)
        if inside.all() and candidate.visible(positions[-1:], vertices[:1]).all():
            world, edges = candidate, edges[free]
    see = rng.random() < 0.8
    roadmap = tb.Roadmap(world, 0.1, world.component(vertices[0], 0.01), vertices, edges)
    kind = rng.random()
    goal = None if kind < 0.3 else 1
    shortest = float(roadmap.distances_to(0)[1])
    if not math.isfinite(shortest) or shortest == 0:
        goal = None
    length = float(rng.uniform(2.0, 6.0)) if goal is None else shortest * float(rng.uniform(1.0, 3.0))
    rule = tb.ClosureModel(
        radius=float(rng.uniform(0.8, 2.5)),
        angle=math.pi if rng.random() < 0.6 else float(rng.uniform(0.5, 2.5)),
        min_index_gap=int(rng.integers(2, 7)),
        max_per_pose=None if rng.random() < 0.5 else int(rng.integers(1, 4)),
        probability=1.0 if rng.random() < 0.5 else float(rng.uniform(0.1, 1)),
    )
    cost = 0.0 if rng.random() < 0.6 else float(10 ** rng.uniform(-4, 0))
    spacing = float(rng.choice([0.5, 1.0, 0.73]))
    back = goal is None and seed % 3 == 0
    length *= 1.6 if back else 1.0
    return Case(graph, roadmap, world if see else None, goal, length, spacing, information, rule, back, cost)


def with_landmarks(case: Case, seed: int) -> Case:
    """The case with landmarks around the roadmap that its drive has seen, and a random sensor; nodes in any order of kinds."""
    rng = np.random.default_rng(seed)
    graph, n, count = case.graph, case.graph.num_poses, int(rng.integers(1, 6))
    low, high = case.roadmap.vertices.min(axis=0) - 1, case.roadmap.vertices.max(axis=0) + 1
    landmarks = np.column_stack([rng.uniform(low, high, (count, 2)), np.zeros(count)])
    seen = np.array([(int(rng.integers(n)), n + landmark) for landmark in range(count) for _ in range(2)])
    matrix = np.zeros((1, 3, 3))
    matrix[0, [0, 1], [0, 1]] = rng.uniform(1, 30)
    whole = tb.PoseGraph(
        np.concatenate([graph.poses, landmarks]),
        np.concatenate([graph.edges, seen]),
        None,
        np.concatenate([graph.information, np.repeat(matrix, len(seen), axis=0)]),
        ["pose"] * n + ["landmark"] * count,
    )
    model = tb.ObservationModel(
        max_range=float(rng.uniform(1, 5)),
        sigma=float(rng.uniform(0.05, 0.5)),
        field_of_view=float(rng.choice([2 * math.pi, rng.uniform(0.5, 6.0)])),
        max_per_pose=[None, 1, 2][rng.integers(3)],
        probability=float(rng.choice([1.0, 0.4])),
    )
    return replace(case, graph=whole, observations=model)
