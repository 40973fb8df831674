"""What the page shows before any question: map, graph, where the robot stands, and what may be chosen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from shapely import MultiPolygon

from topobelief.arrays import FloatArray
from topobelief.candidates.start import Start
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.registry import AUTO, BOUNDS
from topobelief.world import World

_DETAIL = 0.02  # metres; corners of walls that matter less to a picture are left out
_OBJECTIVES = (
    ("error", "expected map error"),
    ("map", "entropy of the map"),
    ("joint", "joint entropy"),
    ("per_pose", "joint entropy per pose"),
)
_COMPARISONS = (("0", "all ways of the roadmap"), ("20", "20 diverse paths"), ("100", "100 diverse paths"))


def document(
    name: str, graph: PoseGraph, world: World, start: Start, closure_models: Sequence[tuple[str, str]], *, trip: float
) -> Mapping[str, object]:
    """For the page; lengths in metres.

    Parameters
    ----------
    name
        What the graph is called.
    graph
        In SE(2).
    world
    start
    closure_models
        Those to choose from: name, and what they predict in words.
    trip
        Length of a trip without a goal unless another is asked for.
    """
    apart = np.abs(graph.edges[:, 0] - graph.edges[:, 1]) > 1
    corners = np.concatenate([graph.positions[:, :2], np.reshape(world.free.bounds, (2, 2))])
    return {
        "name": name,
        "free": rings(world.free.simplify(_DETAIL)),
        "extent": [*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()],
        "poses": rounded(graph.positions[:, :2]),
        "odometry": graph.edges[~apart].tolist(),
        "closures": graph.edges[apart].tolist(),
        "start": rounded(start.place),
        "max_length": trip,
        "objectives": _OBJECTIVES,
        "closure_models": closure_models,
        "comparisons": _COMPARISONS,
        "bounds": [(family, family) for family in (AUTO, *BOUNDS)],
    }


def rings(shape: object) -> list[list[list[float]]]:
    """All outlines of a region; what lies within an odd number of them is in it."""
    polygons = shape.geoms if isinstance(shape, MultiPolygon) else [shape]
    return [
        rounded(np.asarray(ring.coords))  # pyright: ignore[reportUnknownMemberType, reportUnknownArgumentType, reportAttributeAccessIssue]
        for polygon in polygons  # pyright: ignore[reportUnknownVariableType]
        for ring in (polygon.exterior, *polygon.interiors)  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType, reportAttributeAccessIssue]
    ]


def rounded(points: FloatArray) -> list[list[float]]:
    """To millimetres."""
    return np.round(points, 3).tolist()
