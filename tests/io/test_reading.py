"""What options of reading drop and assume, and how a file that needs one is refused."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pytest

from data_files import case_file, data_file
from topobelief.errors import FileError, InvalidInputError, ReadingWarning
from topobelief.io.formats import read_graph_file, read_pose_graph
from topobelief.io.g2o import read_g2o
from topobelief.io.reading import ReadingKeywords, ReadingOptions

SQUARE = """VERTEX_SE2 0 0 0 0
VERTEX_SE2 1 2 0 1.5
VERTEX_SE2 2 2 2 3
EDGE_SE2 0 1 2 0 1.5 1 0 0 1 0 1
EDGE_SE2 1 2 2 0 1.5 1 0 0 1 0 1
"""
IDENTITY = "0 0 0 0 0 0 1"
UNIT_3D = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"
SPACE = f"""VERTEX_SE3:QUAT 0 {IDENTITY}
FIX 0
VERTEX_SE3:QUAT 1 {IDENTITY}
EDGE_SE3:QUAT 0 1 {IDENTITY} {UNIT_3D}
"""
X0 = ord("x") << 56


@pytest.fixture
def filed(tmp_path: Path):
    """A function that writes text to graph.g2o and returns the path."""

    def write(text: str) -> Path:
        path = tmp_path / "graph.g2o"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def noted(path: Path, **options: object):
    """The graph, with what was dropped or assumed as one text."""
    graph, notes = read_graph_file(path, ReadingOptions(**options))  # pyright: ignore[reportArgumentType]
    return graph, "\n".join(notes)


FOREIGN = {
    "EDGE_SE2_PRIOR 0 0 0 0 1 0 0 1 0 1": ("priors", "absolute priors on poses"),
    "EDGE_PRIOR_SE2 0 0 0 0 1 0 0 1 0 1": ("priors", "absolute priors on poses"),
    f"EDGE_SE3_PRIOR 1 0 {IDENTITY} {UNIT_3D}": ("priors", "absolute priors on poses"),
    "EDGE_PRIOR_SE2_XY 0 1 2 1 0 1": ("gps", "absolute positions, as from GPS"),
    "EDGE_SE3_PRIORXYZ 0 1 2 3 1 0 0 1 0 1": ("gps", "absolute positions, as from GPS"),
    "EDGE_SE3_PRIORXY 0 1 2 1 0 1": ("gps", "absolute positions, as from GPS"),
    "EDGE_POINTXYZ_PRIOR 0 1 2 3 1 0 0 1 0 1": ("gps", "absolute positions, as from GPS"),
    "EDGE_SE3_GNSS 0 1 2 3": ("gps", "absolute positions, as from GPS"),
    "EDGE_SE3_PRIORVEC 0 0 0 1 0 0 1 1 0 0 1 0 1": ("gravity", "directions of gravity or orientations of an IMU"),
    "EDGE_SE3_PRIORQUAT 0 0 0 0 1 1 0 0 1 0 1": ("gravity", "directions of gravity or orientations of an IMU"),
    "EDGE_PLANE_PRIOR_NORMAL 9 0 0 1 1 0 0 1 0 1": ("planes", "planes or lines"),
    "EDGE_SE2_LINE2D 0 9 1 2 1 0 1": ("planes", "planes or lines"),
    "VERTEX_POINT_XYZ 9 1 2 3": ("landmarks", "landmarks"),
    "VERTEX_SWITCH 9 1": ("robust", "robust edges, which may turn out to be outliers"),
    "EDGE_SE2_MIXTURE 0 1 2 EDGE_SE2 0.5 0 1 EDGE_SE2 0.5 0 2": ("robust", "robust edges, which may turn out to be outliers"),
    "EQUIV 0 1": ("equiv", "pairs of poses that are to be merged into one"),
}


@pytest.mark.parametrize("line", FOREIGN)
def test_what_is_no_plain_edge_is_named_and_can_be_dropped(line: str, filed):
    """The refusal says what the line is and which option drops it; with the option the rest is the graph that it was."""
    word, name = FOREIGN[line]
    path = filed(SQUARE + line + "\n")
    with pytest.raises(FileError) as caught:
        read_g2o(path)
    assert caught.value.line == 6
    tag = line.split()[0]
    assert f"got {name} ({tag} on line 6); leave them out together with --drop {word} " in str(caught.value)
    graph, notes = noted(path, drop=word)
    assert (graph.num_poses, graph.num_edges) == (3, 2)
    assert notes == f"dropped {name}: {tag} on line 6; what they measure is not counted"


def test_a_plane_its_edges_and_its_fix_belong_together(filed):
    """One message names all that belongs to planes and to GPS; the options drop it, and FIX 0 stays."""
    plane = "VERTEX_PLANE 4 0 0 1 0\nFIX 4\n" + "EDGE_SE3_PLANE 1 4 0 0 1 0 1 0 0 1 0 1\n" * 2
    path = filed(SPACE + plane + "EDGE_SE3_PRIORXYZ 0 1 2 3 1 0 0 1 0 1\n")
    with pytest.raises(FileError) as caught:
        read_g2o(path)
    assert str(caught.value).startswith(f"{path}:5: ")
    assert "planes or lines (VERTEX_PLANE on line 5, 2 EDGE_SE3_PLANE from line 7 on, FIX 4 on line 6)" in str(caught.value)
    assert "(EDGE_SE3_PRIORXYZ on line 9) and planes" in str(caught.value)
    assert "; leave them out together with --drop gps --drop planes " in str(caught.value)
    with pytest.raises(FileError, match="got absolute positions, as from GPS"):
        read_g2o(path, drop="planes")
    graph, notes = noted(path, drop=("planes", "gps"))
    assert (graph.num_poses, graph.num_edges, graph.fixed) == (2, 1, (0,))
    assert notes.count("\n") == 1


def test_a_pose_edge_cannot_lead_to_what_was_dropped(filed):
    path = filed(SQUARE + "VERTEX_XY 9 1 2\nEDGE_SE2 0 9 2 0 1.5 1 0 0 1 0 1\n")
    with pytest.raises(FileError, match=r":7: expected an edge between poses, got one to 9, which is no pose"):
        read_g2o(path, drop="landmarks")


def test_what_is_dropped_is_a_warning_in_python(filed):
    path = filed(SQUARE + "VERTEX_XY 9 1 2\n")
    with pytest.warns(ReadingWarning, match="dropped landmarks: VERTEX_XY on line 6") as caught:
        read_pose_graph(path, drop="landmarks")
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_pose_graph(filed(SQUARE), drop="landmarks", robust_as_plain=True, component="largest", planar=True)


ROBUST = {
    "switchable": "VERTEX_SWITCH 9 1\nEDGE_SWITCH_PRIOR 9 1 1\nEDGE_SE2_SWITCHABLE 2 0 9 5 6 0.25 10 1 2 20 3 30\n",
    "weight before": "EDGE_SE2_MAXMIX 2 0 0.01 5 6 0.25 10 1 2 20 3 30\n",
    "weight behind": "EDGE_SE2_MAXMIX 2 0 5 6 0.25 0.01 10 1 2 20 3 30\n",
    "no weight": "EDGE_SE2_MAXMIX 2 0 5 6 0.25 10 1 2 20 3 30\n",
}


@pytest.mark.parametrize("case", ROBUST)
def test_robust_edges_can_be_read_as_plain_ones(case: str, filed):
    """Switch and weight go, the measurement stays, and edges keep the order of the file."""
    last = "EDGE_SE2 0 1 2 0 1.5 1 0 0 1 0 1\n"
    graph, notes = noted(filed(SQUARE + ROBUST[case] + last), robust_as_plain=True)
    assert graph.edges.tolist() == [[0, 1], [1, 2], [2, 0], [0, 1]]
    assert graph.measurements[2].tolist() == [5, 6, 0.25]
    assert graph.information[2].tolist() == [[10, 1, 2], [1, 20, 3], [2, 3, 30]]
    assert notes.startswith("took robust edges (1 EDGE_SE2_")
    assert "each counts as a correct measurement" in notes


def test_robust_edges_in_space_can_be_read_as_plain_ones(filed):
    edges = "".join(f"EDGE_{tag}_SWITCHABLE 0 1 9 1 2 3 0 0 0 1 {UNIT_3D}\n" for tag in ("SE3", "SE3:QUAT"))
    graph, _ = noted(filed(SPACE + edges), robust_as_plain=True)
    assert graph.measurements[:, :3].tolist() == [[0, 0, 0], [1, 2, 3], [1, 2, 3]]


def test_robust_edges_that_are_malformed_are_refused(filed):
    for line, message in (
        (
            "EDGE_SE2_MAXMIX 2 0 5 6 0.25 7 10 1 2 20 3 30",
            "expected the weight of EDGE_SE2_MAXMIX from 0 to 1 before or behind",
        ),
        ("EDGE_SE2_MAXMIX 2 0 5 6 0.25 10", "expected 6 information entries for EDGE_SE2, got 1"),
        ("EDGE_SE2_SWITCHABLE 2", "expected 2 ids, 3 numbers and 6 information entries for EDGE_SE2, got 1 fields"),
        ("EDGE_SE2_SWITCHABLE 2 0 9 5 6 x 10 1 2 20 3 30", "expected a number for EDGE_SE2, got 'x'"),
        ("EDGE_SE2_MIXTURE 0 1 2", "robust edges, which may turn out to be outliers (EDGE_SE2_MIXTURE on line 6)"),
    ):
        with pytest.raises(FileError) as caught:
            read_g2o(filed(SQUARE + line + "\n"), robust_as_plain=True)
        assert caught.value.line == 6
        assert message in str(caught.value)


def test_edges_of_indefinite_information_can_be_dropped_and_are_counted(filed):
    bad = "EDGE_SE2 0 2 2 2 3 1 2 0 1 0 1\n"
    path = filed(SQUARE + bad * 2)
    with pytest.raises(FileError, match=r":6: .*leave out 2 of 4 edges, .* with --drop indefinite"):
        read_g2o(path)
    graph, notes = noted(path, drop="indefinite")
    assert graph.num_edges == 2
    assert notes == "dropped 2 of 4 edges, whose information is not positive definite (the first on line 6)"
    assert not noted(filed(SQUARE), drop="indefinite")[1]


PARTS = SQUARE + "VERTEX_SE2 7 0 0 0\nVERTEX_SE2 8 5 5 0\nFIX 0 8\nEDGE_SE2 7 8 1 0 0 1 0 0 1 0 1\nVERTEX_SE2 9 0 0 0\n"


@pytest.mark.parametrize(
    ("component", "ids", "fixed", "text"),
    [
        ("largest", [0, 1, 2], (0,), "kept one of 3 components: 3 of 6 poses (0 … 2)"),
        (8, [7, 8], (1,), "kept one of 3 components: 2 of 6 poses (7 … 8)"),
        ("9", [9], (), "kept one of 3 components: 1 of 6 poses (9 … 9)"),
        ("all", [0, 1, 2, 7, 8, 9], (0, 4), ""),
    ],
)
def test_one_component_can_be_kept(component: int | str, ids: list[int], fixed: tuple[int, ...], text: str, filed):
    graph, notes = noted(filed(PARTS), component=component)
    assert (graph.ids.tolist(), graph.fixed, notes) == (ids, fixed, text)


def test_a_component_may_have_no_vertex_lines(filed):
    """What cannot be placed beside the rest can be read by itself."""
    text = "EDGE_SE2 1 2 1 0 0 1 0 0 1 0 1\n" + "EDGE_SE2 5 6 1 0 0 1 0 0 1 0 1\nEDGE_SE2 6 7 1 0 0 1 0 0 1 0 1\n"
    graph, _ = noted(filed(text), component="largest")
    assert (graph.ids.tolist(), graph.positions[:, 0].tolist()) == ([5, 6, 7], [0, 1, 2])


def test_components_and_messages_know_symbols(filed):
    vertices = [f"VERTEX_SE2 {X0 + k} {k} 0 0" for k in range(3)]
    edges = [f"EDGE_SE2 {X0 + k} {X0 + k + 1} 1 0 0 1 0 0 1 0 1" for k in range(2)]
    text = "\n".join([*vertices, *edges, "VERTEX_SE2 5 0 0 0\n"])
    graph, notes = noted(filed(text), component="x1")
    assert graph.ids.tolist() == [X0, X0 + 1, X0 + 2]
    assert notes == "kept one of 2 components: 3 of 4 poses (x0 … x2)"
    with pytest.raises(FileError, match=r":7: expected an edge between two poses, got a self-loop at x1"):
        read_g2o(filed(text + f"EDGE_SE2 {X0 + 1} {X0 + 1} 2 0 1.5 1 0 0 1 0 1\n"))
    with pytest.raises(FileError, match='expected component to be "all", "largest" or the id of a pose, got \'x9\''):
        read_g2o(filed(text), component="x9")


def test_options_are_checked():
    with pytest.raises(InvalidInputError, match=r'expected drop to be one of "priors", "gps", .* got .prior.'):
        ReadingOptions(drop="prior")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InvalidInputError, match="expected edge2_order to be one of"):
        ReadingOptions(edge2_order="g2o")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InvalidInputError, match="expected robust edges to be dropped or read as plain ones, got both"):
        ReadingOptions(drop="robust", robust_as_plain=True)
    assert set(ReadingKeywords.__annotations__) == {field.name for field in dataclasses.fields(ReadingOptions)}


CASES = {  # name: options, space, poses, edges, note
    "apriltag_high_id.g2o": ({}, "SE(2)", 5, 6, ""),
    "rtabmap_export_2d.g2o": ({}, "SE(2)", 4, 4, ""),
    "rtabmap_export_3d.g2o": ({}, "SE(3)", 4, 4, ""),
    "params_offset_pose_only.g2o": ({}, "SE(2)", 4, 4, ""),
    "gtsam_symbol_ids.g2o": ({}, "SE(2)", 4, 4, ""),
    "labeled_symbol_ids.g2o": ({}, "SE(2)", 4, 4, ""),
    "edge_se2_prior.g2o": ({"drop": "priors"}, "SE(2)", 4, 4, "absolute priors on poses: EDGE_SE2_PRIOR on line 9"),
    "se3_prior.g2o": ({"drop": "priors"}, "SE(3)", 3, 3, "absolute priors on poses: EDGE_SE3_PRIOR on line 7"),
    "switchable.g2o": ({"robust_as_plain": True}, "SE(2)", 4, 5, "took robust edges (1 EDGE_SE2_SWITCHABLE)"),
    "maxmix.g2o": ({"robust_as_plain": True}, "SE(2)", 4, 5, "took robust edges (1 EDGE_SE2_MAXMIX)"),
    "hdl_graph_slam_dump.g2o": ({"drop": "planes"}, "SE(3)", 4, 4, "EDGE_SE3_PLANE on line 12, FIX 4 on line 7"),
    "toro_in_g2o.g2o": ({}, "SE(2)", 3, 3, ""),
    "g2o_in_graph.graph": ({}, "SE(2)", 4, 4, ""),
    "toro_equiv.graph": ({"drop": "equiv"}, "SE(2)", 3, 2, "EQUIV on line 6"),
    "latin1_comment.g2o": ({}, "SE(2)", 4, 4, ""),
    "two_robots_unlinked.g2o": ({"component": "100"}, "SE(2)", 4, 4, "kept one of 2 components: 4 of 8 poses (100 … 103)"),
    "singleton_vertex.g2o": ({"component": "largest"}, "SE(2)", 4, 4, "kept one of 2 components: 4 of 5 poses"),
    "planar_as_3d_tiny.g2o": ({"planar": True}, "SE(2)", 3, 3, "dropped heights from 0 to 0.2 m"),
}


@pytest.mark.parametrize("name", CASES)
def test_files_of_other_programs_can_be_read(name: str):
    """Each with the option that it needs, if any; without it the file is refused or, in parts, read as it is."""
    options, space, num_poses, num_edges, note = CASES[name]
    path = case_file(f"graphs/{name}")
    graph, notes = noted(path, **options)
    assert (graph.group.name, graph.num_poses, graph.num_edges) == (space, num_poses, num_edges)
    assert note in notes
    assert bool(note) == bool(notes)
    if "drop" in options or "robust_as_plain" in options:
        with pytest.raises(FileError, match=r"--drop \w+ \(in Python drop="):
            read_pose_graph(path)


def test_the_weight_of_a_max_mixture_is_not_its_measurement():
    graph, _ = noted(case_file("graphs/maxmix.g2o"), robust_as_plain=True)
    assert graph.measurements[-1].tolist() == [1.99, 0, 1.57]


def test_a_garage_on_two_floors_can_be_projected():
    graph, notes = noted(data_file("parking-garage.g2o"), planar=True)
    assert (graph.group.name, graph.num_poses) == ("SE(2)", 1661)
    assert notes.startswith("projected onto the plane: dropped heights from ")
    assert np.isfinite(graph.chi2)
