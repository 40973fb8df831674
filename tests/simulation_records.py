"""A record made by hand, so that what is written and drawn of a run can be tested without a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from topobelief.candidates.polyline import path_length
from topobelief.geometry import SE2_GROUP
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.simulation.noise import InjectedNoise
from topobelief.simulation.occupancy import OccupancyMap
from topobelief.simulation.record import Deliberation, History, KeyPoses, Leg, Record, RunOptions
from topobelief.simulation.scan import Scan
from topobelief.simulation.scenario import Goal, Scenario
from topobelief.strategies.choice import Choice, Reasons
from topobelief.strategies.question import Question
from topobelief.world import World

INFORMATION = np.diag([100.0, 100.0, 816.0])


def made_record(
    *, objective: str = "error", noise: InjectedNoise | None = None, outcome: str = "arrived", **changes: Any
) -> Record:
    """A drive around a pillar in a room of 8 m: 4 poses to the first goal, 4 more to the second, and one closure."""
    world = World.from_boxes([(3, 3, 5, 5)], bounds=(0, 0, 8, 8))
    scenario = Scenario("room", world, (1.5, 1.5, 0.0), (Goal((6.5, 1.5), 2), Goal((1.5, 6.5), 2)))
    corners = [(1.5, 1.5), (3, 1.5), (5, 1.5), (6.5, 1.5), (6.5, 4), (6.5, 6.5), (4, 6.5), (1.5, 6.5)]
    truth = np.column_stack([corners, [0.0, 0, 0, np.pi / 2, np.pi / 2, np.pi, np.pi, np.pi]])
    edges = [*((i, i + 1) for i in range(7)), (7, 0)]
    rng = np.random.default_rng(0)
    registered = PoseGraph(truth, edges, None, INFORMATION)
    graph = PoseGraph(truth + rng.normal(0, 0.05, truth.shape), edges, None, INFORMATION)
    prior = PoseGraph(truth[:4], edges[:3], None, INFORMATION)
    actions = [
        Action([[6.5, 4, 1.57], [1.5, 6.5, 3.14]], [(3, 4), (4, 5), (5, 0)], INFORMATION, label="path 1"),
        Action([[4, 2, 3.14], [1.5, 6.5, 3.14]], [(3, 4), (4, 5)], INFORMATION, label="path 2"),
    ]
    paths = [np.array([(6.5, 1.5), (6.5, 6.5), (1.5, 6.5)]), np.array([(6.5, 1.5), (1.5, 1.5), (1.5, 6.5)])]
    question = Question(prior, actions, np.array([path_length(path) for path in paths]), np.zeros(2), objective)
    values = question.values()
    decision = question.planner().decide(actions)
    angles = np.linspace(-np.pi, np.pi, 8, endpoint=False)
    scans = tuple(
        Scan(np.where(angles == 0, np.nan, 1.0 + index / 10), angles, time=float(index), max_range=10.0) for index in range(8)
    )
    legs = (
        Leg(
            goal=1,
            first_pose=0,
            last_pose=3,
            outcome="arrived",
            num_candidates=2,
            planned=5.0,
            distance=5.1,
            driven_seconds=8.0,
            goal_distance=0.10,
            believed_goal_distance=0.12,
        ),
        Leg(
            goal=2,
            first_pose=3,
            last_pose=7,
            outcome=outcome,
            num_candidates=2,
            planned=10.0,
            distance=10.2,
            num_closures=1,
            prior_value=-9.0,
            predicted_value=float(values[0]),
            achieved_value=-20.0,
            candidates_seconds=0.2,
            decision_seconds=0.01,
            driven_seconds=20.0,
            goal_distance=0.21,
            believed_goal_distance=0.11,
        ),
    )
    wheel = SE2_GROUP.compose(truth, np.linspace(0, 1, 8)[:, None] * [0.3, 0.1, 0.1])
    times = np.arange(8.0)
    fields: dict[str, Any] = {
        "scenario": scenario,
        "options": RunOptions(objective=objective, noise=noise, seed=3),
        "history": History(
            key_poses=KeyPoses(times=times, truth=truth, wheel_odometry=wheel, motions=truth, scans=scans),
            legs=legs,
            track=np.column_stack([times, truth, truth]),
        ),
        "estimate": truth,
        "graph": graph,
        "registered": registered,
        "occupancy": OccupancyMap.from_scans(truth, scans, bounds=world.bounds),
        "deliberations": (
            Deliberation(
                leg=1,
                question=question,
                paths=paths,
                values=values,
                choice=Choice(decision.best, 0.01, Reasons.of(decision)),
            ),
        ),
        "outcome": outcome,
    }
    return Record(**{**fields, **changes})
