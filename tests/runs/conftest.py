"""A folder in which tasks leave marks."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def marks(tmp_path: Path, importing_workers: None) -> Path:
    folder = tmp_path / "marks"
    folder.mkdir()
    return folder
