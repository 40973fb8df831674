"""The report as one HTML page that needs no network: figures, the table of claims, and a decision to explore.

What comes from data is escaped; what the page's script reads is JSON in which no tag can end.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from shapely import MultiPolygon

from topobelief.arrays import FloatArray
from topobelief.candidates.polyline import subdivided
from topobelief.io.json_values import json_in_script
from topobelief.optional import load
from topobelief.report.reproduction.beyond_table import beyond_cells
from topobelief.report.reproduction.choice_table import choice_cells
from topobelief.report.reproduction.figures import NamedFigure
from topobelief.reproduction.claims import Claim
from topobelief.reproduction.planning_sessions import NOISES, SESSIONS, PlanningSession, cases, office_session
from topobelief.reproduction.run import Reproduction

TITLE = "Topological belief space planning, reproduced"

_POINT_SPACING = 0.3  # metres between the points of a path that can be hovered


def page(found: Reproduction, figures: Sequence[NamedFigure], pictures: Mapping[str, bytes], tables: Sequence[str]) -> str:
    """The whole page.

    Parameters
    ----------
    found
    figures
        In their order.
    pictures
        Each figure's PNG, by its name.
    tables
        Names of the CSV files beside the page, without their suffix.

    Raises
    ------
    InvalidInputError
        Where plotly is not installed.
    """
    holding = sum(claim.holds for claim in found.claims)
    return _template("page.html").substitute(
        title=escape(TITLE),
        css=_text("page.css"),
        lead=escape(_lead(found)),
        claims_lead=escape(
            f"{holding} of {len(found.claims)} lines hold as written, over {found.plan.num_seeds} seeds of roadmap and paths. "
            "A claim about decisions holds where it holds in every seed; the share stands beside it. Published numbers are "
            "read off the paper's plots and take no part in the verdict."
        ),
        claims="".join(_claim_row(claim) for claim in found.claims),
        choices_lead=escape(
            f"{sum(row.chooser == 'error' for row in found.choices)} decisions: what choosing so loses of the expected error "
            "of the map against the best candidate, mean (and worst), and the median rank correlation with it."
        ),
        choices=_table(choice_cells(found.choices)),
        beyond_lead=escape(
            f"The second session, {len({(row.seed, row.xi) for row in found.beyond})} of its seeds and noises: medians of what "
            "the way found gains against staying, of the gap that the search leaves, of lengths, and of processor time."
        ),
        beyond=_table(beyond_cells(found.beyond)),
        figures="".join(_figure(figure, pictures[figure.name]) for figure in figures),
        tables=", ".join(f'<a href="tables/{escape(name)}.csv">{escape(name)}</a>' for name in tables),
        facts="".join(f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in facts(found).items()),
        plotly=_plotly(),
        data=json_in_script(_data(found)),
        script=_text("page.js"),
    )


def facts(found: Reproduction) -> dict[str, str]:
    """Command, seed, versions and machine."""
    plan = found.plan
    sizes = ", ".join(map(str, plan.sizes))
    named = {
        "command": command(found),
        "seeds": f"{plan.seed} to {plan.seed + plan.num_seeds - 1}",
        "random graphs": f"n = {sizes}; {plan.num_random_graphs} for each n and density",
        "real graphs": ", ".join(path.stem for path in plan.files) or "none given",
        "time spent measuring": f"{found.seconds / 60:.1f} min",
    }
    return named | found.machine


def command(found: Reproduction) -> str:
    """What was typed, by its effect."""
    plan = found.plan
    options = [path.name for path in plan.files] + (["--quick"] if plan.quick else []) + [f"--seed {plan.seed}"]
    return " ".join(["topobelief reproduce", *options])


def _lead(found: Reproduction) -> str:
    return (
        "The experiments of Kitanov and Indelman, “Topological Information-Theoretic Belief Space Planning with Optimality "
        f"Guarantees” (arXiv 1903.00927), run again and taken further. {command(found)}."
    )


def _claim_row(claim: Claim) -> str:
    verdict = "yes" if claim.holds else "no"
    cells = (
        ("", f"{claim.claim} ({claim.where})"),
        ("case", claim.scope),
        ("measured", claim.measured),
        ("threshold", claim.threshold),
        ("held in", f"{claim.holding} of {claim.cases}"),
        ("holds", verdict),
        ("published", claim.published),
    )
    written = "".join(
        f"<td{f' data-label={chr(34)}{label}{chr(34)}' if label else ''}"
        f"{f' class={chr(34)}{verdict}{chr(34)}' if label == 'holds' else ''}>{escape(text)}</td>"
        for label, text in cells
    )
    return f'<tr data-holds="{verdict}" data-topic="{escape(claim.topic)}">{written}</tr>'


def _table(cells: list[list[str]]) -> str:
    """Rows of a table, the first its header."""
    header, *lines = cells
    rows = [(header, "th"), *((line, "td") for line in lines)]
    return "".join(f"<tr>{''.join(f'<{tag}>{escape(text)}</{tag}>' for text in line)}</tr>" for line, tag in rows)


def _figure(figure: NamedFigure, png: bytes) -> str:
    name, caption = escape(figure.name), escape(figure.caption)
    picture = base64.b64encode(png).decode("ascii")
    links = ", ".join(f'<a href="figures/{name}.{suffix}">{suffix.upper()}</a>' for suffix in ("pdf", "png"))
    image = f'<img alt="{caption}" src="data:image/png;base64,{picture}">'
    return f'<figure id="figure-{name}">{image}<figcaption>{caption} {links}</figcaption></figure>'


def _data(found: Reproduction) -> dict[str, Any]:
    seed, rows = found.plan.seed, cases(found.actions)
    sessions = [office_session(name, seed, xi) for name in SESSIONS for xi in NOISES]
    return {
        "walls": _rings(sessions[0].world.free),
        "sessions": [
            {**_geometry(session), "actions": [asdict(row) for row in rows[session.name, session.xi, seed]]}
            for session in sessions
        ],
        "graphs": [asdict(row) for row in found.random_graphs],
    }


def _geometry(session: PlanningSession) -> dict[str, Any]:
    return {
        "name": session.name,
        "xi": session.xi,
        "start": _rounded(session.graph.positions[-1]),
        "goal": list(session.goal),
        "prior": _rounded(session.graph.positions),
        "paths": [_rounded(_dense(path)) for path in session.paths],
    }


def _dense(path: FloatArray) -> FloatArray:
    """With points so close that the mouse finds one."""
    longest = float(np.max(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    return subdivided(path, max(1, math.ceil(longest / _POINT_SPACING)))


def _rings(shape: MultiPolygon) -> list[Any]:
    return [_rounded(np.asarray(ring.coords)) for polygon in shape.geoms for ring in (polygon.exterior, *polygon.interiors)]


def _rounded(points: FloatArray) -> list[Any]:
    return np.round(points, 3).tolist()


def _plotly() -> str:
    """plotly's script, whole."""
    return load("plotly.offline", "page").get_plotlyjs()


def _text(name: str) -> str:
    return (files("topobelief.report.reproduction") / name).read_text(encoding="utf-8")


def _template(name: str) -> Template:
    return Template(_text(name))
