"""A summary counts what the rows say, group by group."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from study_plays import failing
from topobelief.runs.attempt import Finished, attempt
from topobelief.study.dataset import Dataset, read_table
from topobelief.study.summary import flat, summaries


@pytest.fixture
def found(make_tasks, tmp_path):
    """Losses 0, 1, … by seed; seeds 1 and 2 fail."""
    dataset = Dataset(tmp_path)
    for task in make_tasks(seeds="7"):
        outcome = attempt(failing, task)
        if outcome.result is not None:
            found = {"loss": float(task.seed), "action_consistent": task.seed == 0, "num_evaluations": 2 * task.seed}
            outcome = replace(outcome, result=outcome.result | found)
        dataset.add(Finished(task, outcome, 1))
    return summaries(read_table(tmp_path))


def test_one_summary_for_all_seeds_of_a_combination(found):
    assert len(found) == 2 * 2 * 2
    for one in found:
        assert (one.num_ok, one.num_failed) == (5, 2)
        assert one.action_consistent.value == pytest.approx(0.2)
        assert one.loss.mean == pytest.approx((0 + 3 + 4 + 5 + 6) / 5)
        assert (one.loss.median, one.loss.largest) == (4, 6)
        assert one.evaluations.mean == pytest.approx(7.2)


def test_what_no_row_says_is_nan(found):
    assert math.isnan(found[0].order_consistent.value)
    assert math.isnan(found[0].spearman.median)


def test_a_line_of_csv_holds_every_number(found):
    line = flat(found[0])
    assert line["action_consistent"] == pytest.approx(0.2)
    assert line["action_consistent_low"] < 0.2 < line["action_consistent_high"]
    assert (line["strategy"], line["loss_largest"]) == (found[0].strategy, 6)
