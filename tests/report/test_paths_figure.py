"""The picture of the paths: what is drawn is what was given, and nothing covers anything."""

from __future__ import annotations

import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from topobelief.candidates.start import find_start
from topobelief.graph.action import Action
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.report.map_layers import Sight
from topobelief.report.paths_figure import draw_paths
from topobelief.report.style import BEST, CLOSURE, FREE, NOT_FREE, ODOMETRY, PREDICTED_CLOSURE, SEEN_AGAIN
from topobelief.world import World

OMEGA = np.diag([100.0, 100.0, 400.0])
ROOM = World.from_boxes([(4, 4, 6, 6)], bounds=(0, 0, 10, 10))
HALL = World.from_boxes([], bounds=(0, 0, 200, 60))
TOWER = World.from_boxes([], bounds=(0, 0, 10, 90))


@pytest.fixture
def scene():
    """A robot that came along y = 2 and may go left or right of the pillar."""
    graph = PoseGraph([[x, 2, 0] for x in range(1, 6)], [(0, 1), (1, 2), (2, 3), (3, 4), (0, 2)], None, OMEGA)
    paths = [np.array([(5, 2), (3, 5), (5, 8)], float), np.array([(5, 2), (7, 5), (5, 8)], float)]
    actions = [
        Action([(3, 5, 2), (5, 8, 1)], [(4, 5), (5, 6), (5, 1), (5, 2)], OMEGA, label="left"),
        Action([(7, 5, 1), (5, 8, 2)], [(4, 5), (5, 6)], OMEGA, label="right"),
    ]
    return graph, paths, actions, Planner(graph).decide(actions)


def drawn(scene, world: World = ROOM) -> Figure:
    graph, paths, actions, decision = scene
    return draw_paths(graph, world, paths, actions, decision, goal=(5, 8))


def segments(figure: Figure, colour: str) -> np.ndarray:
    """Segments of the large panel in one colour, shape (N, 2, 2)."""
    found = [c for c in figure.axes[0].collections if to_hex(c.get_color()[0]).upper() == colour.upper()]
    return np.concatenate([np.zeros((0, 2, 2)), *(np.array(c.get_segments()) for c in found)])


def test_the_best_path_is_drawn_where_it_goes(scene):
    _, paths, _, decision = scene
    best = [line for line in drawn(scene).axes[0].lines if line.get_color() == BEST]
    assert [line.get_xydata().tolist() for line in best] == [paths[decision.best].tolist()]


def test_odometry_closures_and_predicted_closures_of_the_best_are_told_apart(scene):
    figure = drawn(scene)
    assert scene[3].best == 0
    assert len(segments(figure, ODOMETRY)) == 4
    assert segments(figure, CLOSURE).tolist() == [[[1, 2], [3, 2]]]
    assert segments(figure, PREDICTED_CLOSURE).tolist() == [[[3, 5], [2, 2]], [[3, 5], [3, 2]]]


def test_poses_seen_again_lie_on_a_band(scene):
    """Each as a dot, and joined where they follow one another."""
    figure = drawn(scene)
    assert segments(figure, SEEN_AGAIN).tolist() == [[[2, 2], [3, 2]], [[2, 2], [2, 2]], [[3, 2], [3, 2]]]
    assert "poses it sees again (2)" in {text.get_text() for text in figure.legends[0].get_texts()}
    assert any(text.get_text().endswith("2 closures; sees poses 1 to 2 again") for text in figure.texts)


def test_of_many_closures_the_two_shortest_of_each_new_pose_are_drawn(scene):
    graph, paths, _, _ = scene
    action = Action([(5, 3, 2), (5, 8, 1)], [(4, 5), (5, 6), (5, 0), (1, 5), (5, 2), (5, 3), (6, 0)], OMEGA, label="left")
    figure = draw_paths(graph, ROOM, paths[:1], [action], Planner(graph).decide([action]), goal=(5, 8))
    assert segments(figure, PREDICTED_CLOSURE).tolist() == [[[5, 3], [3, 2]], [[5, 3], [4, 2]], [[5, 8], [1, 2]]]
    assert "its predicted closures (3 of 5)" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_stretches_are_named_by_ids_those_with_most_closures_first():
    graph = PoseGraph([[x, 0, 0] for x in range(20)], [(x, x + 1) for x in range(19)], None, OMEGA, ids=range(100, 120))
    action = Action([(0, 1, 0)], [(19, 20), *((20, seen) for seen in (0, 4, 6, 9, 15, 16))], OMEGA)
    sight = Sight.of(graph, find_start(graph), action)
    assert sight.seen.tolist() == [0, 4, 6, 9, 15, 16]
    assert [stretch.name(graph) for stretch in sight.stretches] == ["104 to 109", "115 to 116", "100"]


def test_the_key_counts_survivors_and_ruled_out(scene):
    texts = [text.get_text() for text in drawn(scene).legends[0].get_texts()]
    ruled_out = len(scene[1]) - len(scene[3].survivors)
    assert ruled_out == 1
    assert "ruled out (1)" in texts
    assert "left, the best" in texts


def test_obstacles_are_grey_and_free_space_is_white(scene):
    figure = drawn(scene)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())

    def colour_at(x: float, y: float) -> str:
        column, row = figure.axes[0].transData.transform((x, y)).round().astype(int)
        return to_hex(pixels[-row, column] / 255)

    assert colour_at(5, 5) == NOT_FREE.lower()  # in the pillar, a hole of the free region
    assert colour_at(8.5, 8.5) == FREE.lower()


@pytest.mark.parametrize("world", [ROOM, HALL, TOWER], ids=["room", "hall", "tower"])
def test_a_metre_is_as_long_upward_as_across_and_nothing_overlaps(scene, world):
    figure = drawn(scene, world)
    FigureCanvasAgg(figure).draw()
    boxes = [axes.get_window_extent() for axes in figure.axes] + [figure.legends[0].get_window_extent()]
    for axes in figure.axes:
        (x_0, y_0), (x_1, y_1) = axes.transData.transform([(0, 0), (1, 1)])
        assert x_1 - x_0 == pytest.approx(y_1 - y_0, rel=1e-6)
    for index, box in enumerate(boxes):
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])


@pytest.mark.parametrize(("world", "panels"), [(ROOM, 1), (HALL, 2), (TOWER, 2)], ids=["room", "hall", "tower"])
def test_the_whole_map_stands_beside_where_the_paths_fill_little_of_it(scene, world, panels):
    """Both their width and their height are small parts of it."""
    assert len(drawn(scene, world).axes) == panels


def test_a_single_path_without_closures_is_drawn(scene):
    graph, paths, actions, _ = scene
    decision = Planner(graph).decide(actions[1:])
    figure = draw_paths(graph, ROOM, paths[1:], actions[1:], decision, goal=(5, 8))
    assert len(segments(figure, PREDICTED_CLOSURE)) == 0
    assert any(text.get_text() == "right on the pose graph, the only candidate" for text in figure.texts)
    assert "right, the only candidate" in {text.get_text() for text in figure.legends[0].get_texts()}


def test_a_start_elsewhere_is_marked_and_its_odometry_is_no_closure(scene):
    """From pose 1 the first new pose is joined to pose 1, and what it sees of pose 4, the last, is a closure."""
    graph = scene[0]
    actions = [Action([(2, 4, 2), (2, 8, 1)], [(1, 5), (5, 6), (5, 4)], OMEGA, label="back")]
    decision = Planner(graph).decide(actions)
    path = [np.array([(2, 2), (2, 8)], float)]
    for start, name in ((1, "start, pose 1"), ((2.0, 2.5), "start, near pose 1"), (4, "start, the graph's last pose")):
        figure = draw_paths(graph, ROOM, path, actions, decision, goal=(2, 8), start=start)
        assert name in {text.get_text() for text in figure.legends[0].get_texts()}
        expected = [[[2, 4], [5, 2]]] if start != 4 else [[[2, 2], [2, 4]]]
        assert segments(figure, PREDICTED_CLOSURE).tolist() == expected


def test_drawing_leaves_the_settings_of_matplotlib_alone(scene):
    before = dict(mpl.rcParams)
    drawn(scene)
    assert dict(mpl.rcParams) == before


def test_pictures_need_no_graphical_backend():
    """pyplot, which would choose one, is never imported."""
    code = (
        "import sys, topobelief.report.paths_figure, topobelief.report.bounds_figure; print('matplotlib.pyplot' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"
