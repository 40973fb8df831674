"""Decisions in words, in a table, and in JSON and back."""

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import path, sessions
from topobelief.errors import InvalidInputError
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import SCHEMA, Decision
from topobelief.planning.planner import Planner

OMEGA = np.diag([100.0, 100.0, 400.0])
LINE = PoseGraph([[i, 0, 0] for i in range(5)], path(5).edges, None, OMEGA)
EXPLORE = Action([[5, 0, 0], [6, 0, 0]], [(4, 5), (5, 6)], OMEGA, label="path 7")
REVISIT = Action([[4, 1, 0]], [(4, 5), (5, 3), (5, 0)], OMEGA, cost=0.25)

limits = st.sampled_from(
    [{"proof": "none"}, {}, {"proof": "optimal"}, {"margin": 0.0}, {"proof": "optimal", "max_evaluations": 1}]
)


@given(sessions(), limits, st.sampled_from(["spanning_trees", "von_neumann_approx"]))
def test_json_and_back(session, limit, signature):
    """Strict JSON, nan and inf included, and nothing is lost."""
    decision = Planner(session.graph, signature=signature).decide(session.actions, **limit)
    text = json.dumps(decision.to_dict(), allow_nan=False)
    again = Decision.from_dict(json.loads(text))
    assert again.to_dict() == decision.to_dict()
    for name in ("signatures", "lower", "upper", "entropies"):
        assert np.array_equal(getattr(again, name), getattr(decision, name), equal_nan=True)
    for name in ("ranking", "survivors"):
        assert getattr(again, name).tolist() == getattr(decision, name).tolist()
    for name in (
        "best",
        "error_bound",
        "margin_met",
        "num_evaluations",
        "proven_optimal",
        "candidates",
        "objective",
        "signature",
    ):
        assert getattr(again, name) == getattr(decision, name)
    assert str(again) == str(decision)


def test_the_dictionary_is_versioned_and_names_what_was_asked():
    data = Planner(LINE, objective="map", determinant="hadamard").decide([EXPLORE, REVISIT], proof="none").to_dict()
    assert data["schema"] == SCHEMA == "topobelief.decision/2"
    assert (data["objective"], data["signature"], data["bounds"], data["determinant"]) == (
        "map",
        "spanning_trees",
        "fischer",
        "hadamard",
    )
    assert data["error_bound"] is None
    assert data["actions"][0]["lower"] is None
    assert [action["index"] for action in data["actions"]] == [0, 1]
    assert data["actions"][1]["cost"] == 0.25
    assert data["actions"][0]["length"] == pytest.approx(2.0)
    assert (data["actions"][0]["num_new_poses"], data["actions"][1]["num_closures"]) == (2, 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"schema": "topobelief.decision/99"},
            "expected a decision of schema \"topobelief.decision/2\", got 'topobelief.decision/99'",
        ),
        ({"schema": None}, "expected a decision of schema"),
        ({"ranking": ...}, "expected a decision with the field 'ranking', got none"),
        ({"actions": [{"label": "x"}]}, "expected a decision with the field 'signature', got none"),
        ({"actions": None}, "expected"),
        ({"error_bound": "much"}, "expected"),
    ],
    ids=["other schema", "no schema", "field missing", "action field missing", "null", "word for a number"],
)
def test_what_is_not_a_decision_is_refused(change, message):
    data = Planner(LINE).decide([EXPLORE, REVISIT]).to_dict() | change
    data = {key: value for key, value in data.items() if value is not ...}
    with pytest.raises(InvalidInputError, match=message):
        Decision.from_dict(data)


def test_the_table_has_a_line_per_action_in_ranking_order():
    decision = Planner(LINE).decide([EXPLORE, REVISIT])
    lines = str(decision).splitlines()
    assert lines[1] == ""
    assert lines[2].split() == [
        "rank",
        "action",
        "signature",
        "lower",
        "upper",
        "exact",
        "poses",
        "closures",
        "length",
        "survives",
    ]
    assert len(lines) == 5
    for line, index in zip(lines[3:], decision.ranking, strict=True):
        assert decision.name(index) in line
        assert f"{decision.signatures[index]:.2f}" in line
    assert lines[3].split()[-1] == "best"
    assert " - " in lines[3]  # nothing evaluated


@pytest.mark.parametrize(
    ("actions", "limit", "words"),
    [
        ([EXPLORE, REVISIT], {"proof": "none"}, "is the best by spanning trees."),
        ([EXPLORE], {}, "Path 7 (2.0 m, 2 new poses, 0 loop closures) is the only candidate: there is nothing to choose from."),
        ([EXPLORE, REVISIT], {"margin": 1e6}, "nats, is below the margin."),
        ([EXPLORE, REVISIT], {"margin": -1e6}, "nats, misses the margin."),
        ([REVISIT, REVISIT], {}, "No candidate can be better by more than"),
        ([REVISIT, REVISIT], {"proof": "optimal"}, "That is proven by 1 exact evaluation."),
    ],
)
def test_the_summary_says_what_is_known(actions, limit, words):
    assert words in Planner(LINE).decide(actions, **limit).summary()


def test_an_action_without_a_label_goes_by_its_index():
    decision = Planner(LINE).decide([EXPLORE, REVISIT], proof="none")
    assert (decision.name(0), decision.name(1)) == ("path 7", "action 1")
    assert decision.num_actions == 2
    assert math.isinf(decision.error_bound)
