"""Compile every kernel before the first decision needs it: `python -m topobelief.planning.compile_kernels`.

Kernels are compiled for the types of argument that they meet, once per machine, and kept on disk (see `linalg.compiled`). A
tiny decision of each kind uses all of them; it takes half a minute, or an instant if it has been done before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from topobelief.geometry import SE2_GROUP, SE3_GROUP, Group
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import has_kernels
from topobelief.planning.planner import Planner

_CHOICES: tuple[dict[str, Any], ...] = (
    {"bounds": "fischer"},
    {"bounds": "anchored"},
    {"bounds": "chain"},
    {"objective": "error", "signature": "resistance"},
    {"signature": "von_neumann_approx", "determinant": "hadamard"},
)


def compile_kernels() -> None:
    """Evaluate an action on a ring of poses, in SE(2) and SE(3), with block-isotropic and other noise."""
    from topobelief.forms.prior_factors import PriorFactors
    from topobelief.linalg.selected_inverse import projected_trace

    for group in (SE2_GROUP, SE3_GROUP):
        for coupling in (0.0, 0.1):
            graph, action = _ring(group, coupling)
            grown = posterior(graph, action)
            for name in ("joint", "trees_p"):  # traces of large graphs alone take these
                prior = PriorFactors(graph, 0)
                projected_trace(prior.factor(name, 0.0), prior.projection(name))
            revisit = Action(grown.poses[:0], action.edges[:1], action.information[0])
            for choice in _CHOICES:
                choices: dict[str, Any] = {"objective": "map", "engine": "incremental", "anchor": 0, **choice}
                planner = Planner(graph, **choices)
                _evaluate(planner, action)
                _evaluate(planner.extended(grown), revisit)


def load_kernels() -> None:
    """The same where numba is installed; nothing otherwise. So the first decision by increments is as fast as the others."""
    if has_kernels():
        compile_kernels()


def _evaluate(planner: Planner, action: Action) -> None:
    planner.decide([action])
    planner.entropies([action])


def _ring(group: Group, coupling: float, *, num_poses: int = 70) -> tuple[PoseGraph, Action]:
    """Large enough for errors to be sampled; an action that adds a pose and closes a loop."""
    kappa, pose = group.tangent_dim, np.arange(num_poses)
    poses = np.tile(group.identity(), (num_poses + 1, 1))
    poses[:-1, 0], poses[:-1, 1] = np.cos(pose), np.sin(pose)
    information = np.eye(kappa) + coupling * np.ones((kappa, kappa))
    graph = PoseGraph(poses[:-1], np.stack([pose, (pose + 1) % num_poses], axis=1), None, information)
    return graph, Action(poses[-1:], [(0, num_poses), (num_poses, 1)], information)


if __name__ == "__main__":
    compile_kernels()
