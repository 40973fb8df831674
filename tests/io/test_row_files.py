"""Rows as CSV, and as values for JSON that come back to the last bit."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topobelief.io.row_files import csv_text, json_rows, rows_of_json, write_rows


@dataclass(frozen=True)
class Row:
    name: str
    count: int
    value: float
    fine: bool


ROWS = [Row('a, "b"\nc', 3, 0.1 + 0.2, True), Row("nan", -1, float("nan"), False), Row("", 0, float("-inf"), True)]


def test_rows_are_csv(tmp_path: Path) -> None:
    write_rows(tmp_path / "new" / "rows.csv", Row, ROWS)
    text = (tmp_path / "new" / "rows.csv").read_bytes().decode()
    assert text == csv_text(Row, ROWS)
    assert text.startswith('name,count,value,fine\n"a, ""b""\nc",3,0.30000000000000004,True\n')


def test_rows_come_back_from_json_to_the_last_bit() -> None:
    text = json.dumps(json_rows(ROWS), allow_nan=False)
    read = rows_of_json(Row, json.loads(text))
    assert csv_text(Row, read) == csv_text(Row, ROWS)
    assert read[0] == ROWS[0]


def test_numbers_of_numpy_are_numbers() -> None:
    row = Row("a", np.int64(3), np.float64(0.5), np.bool_(True))  # type: ignore[arg-type]  (what NumPy computes)
    assert json.dumps(json_rows([row])) == '[{"name": "a", "count": 3, "value": 0.5, "fine": true}]'
