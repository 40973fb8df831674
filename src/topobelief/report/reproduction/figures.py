"""All figures of a reproduction, by the names of their files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from topobelief.report.reproduction.beyond_figure import draw_beyond
from topobelief.report.reproduction.choice_figure import draw_choices
from topobelief.report.reproduction.entropy_figures import draw_bounds, draw_signatures
from topobelief.report.reproduction.length_figure import draw_lengths
from topobelief.report.reproduction.quality_figures import draw_anytime, draw_bounds_quality, draw_real_graphs
from topobelief.report.reproduction.random_graph_figures import draw_random_graphs
from topobelief.report.reproduction.session_figures import draw_candidates, draw_uncertainty
from topobelief.report.reproduction.time_figures import draw_speed_ratios, draw_times
from topobelief.reproduction.planning_sessions import NOISES, SESSIONS, cases, office_session
from topobelief.reproduction.run import Reproduction
from topobelief.reproduction.trajectory_uncertainty import best_and_worst


@dataclass(frozen=True, slots=True)
class NamedFigure:
    """What a figure is called, what it says in a sentence, and what draws it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


def figures_of(found: Reproduction) -> list[NamedFigure]:
    """In the order of the report; those without data are left out."""
    seed, xi = found.plan.seed, NOISES[1]
    figures = [
        NamedFigure(
            "candidates", "Candidate paths of both sessions over their roadmaps.", lambda: _candidates(found, seed, xi)
        ),
        NamedFigure(
            "uncertainty",
            "Topology and trajectory uncertainty after the best and the worst action of each session.",
            lambda: draw_uncertainty([best_and_worst(office_session(name, seed, xi)) for name in SESSIONS]),
        ),
        NamedFigure(
            "entropy_bounds",
            "Joint entropy of each action with its bounds: the paper's, exact and by Hadamard, and two of this project.",
            lambda: draw_bounds(found.actions, seed),
        ),
        NamedFigure(
            "signatures", "Each signature against the joint entropy, six cases.", lambda: draw_signatures(found.actions, seed)
        ),
        NamedFigure("times", "Time per action by method, with what the paper published.", lambda: draw_times(found.times)),
        NamedFigure(
            "speed_ratios", "Speed of signatures on random pose graphs.", lambda: draw_speed_ratios(found.random_graphs)
        ),
        NamedFigure(
            "random_graphs",
            "Signatures against the entropy on random pose graphs.",
            lambda: draw_random_graphs(found.random_graphs),
        ),
        NamedFigure(
            "path_length",
            "Objectives against path length, in metres and in millimetres, and what each of them chooses.",
            lambda: draw_lengths(found.lengths),
        ),
        NamedFigure(
            "bounds_quality",
            "What families of bounds rule out, what they leave to be lost, and evaluations until the best action is proven.",
            lambda: draw_bounds_quality(found.bounds),
        ),
        NamedFigure("anytime", "The best action so far against exact evaluations.", lambda: draw_anytime(found.anytime)),
        NamedFigure(
            "entropy_or_error",
            "What each way to choose loses of the map's expected error, and how it ranks the candidates by it.",
            lambda: draw_choices(found.choices),
        ),
        NamedFigure(
            "beyond_candidates",
            "What the best of 20 and of 200 diverse paths gains, and what a search of the whole roadmap finds.",
            lambda: draw_beyond(found.beyond),
        ),
    ]
    if found.real_actions:
        figures.append(
            NamedFigure(
                "real_graphs",
                "The best action so far on real pose graphs, and what bounds rule out there.",
                lambda: draw_real_graphs(found.anytime, found.real_bounds),
            )
        )
    return figures


def _candidates(found: Reproduction, seed: int, xi: float) -> Figure:
    rows = cases(found.actions)
    best = [int(np.argmin([row.joint for row in rows[name, xi, seed]])) for name in SESSIONS]
    return draw_candidates([office_session(name, seed, xi) for name in SESSIONS], best)
