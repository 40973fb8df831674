"""Decisions in words, in a table, and in JSON and back."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import path, sessions
from topobelief.errors import InvalidInputError
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.decision import SCHEMA, Decision
from topobelief.planning.decision_table import decision_table
from topobelief.planning.planner import Planner
from topobelief.report.bounds_figure import draw_bounds

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
    assert lines[:2] == [decision.summary(), ""]
    assert lines[2].split() == ["#", "action", "signature", "lower", "upper", "cost", "poses", "closures", "metres", "best"]
    for line, index in zip(lines[3:5], decision.ranking, strict=True):
        assert decision.name(index) in line
        assert f"{decision.signatures[index]:.2f}" in line
    assert lines[3].endswith("yes")
    assert lines[6] == "lower, upper: bounds of the joint entropy plus cost in nats; the less, the better."


def test_text_and_html_show_the_same_cells():
    decision = Planner(LINE).decide([EXPLORE, REVISIT], proof="optimal")
    table, html = decision_table(decision), decision._repr_html_()
    for row in table.rows:
        cells = re.findall(r">([^<]*)</td>", next(line for line in html.splitlines() if f">{row.cells[1]}<" in line))
        assert tuple(cells) == row.cells
        assert any(all(cell in line for cell in row.cells) for line in str(decision).splitlines())
    assert f"<p>{decision.summary()}</p>" in html


def test_of_many_actions_html_shows_the_first_and_the_best():
    """The best is not the first of the ranking once exact values are known."""
    decision = replace(Planner(LINE).decide([EXPLORE] * 40), best=39)
    html = decision._repr_html_()
    assert html.count("<td") == 31 * len(decision_table(decision).columns)
    assert html.count("font-weight: bold") == 1
    assert "9 more actions in print(decision)." in html
    assert len(str(decision).splitlines()) == 2 + 1 + 40 + 3


def test_labels_are_text_in_html_too():
    decision = Planner(LINE).decide([Action([[5, 0, 0]], [(4, 5)], OMEGA, label="<b>")])
    assert "&lt;b&gt;" in decision._repr_html_()
    assert "<b>" not in decision._repr_html_()


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        ({"proof": "none"}, r"Decision\(action 1 of 2, without bounds\)"),
        ({}, r"Decision\(action 1 of 2, at most [\d.]+ nats from the best\)"),
        ({"proof": "optimal"}, r"Decision\(action 1 of 2, proven optimal\)"),
    ],
)
def test_a_decision_describes_itself_in_one_line(limit, text):
    actions = [EXPLORE, REVISIT] if "proof" in limit else [REVISIT, REVISIT]
    description = repr(Planner(LINE, objective="map").decide(actions, **limit))
    assert re.fullmatch(text.replace("action 1", r"action \d"), description), description


def test_metres_are_shown_in_centimetres_everywhere():
    decision = replace(
        Planner(LINE).decide([EXPLORE, REVISIT]),
        objective="error",
        lower=[0.084, 0.12],
        upper=[0.1, 0.19],
        error_bound=0.035,
        proven_optimal=False,
    )
    assert "by more than 3.5 cm;" in decision.summary()
    assert repr(decision).endswith("at most 3.5 cm from the best)")
    for shown in (str(decision), decision._repr_html_()):
        assert "8.40" in shown
        assert "19.00" in shown
        assert "expected error of the map plus cost in cm" in shown
    axes = draw_bounds(decision).axes[0]
    assert axes.get_xlabel() == "expected error of the map after the action, plus cost (cm)"
    assert max(max(line.get_xdata()) for line in axes.lines if line.get_linewidth() == 5) == pytest.approx(19)


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
