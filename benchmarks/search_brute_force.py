"""The search over a roadmap against brute force: small random roadmaps, all of whose walks are enumerated and evaluated.

    python benchmarks/search_brute_force.py --roadmaps 2000 --out out/search-brute-force

A roadmap counts where it has 30 to 20 000 walks within the length, those that turn back among them. Noise, closure rule (limit
a pose, probability, angle), walls, goal or none, return, spacing and cost a metre are drawn (`tests/roadmap_walks.py`).
For each objective, two questions:

* does local search alone find the optimum, and where it does not, does the whole search with its bound?
* does any step of the bound exceed the least value of all walks? The bound counts closures with the map, so it is compared with
  values that count these alone; how often the poses' closures among each other put the optimum below the bound is counted too.

Roadmaps are worked on one after the other and kept; the same command continues.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

import topobelief as tb
from topobelief.errors import PlanningError
from topobelief.io.row_files import json_rows, rows_of_json
from topobelief.runs.in_process import InProcess
from topobelief.runs.journal import Journal
from topobelief.runs.lock import alone
from topobelief.runs.run import run_tasks
from topobelief.search.anytime import SearchProgress
from topobelief.search.both_bounds import BothBounds
from topobelief.search.walk_bounds import walk_bounds

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from roadmap_walks import Case, random_case

OBJECTIVES = ("error", "map", "joint", "per_pose")
FEWEST, MOST = 30, 20_000
STEPS = 5  # of the bound, before the best value is told to it and after
FINE = 10  # layers per new pose of the second bound; the first one has coarse layers
SAME = 1e-9  # relative
SEEDS_AT_ONCE = 200


@dataclass(frozen=True)
class Row:
    """One objective on one roadmap."""

    seed: int
    objective: str
    num_walks: int
    by_local_search: bool  # whether the optimum was found without the bound,
    found: bool  # or with it
    lost: float  # by the whole search, in the unit of the objective
    spread: float  # worst minus best value of all walks
    violated_by: float  # bound minus the least value without closures among new poses; 0 or less
    gap: float  # least value without these closures minus the bound after all steps
    below: float  # bound minus the least value with these closures, where positive


@dataclass(frozen=True)
class RoadmapTask:
    """One random roadmap."""

    seed: int
    objectives: tuple[str, ...]

    @property
    def id(self) -> str:
        """Its seed and what is asked."""
        return f"seed {self.seed} {' '.join(self.objectives)}"


def rows_of(task: RoadmapTask) -> list[Row]:
    """A row for each objective; none where the roadmap does not count."""
    case = random_case(task.seed)
    walks = case.walks(MOST)
    if len(walks) < FEWEST:
        return []
    actions = tb.predict_actions(
        case.graph,
        [case.roadmap.vertices[walk] for walk in walks],
        information=case.information,
        spacing=case.spacing,
        turn=None,
        closures=case.rule,
        world=case.world,
    )
    costs = case.cost_per_metre * np.array([case.length(walk) for walk in walks])
    return [row_of(task.seed, objective, case, actions, costs) for objective in task.objectives]


def row_of(seed: int, objective: str, case: Case, actions: list[tb.Action], costs: np.ndarray) -> Row:
    """One objective on one roadmap."""
    planner = tb.Planner(case.graph, objective=objective, engine="incremental")
    values = planner.entropies(actions) + costs
    with_map = planner.entropies([closures_with_map(action, case.graph.num_poses) for action in actions]) + costs
    least = float(values.min())
    optimum = least + SAME * max(1e-3, abs(least))
    by_local_search = value_found(case, objective, optimum, turn=100.0)  # no pose at a corner, and no bound
    value = by_local_search if by_local_search <= optimum else value_found(case, objective, optimum)
    violated_by, bound = bounded(case, objective, float(with_map.min()))
    return Row(
        seed,
        objective,
        len(actions),
        by_local_search <= optimum,
        value <= optimum,
        max(0.0, value - least),
        float(np.ptp(values)),
        violated_by,
        float(with_map.min()) - bound,
        max(0.0, bound - least),
    )


def value_found(case: Case, objective: str, optimum: float, turn: float | None = None) -> float:
    """What the search finds before it rests by itself; it is stopped at the optimum, after which nothing can change."""

    def stop(progress: SearchProgress) -> None:
        if progress.value <= optimum:
            raise KeyboardInterrupt

    return tb.search_roadmap(
        case.graph,
        case.roadmap,
        goal=None if case.goal is None else case.roadmap.vertices[case.goal],
        max_length=case.max_length,
        return_to_start=case.return_to_start,
        objective=objective,
        closures=case.rule,
        world=case.world,
        cost_per_metre=case.cost_per_metre,
        spacing=case.spacing,
        information=case.information,
        turn=turn,
        on_progress=stop,
    ).value


def bounded(case: Case, objective: str, least: float) -> tuple[float, float]:
    """By how much any step of the bound exceeds the least value (-inf: there is no walk to bound), and the last bound."""
    make = partial(walk_bounds, case.graph, case.roadmap, objective=objective, **case.arguments())
    bound = BothBounds(lambda pieces: make(pieces_per_pose=pieces or FINE), lambda arcs: FINE)
    highest = -np.inf
    for step in range(2 * STEPS):
        if bound.finished:
            break
        try:
            bound.step()
        except PlanningError:  # no edge within the length: staying is all there is
            return -np.inf, least
        highest = max(highest, bound.lower_bound)
        if step + 1 >= STEPS:
            bound.prune(least)
            highest = max(highest, bound.lower_bound)
    return float(highest - least), float(bound.lower_bound)


def closures_with_map(action: tb.Action, num_poses: int) -> tb.Action:
    """The action without closures among its own new poses."""
    kept = (action.edges[:, 1] < num_poses) | (np.arange(len(action.edges)) < action.num_new_poses)
    probabilities = None if action.probabilities is None else action.probabilities[kept]
    return replace(action, edges=action.edges[kept], information=action.information[kept], probabilities=probabilities)


def main() -> None:
    """Work on the roadmaps that are missing, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--roadmaps", type=int, default=2000)
    parser.add_argument("--one-objective", action="store_true", help="on each roadmap, in turns: a quarter of the time")
    parser.add_argument("--out", type=Path, default=Path("out/search-brute-force"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    begin, rows, failed = time.process_time(), list[Row](), list[str]()
    with alone(arguments.out):
        journal: Journal[RoadmapTask, list[Row]] = Journal(arguments.out / "journal.jsonl", {"steps": STEPS}, json_rows)
        for first in itertools.count(step=SEEDS_AT_ONCE):
            tasks = [
                RoadmapTask(seed, OBJECTIVES[seed % 4 : seed % 4 + 1] if arguments.one_objective else OBJECTIVES)
                for seed in range(first, first + SEEDS_AT_ONCE)
            ]
            run_tasks(tasks, rows_of, journal, InProcess())
            failed += [f"{task.id}: {journal.error(task.id)}" for task in tasks if journal.error(task.id)]
            done = [task for task in tasks if not journal.error(task.id)]
            rows += [row for task in done for row in rows_of_json(Row, journal.result(task.id))]
            num_roadmaps = len({row.seed for row in rows})
            print(f"{num_roadmaps} roadmaps, {len(failed)} failed, {time.process_time() - begin:.0f} s of the processor")
            print(table(rows), *failed, sep="\n", flush=True)
            if num_roadmaps >= arguments.roadmaps:
                return


def table(rows: list[Row]) -> str:
    """A line for each objective."""
    lines = [
        f"{'':9s}{'roadmaps':>9s}{'walks':>8s}{'local':>8s}{'found':>8s}{'lost at most':>14s}{'violated':>9s}"
        f"{'by at most':>11s}{'median gap':>11s}{'below by own closures':>23s}"
    ]
    for objective in OBJECTIVES:
        some = [row for row in rows if row.objective == objective]
        if not some:
            continue
        bad = [row for row in some if row.violated_by > 1e-9 * max(1.0, row.spread)]
        lines.append(
            f"{objective:9s}{len(some):9d}{np.median([row.num_walks for row in some]):8.0f}"
            f"{np.mean([row.by_local_search for row in some]):8.2%}{np.mean([row.found for row in some]):8.2%}"
            f"{max(row.lost for row in some):14.3g}{len(bad):9d}{max(row.violated_by for row in some):11.2g}"
            f"{np.median([row.gap for row in some]):11.3g}{np.mean([row.below > SAME for row in some]):23.2%}"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
