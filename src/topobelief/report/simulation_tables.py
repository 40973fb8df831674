"""Runs of the simulation for a terminal: one line per leg, a run's metrics, and strategies side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from topobelief.objectives.objective import Objective
from topobelief.planning.registry import OBJECTIVES, chosen, unit_of
from topobelief.planning.units import cell, quantity, shown_unit
from topobelief.report.tables import quantity_table
from topobelief.simulation.comparison import StrategySummary
from topobelief.simulation.exploration import ENOUGH, TRIPS_DRIVEN, UNDECIDED
from topobelief.simulation.metrics import run_metrics
from topobelief.simulation.record import Leg, Record
from topobelief.wording import counted


def leg_line(leg: Leg) -> str:
    """What was chosen on the way to a goal or for a trip, and what came of it."""
    chosen = f"path {leg.chosen} of {leg.num_candidates} ({leg.planned:.1f} m); " if leg.num_candidates else ""
    driven = ""
    if leg.driven_seconds:
        driven = f" after {leg.distance:.1f} m in {leg.driven_seconds:.0f} s with {leg.num_closures} loop closures"
    if not math.isnan(leg.goal_distance):
        end = "its end" if leg.trip else "the goal"
        driven += f", {leg.goal_distance:.2f} m from {end} ({leg.believed_goal_distance:.2f} m as the robot believes)"
    return f"{leg.name}: {chosen}{leg.outcome}{driven}"


def metrics_table(record: Record) -> Table:
    """Errors, objective and times of a run."""
    values = run_metrics(record)
    rows = [
        ("goals reached in truth", f"{values['goals_reached']:.0f} of {values['goals']:.0f}"),
        ("graph", f"{values['poses']:.0f} key poses, {values['closures']:.0f} loop closures"),
        (
            "driven",
            f"{values['distance']:.1f} m in {values['driven_seconds']:.0f} s (simulated), {values['contacts']:.0f} contacts",
        ),
    ]
    if not math.isnan(values["goal_distance"]):
        true, believed = values["goal_distance"], values["believed_goal_distance"]
        rows.append(("distance from the goals", f"at most {true:.2f} m, as the robot believes {believed:.2f} m"))
    for label, name in (
        ("trajectory error", "slam"),
        ("  odometry of the graph alone", "odometry_factors"),
        ("  scan odometry", "scan_odometry"),
        ("  wheel odometry", "wheel_odometry"),
    ):
        whole, before = values[f"error_{name}"], values[f"error_{name}_before"]
        rows.append((label, f"{cell(whole, 'm')} cm on all poses, {cell(before, 'm')} cm on those before the last leg"))
    if "predicted_value" in values:
        objective: Objective = chosen(OBJECTIVES, record.options.objective)
        unit, words = objective.unit, (("prior", "before"), ("predicted", "predicted"), ("achieved", "achieved"))
        found = ", ".join(f"{word} {cell(values[f'{name}_value'], unit)}" for name, word in words)
        rows.append((f"{objective.quantity}, last leg", f"{found} {shown_unit(unit)}"))
    driven = values["driven_seconds"]
    for label, name in (("making candidates", "candidates_seconds"), ("deciding", "decision_seconds")):
        share = f", {values[name] / driven:.3%} of the time driven" if driven else ""
        rows.append((label, f"{values[name]:.3f} s{share}"))
    return quantity_table(f"{record.scenario.name}: {record.outcome}", rows)


def trips_table(record: Record) -> Table:
    """What each trip was predicted to gain, and what it gained."""
    unit = unit_of(record.options.objective)
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        pad_edge=False,
        caption=f"before, predicted, achieved: {_quantity(record.options.objective)}, of the poses that stood before the trip, "
        f"{shown_unit(unit)}",
        caption_justify="left",
    )
    table.add_column("trip", no_wrap=True)
    for name in ("metres", "closures", "before", "predicted", "achieved", "gain", "of predicted"):
        table.add_column(name, justify="right", no_wrap=True)
    for leg in record.legs:
        if leg.trip:
            before, predicted, achieved = leg.prior_value, leg.predicted_value, leg.achieved_value
            values = [cell(value, unit) for value in (before, predicted, achieved, before - achieved, before - predicted)]
            table.add_row(str(leg.trip), f"{leg.distance:.1f}", str(leg.num_closures), *values)
    return table


def exploration_line(record: Record) -> str:
    """Why no more trips were driven, and what is known of the next one; empty where there were to be none."""
    found, trips = record.exploration, record.options.trips
    if found is None or trips is None:
        return ""
    after = f"after {counted(found.num_trips, 'trip')}"
    if math.isnan(found.value_now):
        return f"Trips ended {after}: {found.stopped_by}"
    unit = unit_of(record.options.objective)
    returning = " that returns" if trips.return_to_start else ""
    improves = f"trip of up to {trips.max_length:g} m{returning} improves the {_quantity(record.options.objective)}"
    most = "nothing is proven of the others" if math.isinf(found.most) else f"none by more than {quantity(found.most, unit)}"
    best = f"the best {improves} by {quantity(max(found.gain, 0.0), unit)}, {most}"
    asked = quantity(trips.enough, unit) if trips.enough else "anything"
    if found.stopped_by == ENOUGH:
        return f"Enough {after}: no {improves} by more than {asked}."
    if found.stopped_by == UNDECIDED:
        return f"Undecided {after}: {best}, where {asked} was asked for."
    if found.stopped_by == TRIPS_DRIVEN:
        return f"Stopped {after}, as many as were allowed: {best}."
    return f"Trips ended {after}: {found.stopped_by}"


def _quantity(objective: str) -> str:
    return chosen(OBJECTIVES, objective).quantity


def comparison_table(found: Sequence[StrategySummary], *, baseline: str, unit: str) -> Table:
    """One line per strategy: medians over the seeds, and the share of seeds in which it beat the baseline.

    Parameters
    ----------
    found
    baseline
        The strategy that gains are told against.
    unit
        Of the objective.
    """
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1),
        pad_edge=False,
        caption=f"medians over seeds; predicted: the objective of the chosen path, {shown_unit(unit)}; errors in centimetres, "
        f"means over redraws: of the map, the poses that stood before the session, and of all poses; against {baseline}: "
        "saved, of the map's error on the same seed, and gain, by which its median is lower",
        caption_justify="left",
    )
    table.add_column("strategy", no_wrap=True)
    for name in ("arrived", "metres", "closures", "predicted", "map error", "error of all", "saved", "gain", "better", "same"):
        table.add_column(name, justify="right", no_wrap=True)
    for each in found:
        table.add_row(
            Text(each.strategy),
            f"{each.num_arrived}/{each.num_runs}",
            f"{each.planned:.1f}",
            f"{each.num_closures:.0f}",
            cell(each.predicted, unit),
            f"{100 * each.error_shared:.1f}",
            f"{100 * each.error_all:.1f}",
            cell(each.saved, "m"),
            _percent(each.gain),
            _percent(each.share_better),
            _percent(each.share_same),
        )
    return table


def _percent(share: float) -> str:
    return "–" if math.isnan(share) else f"{share:.0%}"
