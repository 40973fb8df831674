"""The page as one HTML file, with what it shows in it."""

from __future__ import annotations

import html
import json
import secrets
from collections.abc import Mapping
from importlib.resources import files
from string import Template

from topobelief.io.json_values import without_nan


def page_text(
    situation: Mapping[str, object], answer: Mapping[str, object] | None = None, *, token: str | None = None
) -> tuple[str, str]:
    """The page, and the nonce by which a browser may tell its own script and style from others.

    Parameters
    ----------
    situation
        Map, graph and choices, as `situation.document` makes it.
    answer
        Shown at once.
    token
        What questions to a server carry; None for a page that stands alone.
    """
    nonce = secrets.token_urlsafe(16)
    asking = "Click the map to say where the robot shall go." if token is not None else ""
    data = {"situation": situation, "answer": answer, "live": token is not None, "token": token or "", "first": asking}
    title = f"{situation['name']}: where to drive next"
    text = Template(_part("page.html")).substitute(
        title=html.escape(title),
        first=html.escape(asking),
        nonce=nonce,
        css=_part("page.css"),
        script=_part("page.js"),
        data=_json(data),
    )
    return text, nonce


def _json(document: Mapping[str, object]) -> str:
    """JSON that may stand in a script element."""
    text = json.dumps(without_nan(document), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _part(name: str) -> str:
    return (files("topobelief.page") / name).read_text(encoding="utf-8")
