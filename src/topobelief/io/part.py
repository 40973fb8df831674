"""The part of a graph that the options of reading ask for: one component, and its projection onto the plane."""

from __future__ import annotations

import numpy as np

from topobelief.arrays import BoolArray, IntArray
from topobelief.errors import FileError, InvalidGraphError
from topobelief.geometry import SE3_GROUP
from topobelief.graph.components import part_of
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.projection import projected_to_plane
from topobelief.graph.topology import Topology
from topobelief.io.files import StrPath
from topobelief.io.reading import ReadGraph, ReadingOptions
from topobelief.symbols import find_node, node_name


def wanted_component(path: StrPath, ids: IntArray, edges: IntArray, wanted: int | str) -> tuple[BoolArray, list[str]]:
    """Which poses are in the component that is asked for, and what to say where that is not all of them.

    Parameters
    ----------
    path
    ids : shape (n,)
    edges : shape (m, 2)
        Indices of poses.
    wanted
        "all", "largest", or the id or name of a pose.

    Raises
    ------
    FileError
        If no pose has that id.
    """
    topology = Topology(len(ids), edges)
    labels = topology.component_labels
    if wanted == "all":
        return np.ones(len(ids), dtype=np.bool_), []
    if wanted == "largest":
        member = int(np.argmax(np.bincount(labels)[labels]))
    elif (found := find_node(ids.tolist(), wanted)) is not None:
        member = found
    else:
        raise FileError(path, f'expected component to be "all", "largest" or the id of a pose, got {wanted!r}')
    inside = labels == labels[member]
    if inside.all():
        return inside, []
    first, last = (node_name(int(ids[index])) for index in np.flatnonzero(inside)[[0, -1]])
    kept = f"{np.count_nonzero(inside)} of {len(ids)} poses ({first} … {last})"
    return inside, [f"kept one of {topology.num_components} components: {kept}"]


def in_plane(path: StrPath, graph: PoseGraph, options: ReadingOptions) -> tuple[PoseGraph, list[str]]:
    """The graph, projected where the options ask for it and it is in space, and what that dropped.

    Raises
    ------
    FileError
        If something is tilted too far.
    """
    if not options.planar or graph.group is not SE3_GROUP:
        return graph, []
    try:
        planar, note = projected_to_plane(graph)
    except InvalidGraphError as error:
        raise FileError(path, str(error)) from None
    return planar, [note]


def wanted_part(path: StrPath, graph: PoseGraph, options: ReadingOptions, notes: list[str]) -> ReadGraph:
    """A graph of which everything is known, reduced to the part that the options ask for.

    Raises
    ------
    FileError
        As `wanted_component` and `in_plane` do.
    """
    inside, kept = wanted_component(path, graph.ids, graph.edges, options.component)
    part = graph if inside.all() else part_of(graph, np.flatnonzero(inside))
    planar, dropped = in_plane(path, part, options)
    return ReadGraph(planar, (*notes, *kept, *dropped))
