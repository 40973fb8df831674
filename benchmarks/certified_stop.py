"""After a certified stop of `simulate --explore`, do random trips of the same length gain more than is enough?

    python benchmarks/certified_stop.py office --seeds 5 --max-length 10 --enough 0.01

For each seed the robot drives the scenario's goals and then its trips, until it is proven that none gains more than enough.
From where it then stands, random trips that return to the start are drawn on the same roadmap, through random vertices as
long as they fit, and the expected error of the map after each is computed exactly: with new poses by distance, as the
certificate counts them, and with new poses where paths turn too, as the robot's front end makes them.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass, replace

import numpy as np

import topobelief as tb
from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import path_length
from topobelief.candidates.propose import predict_along
from topobelief.candidates.roadmap import Roadmap, build_roadmap
from topobelief.errors import NotOptimizedWarning
from topobelief.simulation.decisions import decision_rule
from topobelief.simulation.episode import Episode
from topobelief.simulation.exploration import TripOptions
from topobelief.simulation.front_end import FrontEndSettings
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import Record, RunOptions
from topobelief.simulation.scenario import named_scenario
from topobelief.simulation.ways import place_with_room

_MOST_TRIES = 50  # random vertices that do not fit, after which a trip is long enough


@dataclass(frozen=True, slots=True)
class Stop:
    """A run that ended, and what random trips would gain after it, metres of map error."""

    seed: int
    record: Record
    gains: FloatArray  # by distance
    gains_with_turns: FloatArray


def random_trip(roadmap: Roadmap, max_length: float, rng: np.random.Generator) -> FloatArray:
    """From the start through random vertices and back, shape (waypoints, 2)."""
    home = roadmap.distances_to(0)
    walk, length, tries = [0], 0.0, 0
    while tries < _MOST_TRIES:
        via = int(rng.integers(1, len(roadmap.vertices)))
        there = roadmap.distances_to(via)[walk[-1]]
        if length + there + home[via] <= max_length:
            walk += _way(roadmap, walk[-1], via)
            length += there
        else:
            tries += 1
    walk += _way(roadmap, walk[-1], 0)
    return roadmap.vertices[walk]


def _way(roadmap: Roadmap, source: int, target: int) -> list[int]:
    """Vertices after the first of the shortest way."""
    return (roadmap.shortest_path(source, target) or [source])[1:]


def stopped(name: str, seed: int, xi: float, trips: TripOptions, num_random: int) -> Stop:
    """Drive a seed, and draw random trips from where it ends."""
    scenario = named_scenario(name)
    record = Episode(scenario, RunOptions(seed=seed, noise=InjectedNoise.of_ratio(xi), trips=trips)).run()
    belief = tb.PoseGraph(record.estimate, record.graph.edges, None, record.graph.information)
    rule = decision_rule(scenario.rule, belief, scenario.world, FrontEndSettings(), seed=seed)
    start = place_with_room(scenario.world, belief.positions[-1], rule.robot_radius)
    roadmap = build_roadmap(scenario.world, start, None, rule.num_vertices, rule.robot_radius, seed)
    rng = np.random.default_rng(seed)
    paths = [random_trip(roadmap, trips.max_length, rng) for _ in range(num_random)]
    assert all(path_length(path) <= trips.max_length + 1e-9 for path in paths)
    now = tb.expected_errors(belief).map_rmse
    gains = [
        now - tb.Planner(belief, objective="error", signature="resistance").entropies(
            predict_along(belief, scenario.world, paths, replace(rule, turn=turn))
        )
        for turn in (None, rule.turn)
    ]  # fmt: skip
    return Stop(seed, record, *gains)


def main() -> None:
    """Print a line a seed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenario", nargs="?", default="office")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--xi", type=float, default=0.35, help="injected noise")
    parser.add_argument("--max-length", type=float, default=10.0, help="metres")
    parser.add_argument("--enough", type=float, default=0.01, help="metres of map error")
    parser.add_argument("--trips", type=int, default=10)
    parser.add_argument("--random", type=int, default=20, help="random trips after each stop")
    options = parser.parse_args()
    trips = TripOptions(max_length=options.max_length, return_to_start=True, enough=options.enough, max_trips=options.trips)
    warnings.simplefilter("ignore", NotOptimizedWarning)
    print("seed  ended      trips  error now  none gains over  random trips: most gained, with turns   (cm)", flush=True)
    for seed in range(options.seeds):
        found = stopped(options.scenario, seed, options.xi, trips, options.random)
        end = found.record.exploration
        if end is None:
            print(f"{seed:4d}  {found.record.outcome}", flush=True)
            continue
        row = (end.value_now, end.most, found.gains.max(), found.gains_with_turns.max())
        shown = "  ".join(f"{100 * value:9.2f}" for value in row)
        over = int((found.gains > options.enough).sum())
        print(
            f"{seed:4d}  {end.stopped_by:10s} {end.num_trips:5d}  {shown}   {over} of {options.random} more than enough",
            flush=True,
        )


if __name__ == "__main__":
    main()
