"""A decision to make, in the form in which every strategy gets it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray
from topobelief.bounds.entropy_bounds import Determinant
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.roadmap import Roadmap
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import has_kernels
from topobelief.planning.planner import Planner
from topobelief.planning.registry import default_signature, unit_of
from topobelief.search.result import Way
from topobelief.world import World


def installed_bounds() -> str:
    """Bounds anchored in the prior where numba is installed, which compiles them; Fischer's otherwise."""
    return "anchored" if has_kernels() else "fischer"


@dataclass(frozen=True, eq=False, slots=True)
class Ground:
    """What the candidates of a question were found on, for strategies that look for a path themselves.

    Attributes
    ----------
    roadmap
        Paths begin at its first vertex and are joined to the last pose of the graph.
    goal : shape (2,) or (3,)
        Metres; a heading is ignored.
    world
    rule
        By which the candidates' factors were predicted.
    """

    roadmap: Roadmap
    goal: ArrayLike
    world: World
    rule: CandidateRule


@dataclass(frozen=True, eq=False, slots=True)
class Question:
    """A decision to make.

    Attributes
    ----------
    graph
        At its estimate.
    actions
        K of them.
    lengths : shape (K,)
        Of the paths, metres.
    random_scores : shape (K,)
        Random numbers drawn by the caller; "random" takes the action with the largest. Strategies draw none themselves.
    objective, bounds, determinant
        As the planner takes them. Default of the bounds: `installed_bounds`.
    ground
        What the candidates were found on; only the strategy "roadmap" needs it.
    """

    graph: PoseGraph
    actions: Sequence[Action]
    lengths: FloatArray
    random_scores: FloatArray
    objective: str
    bounds: str = field(default_factory=installed_bounds)
    determinant: Determinant = "cholesky"
    ground: Ground | None = None

    def joined_by(self, way: Way | None) -> Question:
        """The same with the path that a strategy has found by itself as one more candidate, the last."""
        if way is None:
            return self
        lengths = np.append(self.lengths, way.length)
        return replace(
            self, actions=[*self.actions, way.action], lengths=lengths, random_scores=np.append(self.random_scores, -np.inf)
        )

    @property
    def unit(self) -> str:
        """Of the objective."""
        return unit_of(self.objective)

    def values(self) -> FloatArray:
        """The exact objective of every action, shape (K,), in its unit."""
        return self.planner().entropies(self.actions)

    def planner(self, signature: str | None = None) -> Planner:
        """For this question; dense spectra are allowed, since the caller named the strategy.

        Parameters
        ----------
        signature
            Default: the one that goes with the objective.
        """
        return Planner(
            self.graph,
            objective=self.objective,
            signature=signature or default_signature(self.objective),
            bounds=self.bounds,
            determinant=self.determinant,
            allow_dense_spectrum=True,
        )
