"""A run's folder: what is written after each leg, and what a run is continued from.

run.json          scenario, options, legs, metrics, outcome
metrics.csv       the metrics alone
graph.g2o         the graph that was decided on, at its estimate
registered.g2o    the same before noise was added
key_poses.csv     true, estimated, dead-reckoned poses
sensors.npz       scans, wheel odometry and tracked motions, bit for bit
leg-N.json        a decision: candidates, ranking, bounds
map.yaml, .pgm    a ROS map
"""

from __future__ import annotations

import csv
import io
import json
import math
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, cast

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import FileError
from topobelief.io.files import StrPath, read_text
from topobelief.io.g2o import write_g2o
from topobelief.io.json_values import without_nan
from topobelief.planning.registry import unit_of
from topobelief.simulation.exploration import Exploration
from topobelief.simulation.metrics import chained, run_metrics
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.record import Deliberation, History, KeyPoses, Leg, Record, RunOptions
from topobelief.simulation.scan import Scan

SCHEMA = "topobelief.run/2"
RUN_FILE, SENSORS_FILE = "run.json", "sensors.npz"

Writers = Mapping[str, Callable[[Path], object]]
"""For each file what writes it to a path."""


def writers(record: Record) -> Writers:
    """What writes a run's folder but for its map and its pictures."""
    texts = {
        RUN_FILE: _json(run_document(record)),
        "metrics.csv": _csv(["metric", "value"], [[name, value] for name, value in run_metrics(record).items()]),
        "key_poses.csv": _key_poses(record),
        **{f"leg-{each.leg + 1}.json": _json(_deliberation(each)) for each in record.deliberations},
    }
    found: dict[str, Callable[[Path], object]] = {
        name: lambda path, text=text: path.write_text(text, encoding="utf-8", newline="") for name, text in texts.items()
    }
    found["graph.g2o"] = lambda path: write_g2o(record.graph, path)
    found["registered.g2o"] = lambda path: write_g2o(record.registered, path)
    found[SENSORS_FILE] = lambda path: _write_sensors(path, record.history)
    return found


def run_document(record: Record) -> dict[str, object]:
    """What run.json holds; None stands for what is not a number."""
    options = record.options
    return {
        "schema": SCHEMA,
        "topobelief": version("topobelief"),
        "scenario": record.scenario.name,
        "options": {
            **asdict(options),
            "noise": None if options.noise is None else [options.noise.sigma_p, options.noise.sigma_theta],
        },
        "unit": unit_of(options.objective),
        "outcome": record.outcome,
        "metrics": {name: without_nan(value) for name, value in run_metrics(record).items()},
        "legs": [{name: without_nan(value) for name, value in asdict(leg).items()} for leg in record.legs],
        "exploration": None if record.exploration is None else _exploration(record.exploration),
    }


def read_history(folder: StrPath, *, scenario: str, options: RunOptions) -> History:
    """The run in a folder, to be continued.

    Raises
    ------
    FileError
        If there is none, it is damaged, or it is one of another scenario or of other options, which are named.
    """
    path = Path(folder) / RUN_FILE
    try:
        content: object = json.loads(read_text(path))
        document = cast("dict[str, Any]", content) if isinstance(content, dict) else {}
        schema = document.get("schema")
        if schema != SCHEMA:
            raise FileError(path, f'expected a run of schema "{SCHEMA}", got {schema!r}')
        _require_same(path, "scenario", scenario, document["scenario"])
        known = document["options"]
        noise = None if known["noise"] is None else InjectedNoise(*known["noise"])
        _require_same(path, "seed", options.seed, known["seed"])
        _require_same(path, "noise", options.noise, noise)
        _require_same(path, "unknown", options.unknown, known["unknown"])
        legs = tuple(Leg(**{name: _number(value) for name, value in leg.items()}) for leg in document["legs"])
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise FileError(path, f"expected a run as `topobelief simulate` writes it, got {error!r}") from None
    return _read_sensors(Path(folder) / SENSORS_FILE, legs)


def _require_same(path: Path, name: str, expected: object, got: object) -> None:
    if expected != got:
        raise FileError(path, f"expected a run with {name} {expected} to continue, got {got}; choose another --out")


def _write_sensors(path: Path, history: History) -> None:
    key_poses, scans = history.key_poses, history.key_poses.scans
    columns = {
        "times": key_poses.times,
        "truth": key_poses.truth,
        "wheel_odometry": key_poses.wheel_odometry,
        "motions": key_poses.motions,
        "track": history.track,
        "ranges": np.array([scan.ranges for scan in scans]),
        "angles": np.array([scan.angles for scan in scans]),
        "scan_times": np.array([scan.time for scan in scans]),
        "max_ranges": np.array([scan.max_range for scan in scans]),
    }
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **columns)


def _read_sensors(path: Path, legs: tuple[Leg, ...]) -> History:
    try:
        with np.load(path, allow_pickle=False) as file:
            columns: dict[str, FloatArray] = {name: np.asarray(file[name], dtype=np.float64) for name in file.files}
        scans = zip(
            columns["ranges"], columns["angles"], columns["scan_times"].tolist(), columns["max_ranges"].tolist(), strict=True
        )
        key_poses = KeyPoses(
            times=columns["times"],
            truth=columns["truth"],
            wheel_odometry=columns["wheel_odometry"],
            motions=columns["motions"],
            scans=tuple(Scan(ranges, angles, time=time, max_range=max_range) for ranges, angles, time, max_range in scans),
        )
        return History(key_poses=key_poses, legs=legs, track=columns["track"])
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise FileError(path, f"expected the sensor data of a run, got {error}") from None


def _key_poses(record: Record) -> str:
    blocks = {
        "true": record.truth,
        "estimate": record.estimate,
        "graph": record.graph.poses,
        "graph_odometry": chained(record.graph),
        "scan_odometry": chained(record.registered),
        "wheel_odometry": record.history.key_poses.wheel_odometry,
    }
    header = ["index", "time", *(f"{name}_{axis}" for name in blocks for axis in ("x", "y", "theta"))]
    table = np.concatenate([record.history.key_poses.times[:, None], *blocks.values()], axis=1)
    return _csv(header, [[index, *(f"{value:.6f}" for value in row)] for index, row in enumerate(table.tolist())])


def _deliberation(each: Deliberation) -> dict[str, object]:
    """A decision as JSON; `decision` is what `Decision.from_dict` reads, None where the strategy makes none."""
    decision = each.choice.decision
    question = each.question
    candidates = zip(each.paths, question.lengths.tolist(), question.actions, each.values.tolist(), strict=True)
    return {
        "num_poses": question.graph.num_poses,
        "objective": question.objective,
        "unit": question.unit,
        "chosen": each.choice.index,
        "decision": None if decision is None else decision.to_dict(),
        "candidates": [
            {
                "length": length,
                "value": without_nan(value),
                "num_new_poses": action.num_new_poses,
                "num_closures": action.num_closures,
                "waypoints": path.tolist(),
            }
            for path, length, action, value in candidates
        ],
    }


def _exploration(found: Exploration) -> dict[str, object]:
    """How trips ended; None stands for what is not known."""
    return without_nan({**asdict(found), "gain": found.gain, "most": found.most})


def _json(document: Mapping[str, object]) -> str:
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _csv(header: list[str], rows: list[list[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()


def _number(value: object) -> Any:
    return math.nan if value is None else value
