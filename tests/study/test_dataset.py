"""The dataset is whole at every moment, and readable by anything that reads Parquet."""

from __future__ import annotations

import pyarrow.dataset
import pyarrow.parquet
import pytest

from study_plays import quick
from topobelief.errors import FileError
from topobelief.runs.attempt import Finished, Outcome
from topobelief.study.dataset import ROWS_PER_FILE, Dataset, read_table
from topobelief.study.rows import COLUMNS


def finished(task, *, error=None):
    return Finished(task, Outcome(None, error) if error else Outcome(quick(task)), 1)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "out" / "study"


def test_rows_come_back_in_one_order(make_tasks, folder):
    tasks = make_tasks()
    dataset = Dataset(folder)
    for task in reversed(tasks):
        dataset.add(finished(task))
    table = read_table(folder)
    assert table.column_names == list(COLUMNS)
    assert table.num_rows == len(tasks)
    combinations = list(zip(*(table[name].to_pylist() for name in ("session", "sigma_theta", "strategy", "seed")), strict=True))
    assert combinations == sorted(combinations)
    assert pyarrow.dataset.dataset(folder / "rows").to_table().num_rows == len(tasks)


def test_files_fill_up_and_a_reopened_dataset_goes_on_where_there_is_room(make_tasks, folder):
    tasks = make_tasks(seeds="40")
    assert len(tasks) > 2 * ROWS_PER_FILE
    for start in range(0, len(tasks), 50):
        dataset = Dataset(folder)
        assert len(dataset) == start
        for task in tasks[start : start + 50]:
            dataset.add(finished(task))
    sizes = [pyarrow.parquet.read_metadata(path).num_rows for path in sorted((folder / "rows").iterdir())]
    assert sizes == [ROWS_PER_FILE, ROWS_PER_FILE, len(tasks) - 2 * ROWS_PER_FILE]
    assert set(read_table(folder)["task"].to_pylist()) == {task.id for task in tasks}


def test_what_a_killed_run_was_writing_is_no_row_and_is_cleared(make_tasks, folder):
    tasks = make_tasks()
    Dataset(folder).add(finished(tasks[0]))
    (folder / "rows" / ".part-000000.0123456789ab.parquet").write_bytes(b"PAR1 half of a fi")
    assert pyarrow.dataset.dataset(folder / "rows").to_table().num_rows == 1
    dataset = Dataset(folder)
    dataset.clear_remains()
    assert [path.name for path in (folder / "rows").iterdir()] == ["part-000000.parquet"]


def test_a_task_has_one_row(make_tasks, folder):
    task = make_tasks()[0]
    dataset = Dataset(folder)
    dataset.add(finished(task))
    with pytest.raises(FileError, match=f"expected one row a task, got a second one of {task.id}"):
        dataset.add(finished(task))
    assert read_table(folder).num_rows == 1


def test_rows_by_another_rule_are_not_mixed(make_tasks, folder):
    Dataset(folder).add(finished(make_tasks()[0]))
    with pytest.raises(FileError, match=r"another map, session or rule for across in room; choose another --out"):
        Dataset(folder).require_no_other(make_tasks(rule="{num_vertices: 99}"))
    Dataset(folder).require_no_other(make_tasks(seeds="9"))


def test_failed_rows_can_be_dropped(make_tasks, folder):
    tasks = make_tasks()
    dataset = Dataset(folder)
    for number, task in enumerate(tasks):
        dataset.add(finished(task, error="PlanningError: no way" if number % 3 == 0 else None))
    dataset.drop_failed()
    for found in (dataset, Dataset(folder)):
        assert [task.id in found for task in tasks] == [number % 3 != 0 for number in range(len(tasks))]
    dataset.add(finished(tasks[0]))
    assert Dataset(folder).failed(task.id for task in tasks) == 0


def test_strange_files_are_named(make_tasks, folder):
    with pytest.raises(FileError, match="expected the folder of a study, got one without rows"):
        read_table(folder)
    Dataset(folder).add(finished(make_tasks()[0]))
    strange = folder / "rows" / "part-000007.parquet"
    strange.write_bytes(b"no parquet")
    with pytest.raises(FileError, match=r"part-000007\.parquet: expected a Parquet file, got"):
        Dataset(folder)
    pyarrow.parquet.write_table(pyarrow.table({"a": [1]}), strange)
    with pytest.raises(FileError, match=r"part-000007\.parquet: expected the columns of a study"):
        read_table(folder)
