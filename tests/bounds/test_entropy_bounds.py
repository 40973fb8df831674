"""LB <= J <= UB: both families, both determinants, any noise; dense values, trees, published gaps, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from data_files import data_file
from graphs import SE2_GROUP, connected_topologies, noises, path, pose_graphs, random_poses, relabelled, star
from references import entropy_from, entropy_reference, log_det_reference
from topobelief.bounds import entropy_bounds
from topobelief.entropy import joint_entropy, joint_entropy_estimate
from topobelief.errors import DisconnectedGraphError, InvalidGraphError, InvalidInputError
from topobelief.graph.pose_graph import PoseGraph
from topobelief.signatures.spanning_trees import log_num_spanning_trees, spanning_tree_signature

FAMILIES = ("paper", "fischer")
DETERMINANTS = ("cholesky", "hadamard")
BOTH = [(family, determinant) for family in FAMILIES for determinant in DETERMINANTS]

seeds = st.integers(0, 2**32 - 1)
anchors = st.integers(0, 10**6)


def close(value):
    return pytest.approx(value, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("determinant", DETERMINANTS)
@settings(max_examples=100)
@given(graph=pose_graphs(), anchor=anchors)
def test_fischer_brackets_the_entropy_under_any_noise(determinant, graph, anchor):
    bounds = entropy_bounds(graph, determinant=determinant, anchor=anchor % graph.num_poses)
    J = joint_entropy_estimate(graph)
    assert bounds.lower - J.error <= J.value <= bounds.upper + J.error
    assert bounds.lower - 1e-7 <= entropy_reference(graph) <= bounds.upper + 1e-7


@pytest.mark.parametrize("determinant", DETERMINANTS)
@settings(max_examples=80)
@given(graph=pose_graphs(kinds=("equal",)), anchor=anchors)
def test_the_paper_brackets_the_entropy_under_equal_noise_and_fischer_more_tightly(determinant, graph, anchor):
    """Fischer LB >= paper LB at the same anchor and determinant; the upper bounds are one."""
    anchor %= graph.num_poses
    paper = entropy_bounds(graph, family="paper", determinant=determinant, anchor=anchor)
    fischer = entropy_bounds(graph, determinant=determinant, anchor=anchor)
    J = joint_entropy_estimate(graph)
    assert paper.lower - J.error <= J.value <= paper.upper + J.error
    assert fischer.lower >= paper.lower - 1e-9 * max(1, abs(paper.lower)) - 10 * J.error
    assert fischer.upper == close(paper.upper)


@given(pose_graphs(), anchors)
def test_fischer_takes_the_values_of_its_definition(graph, anchor):
    """THEORY section 4 by dense QR: I_pp + L_r|p below, I_pp + I_rr above, Hadamard on I_rr alone."""
    anchor %= graph.num_poses
    positions, rotations, weakest = (
        log_det_reference(graph, part, held=anchor) for part in ("positions", "rotations", "rotations_given_positions")
    )
    bounds = entropy_bounds(graph, anchor=anchor)
    assert bounds.upper == close(entropy_from(positions + weakest, graph))
    assert bounds.lower == close(entropy_from(positions + rotations, graph))
    hadamard = entropy_bounds(graph, determinant="hadamard", anchor=anchor)
    blocks = sum(
        log_det_reference(graph, "rotations", held=[other for other in range(graph.num_poses) if other != node])
        for node in range(graph.num_poses)
        if node != anchor
    )
    assert hadamard.upper == close(bounds.upper)
    assert hadamard.lower == close(entropy_from(positions + blocks, graph))


@given(pose_graphs(kinds=("equal",), groups=(SE2_GROUP,)), anchors)
def test_the_paper_takes_the_values_of_its_equations(graph, anchor):
    """UB = -s_ST; LB = -s_ST - 1/2 ln det(L + Psi I) + 1/2 tau; Hadamard: sum of ln(d(i) + Psi) (THEORY section 3)."""
    anchor %= graph.num_poses
    s, tau = (
        spanning_tree_signature(graph.topology, graph.information if graph.num_edges else np.eye(3)),
        log_num_spanning_trees(graph.topology),
    )
    psi = 0.0
    if graph.num_edges:
        i, j = graph.edges.T
        squares = np.sum((graph.positions[i] - graph.positions[j]) ** 2, axis=1)
        psi = graph.information[0, 0, 0] / graph.information[0, 2, 2] * np.bincount(i, weights=squares).max()
    laplacian = graph.topology.reduced_laplacian(anchor=anchor).toarray()
    log_det = np.linalg.slogdet(laplacian + psi * np.eye(len(laplacian)))[1]
    bounds = entropy_bounds(graph, family="paper", anchor=anchor)
    assert bounds.upper == close(-s)
    assert bounds.lower == close(-s - log_det / 2 + tau / 2)
    hadamard = entropy_bounds(graph, family="paper", determinant="hadamard", anchor=anchor)
    assert hadamard.upper == close(-s)
    assert hadamard.lower == close(-s - np.log(np.diagonal(laplacian) + psi).sum() / 2 + tau / 2)


@given(pose_graphs(kinds=("equal",), groups=(SE2_GROUP,), min_poses=2), anchors)
def test_with_equal_noise_fischer_is_the_papers_bound_with_a_diagonal_for_psi(graph, anchor):
    """ln det I <= 2 tau + ln det(L + xi^2 D) + (n-1) ln|Omega|, D_ii the squared lengths of edges leaving i."""
    anchor %= graph.num_poses
    i, j = graph.edges.T
    squares = np.sum((graph.positions[i] - graph.positions[j]) ** 2, axis=1)
    D = graph.information[0, 0, 0] / graph.information[0, 2, 2] * np.bincount(i, weights=squares, minlength=graph.num_poses)
    free = np.arange(graph.num_poses) != anchor
    laplacian = graph.topology.reduced_laplacian(anchor=anchor).toarray()
    log_det = 2 * log_num_spanning_trees(graph.topology) + np.linalg.slogdet(laplacian + np.diag(D[free]))[1]
    log_det += (graph.num_poses - 1) * np.linalg.slogdet(graph.information[0])[1]
    assert entropy_bounds(graph, anchor=anchor).lower == close(entropy_from(log_det, graph))


@given(pose_graphs(kinds=("isotropic",), min_poses=2), anchors)
def test_block_isotropic_noise_needs_scalar_laplacians_only(graph, anchor):
    """THEORY section 5: k tau_p + q tau_r below; SE(2) 2 tau_p + ln det(L_r + D_w), SE(3) with 3 x 3 blocks, above."""
    anchor %= graph.num_poses
    k, q = graph.group.position_dim, graph.group.rotation_dim
    w_p, w_r = graph.information[:, 0, 0], graph.information[:, k, k]
    tau_p, tau_r = (log_num_spanning_trees(graph.topology, weights=w) for w in (w_p, w_r))
    bounds = entropy_bounds(graph, anchor=anchor)
    assert bounds.upper == close(entropy_from(k * tau_p + q * tau_r, graph))
    assert bounds.upper == close(-spanning_tree_signature(graph.topology, graph.information))
    matrix = np.kron(graph.topology.laplacian(w_r).toarray(), np.eye(q))
    for w, (i, j) in zip(w_p, graph.edges.tolist(), strict=True):
        d = graph.positions[j] - graph.positions[i]
        matrix[q * i : q * (i + 1), q * i : q * (i + 1)] += w * (d @ d * np.eye(q) - (np.outer(d, d) if q == 3 else 0))
    free = np.repeat(np.arange(graph.num_poses) != anchor, q)
    scale = 1 / np.sqrt(np.diagonal(matrix)[free])
    log_det = np.linalg.slogdet(matrix[np.ix_(free, free)] * scale[:, None] * scale)[1] - 2 * np.log(scale).sum()
    assert bounds.lower == pytest.approx(entropy_from(k * tau_p + log_det, graph), rel=1e-6, abs=1e-5)


@given(connected_topologies(min_nodes=2, max_extra=0), noises(), seeds, anchors)
def test_a_tree_has_its_upper_bound_as_entropy(topology, noise, seed, anchor):
    rng = np.random.default_rng(seed)
    poses = random_poses(rng, noise.group, topology.edges, topology.num_nodes, noise.length)
    information = noise.draw(rng, topology.num_edges)
    graph = PoseGraph(
        poses, topology.edges, None, information[:1].repeat(topology.num_edges, 0) if noise.kind == "equal" else information
    )
    J = joint_entropy(graph)
    for family in FAMILIES if noise.kind == "equal" else ("fischer",):
        assert entropy_bounds(graph, family=family, anchor=anchor % graph.num_poses).upper == close(J)


@given(st.integers(1, 7), noises(kinds=("equal", "isotropic")), seeds)
def test_a_star_leaving_the_anchor_has_its_lower_bound_as_entropy_too(leaves, noise, seed):
    """All edges leave the anchor: no lever is left in I_rr, and block-isotropic noise does not couple its parts."""
    rng = np.random.default_rng(seed)
    topology = star(leaves + 1)
    information = noise.draw(rng, leaves)
    information = information[:1].repeat(leaves, 0) if noise.kind == "equal" else information
    graph = PoseGraph(
        random_poses(rng, noise.group, topology.edges, leaves + 1, noise.length), topology.edges, None, information
    )
    for determinant in DETERMINANTS:
        bounds = entropy_bounds(graph, determinant=determinant, anchor=0)
        assert bounds.lower == close(joint_entropy(graph))
        assert bounds.upper == close(joint_entropy(graph))


def test_a_tree_with_a_lever_has_a_lower_bound_below_its_entropy():
    graph = PoseGraph([[0, 0, 0], [1, 0, 0], [2, 0, 0]], path(3).edges, None, np.eye(3))
    assert entropy_bounds(graph, anchor=0).lower < joint_entropy(graph) - 0.1
    turned = PoseGraph(graph.poses, [(1, 0), (2, 1)], None, np.eye(3))
    assert entropy_bounds(turned, anchor=0).lower < joint_entropy(graph) - 0.1


@given(pose_graphs(min_poses=2, kinds=("equal",)), anchors, anchors)
def test_upper_bounds_do_not_depend_on_the_anchor_and_lower_bounds_hold_for_any(graph, one, other):
    for family, determinant in BOTH:
        found = [
            entropy_bounds(graph, family=family, determinant=determinant, anchor=anchor % graph.num_poses)
            for anchor in (one, other)
        ]
        assert found[0].upper == close(found[1].upper)
        assert max(bound.lower for bound in found) <= joint_entropy(graph) + 1e-9


@given(pose_graphs(min_poses=2), seeds, anchors)
def test_names_do_not_matter_where_the_anchor_moves_along(graph, seed, anchor):
    anchor %= graph.num_poses
    permutation = np.random.default_rng(seed).permutation(graph.num_poses)
    other = relabelled(graph, permutation)
    for determinant in DETERMINANTS:
        expected = entropy_bounds(graph, determinant=determinant, anchor=anchor)
        found = entropy_bounds(other, determinant=determinant, anchor=int(permutation[anchor]))
        assert (found.lower, found.upper) == (close(expected.lower), close(expected.upper))


@given(pose_graphs(min_poses=2, kinds=("equal",)), anchors)
def test_hadamard_is_never_tighter(graph, anchor):
    for family in FAMILIES:
        exact, diagonal = (
            entropy_bounds(graph, family=family, determinant=determinant, anchor=anchor % graph.num_poses)
            for determinant in DETERMINANTS
        )
        assert diagonal.lower <= exact.lower + 1e-9 * max(1, abs(exact.lower))


def test_bounds_meet_where_the_lever_vanishes():
    """Psi = 0 where all poses are in one place: LB = J = UB."""
    graph = PoseGraph(np.zeros((4, 3)), [(0, 1), (1, 2), (2, 3), (3, 0)], None, np.diag([4.0, 4.0, 9.0]))
    J = joint_entropy(graph)
    for family in FAMILIES:
        bounds = entropy_bounds(graph, family=family)
        assert (bounds.lower, bounds.upper) == (close(J), close(J))
        assert bounds.lower <= J <= bounds.upper


@pytest.mark.parametrize(("family", "determinant"), BOTH)
def test_one_pose_has_nothing_to_bound(family, determinant):
    bounds = entropy_bounds(PoseGraph([[0, 0, 0]], [], None, np.eye(3)), family=family, determinant=determinant)
    assert (bounds.lower, bounds.upper) == (0.0, 0.0)


# Published numbers ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "above", "below"), [("csail.g2o", 6, 112), ("intel.g2o", 18, 99), ("parking-garage.g2o", 1968, 1267)]
)
def test_gaps_at_the_poses_as_filed_anchored_at_the_first(name, above, below):
    from topobelief.io.g2o import read_g2o

    graph = read_g2o(data_file(name))
    bounds, J = entropy_bounds(graph, anchor=0), joint_entropy(graph)
    assert (round(bounds.upper - J), round(J - bounds.lower)) == (above, below)


@pytest.mark.parametrize("name", ["manhattan3500.g2o", "city10000.g2o"])
def test_on_equal_noise_fischer_is_much_tighter_than_the_paper(name):
    from topobelief.io.g2o import read_g2o

    graph = read_g2o(data_file(name))
    if name == "city10000.g2o":  # per-edge matrices that are all diag(50, 50, 100)
        assert np.array_equal(graph.information[7], np.diag([50, 50, 100]))
    paper, fischer = (entropy_bounds(graph, family=family, anchor=graph.num_poses - 1) for family in FAMILIES)
    J = joint_entropy(graph)
    assert paper.lower < fischer.lower <= J <= fischer.upper
    assert fischer.upper == close(paper.upper)


# Refusals ---------------------------------------------------------------------------------------------------------------

SQUARE = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [(0, 1), (1, 2), (2, 3), (3, 0)], None)


@pytest.mark.parametrize(
    ("information", "message"),
    [
        (
            np.diag([1.0, 2.0, 3.0]),
            'expect one block-isotropic information matrix .* not block-isotropic; use family="fischer"',
        ),
        (np.eye(3) + 0.1, 'expect one block-isotropic information matrix .* not block-isotropic; use family="fischer"'),
        (
            [np.diag([w, w, 1.0]) for w in (5, 5, 6, 5)],
            'expect the same noise on all edges, got position information 5 at edge 0 and 6 at edge 2; use family="fischer"',
        ),
        (
            [np.diag([1.0, 1.0, w]) for w in (5, 5, 5, 4)],
            'expect the same noise on all edges, got rotation information 5 at edge 0 and 4 at edge 3; use family="fischer"',
        ),
    ],
)
def test_the_paper_refuses_other_noise_and_names_the_way_out(information, message):
    graph = PoseGraph(*SQUARE, information)
    with pytest.raises(InvalidGraphError, match=message):
        entropy_bounds(graph, family="paper")
    assert entropy_bounds(graph).lower < joint_entropy(graph)


def test_unknown_choices_are_refused():
    graph = PoseGraph(*SQUARE, np.eye(3))
    with pytest.raises(InvalidInputError, match='expected family to be one of "paper", "fischer", "fischer_step", got \'psi\''):
        entropy_bounds(graph, family="psi")
    with pytest.raises(InvalidInputError, match='expected determinant to be one of "cholesky", "hadamard", got \'qr\''):
        entropy_bounds(graph, determinant="qr")
    with pytest.raises(InvalidGraphError, match="expected an anchor from 0 to 3, got 4"):
        entropy_bounds(graph, anchor=4)


def test_unreached_poses_are_named():
    with pytest.raises(DisconnectedGraphError, match="node 3 does not reach: 0, 1, 2"):
        entropy_bounds(PoseGraph(SQUARE[0], [(0, 1), (1, 2)], None, np.eye(3)), anchor=3)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("where", ["first edge", "first axis"])
def test_weights_that_almost_agree_are_not_rounded_to_one_another(family, where):
    """A guarantee is a guarantee: information that differs in the 13th digit costs no bracket (refusing it is fine)."""
    n = 2000
    poses = np.column_stack([np.cos(np.arange(n)), np.sin(np.arange(n)), np.zeros(n)])
    poses[0] = 0
    information = np.tile(np.eye(3), (n - 1, 1, 1))
    if where == "first edge":
        information[0] *= 1 + 9e-13
    else:
        information[:, 0, 0] = 1 + 9e-13
    graph = PoseGraph(poses, star(n).edges, None, information)
    log_det = math.fsum(np.log(np.diagonal(information, axis1=1, axis2=2)).ravel())
    J = entropy_from(log_det, graph)
    assert joint_entropy(graph) == pytest.approx(J, abs=1e-10)
    try:
        bounds = entropy_bounds(graph, family=family)
    except InvalidGraphError:
        return
    assert bounds.lower - 1e-10 <= J <= bounds.upper + 1e-10


@pytest.mark.parametrize(("direction", "matters"), [((0, 0, 0), False), ((1, 2, -1), True)])
def test_the_anchor_matters_on_a_line_but_not_in_one_place(direction, matters):
    """In both I_rr before a pose is removed is singular, and the bounds are finite all the same."""
    rng = np.random.default_rng(0)
    poses = np.hstack([np.outer([0, 1, 3, 4], direction), rng.normal(size=(4, 4))])
    graph = PoseGraph(poses, [(0, 1), (1, 2), (2, 3), (3, 0)], None, np.eye(6))
    lower = [entropy_bounds(graph, anchor=anchor).lower for anchor in range(4)]
    assert np.isfinite(lower).all()
    assert bool(np.ptp(lower) > 1e-6) == matters
