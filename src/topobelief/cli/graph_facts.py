"""What there is to know of a pose graph, in the order in which a person asks: size, fit, topology, uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from topobelief.bounds import entropy_bounds
from topobelief.bounds.entropy_bounds import Determinant, Family
from topobelief.cli.console import Reporter
from topobelief.cli.prior import estimated, read_filed
from topobelief.entropy import joint_entropy_estimate
from topobelief.errors import IllConditionedError, InvalidGraphError
from topobelief.graph.components import components
from topobelief.graph.information import isotropic_weights, shared_information
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.reading import ReadingOptions
from topobelief.report.tables import quantity_table
from topobelief.signatures.spanning_trees import log_num_spanning_trees, spanning_tree_signature
from topobelief.signatures.von_neumann import (
    DENSE_SPECTRUM_SIZE,
    expected_spectrum_seconds,
    von_neumann_entropy,
    von_neumann_entropy_approx,
)
from topobelief.symbols import node_name

_BOUNDS: tuple[tuple[Family, Determinant], ...] = (
    ("fischer", "cholesky"),
    ("fischer", "hadamard"),
    ("paper", "cholesky"),
    ("paper", "hadamard"),
)

_MOST_COMPONENTS = 10  # listed for a person

Value = str | int | float | None | dict[str, float] | Sequence[int | Sequence[float] | Mapping[str, object]]


@dataclass(frozen=True, slots=True)
class Fact:
    """One line: for a program a key and a value, for a person a label and a text."""

    key: str  # empty where only a person cares
    value: Value
    label: str  # empty where only a program cares
    text: str


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts in groups, each with a heading, and the graph at the poses that they are about."""

    groups: dict[str, list[Fact]]
    graph: PoseGraph

    def tables(self) -> list[Table]:
        """For a person."""
        return [
            quantity_table(heading, [(fact.label, fact.text) for fact in facts if fact.label])
            for heading, facts in self.groups.items()
        ]

    def document(self) -> dict[str, object]:
        """For a program."""
        return {fact.key: fact.value for facts in self.groups.values() for fact in facts if fact.key}


def describe(path: Path, reporter: Reporter, *, optimized: bool, reading: ReadingOptions) -> Facts:
    """All facts of a file's graph; of one that is not connected its size and its components.

    Raises
    ------
    FileError
        If the file is wrong.
    EstimationError
        If no estimate is found.
    """
    filed = read_filed(path, reporter, reading=reading)
    if filed.topology.num_components > 1:
        return Facts(
            {
                str(path): [Fact("file", str(path), "", ""), *_size(filed), _extent(filed, "as filed")],
                "Components; for fit, signatures and uncertainty of one, pass --component": list(_components(filed)),
            },
            filed,
        )
    graph = estimated(filed, reporter, optimized=optimized).graph
    at = "at the optimised poses" if optimized else "at the poses as filed"
    with reporter.stage("quantities"):
        return Facts(
            {
                str(path): [Fact("file", str(path), "", ""), *_size(filed), _extent(graph, at)],
                "Fit": list(_fit(filed, graph, optimized=optimized)),
                "Topology": list(_topology(graph)),
                f"Uncertainty {at}": list(_uncertainty(graph)),
            },
            graph,
        )


def _size(graph: PoseGraph) -> Iterator[Fact]:
    topology = graph.topology
    alone = graph.poses_alone
    gap = np.abs(alone.edges[:, 0] - alone.edges[:, 1])
    closures = int(np.count_nonzero(gap > 1))
    parallel = topology.num_edges - topology.simple().num_edges
    degrees = topology.degrees
    of_poses = topology.component_labels[graph.pose_indices]
    steps = np.linalg.norm(np.diff(alone.positions, axis=0), axis=1)[np.diff(of_poses) == 0]
    yield Fact("space", graph.group.name, "space", graph.group.name)
    yield Fact("num_poses", graph.num_poses, "poses", str(graph.num_poses))
    if graph.num_landmarks:
        yield Fact("num_landmarks", graph.num_landmarks, "landmarks", str(graph.num_landmarks))
    yield Fact("num_edges", graph.num_edges, "edges", str(graph.num_edges))
    if graph.num_landmarks:
        names, counts = np.unique(graph.readings[graph.reading_codes > 0], return_counts=True)
        told = [f"{n} of {name.replace('_', ' and ')}" for name, n in zip(names.tolist(), counts.tolist(), strict=True)]
        yield Fact("num_observations", int(counts.sum()), "of these observations of landmarks", ", ".join(told))
    yield Fact("num_loop_closures", closures, "of these loop closures", f"{closures} (not between consecutive poses)")
    yield Fact("num_parallel_edges", parallel, "of these parallel", f"{parallel} (beyond the first between two poses)")
    highest = int(degrees.argmax())
    most, what = graph.label(highest), "landmark" if graph.is_landmark[highest] else "pose"
    fixed = [int(graph.ids[index]) for index in graph.fixed]
    yield Fact("fixed", fixed, "fixed in the file", ", ".join(map(node_name, fixed)) or "none")
    yield Fact("mean_degree", float(degrees.mean()), "mean degree", f"{degrees.mean():.2f}")
    yield Fact("max_degree", int(degrees.max()), "largest degree", f"{degrees.max()} ({what} {most})")
    parts = topology.num_components
    yield Fact("num_components", parts, "connectivity", "connected" if parts == 1 else f"{parts} components")
    yield Fact("length", float(steps.sum()), "length from pose to pose", f"{steps.sum():.1f} m as filed")
    yield Fact("noise", _noise(graph), "noise", _noise(graph))


def _extent(graph: PoseGraph, at: str) -> Fact:
    low, high = graph.positions.min(axis=0).tolist(), graph.positions.max(axis=0).tolist()
    spans = [f"{axis} {a:.1f} … {b:.1f} m" for axis, a, b in zip("xyz", low, high, strict=False)]
    return Fact("extent", [[a, b] for a, b in zip(low, high, strict=True)], "extent", f"{', '.join(spans)}, {at}")


def _components(graph: PoseGraph) -> Iterator[Fact]:
    parts = components(graph)
    rows: list[dict[str, int | float | None]] = []
    for part in parts:
        freedom = part.degrees_of_freedom
        row = {"num_poses": part.num_poses, "num_edges": part.num_edges, "first": int(part.ids[0]), "last": int(part.ids[-1])}
        rows.append(row | {"chi2_per_dof_filed": part.chi2 / freedom if freedom else None})
    yield Fact("components", rows, "", "")
    for part, row in zip(parts[:_MOST_COMPONENTS], rows, strict=False):
        first, last = part.label(0), part.label(-1)
        label = f"pose {first}" if part.num_poses == 1 else f"{part.num_poses} poses, {first} … {last}"
        ratio = row["chi2_per_dof_filed"]
        fit = "a tree" if ratio is None else f"χ² per degree of freedom {ratio:.4g} as filed"
        edges = "1 edge" if part.num_edges == 1 else f"{part.num_edges} edges"
        yield Fact("", None, label, f"{edges}, {fit}" if part.num_edges else "no edges")
    if len(parts) > _MOST_COMPONENTS:
        yield Fact("", None, "and smaller ones", str(len(parts) - _MOST_COMPONENTS))


def _noise(graph: PoseGraph) -> str:
    if graph.num_edges == 0:
        return "no edges"
    weights = isotropic_weights(graph.information)
    if shared_information(graph.information) is None:
        return f"differs between edges{'' if weights is None else ', each block-isotropic'}"
    if weights is None:
        return "one matrix for all edges, not block-isotropic"
    sigma_p, sigma_r = (float(weight[0]) ** -0.5 for weight in weights)
    return f"one for all edges, block-isotropic: {sigma_p:.4g} m, {sigma_r:.4g} rad"


def _fit(filed: PoseGraph, graph: PoseGraph, *, optimized: bool) -> Iterator[Fact]:
    freedom = filed.degrees_of_freedom
    yield Fact("degrees_of_freedom", freedom, "degrees of freedom", str(freedom))
    for key, label, at in (("filed", "as filed", filed), ("optimized", "optimised", graph)):
        if not optimized and key == "optimized":
            continue
        ratio = at.chi2 / freedom if freedom else None
        text = f"{ratio:.4g}" if ratio is not None else "none: the graph is a tree"
        yield Fact(f"chi2_per_dof_{key}", ratio, f"χ² per degree of freedom, {label}", text)


def _topology(graph: PoseGraph) -> Iterator[Fact]:
    topology, size = graph.topology, graph.num_nodes
    tau = log_num_spanning_trees(topology)
    yield Fact("log_num_spanning_trees", tau, "τ, log number of spanning trees", f"{tau:.4f}")
    if size <= DENSE_SPECTRUM_SIZE:
        exact = von_neumann_entropy(topology)
        yield Fact("von_neumann_entropy", exact, "s_VN, von Neumann entropy", f"{exact:.4f}")
    else:
        nodes = "nodes" if graph.num_landmarks else "poses"
        text = f"not computed: some {expected_spectrum_seconds(size):.0f} s for the spectrum of {size} {nodes}"
        yield Fact("von_neumann_entropy", None, "s_VN, von Neumann entropy", text)
    degrees = von_neumann_entropy_approx(topology)
    yield Fact("von_neumann_entropy_approx", degrees, "ŝ_VN, the same by degrees", f"{degrees:.4f}")
    signature = spanning_tree_signature(topology, graph.information, kinds=graph.kinds)
    yield Fact("spanning_tree_signature", signature, "s_ST, spanning-tree signature", f"{signature:.4f} nats")


def _uncertainty(graph: PoseGraph) -> Iterator[Fact]:
    label = "J, joint entropy"
    try:
        entropy = joint_entropy_estimate(graph)
        yield Fact("joint_entropy", entropy.value, label, f"{entropy.value:.4f} nats (rounding error {entropy.error:.0e})")
        yield Fact("joint_entropy_error", entropy.error, "", "")
    except IllConditionedError as error:
        yield Fact("joint_entropy", None, label, f"not known: {error}")
    for family, determinant in _BOUNDS:
        key = f"bounds_{family}_{determinant}"
        label = f"its bounds, {family}, {determinant}"
        try:
            bounds = entropy_bounds(graph, family=family, determinant=determinant)
            text = f"{bounds.lower:.4f} … {bounds.upper:.4f} nats"
            yield Fact(key, {"lower": bounds.lower, "upper": bounds.upper}, label, text)
        except InvalidGraphError:
            poses_alone = "poses alone and " if graph.num_landmarks else ""
            yield Fact(key, None, label, f"do not apply: they need {poses_alone}one block-isotropic noise on all edges")
        except IllConditionedError as error:
            yield Fact(key, None, label, f"not known: {error}")
