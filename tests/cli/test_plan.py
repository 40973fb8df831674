"""`plan` says and writes what the library decides."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from data_files import data_file
from topobelief.candidates.closures import ClosureModel
from topobelief.candidates.diverse_paths import diverse_paths
from topobelief.candidates.learned_closures import learn_closures
from topobelief.candidates.polyline import path_length
from topobelief.candidates.predicted_factors import predict_actions
from topobelief.candidates.roadmap import build_roadmap
from topobelief.cli import plan_files, plan_stages
from topobelief.cli.console import Reporter
from topobelief.entropy import joint_entropy
from topobelief.errors import FileError, IllConditionedError
from topobelief.estimation import optimize
from topobelief.graph.action import posterior
from topobelief.io.floor_plan import read_world
from topobelief.io.g2o import read_g2o, write_g2o
from topobelief.planning.decision import Candidate, Decision
from topobelief.planning.planner import Planner

PICTURES = {"paths.png", "bounds.png"}


@pytest.fixture(scope="module")
def by_hand(office):
    """The same plan through the library: graph, world, paths, actions and decision."""
    graph = optimize(read_g2o(office.graph_file))
    world = read_world(office.map_file)
    start, goal = graph.positions[-1], (0.0, 5.0)
    roadmap = build_roadmap(world, start, goal, num_vertices=200, robot_radius=0.35, seed=0)
    paths = diverse_paths(roadmap, start, goal, num_paths=6, max_detour=1.3, seed=0)
    actions = predict_actions(graph, paths, world=world)
    planner = Planner(graph, objective="error", signature="resistance", bounds="auto")
    return graph, paths, actions, planner.decide(actions, proof="optimal")


def document(topobelief, arguments: list[str]) -> dict:
    outcome = topobelief([*arguments, "--json"])
    assert outcome.code == 0
    assert outcome.err == ""
    return json.loads(outcome.out)


def test_the_decision_is_that_of_the_library(topobelief, office, by_hand):
    plan = document(topobelief, office.plan("--candidates", 6))
    _, paths, _, decision = by_hand
    assert Decision.from_dict(plan).to_dict() == decision.to_dict()
    assert [action["waypoints"] for action in plan["actions"]] == [path.tolist() for path in paths]


def test_the_answer_comes_in_words_then_as_a_table_then_where_the_pictures_are(topobelief, office, by_hand):
    outcome = topobelief(office.plan("--candidates", 6))
    decision = by_hand[3]
    told = ("Drive path ", decision.summary(), "signature", "Why, and why not:", "Pictures: out/paths.png")
    places = [outcome.out.index(text) for text in told]
    assert outcome.code == 0
    assert places == sorted(places)
    assert outcome.err == ""


def test_three_files_are_written_and_the_decision_reads_back(topobelief, office, tmp_path, by_hand):
    assert topobelief(office.plan("--candidates", 6, "--out", "a/b")).code == 0
    folder = tmp_path / "a" / "b"
    assert {path.name for path in folder.iterdir()} == PICTURES | {"decision.json"}
    assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in PICTURES)
    decision = Decision.from_dict(json.loads((folder / "decision.json").read_text()))
    assert decision.to_dict() == by_hand[3].to_dict()


def test_the_same_arguments_give_the_same_bytes(topobelief, office, tmp_path):
    for _ in range(2):
        topobelief(office.plan("--candidates", 3, "--out", "out"))
        (tmp_path / "out").rename(tmp_path / f"out{len(list(tmp_path.iterdir()))}")
    first, second = sorted(tmp_path.iterdir())
    for name in (*PICTURES, "decision.json"):
        assert (first / name).read_bytes() == (second / name).read_bytes()


def test_for_a_program_no_file_is_written_unless_a_folder_is_named(topobelief, office, tmp_path):
    document(topobelief, office.plan("--candidates", 2))
    assert list(tmp_path.iterdir()) == []
    document(topobelief, office.plan("--candidates", 2, "--out", "here"))
    assert (tmp_path / "here" / "decision.json").exists()


def test_exact_values_stand_apart_from_the_decision_that_did_not_need_them(topobelief, office, tmp_path, by_hand):
    choices = ["--candidates", 6, "--objective", "joint", "--proof", "bounded", "--bounds", "fischer"]
    topobelief(office.plan(*choices))
    written = json.loads((tmp_path / "out" / "decision.json").read_text())
    graph, _, actions, _ = by_hand
    assert written["num_evaluations"] == 0
    for row, action in zip(written["actions"], actions, strict=True):
        assert row["entropy"] is None
        assert row["exact_for_comparison"] == pytest.approx(joint_entropy(posterior(graph, action)), abs=1e-6)


def test_without_exact_values_none_is_computed(topobelief, office, tmp_path):
    """With bounds that do not compute them along the way."""
    topobelief(office.plan("--candidates", 2, "--no-exact", "--proof", "bounded", "--objective", "map", "--bounds", "fischer"))
    written = json.loads((tmp_path / "out" / "decision.json").read_text())
    assert [action["exact_for_comparison"] for action in written["actions"]] == [None, None]


def test_exact_values_stop_when_their_time_is_over(by_hand, monkeypatch, capsys):
    """In ranking order, some at a time, and the output says how many there are."""
    graph, _, actions, _ = by_hand
    decision = Planner(graph).decide(actions)
    monkeypatch.setattr(plan_stages, "EXACT_SECONDS", 0.0)
    monkeypatch.setattr(plan_stages, "_AT_ONCE", 2)
    ticks = iter([0.0, 0.0, 1.0])
    monkeypatch.setattr(plan_stages, "monotonic", lambda: next(ticks))
    values = plan_stages.exact_entropies(Planner(graph), actions, decision, Reporter(as_json=False), wanted=True)
    assert np.flatnonzero(~np.isnan(values)).tolist() == sorted(decision.ranking[:2].tolist())
    assert "the first 2 of the ranking" in capsys.readouterr().out


def test_the_paper_rule_is_one_option_and_gives_way_to_others(topobelief, office):

    def settings(*options: object) -> tuple:
        chosen = document(topobelief, office.plan("--candidates", 2, "--proof", "none", *options))["options"]
        rule = ClosureModel(**chosen["closures"])
        return (
            rule.angle,
            rule.min_index_gap,
            rule.max_per_pose,
            chosen["turn"],
            chosen["line_of_sight"],
            chosen["max_detour"],
        )

    fifteen = math.radians(15)
    assert settings("--closures", "by-hand") == (math.pi, 5, None, fifteen, True, 1.3)
    assert settings("--paper") == (1.0, 2, None, None, False, None)
    assert settings("--paper", "--min-index-gap", 4, "--line-of-sight", "--max-detour", 2) == (1.0, 4, None, None, True, 2.0)
    assert settings("--max-detour", "none", "--closure-radius", 3) == (math.pi, 5, None, fifteen, True, None)
    assert settings("--closures", "paper", "--closure-angle", 0.5) == (0.5, 2, None, fifteen, True, 1.3)


def test_closures_are_learned_from_the_graph_and_said_in_one_line(topobelief, office, by_hand):
    outcome = topobelief(office.plan("--candidates", 2, "--proof", "none"))
    model = learn_closures(by_hand[0], world=read_world(office.map_file))
    assert f"\n{model}\n" in outcome.out
    chosen = document(topobelief, office.plan("--candidates", 2, "--proof", "none"))["options"]["closures"]
    assert ClosureModel(**chosen) == model


def test_numbers_for_closures_that_are_learned_are_refused(topobelief, office):
    outcome = topobelief(office.plan("--closures", "learned", "--closure-radius", 2))
    assert outcome.code == 2
    assert "expected --closures learned without numbers" in outcome.err


def test_the_noise_of_predicted_factors_can_be_given(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 2, "--sigma-p", 0.1, "--sigma-theta", 0.05))
    assert np.allclose(plan["options"]["information"], np.diag([100, 100, 400]))
    better = document(topobelief, office.plan("--candidates", 2, "--sigma-p", 0.01, "--sigma-theta", 0.05))
    assert better["actions"][0]["upper"] < plan["actions"][0]["upper"]


def test_optimal_is_proven_and_a_margin_is_judged(topobelief, office):
    assert document(topobelief, office.plan("--candidates", 6, "--proof", "optimal"))["proven_optimal"] is True
    assert document(topobelief, office.plan("--candidates", 6, "--margin", 1e9))["margin_met"] is True
    assert document(topobelief, office.plan("--candidates", 6, "--margin", -1e9))["margin_met"] is False


@pytest.mark.parametrize(
    "choice",
    [
        ("--objective", "map"),
        ("--objective", "joint", "--signature", "resistance"),
        ("--objective", "per_pose"),
        ("--as-paper",),
        ("--closures", "paper"),
        ("--signature", "von_neumann"),
        ("--signature", "von_neumann_approx", "--normalized"),
        ("--objective", "map", "--bounds", "paper", "--determinant", "hadamard", "--closures", "paper"),
        ("--proof", "none"),
    ],
)
def test_every_choice_is_planned_on_and_drawn(topobelief, office, choice):
    outcome = topobelief(office.plan("--candidates", 3, *choice))
    assert (outcome.code, outcome.err) == (0, "")


def test_poses_as_filed_are_kept_on_request(topobelief, office):
    filed = document(topobelief, office.plan("--candidates", 2, "--no-optimize"))
    optimised = document(topobelief, office.plan("--candidates", 2))
    assert filed["start"] == office.graph.poses[-1].tolist()
    assert optimised["graph"]["chi2"] < filed["graph"]["chi2"]


def test_a_graph_without_a_map_is_planned_on_along_its_trajectory(topobelief, tmp_path):
    csail = data_file("csail.g2o")
    outcome = topobelief(["plan", str(csail), "--along-trajectory", "--goal", "20", "-10", "--candidates", "5"])
    assert outcome.code == 0
    assert "world: within 0.92 m of the trajectory" in outcome.out
    assert {path.name for path in (tmp_path / "out").iterdir()} == PICTURES | {"decision.json"}


def test_files_are_written_together_or_not_at_all(tmp_path):
    """A failure in the last leaves the first as it was, and no temporary file."""
    (tmp_path / "first").write_text("old")

    def fails(_: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(FileError, match="second: expected a file to write, got a system error: No space left"):
        plan_files.write_together(tmp_path, {"first": lambda path: path.write_text("new"), "second": fails})
    assert (tmp_path / "first").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["first"]


def test_the_start_is_told(topobelief, office):
    filed = topobelief(office.plan("--candidates", 2, "--no-optimize")).out
    assert "from pose 20, the last of the file, at (10.00, 10.00)" in filed
    plan = document(topobelief, office.plan("--candidates", 2))
    assert plan["start_pose"] == {"index": 20, "id": 20}
    assert plan["notes"] == []


def test_the_start_can_be_a_pose_or_a_place(topobelief, office):
    filed = office.plan("--candidates", 2, "--no-optimize", "--start")
    pose = document(topobelief, [*filed, "3"])
    assert pose["start"] == office.graph.poses[3].tolist()
    assert pose["start_pose"] == {"index": 3, "id": 3}
    assert pose["actions"][0]["waypoints"][0] == [3, 0]
    place = document(topobelief, [*filed, "2.5", "1.5"])
    assert place["start"] == [2.5, 1.5]
    assert place["start_pose"]["index"] in (2, 3)
    assert place["actions"][0]["waypoints"][0] == [2.5, 1.5]
    assert place["options"]["start"] == "2.5 1.5"
    assert "from (2.50, 1.50), 1.58 m from pose" in topobelief([*filed, "2.5", "1.5"]).out


TAG = """VERTEX_SE2 0 0 0 0
VERTEX_SE2 1 2 0 1.57
VERTEX_SE2 2 2 2 3.14
VERTEX_SE2 1007 -3 4 0
EDGE_SE2 0 1 2 0 1.57 100 0 0 100 0 400
EDGE_SE2 1 2 2 0 1.57 100 0 0 100 0 400
EDGE_SE2 1 1007 4 5 -1.57 50 0 0 50 0 50
EDGE_SE2 2 1007 5 -2 -3.14 50 0 0 50 0 50
"""


def test_a_last_pose_where_the_odometry_does_not_end_is_pointed_out(topobelief, tmp_path):
    (tmp_path / "tag.g2o").write_text(TAG)
    arguments = ["plan", "tag.g2o", "--along-trajectory", "--goal", "0", "0", "--width", "1", "--vertices", "50"]
    outcome = topobelief(arguments)
    assert "from pose 1007, the last of the file" in outcome.out
    assert "the odometry from the first pose on ends at pose 2, not at pose 1007" in outcome.out
    chosen = topobelief([*arguments, "--start", "2"])
    assert "from pose 2 at (2." in chosen.out
    assert "1007" not in chosen.out


def test_exact_values_that_cannot_be_had_cost_neither_decision_nor_files(topobelief, office, tmp_path, monkeypatch):
    def fails(*_: object) -> None:
        raise IllConditionedError("joint entropy", 3.0)

    monkeypatch.setattr(Planner, "entropies", fails)
    choices = ["--proof", "bounded", "--closures", "paper", "--objective", "map", "--bounds", "fischer"]
    outcome = topobelief(office.plan("--candidates", 3, *choices))
    assert (outcome.code, outcome.err) == (0, "")
    assert (
        "exact values in the picture: 3 of 3 could not be computed; joint entropy: the graph is too ill-conditioned"
        in outcome.out
    )
    assert {path.name for path in (tmp_path / "out").iterdir()} == PICTURES | {"decision.json"}


def test_a_picture_that_fails_does_not_cost_the_decision(topobelief, office, tmp_path, monkeypatch):
    monkeypatch.setattr("topobelief.report.bounds_figure.draw_bounds", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        topobelief(office.plan("--candidates", 2))
    assert Decision.from_dict(json.loads((tmp_path / "out" / "decision.json").read_text())).num_actions == 2


@pytest.mark.parametrize(
    ("wall", "note"),
    [
        ("3.5,-0.1,4.5,0.1", "1 of 21 poses is not in free space\n"),
        ("-0.5,-0.1,4.5,0.1", "5 of 21 poses are not in free space: another map or another frame?\n"),
    ],
)
def test_poses_outside_the_map_are_counted(topobelief, office, tmp_path, wall, note):
    """One in a wall is an error of the map; many, and the map may be another one."""
    (tmp_path / "walls.csv").write_text(f"{office.map_file.read_text()}{wall}\n")
    arguments = ["plan", str(office.graph_file), "--map", "walls.csv", "--goal", "0", "5", "--candidates", "2"]
    outcome = topobelief([*arguments, "--no-optimize"])
    assert outcome.code == 0
    assert note in outcome.out


def test_a_start_outside_the_map_says_how_many_poses_are(topobelief, office, tmp_path):
    (tmp_path / "far.csv").write_text("x_min,y_min,x_max,y_max\n90,90,99,90.2\n90,99,99,99.2\n")
    outcome = topobelief(["plan", str(office.graph_file), "--map", "far.csv", "--goal", "95", "95"])
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert outcome.err.rstrip().endswith("21 of 21 poses are not in free space: another map or another frame?")


def test_lengths_are_those_of_the_paths_everywhere(topobelief, office, tmp_path):
    """Also where poses are so far apart that they cut the corners."""
    outcome = topobelief(office.plan("--candidates", 4, "--spacing", 100))
    written = json.loads((tmp_path / "out" / "decision.json").read_text())
    lengths = [path_length(action["waypoints"]) for action in written["actions"]]
    assert [action["length"] for action in written["actions"]] == pytest.approx(lengths)
    assert written["chosen"]["length"] == pytest.approx(lengths[written["best"]])
    rows = [line.split() for line in outcome.out.splitlines() if line.split()[1:2] == ["path"]]
    assert {int(row[2]): float(row[-2]) for row in rows} == {index: round(each, 1) for index, each in enumerate(lengths)}
    assert f"({lengths[written['best']]:.1f} m, " in outcome.out
    assert f"{min(lengths):.1f} to {max(lengths):.1f} m" in outcome.out


def test_labels_are_indices_and_the_chosen_path_can_be_driven(topobelief, office):
    plan = document(topobelief, office.plan("--candidates", 5))
    assert [(each["index"], each["label"]) for each in plan["actions"]] == [(k, f"path {k}") for k in range(5)]
    chosen = plan["chosen"]
    assert (chosen["index"], chosen["label"]) == (plan["best"], f"path {plan['best']}")
    poses = np.array(chosen["x_y_yaw"])
    assert poses[:, :2].tolist() == plan["actions"][plan["best"]]["waypoints"]
    step = np.diff(poses[:, :2], axis=0)
    assert np.allclose(poses[1:, 2], np.arctan2(step[:, 1], step[:, 0]))


def test_where_there_is_nothing_to_choose_from_the_output_says_what_would_bring_more(topobelief, office):
    one = topobelief(office.plan("--candidates", 1)).out
    assert "is the only candidate: there is nothing to choose from." in one
    assert "raise --candidates (1 now)" in one
    narrow = topobelief(office.plan("--candidates", 20, "--max-detour", 1)).out
    assert "raise --max-detour (1 now), lower --robot-radius (0.35 m now) or raise --vertices (200 now)" in narrow


def test_poses_far_from_the_estimate_are_pointed_out(topobelief, office, tmp_path):
    stretched = office.graph.with_poses(office.graph.poses * [1, 1.5, 1])
    write_g2o(stretched, tmp_path / "far.g2o")
    arguments = ["plan", "far.g2o", "--along-trajectory", "--goal", "5", "0", "--candidates", "2", "--vertices", "50"]
    outcome = topobelief([*arguments, "--no-optimize"])
    assert "far from the maximum-likelihood estimate" in outcome.out
    assert "leave out --no-optimize" in outcome.out
    assert outcome.err == ""
    assert "far from" not in topobelief(arguments).out


def decision_of(poses: list[int], objective: str = "joint") -> Decision:
    """Actions with so many new poses, ranked as listed."""
    count = len(poses)
    nothing = np.zeros(count)
    return Decision(
        best=0,
        ranking=np.arange(count),
        signatures=nothing,
        lower=nothing,
        upper=nothing,
        entropies=nothing,
        survivors=np.arange(count),
        error_bound=0.0,
        margin_met=None,
        num_evaluations=0,
        proven_optimal=False,
        candidates=tuple(Candidate("", number, 0, float(number), 0.0) for number in poses),
        objective=objective,
        signature="spanning_trees",
        bounds="fischer",
        determinant="cholesky",
    )


def test_a_ranking_that_counts_poses_is_called_so():
    hint = plan_stages.length_bias_hint(decision_of([20, 18, 16, 14, 12, 13]))
    assert hint is not None
    assert "rank correlation 0.94" in hint
    assert "--objective error or map" in hint
    assert "\n" not in hint


@pytest.mark.parametrize(
    "decision",
    [
        decision_of([12, 13, 14, 16, 18, 20]),  # the shortest first
        decision_of([20, 12, 18, 13, 16, 14]),
        decision_of([20] * 6),
        decision_of([20, 18, 16]),  # too few to say
        decision_of([20, 18, 16, 14, 12, 13], objective="map"),
    ],
)
def test_other_rankings_are_not(decision):
    assert plan_stages.length_bias_hint(decision) is None


def test_where_specks_part_some_paths_the_number_of_classes_is_a_lower_bound(topobelief, office, tmp_path):
    """The room's pillar makes 2 classes; specks all around it, which make none, may part more paths."""
    specks = "".join(f"{x},{y},{x + 0.05},{y + 0.05}\n" for x in range(1, 10) for y in (1, 2, 8, 9))
    (tmp_path / "specks.csv").write_text(office.map_file.read_text() + specks)
    arguments = office.plan("--candidates", 12, "--max-detour", 2)
    assert ": 2 homotopy classes, " in topobelief(arguments).out
    arguments[arguments.index(str(office.map_file))] = str(tmp_path / "specks.csv")
    assert ": at least 2 homotopy classes, " in topobelief(arguments).out


def test_the_graph_is_read_as_the_options_say(topobelief, office, tmp_path):
    """A lone pose far away and a prior are left out, and a note says so; the plan is that of the rest."""
    graph_file = tmp_path / "parts.g2o"
    graph_file.write_text(
        office.graph_file.read_text() + "VERTEX_SE2 999 50 50 0\nEDGE_SE2_PRIOR 0 0 0 0 1 0 0 1 0 1\n", encoding="utf-8"
    )
    arguments = office.plan("--candidates", 2, "--component", "largest", "--drop", "priors", "--no-exact")
    arguments[1] = str(graph_file)
    printed = topobelief(arguments).out.splitlines()
    assert printed[0].startswith(f"{graph_file}: dropped absolute priors on poses: EDGE_SE2_PRIOR on line ")
    assert printed[1] == f"{graph_file}: kept one of 2 components: 21 of 22 poses (0 … 20)"
    assert printed[2] == f"{graph_file}: 21 poses, 24 edges"
