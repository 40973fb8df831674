"""Where tests find real pose graphs and floor plans: one drive of our own ships with the project, the others do not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_BESIDE_CHECKOUT = Path(__file__).resolve().parents[2] / "shared"


RECORDED = "recorded.g2o"
"""121 poses and 386 edges that the simulated robot recorded in the office."""


def data_file(name: str) -> Path:
    """The recorded drive, or a graph from $TOPOBELIEF_DATA or shared/data beside the checkout; skips where that is absent."""
    if name == RECORDED:
        return Path(__file__).resolve().parents[1] / "examples" / "office" / RECORDED
    return _file_or_skip(Path(os.environ.get("TOPOBELIEF_DATA", _BESIDE_CHECKOUT / "data")) / name)


def map_file(name: str) -> Path:
    """A floor plan from $TOPOBELIEF_MAPS, or from shared/maps beside the checkout; skips where it is absent."""
    return _file_or_skip(Path(os.environ.get("TOPOBELIEF_MAPS", _BESIDE_CHECKOUT / "maps")) / name)


def case_file(name: str) -> Path:
    """An input from $TOPOBELIEF_CASES, or from shared/cases beside the checkout; skips where it is absent."""
    return _file_or_skip(Path(os.environ.get("TOPOBELIEF_CASES", _BESIDE_CHECKOUT / "cases")) / name)


def _file_or_skip(path: Path) -> Path:
    if not path.exists():
        pytest.skip(f"{path.name} is not at hand: set TOPOBELIEF_DATA, TOPOBELIEF_MAPS or TOPOBELIEF_CASES to its folder")
    return path
