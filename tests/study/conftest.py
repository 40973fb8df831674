"""A room with a pillar, studied; and worker processes that can import the stand-ins."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import pytest

from topobelief.study.specification import read_specification
from topobelief.study.tasks import Task, tasks_of

WALLS = """# bounds: 0 0 12 12
x_min,y_min,x_max,y_max
3,3,7,7
8.5,4,9,8
"""

SPECIFICATION = """worlds: {room: room.csv}
sessions:
  across: {start: [1, 1], goals: [[11, 11]], candidates: 4}
  back: {start: [1, 1, 0.5], goals: [[11, 11], [1, 8]], candidates: [3, 5], worlds: [room]}
noises:
  - {sigma_p: 0.1, sigma_theta: 1e-2}
  - {sigma_p: 0.1, sigma_theta: 0.085}
strategies: [spanning_trees, random]
objectives: [joint]
seeds: 3
rule: {num_vertices: 120, max_detour: none, closure_angle: 1.0, min_index_gap: 2, line_of_sight: false}
"""


TaskMaker = Callable[..., list[Task]]


@pytest.fixture(scope="session")
def make_tasks_in() -> TaskMaker:
    """Tasks of the specification, written to a folder with pieces of its text replaced."""

    def make(folder: Path, **replacements: str) -> list[Task]:
        text = SPECIFICATION
        for name, value in replacements.items():
            start = text.index(f"{name}: ")
            text = text[:start] + f"{name}: {value}" + text[text.index("\n", start) :]
        if not (folder / "room.csv").exists():
            (folder / "room.csv").write_text(WALLS)
        (folder / "study.yaml").write_text(text)
        return tasks_of(read_specification(folder / "study.yaml"))

    return make


@pytest.fixture
def make_tasks(make_tasks_in: TaskMaker, tmp_path: Path) -> TaskMaker:
    """The same in a folder of the test."""
    return functools.partial(make_tasks_in, tmp_path)


@pytest.fixture
def specification_file(make_tasks: TaskMaker, tmp_path: Path) -> Path:
    make_tasks()
    return tmp_path / "study.yaml"


@pytest.fixture
def plays_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, importing_workers: None) -> Path:
    """Where the stand-ins leave marks; workers started within the test find their module."""
    folder = tmp_path / "marks"
    folder.mkdir()
    monkeypatch.setenv("STUDY_PLAYS_FOLDER", str(folder))
    return folder
