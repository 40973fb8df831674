"""A decision to make, in the form in which every strategy gets it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from topobelief.arrays import FloatArray
from topobelief.bounds.entropy_bounds import Determinant
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.optional import has_kernels
from topobelief.planning.planner import Planner
from topobelief.planning.registry import default_signature, unit_of


def installed_bounds() -> str:
    """Bounds anchored in the prior where numba is installed, which compiles them; Fischer's otherwise."""
    return "anchored" if has_kernels() else "fischer"


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
    """

    graph: PoseGraph
    actions: Sequence[Action]
    lengths: FloatArray
    random_scores: FloatArray
    objective: str
    bounds: str = field(default_factory=installed_bounds)
    determinant: Determinant = "cholesky"

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
