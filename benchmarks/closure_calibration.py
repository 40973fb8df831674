"""Do simulated robots find the closures that they predict, and the information that these promise?

    python benchmarks/closure_calibration.py office --seeds 10 --out out/closure-calibration

drives a scenario for each seed (extra `sim`) and keeps what each decision knew, decided and led to; seeds that are there
already are not driven again. Then it prints, seed by seed and as medians, predicted and found key poses and closures, and
predicted and achieved gain in map entropy, by the closure model of today. With `--seeds 0` it only reads what is there.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import topobelief as tb
from topobelief.candidates.learned_closures import History
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.simulation.decisions import value_after
from topobelief.simulation.episode import Episode
from topobelief.simulation.front_end import FrontEndSettings
from topobelief.simulation.record import Record, RunOptions
from topobelief.simulation.scenario import SCENARIO_NAMES, named_scenario


@dataclass(frozen=True)
class Row:
    """A leg or the sum of several: pairs of predicted and found."""

    poses: tuple[float, float]
    closures: tuple[float, float]
    gain: tuple[float, float]

    def __add__(self, other: Row) -> Row:
        return Row(*(tuple(np.add(a, b)) for a, b in zip(self.pairs, other.pairs, strict=True)))

    @property
    def pairs(self) -> tuple[tuple[float, float], ...]:
        """Poses, closures, gain in nats."""
        return self.poses, self.closures, self.gain


def main() -> None:
    """Drive what is missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", choices=SCENARIO_NAMES)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("out/closure-calibration"))
    parser.add_argument("--unknown-rule", action="store_true", help="predict as if nothing were known of the front end")
    arguments = parser.parse_args()
    folder: Path = arguments.out / arguments.scenario
    for seed in range(arguments.seeds):
        if not (folder / f"{seed}" / "legs.json").exists():
            options = RunOptions(seed=seed, strategy="spanning_trees", objective="map")
            keep(Episode(named_scenario(arguments.scenario), options).run(), folder / f"{seed}")
    runs = sorted(folder.glob("*/legs.json"), key=lambda file: int(file.parent.name))
    print(f"{arguments.scenario}: predicted / found, all decisions of a run together")
    print(f"{'seed':>4} {'legs':>4} {'key poses':>13} {'closures':>15} {'ratio':>6} {'gain in nats':>17} {'ratio':>6}")
    sums: list[Row] = []
    for file in runs:
        rows = read(file, arguments.scenario, rule_is_known=not arguments.unknown_rule)
        total = sum(rows[1:], rows[0])
        sums.append(total)
        print(f"{file.parent.name:>4} {len(rows):>4} {shown(total)}")
    for name, pairs in zip(("key poses", "closures", "gain"), zip(*(row.pairs for row in sums), strict=True), strict=True):
        ratios = [predicted / found for predicted, found in pairs if found]
        low, median, high = np.quantile(ratios, [0.1, 0.5, 0.9])
        print(
            f"{name}: predicted over found, median {median:.2f} over {len(ratios)} runs (10 to 90 %: {low:.2f} to {high:.2f})"
        )


def keep(record: Record, folder: Path) -> None:
    """Write the graph at the end and, for each decision, its prior and chosen path."""
    folder.mkdir(parents=True, exist_ok=True)
    tb.write_g2o(record.graph, folder / "graph.g2o")
    legs: list[dict[str, object]] = []
    for deliberation in record.deliberations:
        leg = record.history.legs[deliberation.leg]
        if leg.believed_arrived:
            prior = deliberation.question.graph
            name = f"prior{deliberation.leg}.g2o"
            if prior.num_edges:
                tb.write_g2o(prior, folder / name)
            legs.append(
                {
                    "prior": name if prior.num_edges else None,
                    "pose": prior.poses[-1].tolist(),
                    "path": deliberation.paths[leg.chosen].tolist(),
                    "last_pose": leg.last_pose,
                }
            )
    (folder / "legs.json").write_text(json.dumps(legs))


def read(file: Path, scenario: str, *, rule_is_known: bool) -> list[Row]:
    """Each decision of a run that was followed to its end."""
    settings, world = FrontEndSettings(), named_scenario(scenario).world
    graph = tb.read_g2o(file.parent / "graph.g2o")
    rows: list[Row] = []
    for leg in json.loads(file.read_text()):
        information = None
        if leg["prior"] is None:
            prior = tb.PoseGraph([leg["pose"]], np.zeros((0, 2), dtype=int), None, np.eye(3))
            information = settings.expected_information
        else:
            prior = tb.read_g2o(file.parent / leg["prior"])
        (action,) = predict_actions(
            prior,
            [leg["path"]],
            closures=tb.learn_closures(prior, world=world, rule=settings.expected_closures if rule_is_known else None),
            information=information,
            spacing=settings.key_pose_distance,
            turn=settings.key_pose_angle,
            world=world,
        )
        n, end = prior.num_poses, leg["last_pose"] + 1
        inside = (graph.edges < end).all(axis=1)
        driven = tb.PoseGraph(graph.poses[:end], graph.edges[inside], None, graph.information[inside])
        made = History.of(driven).closures
        rows.append(
            Row(
                poses=(action.num_new_poses, end - n),
                closures=(action.expected_closures, int(np.count_nonzero(made[:, 0] >= n))),
                gain=gains(prior, action, driven) if n > 1 else (0.0, 0.0),
            )
        )
    return rows


def gains(prior: tb.PoseGraph, action: tb.Action, driven: tb.PoseGraph) -> tuple[float, float]:
    """By how much the entropy of the existing map falls, predicted and achieved, nats."""
    planner = tb.Planner(prior, objective="map")
    stay = tb.Action(np.zeros((0, 3)), np.zeros((0, 2), dtype=int), prior.information[0])
    before, predicted = planner.entropies([stay, action])
    return float(before - predicted), float(before - value_after(driven, prior.num_poses, "map"))


def shown(row: Row) -> str:
    """Numbers of a row."""
    (p, q), (c, d), (g, h) = row.pairs
    ratio = f"{c / d:6.2f}" if d else "     -"
    return f"{p:6.0f}/{q:6.0f} {c:7.1f}/{d:7.0f} {ratio} {g:8.1f}/{h:8.1f} {g / h if h else float('nan'):6.2f}"


if __name__ == "__main__":
    main()
