"""The example notebook: its cells run, and show what the file holds."""

from __future__ import annotations

import base64
import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "notebook"
REBUILD = "run python examples/notebook/build.py"


@pytest.fixture(scope="module")
def build() -> dict[str, Any]:
    """What the script that makes the notebook defines."""
    return runpy.run_path(str(FOLDER / "build.py"))


@pytest.fixture(scope="module")
def filed() -> dict[str, Any]:
    return json.loads((FOLDER / "office.ipynb").read_text(encoding="utf-8"))


def texts(outputs: list[dict[str, Any]]) -> str:
    """What outputs show, pictures aside."""
    parts = [out.get("text") or [*out["data"].get("text/html", []), *out["data"]["text/plain"]] for out in outputs]
    return "\n".join("".join(part) for part in parts)


def test_the_notebook_is_made_from_the_script(build, filed):
    held = [(cell["cell_type"], "".join(cell["source"])) for cell in filed["cells"]]
    assert held == build["read_cells"](FOLDER / "office.py"), REBUILD


def test_the_cells_run_and_show_what_the_notebook_holds(build, filed):
    """Words are the same, numbers to rounding."""
    cells = build["read_cells"](FOLDER / "office.py")
    number = r"-?\d+(?:\.\d+)?"
    for cell, outputs in zip(filed["cells"], build["run_notebook"](cells), strict=True):
        held, shown = texts(cell.get("outputs", [])), texts(outputs)
        assert re.sub(number, "0", shown) == re.sub(number, "0", held), REBUILD
        assert [float(n) for n in re.findall(number, shown)] == pytest.approx(
            [float(n) for n in re.findall(number, held)], abs=0.02
        ), REBUILD


def test_pictures_are_small(filed):
    pictures = [
        base64.b64decode(out["data"]["image/png"])
        for cell in filed["cells"]
        for out in cell.get("outputs", [])
        if "image/png" in out.get("data", {})
    ]
    assert len(pictures) == 3
    assert sum(map(len, pictures)) < 300_000
    assert all(picture.startswith(b"\x89PNG") for picture in pictures)


def test_a_cell_shows_what_jupyter_shows(build):
    """What it prints, and the value of its last line unless that ends in a semicolon."""
    names: dict[str, Any] = {}
    printed, value = build["run_cell"]("print('a')\nx = 2\nx", names)
    assert printed["text"] == ["a\n"]
    assert value["data"] == {"text/plain": ["2"]}
    assert build["run_cell"]("x;", names) == build["run_cell"]("None", names) == []
