"""The figure of the three objectives against path length, in metres and in millimetres.

    python docs/figures/make_objectives.py [--seed 7] [--out docs/figures/objectives.png]

A robot has driven most of a lap and can reach one goal along 60 paths, each through a random place. For every path
the exact joint entropy, map entropy and joint entropy per pose are drawn, once with positions in metres and once with
the very same graph in millimetres (docs, the mathematics, section 11).
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from scipy import stats

import topobelief as tb

SIGMA_P, SIGMA_THETA = 0.1, 0.035  # m, rad
INFORMATION = np.diag([SIGMA_P**-2, SIGMA_P**-2, SIGMA_THETA**-2])
SPACING, CLOSURE_RADIUS = 1.0, 2.0  # m
LAP = np.array([[0, 0], [24, 0], [24, 14], [0, 14], [0, 4]], dtype=float)  # m
GOAL = np.array([20.0, 4.0])  # m
NUM_PATHS = 60
UNITS = {"metres": 1.0, "millimetres": 1000.0}  # per metre
OBJECTIVES = {"joint": "joint entropy", "map": "map entropy", "per_pose": "joint entropy per pose"}
COLOURS = "viridis"  # legible to the colour-blind, and in grey
WINNERS = ("#D55E00", "#0072B2", "#CC79A7", "#000000")  # Okabe and Ito


@dataclass(frozen=True)
class Scene:
    """A graph, the actions on it, and where their paths run."""

    graph: tb.PoseGraph
    actions: list[tb.Action]
    lengths: np.ndarray  # (K,), metres
    closures: np.ndarray  # (K,)


def driven_along(waypoints: np.ndarray) -> np.ndarray:
    """Poses `SPACING` apart along a polyline, the last step shorter; headings along it; shape (n, 3)."""
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    so_far = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.append(np.arange(0.0, so_far[-1] - 1e-9, SPACING), so_far[-1])
    x, y = (np.interp(at, so_far, column) for column in waypoints.T)
    leg = np.clip(np.searchsorted(so_far, at, side="left") - 1, 0, len(steps) - 1)
    along = np.diff(waypoints, axis=0)[leg]
    return np.column_stack([x, y, np.arctan2(along[:, 1], along[:, 0])])


def closures_between(new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """Pairs (new, old) of poses that lie within the closure radius, shape (c, 2)."""
    distance = np.linalg.norm(new[:, None, :2] - old[None, :, :2], axis=2)
    return np.argwhere(distance < CLOSURE_RADIUS)


def prior_graph(rng: np.random.Generator) -> tb.PoseGraph:
    """A lap with some wobble, a few closures between neighbours but one."""
    poses = driven_along(LAP)
    poses[:, :2] += rng.normal(scale=0.1, size=(len(poses), 2))
    odometry = [(i, i + 1) for i in range(len(poses) - 1)]
    closures = [(i + 2, i) for i in range(0, len(poses) - 2, 4)]
    return tb.PoseGraph(poses, odometry + closures, None, INFORMATION)


def action_through(graph: tb.PoseGraph, via: np.ndarray, label: str) -> tuple[tb.Action, float]:
    """The action of driving to the goal through a place, and its length in metres."""
    waypoints = np.stack([graph.poses[-1, :2], via, GOAL])
    new = driven_along(waypoints)[1:]
    n = graph.num_poses
    chain = np.column_stack([np.arange(n - 1, n - 1 + len(new)), np.arange(n, n + len(new))])
    pairs = closures_between(new, graph.poses[:-5])  # the last five poses are odometry's neighbours
    edges = np.concatenate([chain, pairs + np.array([n, 0])])
    length = float(np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum())
    return tb.Action(new, edges, INFORMATION, label=label), length


def make_scene(seed: int) -> Scene:
    """The lap and `NUM_PATHS` paths through places drawn uniformly inside and around it."""
    rng = np.random.default_rng(seed)
    graph = prior_graph(rng)
    places = rng.uniform((-8, -8), (32, 22), size=(NUM_PATHS, 2))
    made = [action_through(graph, place, f"path {index}") for index, place in enumerate(places)]
    actions = [action for action, _ in made]
    return Scene(graph, actions, np.array([length for _, length in made]), np.array([a.num_closures for a in actions]))


def in_units(scene: Scene, per_metre: float) -> Scene:
    """The same scene with positions in another unit: poses, measurements and information."""
    unit = np.array([per_metre, per_metre, 1.0])
    scale = 1 / np.outer(unit, unit)
    graph = scene.graph
    scaled = tb.PoseGraph(graph.poses * unit, graph.edges, graph.measurements * unit, graph.information * scale)
    actions = [tb.Action(a.poses * unit, a.edges, a.information * scale, label=a.label) for a in scene.actions]
    return Scene(scaled, actions, scene.lengths, scene.closures)


def changes(scene: Scene, objective: str) -> np.ndarray:
    """Each action's objective minus that of staying, shape (K,), nats."""
    stay = tb.Action(np.empty((0, 3)), np.empty((0, 2), dtype=int), INFORMATION, label="stay")
    values = tb.Planner(scene.graph, objective=objective).entropies([stay, *scene.actions])
    return values[1:] - values[0]


def nats_per_pose(per_metre: float) -> float:
    """What a further pose without a closure adds to the joint entropy: kappa/2 ln(2 pi e) - 1/2 ln |Omega|."""
    log_det = math.log(np.linalg.det(INFORMATION)) - 4 * math.log(per_metre)
    return 1.5 * math.log(2 * math.pi * math.e) - 0.5 * log_det


def draw_scene(axes: Axes, scene: Scene, winners: dict[int, list[str]]) -> None:
    """The lap, all paths, and the paths that win."""
    paths = [np.vstack([scene.graph.poses[-1, :2], action.poses[:, :2]]) for action in scene.actions]
    axes.add_collection(LineCollection(paths, colors="0.82", linewidths=0.7))
    axes.plot(*scene.graph.poses[:, :2].T, "-", color="0.35", linewidth=2.2, solid_capstyle="round")
    for (index, names), colour, style in zip(winners.items(), WINNERS, ("-", (0, (5, 2)), "-.", ":"), strict=False):
        axes.plot(*paths[index].T, linestyle=style, color=colour, linewidth=2.2, label="\n".join(names))
    start = scene.graph.poses[-1, :2]
    axes.plot(*start, "o", color="black", markersize=6)
    axes.plot(*GOAL, "*", color="black", markersize=12)
    axes.annotate("robot", start, xytext=(-6, 0), textcoords="offset points", ha="right", va="center")
    axes.annotate("goal", GOAL, xytext=(0, 8), textcoords="offset points", ha="center")
    axes.set(xlim=(-9, 33), ylim=(-9, 23), aspect="equal", anchor="N", xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"the driven lap and {NUM_PATHS} paths to one goal", fontsize=10)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), frameon=False, handlelength=3.0, title="path with the least")


def draw_objective(axes: Axes, scene: Scene, values: np.ndarray, colours: Normalize, winner_colour: str) -> None:
    """Entropy change against length, the winner ringed, with the rank correlation."""
    axes.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
    axes.scatter(scene.lengths, values, c=scene.closures, cmap=COLOURS, norm=colours, s=22, edgecolor="white", linewidth=0.3)
    best = int(np.argmin(values))
    axes.scatter(scene.lengths[best], values[best], s=120, facecolor="none", edgecolor=winner_colour, linewidth=2.0)
    rho = stats.spearmanr(scene.lengths, values.round(6)).statistic  # equal up to rounding is a tie
    axes.text(0.97, 0.96, signed(f"rank correlation {rho:+.2f}"), transform=axes.transAxes, ha="right", va="top", fontsize=9)
    axes.margins(0.08, 0.17)
    axes.spines[["top", "right"]].set_visible(False)


def signed(text: str) -> str:
    """With a real minus sign, as wide as the plus."""
    return text.replace("-", "\N{MINUS SIGN}")


def draw(scene: Scene) -> Figure:
    """The whole figure."""
    scenes = {unit: in_units(scene, per_metre) for unit, per_metre in UNITS.items()}
    values = {(unit, objective): changes(scenes[unit], objective) for unit in UNITS for objective in OBJECTIVES}
    winners: dict[int, list[str]] = {}
    for objective, name in OBJECTIVES.items():
        best = {unit: int(np.argmin(values[unit, objective])) for unit in UNITS}
        agree = len(set(best.values())) == 1
        for unit, index in best.items():
            label = f"{name}, {'either unit' if agree else unit}"
            labels = winners.setdefault(index, [])
            labels.extend([label] if label not in labels else [])

    figure = Figure(figsize=(13.4, 5.8), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 4, width_ratios=(1.6, 1, 1, 1))
    draw_scene(figure.add_subplot(grid[:, 0]), scene, winners)
    colours = Normalize(0, int(scene.closures.max()))
    panels: list[Axes] = []
    for cell, ((unit, objective), column) in enumerate(values.items()):
        axes = figure.add_subplot(grid[cell // 3, 1 + cell % 3], sharex=panels[0] if panels else None)
        panels.append(axes)
        colour = WINNERS[list(winners).index(int(np.argmin(column)))]
        draw_objective(axes, scene, column, colours, colour)
        if objective == "joint":
            slope = nats_per_pose(UNITS[unit])
            reach = np.array([scene.lengths.min(), scene.lengths.max()])
            axes.plot(reach, slope * reach / SPACING, "--", color="0.4", linewidth=1.0, zorder=0)
            axes.text(0.03, 0.04, signed(f"dashed: {slope:+.1f} nats a pose"), transform=axes.transAxes, fontsize=9)
            axes.set_ylabel(f"in {unit}\nchange against staying [nats]")
        if cell < 3:
            axes.set_title(OBJECTIVES[objective], fontsize=10)
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("path length [m]")
    bar = figure.colorbar(panels[0].collections[0], ax=panels, fraction=0.025, pad=0.01)
    bar.set_label("loop closures")
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("objectives.png"))
    options = parser.parse_args(arguments)
    draw(make_scene(options.seed)).savefig(options.out, pil_kwargs={"optimize": True})
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
