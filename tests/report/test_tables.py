"""Tables say what the decision says, in its order."""

from __future__ import annotations

import io

import numpy as np
from rich.console import Console
from rich.table import Table

from topobelief.report.tables import candidate_table, quantity_table


def printed(table: Table, width: int = 200) -> str:
    console = Console(file=io.StringIO(), width=width)
    console.print(table)
    return console.file.getvalue()


def rows(table: Table) -> list[list[str]]:
    return [line.split() for line in printed(table).splitlines() if " path " in line]


def test_rows_come_in_ranking_order_and_say_who_may_be_optimal(make_decision):
    table = rows(candidate_table(make_decision(3)))
    assert [row[0] for row in table] == ["1", "2", "3"]
    assert [row[1:3] for row in table] == [["path", "2"], ["path", "1"], ["path", "0"]]
    assert [row[-1] for row in table] == ["yes", "maybe", "no"]
    assert table[0][3:] == ["118.00", "-123.00", "-118.00", "7", "22", "7.5", "yes"]


def test_exact_values_have_a_column_only_where_the_decision_needed_some(make_decision):
    assert "exact" not in printed(candidate_table(make_decision(3)))
    needed = make_decision(3, entropies=[np.nan, np.nan, -120.0], num_evaluations=1)
    assert [row[6] for row in rows(candidate_table(needed))] == ["-120.00", "–", "–"]


def test_costs_have_a_column_where_there_are_any(make_decision):
    assert "cost" not in printed(candidate_table(make_decision(2)))
    assert [row[6] for row in rows(candidate_table(make_decision(2, cost=1.5)))] == ["1.50", "1.50"]


def test_labels_are_text_and_not_markup(make_decision):
    assert "[red] path 1" in printed(candidate_table(make_decision(2, label="[red] path")))


def test_the_table_fits_a_terminal_of_80_columns(make_decision):
    wide = make_decision(20, lower=np.full(20, -39774.36), upper=np.full(20, -37426.12))
    assert "…" not in printed(candidate_table(wide), width=80)


def test_quantities_stand_beside_their_names():
    text = printed(quantity_table("Size", [("poses", "12"), ("[edges]", "30")]))
    assert [line.split() for line in text.splitlines()] == [["Size"], ["poses", "12"], ["[edges]", "30"]]
