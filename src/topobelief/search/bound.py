"""What a search over the walks of a roadmap asks of a bound (docs, the mathematics, section 13)."""

from __future__ import annotations

from typing import Protocol

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.roadmap import Roadmap
from topobelief.graph.pose_graph import PoseGraph
from topobelief.world import World


class ClosureRule(Protocol):
    """Which loops a new pose closes, as `predict_actions` predicts them.

    Attributes
    ----------
    radius
        Poses nearer than this close a loop, metres.
    angle
        Largest relative heading, radians; pi: any.
    min_index_gap
        Least number of steps between the two poses.
    max_per_pose
        Most closures of a new pose with the map; None for no limit.
    probability
        That an opportunity is taken; it scales the information of every closure.
    """

    @property
    def radius(self) -> float: ...
    @property
    def angle(self) -> float: ...
    @property
    def min_index_gap(self) -> int: ...
    @property
    def max_per_pose(self) -> int | None: ...
    @property
    def probability(self) -> float: ...


class WalkBound(Protocol):
    """A lower bound of the objective over all walks of a class, which gets better step by step.

    Attributes
    ----------
    lower_bound
        No walk of the class has a smaller value of the objective, cost included. It begins at -inf and never falls.
    covers
        Which walks the bound covers, and which bound it is.
    finished
        Whether more steps would not raise it.
    """

    @property
    def lower_bound(self) -> float: ...
    @property
    def covers(self) -> str: ...
    @property
    def finished(self) -> bool: ...

    def step(self) -> list[IntArray]:
        """One more iteration.

        Returns
        -------
        list of arrays
            Walks that came up, each as vertices of the roadmap from the start, within the length; candidates whose exact value
            is for the caller to find.
        """
        ...

    def prune(self, best_value: float) -> None:
        """Leave out what cannot lie on a walk with a smaller value than the best one known.

        From then on `lower_bound` is the smaller of this value and the bound over the walks that remain.
        """
        ...


class WalkBoundConstructor(Protocol):
    """How a bound is made: `flow_bound.flow_bound` is of this kind."""

    def __call__(
        self,
        graph: PoseGraph,
        roadmap: Roadmap,
        *,
        start: int,
        goal: int | None,
        max_length: float,
        objective: str,
        closures: ClosureRule,
        spacing: float,
        information: FloatArray,
        closure_information: FloatArray | None = None,
        world: World | None,
        cost_per_metre: float = 0.0,
        return_to_start: bool = False,
        pose: int | None = None,
    ) -> WalkBound:
        """The bound over the walks from one vertex of a roadmap.

        Parameters
        ----------
        graph
            At its estimate.
        roadmap
        start, goal
            Vertices of the roadmap. Without a goal walks may end at any vertex, or at the start if they are to return.
        max_length
            Metres along the walk.
        objective
            "error", "map", "joint" or "per_pose".
        closures
        spacing
            Metres from new pose to new pose.
        information : shape (kappa, kappa)
            Of odometry.
        closure_information : shape (kappa, kappa), optional
            Of a loop closure that is made for certain. Default: that of odometry.
        world
            What poses must see each other in; None: they always do.
        cost_per_metre
            In the unit of the objective.
        return_to_start
        pose
            Of the graph, to which the first new pose is joined. Default: the last one.
        """
        ...
