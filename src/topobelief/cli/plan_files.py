"""What `topobelief plan` leaves behind: paths.png, bounds.png and decision.json, all of them whole or none."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.candidates.attitude import waypoint_poses
from topobelief.candidates.polyline import path_length
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.start import Start
from topobelief.cli.console import Reporter
from topobelief.cli.plan_arguments import GivenPlace
from topobelief.cli.plan_candidates import Proposals
from topobelief.cli.plan_certificate import document as found
from topobelief.cli.plan_draws import Spread
from topobelief.cli.plan_ends import Goal
from topobelief.cli.plan_errors import PlanErrors
from topobelief.cli.plan_search import Limits, Searched
from topobelief.errors import FileError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.files import atomic_file
from topobelief.io.json_values import without_nan
from topobelief.io.path_formats import path_text, require_path_suffix
from topobelief.optional import is_installed
from topobelief.planning.decision import Decision
from topobelief.version import __version__
from topobelief.world import FreeSpace, World, World3D


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A decision and all that it was made from."""

    graph: PoseGraph
    world: FreeSpace
    start: Start
    goals: Sequence[Goal]
    proposals: Proposals
    decision: Decision
    entropies: FloatArray  # (K,): exact values, whether or not the decision needed them; nan where unknown
    errors: PlanErrors
    reasons: Sequence[str]  # K
    spreads: Sequence[Spread]  # of the finalists
    rule: CandidateRule
    options: Mapping[str, object]  # as given, what the rule settles aside
    notes: Sequence[str]
    searched: Searched | None = None  # of the roadmap, where it was
    limits: Limits | None = None  # of that search


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


def checked_path_file(file: Path | None) -> Path | None:
    """The file to write the chosen path to, before any work is done for it.

    Raises
    ------
    FileError
        Where no format has its suffix, or it could not be written.
    """
    if file is not None:
        require_path_suffix(file)
        if not file.absolute().parent.is_dir():
            raise FileError(file, "expected a file to write, got a folder that does not exist; make it, or choose another file")
        if file.is_dir() or not os.access(file if file.exists() else file.absolute().parent, os.W_OK):
            raise FileError(file, "expected a file to write, got a folder or one without permission; choose another file")
    return file


def document(result: PlanResult) -> dict[str, object]:
    """The decision (`Decision.from_dict` reads it), with the paths and all that repeats the plan."""
    decision, graph, start = result.decision, result.graph, result.start
    paths, goals = result.proposals.paths, result.proposals.goals
    plain = decision.to_dict()
    exact = without_nan(result.entropies.tolist())
    described = zip(plain["actions"], paths, goals, exact, result.reasons, strict=True)
    actions = [
        {**action, "goal": goal, "waypoints": path.tolist(), "exact_for_comparison": value, "why": why}
        for action, path, goal, value, why in described
    ]
    best = paths[decision.best]
    return {
        **plain,
        "actions": actions,
        "chosen": {
            "index": decision.best,
            "label": decision.name(decision.best),
            "length": path_length(best),
            "x_y_yaw" if graph.group.position_dim == 2 else "x_y_z_quaternion": _poses(result).tolist(),
        },
        "expected_errors": result.errors.document(),
        **({} if result.searched is None or result.limits is None else {"search": found(result.searched, result.limits)}),
        "closure_draws": [asdict(spread) for spread in result.spreads],
        "notes": list(result.notes),
        "topobelief": __version__,
        "graph": {
            "num_poses": graph.num_poses,
            "num_landmarks": graph.num_landmarks,
            "num_edges": graph.num_edges,
            "chi2": graph.chi2,
        },
        "start": (start.place if start.distance(graph) else graph.poses[start.pose]).tolist(),
        "start_pose": {"index": start.pose, "id": int(graph.ids[start.pose])},
        "goals": [{"name": goal.name, "place": goal.place.tolist()} for goal in result.goals],
        "options": {name: _plain(value) for name, value in {**result.options, **asdict(result.rule)}.items()},
    }


def _poses(result: PlanResult) -> FloatArray:
    """The waypoints of the chosen path as poses."""
    return waypoint_poses(result.graph, result.proposals.paths[result.decision.best], result.rule.attitude)


def _plain(value: object) -> object:
    """For JSON: None for no limit, text for paths and places, lists for arrays, fields for models."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(each) for each in cast("Sequence[object]", value)]
    return str(value) if isinstance(value, Path | GivenPlace) else without_nan(value)


def write(folder: Path | None, path_file: Path | None, result: PlanResult, reporter: Reporter) -> None:
    """Draw and write what is wanted, all of it or nothing; say where it is and how long all took."""
    writers: dict[str, Callable[[Path], object]] = {}
    if path_file is not None:
        text = path_text(path_file, _poses(result))
        writers[str(path_file.absolute())] = _writer(text)
    if folder is not None:
        writers["decision.json"] = _writer(json.dumps(document(result), indent=2, allow_nan=False) + "\n")
        with reporter.stage("pictures"):
            try:
                writers |= _pictures(result)
            finally:  # a picture that fails does not cost the decision
                write_together(folder, writers)
        reporter.say(
            "",
            f"{_pictures_told(folder, result)}; decision: {folder / 'decision.json'}",
        )
    elif path_file is not None:
        write_together(path_file.absolute().parent, writers)
    if path_file is not None:
        reporter.say(f"Chosen path, with a heading at every pose: {path_file}")
    if writers:
        reporter.say(f"Took {reporter.time_taken()}")


def _writer(text: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(text, encoding="utf-8", newline="\n")


def _pictures_told(folder: Path, result: PlanResult) -> str:
    if result.searched is not None or isinstance(result.world, World3D):
        page = f"; to turn and zoom: {folder / 'paths.html'}" if isinstance(result.world, World3D) and has_page() else ""
        return f"Picture: {folder / 'paths.png'}{page}"
    return f"Pictures: {folder / 'paths.png'} and {folder / 'bounds.png'}"


def _pictures(result: PlanResult) -> dict[str, Callable[[Path], object]]:
    """What writes each picture: of a search one, with the front; of a list of candidates two."""
    from topobelief.report.bounds_figure import draw_bounds
    from topobelief.report.canvas import save_figure
    from topobelief.report.paths_figure import draw_paths
    from topobelief.report.search_figure import draw_search

    if isinstance(result.world, World3D):
        return _pictures_in_space(result, result.world)
    if not isinstance(result.world, World):
        return {}
    if result.searched is not None:
        search = draw_search(result.graph, result.world, result.searched.found, start=result.start)
        return {"paths.png": lambda path: save_figure(search, path)}
    proposals, decision = result.proposals, result.decision
    paths = draw_paths(
        result.graph,
        result.world,
        proposals.paths,
        proposals.actions,
        decision,
        goal=[goal.place for goal in result.goals] or [proposals.paths[decision.best][-1]],
        start=result.start,
    )
    bounds = draw_bounds(decision, result.entropies)
    return {"paths.png": lambda path: save_figure(paths, path), "bounds.png": lambda path: save_figure(bounds, path)}


def _pictures_in_space(result: PlanResult, world: World3D) -> dict[str, Callable[[Path], object]]:
    """A picture from above and from the side and, where plotly is installed, a page to turn it; of a list the bounds too."""
    from topobelief.report.bounds_figure import draw_bounds
    from topobelief.report.canvas import save_figure
    from topobelief.report.space_figure import draw_space, space_titles
    from topobelief.report.space_page import space_page

    proposals, decision = result.proposals, result.decision
    goals = np.array([goal.place for goal in result.goals]).reshape(-1, 3)
    title, subtitle = space_titles(decision, None if result.searched is None else result.searched.found)
    scene = (result.graph, world, proposals.paths, proposals.actions[decision.best], decision.best)
    figure = draw_space(*scene, title, subtitle, goals=goals, start=result.start)
    writers: dict[str, Callable[[Path], object]] = {"paths.png": lambda path: save_figure(figure, path)}
    if has_page():
        names = [
            f"{action.label}, {path_length(path):.1f} m"
            for action, path in zip(proposals.actions, proposals.paths, strict=True)
        ]
        writers["paths.html"] = _writer(space_page(*scene, names, title, subtitle, goals=goals, start=result.start))
    if result.searched is None:
        bounds = draw_bounds(decision, result.entropies)
        writers["bounds.png"] = lambda path: save_figure(bounds, path)
    return writers


def has_page() -> bool:
    """Whether interactive pages can be made."""
    return is_installed("plotly")


def write_together(folder: Path, writers: Mapping[str, Callable[[Path], object]]) -> None:
    """Write files beside their places first; they take their names once all are complete.

    Parameters
    ----------
    folder
        Made where it is missing.
    writers
        What writes each, by its name in the folder, or by its whole path for one elsewhere.

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
