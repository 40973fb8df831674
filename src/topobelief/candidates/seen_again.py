"""What a path sees again: the stretches of existing poses that its loop closures lead to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topobelief.arrays import BoolArray
from topobelief.graph.action import Action, landmark_ends
from topobelief.graph.pose_graph import PoseGraph
from topobelief.wording import closures_in_words, counted

_GAP = 3  # poses; one stretch goes on across fewer that are not seen


@dataclass(frozen=True, slots=True)
class Stretch:
    """Existing poses, one after another, and the closures of an action with them."""

    first: int  # index of a pose
    last: int
    num_closures: int
    expected: float  # of these, by their probabilities
    first_new: int  # of the action's new poses that close them, counted from 0
    last_new: int

    def name(self, graph: PoseGraph) -> str:
        """Its first and last pose, by what the file calls them: "31 to 46"."""
        first, last = (graph.label(index) for index in (self.first, self.last))
        return first if self.first == self.last else f"{first} to {last}"


def closing_edges(graph: PoseGraph, start: int, action: Action) -> BoolArray:
    """Which measurements of an action are not its odometry, shape (number of edges,).

    Parameters
    ----------
    graph
    start
        Index of the pose from which the robot leaves.
    action
    """
    low, high = np.sort(action.edges, axis=1).T
    first = (low == start) & (high == graph.num_nodes)
    between_new = (low >= graph.num_nodes) & (high - low == 1)
    return ~(first | between_new)


def seen_again(graph: PoseGraph, start: int, action: Action) -> list[Stretch]:
    """Stretches of the graph's poses with which an action closes loops, those with most closures first; see `closing_edges`."""
    low, high = np.sort(action.edges, axis=1).T
    chance = np.ones(len(low)) if action.probabilities is None else action.probabilities
    old = low < graph.num_nodes
    old[old] = ~graph.is_landmark[low[old]]
    edges = np.flatnonzero(closing_edges(graph, start, action) & old)
    if not edges.size:
        return []
    edges = edges[np.argsort(low[edges], kind="stable")]
    stretches: list[Stretch] = []
    for part in np.split(edges, np.flatnonzero(np.diff(low[edges]) > _GAP) + 1):
        new = high[part] - graph.num_nodes
        ends = (int(low[part[0]]), int(low[part[-1]]))
        stretches.append(Stretch(*ends, len(part), float(chance[part].sum()), int(new.min()), int(new.max())))
    return sorted(stretches, key=lambda stretch: -stretch.num_closures)


def described(graph: PoseGraph, stretches: Sequence[Stretch], *, most: int = 3) -> str:
    """The stretches in words, by what the file calls poses: "sees poses 31 to 46 and 3 again, 12 closures"."""
    if not stretches:
        return "sees no pose again"
    names = [stretch.name(graph) for stretch in stretches[:most]]
    if len(stretches) > most:
        names.append(f"{len(stretches) - most} more stretches" if len(stretches) > most + 1 else "1 more stretch")
    listed = " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
    one = len(stretches) == 1 and stretches[0].first == stretches[0].last
    closures = closures_in_words(sum(each.num_closures for each in stretches), sum(each.expected for each in stretches))
    return f"sees pose{'' if one else 's'} {listed} again, {closures}"


def observed(graph: PoseGraph, action: Action) -> str:
    """Landmarks that an action observes, in words to be added: ", may observe 3 landmarks 17 times"; nothing without any."""
    seen = action.edges[landmark_ends(graph, action.edges), 1]
    if not len(seen):
        return ""
    return f", may observe {counted(len(np.unique(seen)), 'landmark')} {counted(len(seen), 'time')}"
