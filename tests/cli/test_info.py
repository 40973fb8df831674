"""`info` prints what the library computes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from data_files import data_file
from topobelief.bounds import entropy_bounds
from topobelief.cli import graph_facts
from topobelief.entropy import joint_entropy
from topobelief.estimation import optimize
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import read_g2o, write_g2o
from topobelief.signatures.spanning_trees import log_num_spanning_trees, spanning_tree_signature
from topobelief.signatures.von_neumann import von_neumann_entropy, von_neumann_entropy_approx

X5 = (ord("x") << 56) + 5


def facts(topobelief, *arguments: object) -> dict:
    outcome = topobelief(["info", *map(str, arguments), "--json"])
    assert outcome.code == 0
    assert outcome.err == ""
    return json.loads(outcome.out)


def test_quantities_are_those_of_the_library_at_the_optimised_poses(topobelief, office):
    found = facts(topobelief, office.graph_file)
    graph = optimize(read_g2o(office.graph_file))
    bounds = entropy_bounds(graph, family="paper", determinant="hadamard")
    assert found["joint_entropy"] == joint_entropy(graph)
    assert found["bounds_paper_hadamard"] == {"lower": bounds.lower, "upper": bounds.upper}
    assert found["log_num_spanning_trees"] == log_num_spanning_trees(graph.topology)
    assert found["spanning_tree_signature"] == spanning_tree_signature(graph.topology, graph.information)
    assert found["von_neumann_entropy"] == von_neumann_entropy(graph.topology)
    assert found["von_neumann_entropy_approx"] == von_neumann_entropy_approx(graph.topology)
    assert found["chi2_per_dof_optimized"] == graph.chi2 / graph.degrees_of_freedom
    assert found["chi2_per_dof_optimized"] < found["chi2_per_dof_filed"]


def test_sizes_are_counted(topobelief, tmp_path):
    """Two parallel edges, one closure over three poses, one of them fixed; ids are those of the file."""
    poses = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]])
    edges = [(0, 1), (1, 2), (0, 2), (1, 2)]
    write_g2o(PoseGraph(poses, edges, None, np.eye(3), ids=[10, 20, 30], fixed=(1,)), tmp_path / "small.g2o")
    found = facts(topobelief, tmp_path / "small.g2o")
    expected = {
        "space": "SE(2)",
        "num_poses": 3,
        "num_edges": 4,
        "num_loop_closures": 1,
        "num_parallel_edges": 1,
        "fixed": [20],
    }
    expected |= {"mean_degree": 8 / 3, "max_degree": 3, "num_components": 1, "degrees_of_freedom": 6, "length": 2.0}
    assert {name: found[name] for name in expected} == expected


def test_poses_as_filed_are_judged_on_request(topobelief, office):
    found = facts(topobelief, office.graph_file, "--no-optimize")
    assert found["joint_entropy"] == joint_entropy(read_g2o(office.graph_file))
    assert "chi2_per_dof_optimized" not in found


def test_a_tree_fits_perfectly_and_has_no_degrees_of_freedom(topobelief, tmp_path):
    chain = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, np.eye(3))
    write_g2o(chain, tmp_path / "chain.g2o")
    found = facts(topobelief, tmp_path / "chain.g2o")
    assert found["degrees_of_freedom"] == 0
    assert found["chi2_per_dof_filed"] is None
    assert found["bounds_fischer_cholesky"]["upper"] == pytest.approx(found["joint_entropy"], abs=1e-9)


def test_a_single_pose_is_described(topobelief, tmp_path):
    (tmp_path / "one.g2o").write_text("VERTEX_SE2 5 1 2 0\n")
    found = facts(topobelief, tmp_path / "one.g2o")
    assert (found["num_poses"], found["num_edges"], found["joint_entropy"]) == (1, 0, 0.0)


def test_the_paper_bounds_say_where_they_do_not_apply(topobelief, tmp_path):
    noise = np.array([np.eye(3), 2 * np.eye(3)])
    write_g2o(PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [(0, 1), (1, 2)], None, noise), tmp_path / "mixed.g2o")
    assert facts(topobelief, tmp_path / "mixed.g2o")["bounds_paper_cholesky"] is None
    assert "do not apply: they need one block-isotropic noise" in topobelief(["info", str(tmp_path / "mixed.g2o")]).out


def test_a_dense_spectrum_that_would_take_long_is_priced_instead(topobelief, office, monkeypatch):
    monkeypatch.setattr(graph_facts, "DENSE_SPECTRUM_SIZE", 20)
    assert facts(topobelief, office.graph_file)["von_neumann_entropy"] is None
    assert "s for the spectrum of 21 poses" in topobelief(["info", str(office.graph_file)]).out


def test_graphs_in_space_are_described_too(topobelief):
    outcome = topobelief(["info", str(data_file("smallGrid3D.g2o"))])
    assert outcome.code == 0
    assert "SE(3)" in outcome.out
    assert "its bounds, fischer, cholesky" in outcome.out


PARTS = """VERTEX_SE2 1 0 0 0
VERTEX_SE2 2 1 0 0
VERTEX_SE2 3 2 0 0
VERTEX_SE2 8646911284551352325 9 9 0
EDGE_SE2 1 2 1.5 0 0 1 0 0 1 0 1
EDGE_SE2 2 3 1 0 0 1 0 0 1 0 1
EDGE_SE2 1 3 2 0 0 1 0 0 1 0 1
EDGE_SE2_PRIOR 1 0 0 0 1 0 0 1 0 1
"""


def test_a_disconnected_graph_is_described_by_its_components(topobelief, tmp_path):
    """Sizes and fit of each part, the largest first; a pose without an edge is a part."""
    (tmp_path / "parts.g2o").write_text(PARTS)
    found = facts(topobelief, tmp_path / "parts.g2o", "--drop", "priors")
    assert (found["num_poses"], found["num_edges"], found["num_components"], found["length"]) == (4, 3, 2, 2.0)
    assert found["components"] == [
        {"num_poses": 3, "num_edges": 3, "first": 1, "last": 3, "chi2_per_dof_filed": 0.25 / 3},
        {"num_poses": 1, "num_edges": 0, "first": X5, "last": X5, "chi2_per_dof_filed": None},
    ]
    assert "joint_entropy" not in found
    output = topobelief(["info", str(tmp_path / "parts.g2o"), "--drop", "priors"]).out
    for text in ("2 components", "3 poses, 1 … 3", "3 edges, χ² per degree of freedom 0.08333 as filed", "pose x5", "no edges"):
        assert text in output


def test_what_was_dropped_is_told(topobelief, tmp_path):
    """To a person as a line before the tables, to a program as notes."""
    (tmp_path / "parts.g2o").write_text(PARTS)
    options = ["--drop", "priors", "--component", "largest"]
    found = facts(topobelief, tmp_path / "parts.g2o", *options)
    assert found["num_components"] == 1
    assert found["joint_entropy"] > 0
    assert len(found["notes"]) == 2
    output = topobelief(["info", str(tmp_path / "parts.g2o"), *options]).out
    assert output.splitlines()[:2] == found["notes"]
    assert found["notes"][0].endswith(
        "parts.g2o: dropped absolute priors on poses: EDGE_SE2_PRIOR on line 8; what they measure is not counted"
    )


def test_a_crowd_of_components_is_cut_short(topobelief, tmp_path):
    lines = [f"VERTEX_SE2 {k} {k} 0 0" for k in range(13)] + ["EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1"]
    (tmp_path / "crowd.g2o").write_text("\n".join(lines))
    output = topobelief(["info", str(tmp_path / "crowd.g2o")]).out
    assert "2 poses, 0 … 1" in output
    assert "1 edge, a tree" in output
    assert output.splitlines()[-1].split() == ["and", "smaller", "ones", "2"]
    assert len(facts(topobelief, tmp_path / "crowd.g2o")["components"]) == 12


def test_extents_are_those_of_the_poses_that_a_plan_starts_from(topobelief, office):
    graph = optimize(read_g2o(office.graph_file))
    found = facts(topobelief, office.graph_file)["extent"]
    assert found == np.stack([graph.positions.min(axis=0), graph.positions.max(axis=0)], axis=1).tolist()
    assert facts(topobelief, office.graph_file, "--no-optimize")["extent"] == [[0, 10], [0, 10]]
    assert (
        "x 0.0 … 10.0 m, y 0.0 … 10.0 m, at the poses as filed"
        in topobelief(["info", str(office.graph_file), "--no-optimize"]).out
    )


def test_the_graph_is_drawn(topobelief, office, tmp_path):
    outcome = topobelief(["info", str(office.graph_file), "--picture", "graph.png", "--map", str(office.map_file)])
    assert outcome.code == 0
    assert "Picture: graph.png" in outcome.out
    assert (tmp_path / "graph.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["graph.png"]


def test_a_graph_in_space_and_one_in_parts_are_drawn_too(topobelief, tmp_path):
    (tmp_path / "parts.g2o").write_text(PARTS)
    for arguments in ([str(data_file("smallGrid3D.g2o"))], ["parts.g2o", "--drop", "priors"]):
        assert topobelief(["info", *arguments, "--no-optimize", "--picture", "graph.svg"]).code == 0
        assert "<svg" in (tmp_path / "graph.svg").read_text()


def test_goals_are_judged_and_the_nearest_free_place_is_one(topobelief, office):
    places = ["--goal", "5", "4.5", "--goal", "3", "--goal", "20", "5"]
    found = facts(topobelief, office.graph_file, "--map", office.map_file, "--no-optimize", *places)["goals"]
    assert [goal["free"] for goal in found] == [False, True, False]
    assert [goal["nearest_free"] for goal in found] == [[5.0, 2.64], [3.0, 0.0], [10.44, 5.0]]
    again = ["--goal", *map(str, found[0]["nearest_free"]), "--goal", *map(str, found[2]["nearest_free"])]
    assert all(goal["free"] for goal in facts(topobelief, office.graph_file, "--map", office.map_file, *again)["goals"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--picture", "graph.bmp"], "graph.bmp: expected a picture that ends in .png, .pdf or .svg, got .bmp"),
        (["--picture", "no/graph.png"], "no/graph.png: expected a file to write, got a folder that does not exist"),
        (["--goal", "77"], "expected --goal as the id of a pose of the file (from 0 to 20) or as X Y, got 77"),
        (["--goal", "1", "2", "--map", "none.csv"], "none.csv: expected a file to read, got nothing of that name"),
    ],
)
def test_what_cannot_be_is_refused(topobelief, office, tmp_path, options, message):
    outcome = topobelief(["info", str(office.graph_file), *options])
    assert (outcome.code, outcome.err.count("\n")) == (2, 1)
    assert message in outcome.err
    assert list(tmp_path.iterdir()) == []


def test_landmarks_are_counted_and_their_graph_described(topobelief, tmp_path):
    path = tmp_path / "graph.g2o"
    path.write_text(
        "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nEDGE_SE2 0 1 1 0 0 9 0 0 9 0 9\nVERTEX_XY 2 1 1\n"
        "EDGE_SE2_XY 0 2 1 1 4 0 4\nEDGE_SE2_XY 1 2 0 1 4 0 4\n"
    )
    found = facts(topobelief, path)
    assert (found["num_poses"], found["num_landmarks"], found["num_observations"]) == (2, 1, 2)
    assert found["bounds_fischer_cholesky"]["lower"] <= found["joint_entropy"] + 1e-9
    assert found["bounds_paper_cholesky"] is None
    shown = topobelief(["info", str(path), "--picture", str(tmp_path / "graph.png")]).out
    assert "do not apply: they need poses alone" in shown
    assert (tmp_path / "graph.png").exists()
    converted = topobelief(["convert", str(path), str(tmp_path / "again.g2o")])
    assert "2 poses, 1 landmark, 3 edges." in converted.out
