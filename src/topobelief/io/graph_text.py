"""Pose graphs as lines of text in a dialect, written so that reading returns every double to the last bit."""

from __future__ import annotations

from topobelief.errors import InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.dialect import Dialect, Tag
from topobelief.io.landmark_lines import observation_lines, vertex_lines


def graph_text(graph: PoseGraph, dialect: Dialect) -> str:
    """Lines of poses, landmarks, FIX, edges and observations, in the dialect's first order of the information.

    Raises
    ------
    InvalidInputError
        If the dialect has no lines for the graph's group, an id is negative, which its reader would refuse, or bearings or
        ranges are read, of which g2o has none.
    """
    tags = {meaning: tag for tag, meaning in dialect.tags.items()}
    if Tag("vertex", graph.group) not in tags:
        raise InvalidInputError(
            f"expected a graph in SE(2) for a {dialect.name} file, got one in {graph.group.name}; write g2o"
        )
    if graph.ids.min() < 0:
        raise InvalidInputError(f"expected ids from 0 to 2^63 - 1 for a file, got {graph.ids.min()}; renumber the poses")
    vertex, edge = tags[Tag("vertex", graph.group)], tags[Tag("edge", graph.group)]
    rows, columns = next(iter(dialect.orders.values()))[graph.tangent_dim]
    poses, between = graph.pose_indices, graph.reading_codes == 0
    lines = [
        f"{vertex} {name} {_joined(pose)}"
        for name, pose in zip(graph.ids[poses].tolist(), graph.poses[poses].tolist(), strict=True)
    ]
    lines += vertex_lines(graph)
    lines += [f"FIX {graph.ids[index]}" for index in graph.fixed]
    lines += [
        f"{edge} {i} {j} {_joined(measured)} {_joined(entries)}"
        for (i, j), measured, entries in zip(
            graph.ids[graph.edges[between]].tolist(),
            graph.measurements[between].tolist(),
            graph.information[between][:, rows, columns].tolist(),
            strict=True,
        )
    ]
    return "\n".join([*lines, *observation_lines(graph)]) + "\n"


def _joined(numbers: list[float]) -> str:
    return " ".join(map(repr, numbers))
