"""What `topobelief plan` leaves behind: paths.png, bounds.png and decision.json, all of them whole or none."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length, path_poses
from topobelief.candidates.propose import CandidateRule, Candidates
from topobelief.candidates.start import Start
from topobelief.cli.console import Reporter
from topobelief.cli.plan import GivenStart
from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import atomic_file
from topobelief.io.json_values import without_nan
from topobelief.planning.decision import Decision
from topobelief.version import __version__
from topobelief.world import World


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A decision and all that it was made from."""

    graph: PoseGraph
    world: World
    start: Start
    candidates: Candidates
    decision: Decision
    entropies: FloatArray  # (K,): exact values, whether or not the decision needed them; nan where unknown
    goal: tuple[float, float]
    rule: CandidateRule
    options: Mapping[str, object]  # as given, what the rule settles aside
    notes: Sequence[str]


def checked_folder(folder: Path | None) -> Path | None:
    """The folder to write to, before any work is done for it.

    Raises
    ------
    FileError
        Where a file is in its place, or it cannot be written to or made.
    """
    if folder is None:
        return None
    nearest = folder
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise FileError(nearest, "expected a folder to write to, got a file; choose another --out")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise FileError(nearest, "expected a folder to write to, got one without permission; choose another --out")
    return folder


def document(result: PlanResult) -> dict[str, object]:
    """The decision (`Decision.from_dict` reads it), with the paths and all that repeats the plan."""
    decision, graph, start = result.decision, result.graph, result.start
    best = result.candidates.paths[decision.best]
    plain = decision.to_dict()
    exact = without_nan(result.entropies.tolist())
    described = zip(plain["actions"], result.candidates.paths, exact, strict=True)
    actions = [{**action, "waypoints": path.tolist(), "exact_for_comparison": value} for action, path, value in described]
    return {
        **plain,
        "actions": actions,
        "chosen": {
            "index": decision.best,
            "label": decision.name(decision.best),
            "length": path_length(best),
            "x_y_yaw": path_poses(best).tolist(),
        },
        "notes": list(result.notes),
        "topobelief": __version__,
        "graph": {"num_poses": graph.num_poses, "num_edges": graph.num_edges, "chi2": graph.chi2},
        "start": (start.place if start.distance(graph) else graph.poses[start.pose]).tolist(),
        "start_pose": {"index": start.pose, "id": int(graph.ids[start.pose])},
        "goal": list(result.goal),
        "options": {name: _plain(value) for name, value in {**result.options, **asdict(result.rule)}.items()},
    }


def _plain(value: object) -> object:
    """For JSON: None for no limit, text for paths, lists for arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path | GivenStart) else without_nan(value)


def write(folder: Path, result: PlanResult, reporter: Reporter) -> None:
    """Draw and write everything, and say where it is and how long all took."""
    text = json.dumps(document(result), indent=2, allow_nan=False) + "\n"
    writers: dict[str, Callable[[Path], object]] = {"decision.json": lambda path: path.write_text(text, encoding="utf-8")}
    with reporter.stage("pictures"):
        try:
            writers |= _pictures(result)
        finally:  # a picture that fails does not cost the decision
            write_together(folder, writers)
    reporter.say(
        "",
        f"Pictures: {folder / 'paths.png'} and {folder / 'bounds.png'}; decision: {folder / 'decision.json'}",
        f"Took {reporter.time_taken()}",
    )


def _pictures(result: PlanResult) -> dict[str, Callable[[Path], object]]:
    """What writes each picture."""
    from topobelief.report.bounds_figure import draw_bounds
    from topobelief.report.canvas import save_figure
    from topobelief.report.paths_figure import draw_paths

    candidates, decision = result.candidates, result.decision
    paths = draw_paths(
        result.graph,
        result.world,
        candidates.paths,
        candidates.actions,
        decision,
        goal=result.goal,
        start=result.start,
    )
    bounds = draw_bounds(decision, result.entropies)
    return {"paths.png": lambda path: save_figure(paths, path), "bounds.png": lambda path: save_figure(bounds, path)}


def write_together(folder: Path, writers: Mapping[str, Callable[[Path], object]]) -> None:
    """Write files beside their places first; they take their names once all are complete.

    Raises
    ------
    FileError
        If the folder cannot be made or a file not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"expected a folder to write to, got: {error.strerror}") from None
    with ExitStack() as stack:
        for name, write_to in writers.items():
            write_to(stack.enter_context(atomic_file(folder / name)))
