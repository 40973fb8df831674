"""Ids are shown as GTSAM shows them."""

from __future__ import annotations

import gtsam
import pytest

from topobelief.errors import DisconnectedGraphError
from topobelief.symbols import find_node, node_name

X = ord("x") << 56


@pytest.mark.parametrize(
    ("node", "name"),
    [
        (X + 3, "x3"),
        ((ord("Z") << 56) + 2**48 - 1, "Z281474976710655"),
        (X + (ord("B") << 48) + 7, "xB7"),
        ((ord("a") << 48) + 17, "a17"),
        (0, "0"),
        (-1, "-1"),
        (2**63 - 1, "9223372036854775807"),
        (1_700_000_000_000_000_000, "1700000000000000000"),
        (X + (1 << 48), str(X + (1 << 48))),
    ],
    ids=["symbol", "largest index", "labelled", "no character", "zero", "negative", "largest", "time stamp", "no letter"],
)
def test_symbols_are_shown_as_symbols_and_numbers_as_numbers(node: int, name: str):
    assert node_name(node) == name
    assert find_node([5, node], name) == find_node([5, node], str(node)) == find_node([5, node], node) == 1


def test_symbols_are_those_of_gtsam():
    assert node_name(gtsam.symbol("l", 12)) == "l12"
    assert node_name(gtsam.mrsymbol(ord("x"), ord("C"), 12)) == "xC12"


def test_errors_name_symbols():
    assert "node x0 does not reach: x4, 7;" in str(DisconnectedGraphError([X + 4, 7], anchor=X))
