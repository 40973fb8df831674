"""One Hypothesis profile for every machine, without deadlines; and worker processes that can import what tests define."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("topobelief", derandomize=True, deadline=None, max_examples=40)
settings.load_profile("topobelief")


@pytest.fixture
def importing_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes that are started within the test find the modules beside this one."""
    paths = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
