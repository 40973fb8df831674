"""A run's journal: another run's is refused, nothing in it is repeated, and an interruption loses what was half done alone."""

from __future__ import annotations

import json

import pytest

from topobelief.errors import FileError
from topobelief.runs.in_process import InProcess
from topobelief.runs.journal import Journal
from topobelief.runs.local_workers import LocalWorkers
from topobelief.runs.lock import alone
from topobelief.runs.run import run_tasks
from works import Number, attempts, squared

SETTINGS = {"seed": 1, "sizes": (1, 2), "name": "a"}


def journal(folder, **changes) -> Journal[Number, int]:
    return Journal(folder / "journal.jsonl", SETTINGS | changes, lambda square: {"square": square})


def numbers(folder, count=5, **deeds):
    return [Number(value, str(folder), deeds.get(f"of_{value}", ())) for value in range(count)]


def squares(folder, count=5):
    return [journal(folder).result(f"number {value}")["square"] for value in range(count)]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": 2}, "expected a run with the same settings, seed 2, got seed 1; choose another --out"),
        ({"sizes": (1, 3)}, r"sizes \[1, 3\], got sizes \[1, 2\]"),
        ({"more": "x"}, 'more "x", got more null'),
    ],
)
def test_another_run_is_refused_and_left_as_it_is(tmp_path, changes, message):
    run_tasks([Number(3)], squared, journal(tmp_path), InProcess())
    before = (tmp_path / "journal.jsonl").read_bytes()
    with pytest.raises(FileError, match=message):
        journal(tmp_path, **changes)
    assert (tmp_path / "journal.jsonl").read_bytes() == before
    assert journal(tmp_path).result("number 3") == {"square": 9}


def test_nothing_is_repeated_and_a_run_may_grow(tmp_path, marks):
    first = run_tasks(numbers(marks, 3), squared, journal(tmp_path), InProcess())
    second = run_tasks(numbers(marks, 5), squared, journal(tmp_path), InProcess())
    assert (first.num_done_now, second.num_done_now, second.num_tasks) == (3, 2, 5)
    assert attempts(marks) == dict.fromkeys(range(5), 1)
    assert squares(tmp_path) == [0, 1, 4, 9, 16]


def test_an_interruption_loses_nothing_that_is_done(tmp_path, marks):
    def interrupt(progress) -> None:
        if progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_tasks(numbers(marks), squared, journal(tmp_path), LocalWorkers(1), on_progress=interrupt)
    kept = [task for task in numbers(marks) if task.id in journal(tmp_path)]
    assert len(kept) == 2
    assert run_tasks(numbers(marks), squared, journal(tmp_path), LocalWorkers(1)).num_done_now == 3
    assert squares(tmp_path) == [0, 1, 4, 9, 16]
    assert all(attempts(marks)[task.value] == 1 for task in kept)


@pytest.mark.parametrize("cut", [1, 20, -1])
def test_half_a_line_is_cut_off_and_its_task_done_again(tmp_path, cut):
    path = tmp_path / "journal.jsonl"
    run_tasks(numbers(""), squared, journal(tmp_path), InProcess())
    *whole, last = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(whole) + last[:cut])
    assert run_tasks(numbers(""), squared, journal(tmp_path), InProcess()).num_done_now == 1
    assert squares(tmp_path) == [0, 1, 4, 9, 16]
    assert len(path.read_text().splitlines()) == 6


def test_failures_are_kept_and_tried_again_only_where_asked(tmp_path, marks):
    tasks = numbers(marks, of_1=("raise",))
    first = run_tasks(tasks, squared, journal(tmp_path), InProcess())
    assert (first.num_failed, first.first_error) == (1, journal(tmp_path).error("number 1"))
    assert str(first.first_error).startswith("ValueError: no such square (works.py:")
    assert run_tasks(tasks, squared, journal(tmp_path), InProcess()).num_done_now == 0
    again = run_tasks(tasks, squared, journal(tmp_path), InProcess(), retry_failed=True)
    assert (again.num_done_now, again.num_failed) == (1, 0)
    assert squares(tmp_path) == [0, 1, 4, 9, 16]


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (0, "[]", "journal.jsonl:1: expected the settings of a run, got something else; choose another --out"),
        (0, '{"schema": "another", "settings": {}, "about": {}}', "journal.jsonl:1: expected the settings of a run"),
        (2, '{"task": 3}', "journal.jsonl:3: expected a finished task"),
        (1, "{", "journal.jsonl:2: expected a finished task"),
    ],
)
def test_a_file_that_is_no_journal_is_refused(tmp_path, line, text, message):
    run_tasks(numbers(""), squared, journal(tmp_path), InProcess())
    path = tmp_path / "journal.jsonl"
    lines = path.read_text().splitlines()
    lines[line] = text
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match=message):
        journal(tmp_path)


def test_an_empty_file_is_no_journal(tmp_path):
    (tmp_path / "journal.jsonl").touch()
    with pytest.raises(FileError, match="expected the settings of a run, got none"):
        journal(tmp_path)


def test_a_task_has_one_line(tmp_path):
    kept = journal(tmp_path)
    (finished,) = InProcess().run(squared, [Number(2)])
    kept.add(finished)
    with pytest.raises(FileError, match="expected one line for each task, got a second one for number 2"):
        kept.add(finished)


def test_what_is_noted_stays_that_of_the_first_session(tmp_path):
    path = tmp_path / "journal.jsonl"
    for name in ("first", "second"):
        assert Journal(path, SETTINGS, int, about={"machine": name}).about == {"machine": "first"}
    assert json.loads(path.read_text())["settings"]["sizes"] == [1, 2]


def test_a_second_run_is_kept_out(tmp_path):
    with alone(tmp_path), pytest.raises(FileError, match="got one in use by another process"), alone(tmp_path):
        pass
    with alone(tmp_path):
        pass
