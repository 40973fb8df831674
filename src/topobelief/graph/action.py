"""Candidate actions: the poses and factors that a path would add to the graph.

Under maximum-likelihood observations nothing is re-estimated: new poses sit where the path puts them, and every
new measurement is the one that the geometry predicts (Kitanov and Indelman, arXiv 1903.00927, section II).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import BoolArray, FloatArray, IntArray, ReadOnlyArrays, frozen_floats, frozen_ints
from topobelief.errors import InvalidActionError, InvalidInputError
from topobelief.graph.information import checked_information, measures_rotations, of_positions
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.pose_rows import checked_pose_rows
from topobelief.graph.topology import Topology
from topobelief.wording import counted


@dataclass(frozen=True, eq=False, init=False)
class Action(ReadOnlyArrays):
    """New poses and the factors among them and to the graph.

    Parameters
    ----------
    poses : shape (L, 3) or (L, 7), L >= 0
        Where the new poses will be, world frame.
    edges : shape (c, 2)
        Odometry included. Indices of the graph, then num_nodes, num_nodes + 1, … for the new poses (without landmarks num_nodes
        is num_poses), in any order and direction; parallel edges and edges among new poses are allowed. An observation of a
        landmark leads from a pose to the landmark. No edges at all ("stay") is valid with L = 0.
    information : shape (c, kappa, kappa) or (kappa, kappa)
        Of an observation of a landmark the block of positions counts, in the frame of the pose.
    label
        What a person calls the action.
    cost
        A deterministic cost (length, energy, time) in the objective's unit, nats or metres of error; it adds to the objective
        and to its bounds.
    length
        How far the robot drives, metres; it is reported and does not influence decisions. Default: from pose to pose
        (`driven_lengths`).
    probabilities : shape (c,), optional
        That each measurement will be made, above 0 and at most 1. `information` is then the expected one: this times the
        information of the measurement. Default: all are certain.

    Raises
    ------
    InvalidActionError
        Names the edge to blame. What depends on the graph is checked when the action meets it.
    """

    poses: FloatArray
    edges: IntArray
    information: FloatArray
    label: str
    cost: float
    length: float | None
    probabilities: FloatArray | None

    def __init__(
        self,
        poses: ArrayLike,
        edges: ArrayLike,
        information: ArrayLike,
        *,
        label: str = "",
        cost: float = 0.0,
        length: float | None = None,
        probabilities: ArrayLike | None = None,
    ) -> None:
        try:
            raw_information = frozen_floats(information, name="information")
            tangent_dim = raw_information.shape[-1] if raw_information.ndim >= 2 else 0
            raw_poses = frozen_floats(poses, name="poses")
            size = {3: 3, 6: 7}.get(tangent_dim)
            if raw_poses.ndim == 2 and raw_poses.shape[1] in (3, 7):
                size = int(raw_poses.shape[1])
            checked_poses, group = checked_pose_rows(raw_poses, name="poses", size=size or 3)
            checked_edges = frozen_ints(edges, name="edges")
            if checked_edges.size == 0:
                checked_edges = checked_edges.reshape(0, 2)
            if checked_edges.ndim != 2 or checked_edges.shape[1] != 2:
                raise InvalidInputError(f"expected edges of shape (c, 2), got {checked_edges.shape}")
            if size is None and len(checked_edges) == 0:  # nothing says which group: the action fits both
                checked = np.zeros((0, 0, 0))
            else:
                checked = checked_information(raw_information, num_edges=len(checked_edges), tangent_dim=group.tangent_dim)
            chances = None if probabilities is None else _checked_probabilities(probabilities, len(checked_edges))
        except InvalidInputError as error:
            raise InvalidActionError(str(error), label=label) from None
        negative = np.flatnonzero((checked_edges < 0).any(axis=1))
        if negative.size:
            raise InvalidActionError("expected indices from 0, got a negative one", edge=int(negative[0]), label=label)
        if not np.isfinite(cost):
            raise InvalidActionError(f"expected a finite cost in nats, got {cost}", label=label)
        if length is not None and not (0 <= length < np.inf):
            raise InvalidActionError(f"expected a length of at least 0 m, got {length}", label=label)
        for name, value in (
            ("poses", checked_poses),
            ("edges", checked_edges),
            ("information", checked),
            ("label", label),
            ("cost", float(cost)),
            ("length", None if length is None else float(length)),
            ("probabilities", chances),
        ):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        label = f"{self.label!r}, " if self.label else ""
        cost = f", cost {self.cost:g}" if self.cost else ""
        return f"Action({label}{counted(self.num_new_poses, 'new pose')}, {counted(len(self.edges), 'edge')}{cost})"

    @property
    def num_new_poses(self) -> int:
        """L."""
        return len(self.poses)

    @property
    def num_closures(self) -> int:
        """Edges between poses beyond the one that attaches each new pose to the graph."""
        return len(self.edges) - self.num_new_poses - self.num_observations

    @property
    def num_observations(self) -> int:
        """Edges that say nothing of rotations, as observations of landmarks do."""
        return int(np.count_nonzero(self._observing))

    @property
    def expected_closures(self) -> float:
        """`num_closures`, each as often as it is probable."""
        if self.probabilities is None:
            return self.num_closures
        return float(self.probabilities[~self._observing].sum()) - self.num_new_poses

    @property
    def expected_observations(self) -> float:
        """`num_observations`, each as often as it is probable."""
        return self.num_observations if self.probabilities is None else float(self.probabilities[self._observing].sum())

    @property
    def _observing(self) -> BoolArray:
        return ~measures_rotations(self.information)


def _checked_probabilities(probabilities: ArrayLike, num_edges: int) -> FloatArray:
    chances = frozen_floats(probabilities, name="probabilities")
    if chances.shape != (num_edges,):
        raise InvalidInputError(f"expected a probability for each of the {num_edges} edges, got shape {chances.shape}")
    if not ((chances > 0) & (chances <= 1)).all():
        raise InvalidInputError("expected probabilities above 0 and at most 1, got others; leave out what cannot happen")
    return chances


def check_action(graph: PoseGraph, action: Action, *, index: int | None = None) -> None:
    """Check what depends on the graph: dimensions, index range, self-loops, and that every new pose is attached.

    Raises
    ------
    InvalidActionError
        Names the action (by `index`) and the edge.
    """
    label = action.label
    if action.information.shape[-1] not in (0, graph.tangent_dim):
        raise InvalidActionError(
            f"expected information matrices of size {graph.tangent_dim} for a graph in {graph.group.name}, "
            f"got {action.information.shape[-1]}",
            action=index,
            label=label,
        )
    if action.num_new_poses and action.poses.shape[1] != graph.poses.shape[1]:
        raise InvalidActionError(
            f"expected poses with {graph.poses.shape[1]} columns, got {action.poses.shape[1]}",
            action=index,
            label=label,
        )
    total = graph.num_nodes + action.num_new_poses
    nodes = "nodes" if graph.num_landmarks else "poses"
    out_of_range = np.flatnonzero((action.edges >= total).any(axis=1))
    if out_of_range.size:
        edge = int(out_of_range[0])
        raise InvalidActionError(
            f"expected indices below {total} ({graph.num_nodes} {nodes} and {action.num_new_poses} new ones), "
            f"got {tuple(action.edges[edge].tolist())}",
            action=index,
            edge=edge,
            label=label,
        )
    loops = np.flatnonzero(action.edges[:, 0] == action.edges[:, 1])
    if loops.size:
        edge = int(loops[0])
        raise InvalidActionError(
            f"expected an edge between two poses, got a self-loop at {action.edges[edge, 0]}",
            action=index,
            edge=edge,
            label=label,
        )
    _check_observations(graph, action, index)
    if action.num_new_poses:
        between = action.edges[~landmark_ends(graph, action.edges)]  # an observation of a landmark leaves a pose loose
        contracted = np.maximum(between - graph.num_nodes + 1, 0)  # the prior graph as one node, 0
        contracted = contracted[contracted[:, 0] != contracted[:, 1]]
        labels = Topology(action.num_new_poses + 1, contracted).component_labels
        loose = np.flatnonzero(labels[1:] != labels[0])
        if loose.size:
            raise InvalidActionError(
                f"expected every new pose to be attached to the graph, got new pose {graph.num_nodes + loose[0]} "
                f"without a path {'of relative poses ' if graph.num_landmarks else ''}to it",
                action=index,
                label=label,
            )


def check_actions(graph: PoseGraph, actions: Sequence[Action]) -> None:
    """Check a list of actions before any work is done.

    Raises
    ------
    InvalidActionError
        Where the list is empty or names the first bad action.
    """
    if len(actions) == 0:
        raise InvalidActionError("expected at least one action to choose from, got none")
    if not _all_fit(graph, actions):
        for index, action in enumerate(actions):
            check_action(graph, action, index=index)


def _all_fit(graph: PoseGraph, actions: Sequence[Action]) -> bool:
    """Whether `check_action` finds nothing wrong, for all actions at once."""
    sizes, columns = (0, graph.tangent_dim), graph.poses.shape[1]
    if not all(
        action.information.shape[-1] in sizes and (len(action.poses) == 0 or action.poses.shape[1] == columns)
        for action in actions
    ):
        return False
    num_new = np.array([action.num_new_poses for action in actions])
    which = np.repeat(np.arange(len(actions)), [len(action.edges) for action in actions])
    edges = np.concatenate([action.edges for action in actions])
    if (edges >= graph.num_nodes + num_new[which, None]).any() or (edges[:, 0] == edges[:, 1]).any():
        return False
    if graph.num_landmarks or any(action.num_observations for action in actions):
        return False  # told apart one by one
    first = np.cumsum(num_new) - num_new  # all new poses in a row, behind the prior as one node, 0
    contracted = np.where(edges < graph.num_nodes, 0, edges - graph.num_nodes + 1 + first[which, None])
    contracted = contracted[contracted[:, 0] != contracted[:, 1]]
    labels = Topology(int(num_new.sum()) + 1, contracted).component_labels
    return bool((labels == labels[0]).all())


def driven_lengths(graph: PoseGraph, actions: Sequence[Action]) -> list[float]:
    """How far the robot drives in each action, metres: as the action says or, where it does not, along its new poses.

    Those are taken in their order, from the old pose that the first of them is joined to by the earliest such edge.
    """
    lengths = [0.0 if action.length is None else action.length for action in actions]
    unknown = [index for index, action in enumerate(actions) if action.length is None and action.num_new_poses]
    if not unknown:
        return lengths
    num_new = np.array([actions[index].num_new_poses for index in unknown])
    places = graph.group.position(np.concatenate([actions[index].poses for index in unknown]))
    first = np.cumsum(num_new) - num_new
    steps = np.diff(places, axis=0, prepend=places[:1])
    steps[first] = 0.0  # where only later poses are joined to the graph, the way begins at the first of them
    source, target = np.concatenate([actions[index].edges for index in unknown]).T
    low, high = np.minimum(source, target), np.maximum(source, target)
    which = np.repeat(np.arange(len(unknown)), [len(actions[index].edges) for index in unknown])
    joining = np.flatnonzero((low < graph.num_nodes) & (high == graph.num_nodes))
    joined, earliest = np.unique(which[joining], return_index=True)
    steps[first[joined]] = places[first[joined]] - graph.positions[low[joining[earliest]]]
    for index, length in zip(
        unknown, np.add.reduceat(np.sqrt(np.einsum("ij,ij->i", steps, steps)), first).tolist(), strict=True
    ):
        lengths[index] = length
    return lengths


def posterior(graph: PoseGraph, action: Action) -> PoseGraph:
    """The graph after the action: the from-scratch reference for everything incremental.

    Parameters
    ----------
    graph
        The prior, n poses.
    action
        L new poses; their measurements are the ones that the geometry predicts.

    Returns
    -------
    PoseGraph
        n + L poses: the prior's, then the new ones; likewise the edges.

    Raises
    ------
    InvalidActionError
        Where the action does not fit the graph.
    """
    check_action(graph, action)
    if len(action.edges) == 0:  # then there are no new poses either
        return graph
    poses = np.concatenate([graph.poses, action.poses]) if action.num_new_poses else graph.poses
    i, j = action.edges.T
    predicted = graph.group.between(poses[i], poses[j])
    observing = landmark_ends(graph, action.edges)
    predicted[observing, graph.group.position_dim :] = graph.group.identity()[graph.group.position_dim :]
    return graph._with_more(  # pyright: ignore[reportPrivateUsage]  (the two modules are one room)
        action.poses if action.num_new_poses else graph.poses[:0],
        action.edges,
        predicted,
        of_positions(action.information, observing),
        _new_ids(graph.ids, action.num_new_poses),
    )


def staying(graph: PoseGraph) -> Action:
    """The action that adds nothing."""
    return Action(graph.poses[:0], np.zeros((0, 2), dtype=np.int64), np.eye(graph.tangent_dim))


def landmark_ends(graph: PoseGraph, edges: IntArray) -> BoolArray:
    """Which edges of actions, shape (c, 2), lead to landmarks of the graph, shape (c,)."""
    target = np.minimum(edges[:, 1], graph.num_nodes - 1)
    return graph.is_landmark[target] & (edges[:, 1] < graph.num_nodes)


def _check_observations(graph: PoseGraph, action: Action, index: int | None) -> None:
    """Observations lead to landmarks, and all other edges measure rotations too."""
    observing = landmark_ends(graph, action.edges)
    measuring = np.flatnonzero(landmark_ends(graph, action.edges[:, ::-1]))
    if measuring.size:
        raise InvalidActionError(
            "expected an observation to lead from a pose to a landmark, got one from a landmark; turn it round",
            action=index,
            edge=int(measuring[0]),
            label=action.label,
        )
    if len(action.edges) == 0:
        return
    partial = np.flatnonzero(~observing & ~measures_rotations(action.information))
    if partial.size:
        raise InvalidActionError(
            "expected a positive definite information matrix between poses, got one that says nothing of rotations",
            action=index,
            edge=int(partial[0]),
            label=action.label,
        )


def _new_ids(ids: IntArray, count: int) -> IntArray:
    """Ids of new poses: those after the largest or, where there is no room, the smallest that are free."""
    largest = int(ids.max())
    if largest < 2**63 - 1 - count:
        return largest + 1 + np.arange(count)
    return np.setdiff1d(np.arange(len(ids) + count), ids)[:count]
