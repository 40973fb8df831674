"""What pictures of a map are made of, each drawn on a panel: world, graph, candidates, what the chosen path sees again.

Every function draws one layer and returns the lines of the key that belong to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from topobelief.arrays import FloatArray, IntArray
from topobelief.candidates.seen_again import Stretch, closing_edges, seen_again
from topobelief.candidates.start import Start, find_start
from topobelief.graph.action import Action, landmark_ends
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import Decision
from topobelief.report import style
from topobelief.report.canvas import Entry, Panel
from topobelief.world import World

_MIN_VIEW = 6.0  # metres
_CLOSURES_DRAWN = 2  # of each new pose: with all that a rule by hand predicts, nothing else would be seen
_PART = 0.6  # of the whole map's width and height: candidates that fill less are shown alone
_BAND = 6.5  # points
_MANY_PATHS = 8  # from here on their lines are thinner


@dataclass(frozen=True, slots=True)
class View:
    """A rectangle of the plane, metres."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    @classmethod
    def around(cls, points: FloatArray, *, padding: float) -> View:
        """All points with room around, and no side so short that nothing of the surroundings would be seen."""
        low, high = points.min(axis=0), points.max(axis=0)
        pads = np.maximum(padding * np.max(high - low), (_MIN_VIEW - (high - low)) / 2)
        return cls(*(low - pads).tolist(), *(high + pads).tolist())

    @property
    def size(self) -> tuple[float, float]:
        """Width and height."""
        return self.x_max - self.x_min, self.y_max - self.y_min

    @property
    def aspect(self) -> float:
        """Height per width."""
        return self.size[1] / self.size[0]

    def reshaped(self, aspect: float) -> View:
        """The smallest view around this one with the given height per width."""
        width, height = self.size
        dx, dy = max(0.0, height / aspect - width) / 2, max(0.0, width * aspect - height) / 2
        return View(self.x_min - dx, self.y_min - dy, self.x_max + dx, self.y_max + dy)

    def shown_on(self, panel: Panel) -> None:
        """Set the limits of a panel's axes."""
        panel.limits((self.x_min, self.x_max), (self.y_min, self.y_max))


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What an action closes loops with.

    Attributes
    ----------
    closures : shape (number of closures, 2), int
        Edges of the action that are not its odometry, smaller index first.
    segments : shape (number of closures, 2, 2)
        Where their ends lie, as the action states them, metres.
    seen : shape (number of poses,), int
        Existing poses among their ends, increasing.
    stretches
        Of these, those with most closures first.
    observed : shape (O, 2, 2)
        From new poses to the landmarks that they observe.
    """

    closures: IntArray
    segments: FloatArray
    seen: IntArray
    stretches: list[Stretch]
    observed: FloatArray

    @classmethod
    def of(cls, graph: PoseGraph, start: Start, action: Action) -> Sight:
        """Of an action that begins at a start."""
        positions = np.concatenate([graph.positions, graph.group.position(action.poses)])[:, :2]
        closing = closing_edges(graph, start.pose, action)
        observing = landmark_ends(graph, action.edges)
        observed = positions[action.edges[observing]]
        closing &= ~observing
        closures = np.sort(action.edges[closing], axis=1)
        seen = np.unique(closures[closures < graph.num_nodes])
        return cls(closures, positions[action.edges[closing]], seen, seen_again(graph, start.pose, action), observed)

    def thinned(self) -> FloatArray:
        """Segments of the shortest closures of each new pose, in the order of the action."""
        length = np.linalg.norm(self.segments[:, 1] - self.segments[:, 0], axis=1)
        new = self.closures[:, 1]
        order = np.lexsort((length, new))
        begins = np.searchsorted(new[order], new[order])  # where the closures of the same new pose begin
        return self.segments[np.sort(order[np.arange(len(order)) - begins < _CLOSURES_DRAWN])]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A decision on a map: what is to be drawn, and which part of the plane that takes.

    Attributes
    ----------
    graph, world, paths, decision
        As `topobelief.draw_paths` takes them.
    start
        Where the paths begin.
    goals : shape (G, 2)
        Where they lead.
    sight
        Of the chosen action.
    view, whole
        What the candidates fill, with room around, and all of world and graph; the same where that is hardly more.
    """

    graph: PoseGraph
    world: World | None
    paths: Sequence[FloatArray]
    decision: Decision
    start: Start
    goals: FloatArray
    sight: Sight
    view: View
    whole: View

    @classmethod
    def of(
        cls,
        graph: PoseGraph,
        world: World | None,
        paths: Sequence[FloatArray],
        actions: Sequence[Action],
        decision: Decision,
        *,
        goal: ArrayLike | None = None,
        start: int | ArrayLike | Start | None = None,
    ) -> Scene:
        """Of what was decided; the goal, or each row of goals, is where the chosen path ends unless it is given."""
        begin = find_start(graph, start, world=world)
        ends = np.atleast_2d(np.asarray(paths[decision.best][-1] if goal is None else goal, dtype=np.float64))[:, :2]
        sight = Sight.of(graph, begin, actions[decision.best])
        seen = np.concatenate([begin.place[None], ends, *paths, sight.segments.reshape(-1, 2)])
        view = View.around(seen, padding=0.07)
        whole = View.around(np.concatenate([_extent(graph, world), seen]), padding=0.02)
        part = max(near / far for near, far in zip(view.size, whole.size, strict=True))
        return cls(graph, world, paths, decision, begin, ends, sight, view if part < _PART else whole, whole)

    @property
    def zoomed(self) -> bool:
        """Whether the view is a part of the map."""
        return self.view is not self.whole

    def draw(self, panel: Panel, view: View) -> list[Entry]:
        """All layers; returns the key."""
        key = draw_world(panel, self.world, view) if self.world is not None else []
        key += draw_graph(panel, self.graph, view)
        key += draw_candidates(panel, self.paths, self.decision)
        key += draw_sight(panel, self.graph, self.sight)
        key += draw_ends(panel, self.graph, self.start, self.goals)
        view.shown_on(panel)
        panel.map_axes()
        return key


def whole_view(graph: PoseGraph, world: World | None = None) -> View:
    """All of a graph and of the world around it."""
    return View.around(_extent(graph, world), padding=0.02)


def _extent(graph: PoseGraph, world: World | None) -> FloatArray:
    """Points whose extent is that of graph and world, shape (N, 2)."""
    corners = np.zeros((0, 2)) if world is None else np.reshape(world.free.bounds, (2, 2))
    return np.concatenate([corners, graph.positions[:, :2]])


def draw_world(panel: Panel, world: World, view: View) -> list[Entry]:
    """Free space white, all else grey."""
    panel.axes.set_facecolor(style.NOT_FREE)
    outline = float(np.clip(60 / max(view.size), 0.15, 0.7))  # walls of a town must not hide its streets
    panel.region(world.free, facecolor=style.FREE, edgecolor=style.WALL, linewidth=outline, zorder=0)
    return [Entry("not free", patch=True, facecolor=style.NOT_FREE, edgecolor=style.WALL, linewidth=0.7)]


def draw_graph(panel: Panel, graph: PoseGraph, view: View) -> list[Entry]:
    """Odometry and loop closures of the prior; the more poses in view, the thinner."""
    positions = graph.positions[:, :2]
    low, high = (view.x_min, view.y_min), (view.x_max, view.y_max)
    inside = ((positions >= low) & (positions <= high)).all(axis=1)
    thin = float(np.clip(1.2 - 0.25 * np.log10(1 + np.count_nonzero(inside)), 0.3, 1.0))
    closing = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    observing = graph.reading_codes > 0
    key: list[Entry] = []
    for label, chosen, colour, width, layer in (
        ("odometry of the graph", ~closing & ~observing, style.ODOMETRY, 1.1 * thin, 2),
        ("loop closures of the graph", closing & ~observing, style.CLOSURE, 0.9 * thin, 1),
        ("observations of landmarks", observing, style.OBSERVATION, 0.4 * thin, 0.8),
    ):
        if chosen.any():
            panel.segments(positions[graph.edges[chosen]], colors=colour, linewidths=width, zorder=layer)
            key.append(Entry(label, color=colour, linewidth=max(width, 0.9)))
    if graph.num_landmarks:
        look: dict[str, Any] = {"marker": "^", "markerfacecolor": style.LANDMARK, "markeredgecolor": "white", "markersize": 5.0}
        panel.line(positions[graph.is_landmark], linestyle="none", markeredgewidth=0.4, zorder=6, **look)
        key.append(Entry(f"landmarks ({graph.num_landmarks})", linestyle="none", **look))
    return key


def draw_sight(panel: Panel, graph: PoseGraph, sight: Sight) -> list[Entry]:
    """Existing poses that an action sees again as a band beneath the graph, some of its loop closures, and its observations."""
    key: list[Entry] = []
    if len(sight.observed):
        panel.segments(sight.observed, colors=style.LANDMARK, linewidths=0.6, alpha=0.8, zorder=3)
        key.append(Entry(f"its predicted observations ({len(sight.observed)})", color=style.LANDMARK, linewidth=1.0))
    if not len(sight.closures):
        return key
    if len(sight.seen):
        places, near = graph.positions[:, :2], np.diff(sight.seen) == 1
        ends = np.concatenate([sight.seen[:-1][near], sight.seen]), np.concatenate([sight.seen[1:][near], sight.seen])
        segments = places[np.stack(ends, axis=1)]
        panel.segments(segments, colors=style.SEEN_AGAIN, linewidths=_BAND, capstyle="round", zorder=0.5)
        key.append(Entry(f"poses it sees again ({len(sight.seen)})", color=style.SEEN_AGAIN, linewidth=_BAND))
    drawn = sight.thinned()
    panel.segments(drawn, colors=style.PREDICTED_CLOSURE, linewidths=0.6, alpha=0.8, zorder=3)
    number = f"{len(drawn)} of {len(sight.closures)}" if len(drawn) < len(sight.closures) else str(len(drawn))
    return [*key, Entry(f"its predicted closures ({number})", color=style.PREDICTED_CLOSURE, linewidth=1.0)]


def draw_candidates(panel: Panel, paths: Sequence[FloatArray], decision: Decision) -> list[Entry]:
    """Ruled-out paths, above them the survivors, and the best itself."""
    best = decision.best
    panel.line(paths[best], color=style.BEST, linewidth=2.4, casing=4.2, zorder=7)
    which = "the best" if decision.num_actions > 1 else "the only candidate"
    key = [Entry(f"{style.short_name(decision, best)}, {which}", color=style.BEST, linewidth=2.4)]
    surviving = set(decision.survivors.tolist()) - {best}
    ruled_out = set(range(decision.num_actions)) - surviving - {best}
    width = 1.1 if len(surviving) < _MANY_PATHS else 0.7
    looks: tuple[tuple[str, set[int], dict[str, Any]], ...] = (
        ("may still be optimal", surviving, {"color": style.SURVIVOR, "linewidth": width, "zorder": 5}),
        ("ruled out", ruled_out, {"color": style.RULED_OUT, "linewidth": 0.8, "linestyle": (0, (4, 2)), "zorder": 4}),
    )
    for label, chosen, look in looks:
        for action in sorted(chosen):
            panel.line(paths[action], **look)
        if chosen:
            key.append(Entry(f"{label} ({len(chosen)})", **look))
    return key


def draw_ends(panel: Panel, graph: PoseGraph, start: Start, goals: FloatArray) -> list[Entry]:
    """Start and goals, shape (G, 2)."""
    at_pose = "the graph's last pose" if start.pose == graph.last_pose else f"pose {graph.label(start.pose)}"
    name = f"start, {f'near {at_pose}' if start.distance(graph) else at_pose}"
    key: list[Entry] = []
    for label, place, marker, colour, size in (
        (name, start.place, "o", "white", 6.0),
        ("goal" if len(goals) == 1 else f"goals ({len(goals)})", goals, "*", style.GOAL, 12.0),
    ):
        look: dict[str, Any] = {"marker": marker, "markerfacecolor": colour, "markeredgecolor": style.INK, "markersize": size}
        panel.line(place, linestyle="none", zorder=9, **look)
        key.append(Entry(label, linestyle="none", **look))
    return key
