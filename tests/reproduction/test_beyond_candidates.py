"""Beyond candidates: one exact value for every way, whatever found it, and medians over decisions."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from reproductions import smallest_reproduction
from topobelief.report.reproduction.beyond_figure import draw_beyond
from topobelief.report.reproduction.beyond_table import beyond_cells, beyond_markdown
from topobelief.reproduction.beyond_candidates import METRIC, TOPOLOGICAL, BeyondRow, beyond_summaries

METHODS = ["3 paths", "6 paths", METRIC, TOPOLOGICAL]


@pytest.fixture(scope="module")
def rows() -> list[BeyondRow]:
    return smallest_reproduction().beyond


def test_all_methods_decide_on_the_same_and_are_valued_alike(rows):
    assert [row.method for row in rows] == 2 * METHODS
    for objective in ("error", "map"):
        mine = [row for row in rows if row.objective == objective]
        assert len({(row.now, row.shortest, row.seed, row.xi, row.max_detour) for row in mine}) == 1
        few, many, metric, topological = mine
        assert many.value <= few.value <= few.shortest <= few.now
        assert metric.value <= metric.shortest
        assert topological.gain == topological.now - topological.value
        assert math.isnan(few.gap)
        assert all(row.length <= 1.3 * min(other.length for other in mine) + 1e-6 for row in mine)


def test_summaries_are_medians_in_centimetres_and_nats(rows):
    first = next(row for row in rows if row.objective == "error")
    better, worse = (replace(first, seed=seed, value=first.value + more) for seed, more in ((7, -0.01), (8, 0.03)))
    summary = next(each for each in beyond_summaries([first, better, worse]) if each.method == first.method)
    assert summary.num_decisions == 3
    assert summary.gain == pytest.approx(100 * first.gain)
    assert math.isnan(summary.gap)


def test_table_and_figure_show_every_method(rows):
    header, shortest, *lines = beyond_cells(rows)
    assert header == ["found by", "expected error, detour 1.3", "map entropy, detour 1.3"]
    assert shortest[0] == "the shortest path"
    assert [line[0] for line in lines] == METHODS
    assert beyond_markdown(rows).count("\n") == 3 + len(METHODS)
    assert len(draw_beyond(rows).get_axes()) == 2
