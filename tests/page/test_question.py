"""Questions of the page: what is read and what is refused."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from topobelief.errors import InvalidInputError
from topobelief.page.question import Question

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda children: st.lists(children, max_size=3) | st.dictionaries(st.text(max_size=5), children, max_size=3),
    max_leaves=5,
)
FIELDS = ("goal", "return", "max_length", "objective", "closures", "candidates", "bounds")


def test_a_question_is_read_back_as_it_is_told() -> None:
    question = Question((1.5, -2.0), False, 30.0, "map", "paper", 20, "chain")
    assert Question.read(question.document()) == question


def test_returning_is_for_trips() -> None:
    assert Question.read({"goal": [0, 0], "return": True}).return_to_start is False
    assert Question.read({"max_length": 5, "return": True}).return_to_start is True


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ([], "JSON object"),
        ({}, "max_length"),
        ({"goal": [1]}, "goal"),
        ({"goal": [1, "2"]}, "goal"),
        ({"goal": [1, float("nan")]}, "goal"),
        ({"goal": [1, 10**400]}, "goal"),
        ({"max_length": -1}, "max_length"),
        ({"max_length": True}, "max_length"),
        ({"goal": [1, 2], "objective": "fun"}, "objective"),
        ({"goal": [1, 2], "bounds": ["chain"]}, "bounds"),
        ({"goal": [1, 2], "candidates": 1e9}, "candidates"),
        ({"max_length": 5, "candidates": 20}, "goal"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(document: object, named: str) -> None:
    with pytest.raises(InvalidInputError, match=named):
        Question.read(document)


@given(st.dictionaries(st.sampled_from(FIELDS), json_values))
def test_any_json_is_read_or_refused(document: dict[str, object]) -> None:
    with suppress(InvalidInputError):
        Question.read(document)
