"""Guarantees beyond comfortable numbers: error estimates and widened bounds against 80-digit arithmetic.

Every claim here has two honest outcomes: the truth lies within the stated error, or `IllConditionedError` says that double
precision cannot tell.
"""

import math
from decimal import Decimal, localcontext

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from data_files import RECORDED, data_file
from graphs import SE2_GROUP, SE3_GROUP, Noise, noises, pose_graphs, random_pose_graph
from landmark_graphs import landmark_sessions
from references import DIGITS, LOG_2_PI_E, exact_rows, laplacian_log_det_exact, log_det_exact
from topobelief.bounds import entropy_bounds
from topobelief.entropy import joint_entropy_estimate
from topobelief.errors import IllConditionedError, InvalidGraphError
from topobelief.graph.action import posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.linalg import LogDetSolver
from topobelief.planning.planner import Planner
from topobelief.signatures.spanning_trees import spanning_tree_signature

seeds = st.integers(0, 2**32 - 1)


def exact_entropy(graph):
    """J in 80 digits, as a `Decimal`."""
    with localcontext(prec=DIGITS), mpmath.workdps(DIGITS):
        two_pi_e = Decimal(mpmath.nstr(2 * mpmath.pi * mpmath.e, DIGITS))
        num_free = (graph.num_poses - 1) * graph.tangent_dim + graph.num_landmarks * graph.group.position_dim
        log_det = log_det_exact(graph, "joint", held=int(graph.pose_indices[0]))
        return Decimal(num_free) / 2 * two_pi_e.ln() - log_det / 2


def assert_covered(graph):
    """The estimate's error covers J and all bounds bracket it; or the graph is refused. Returns error / estimate."""
    J = exact_entropy(graph)
    ratio = 0.0
    try:
        estimate = joint_entropy_estimate(graph)
    except IllConditionedError:
        estimate = None
    if estimate is not None:
        assert estimate.error <= 0.1
        error = abs(float(Decimal(estimate.value) - J))
        assert error <= estimate.error
        ratio = error / estimate.error if estimate.error else 0.0
    for family in ("fischer", "paper"):
        for determinant in ("cholesky", "hadamard"):
            try:
                bounds = entropy_bounds(graph, family=family, determinant=determinant, anchor=graph.last_pose)
            except IllConditionedError:
                continue
            except InvalidGraphError:
                assert family == "paper"
                continue
            assert Decimal(bounds.lower) <= J <= Decimal(bounds.upper), (family, determinant)
    return ratio


@settings(max_examples=15)
@given(pose_graphs(min_poses=2, max_poses=4, max_extra=3, log_ratio=(-3.0, 7.0)), st.integers(0, 3))
def test_the_yardstick_itself_agrees_with_a_dense_determinant_in_mpmath(graph, anchor):
    anchor %= graph.num_poses
    rows_i, rows_j, information = exact_rows(graph, "joint")
    kappa, n = graph.tangent_dim, graph.num_poses
    with mpmath.workdps(50):
        matrix = mpmath.zeros(n * kappa)
        for (i, j), a_i, a_j, omega in zip(graph.edges.tolist(), rows_i, rows_j, information, strict=True):
            row = mpmath.zeros(kappa, n * kappa)
            row[:, i * kappa : (i + 1) * kappa] = mpmath.matrix(a_i.tolist())
            row[:, j * kappa : (j + 1) * kappa] = mpmath.matrix(a_j.tolist())
            matrix += row.T * mpmath.matrix(omega.tolist()) * row
        free = [index for index in range(n * kappa) if index // kappa != anchor]
        reduced = mpmath.matrix([[matrix[row, column] for column in free] for row in free])
        expected = mpmath.log(mpmath.det(reduced))
        assert abs(mpmath.mpf(str(log_det_exact(graph, "joint", held=anchor))) - expected) < mpmath.mpf(10) ** -20


@settings(max_examples=100)
@given(pose_graphs(min_poses=2, max_poses=6, max_extra=6, log_ratio=(-3.0, 2.0)))
def test_up_to_a_hundred_edge_lengths_per_radian(graph):
    assert_covered(graph)


@settings(max_examples=150)
@given(pose_graphs(min_poses=2, max_poses=6, max_extra=6, log_ratio=(2.0, 7.0)))
def test_beyond_a_hundred_edge_lengths_per_radian(graph):
    assert_covered(graph)


@settings(max_examples=80)
@given(landmark_sessions(log_ratio=(-3.0, 5.0), max_actions=1))
def test_with_landmarks(session):
    assert_covered(session.graph)


@settings(max_examples=40)
@given(landmark_sessions(log_ratio=(-2.0, 1.0), max_actions=2), st.sampled_from(["scratch", "incremental"]))
def test_after_actions_that_observe_landmarks_values_are_exact_and_every_family_encloses_them(session, engine):
    graph, actions = session.graph, session.actions
    anchor = int(graph.pose_indices[0])
    expected = [exact_entropy(posterior(graph, action)) for action in actions]
    found = Planner(graph, engine=engine, anchor=anchor).entropies(actions)
    for family in ("fischer", "fischer_step", "anchored", "chain"):
        decision = Planner(graph, engine=engine, anchor=anchor, bounds=family).decide(actions)
        costs = [action.cost for action in actions]
        for J, lower, upper, cost in zip(expected, decision.lower, decision.upper, costs, strict=True):
            assert Decimal(lower - cost) - Decimal("1e-9") <= J <= Decimal(upper - cost) + Decimal("1e-9")
    np.testing.assert_allclose(found, [float(J) for J in expected], rtol=1e-9, atol=1e-7)


@settings(max_examples=40)
@given(landmark_sessions(kinds=("equal", "isotropic"), max_actions=1))
def test_the_signature_with_landmarks_is_that_of_exact_trees(session):
    """2 tau_p over poses and landmarks, tau_r over poses alone; minus J on a tree, and never below minus the upper bound."""
    graph = session.graph
    k, q, anchor = graph.group.position_dim, graph.group.rotation_dim, int(graph.pose_indices[0])
    w_p, w_r = graph.information[:, 0, 0], graph.information[:, -1, -1]
    between = ~graph.is_landmark[graph.edges[:, 1]]
    places = np.searchsorted(graph.pose_indices, graph.edges[between])
    tau_p = laplacian_log_det_exact(graph.num_nodes, graph.edges, w_p, held=anchor)
    tau_r = laplacian_log_det_exact(graph.num_poses, places, w_r[between])
    free = (graph.num_poses - 1) * graph.tangent_dim + graph.num_landmarks * k
    expected = float(k * tau_p + q * tau_r) / 2 - free / 2 * LOG_2_PI_E
    found = spanning_tree_signature(graph.topology, graph.information, kinds=graph.kinds)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-8)
    assert -expected >= float(exact_entropy(graph)) - 1e-8


@settings(max_examples=120)
@given(
    st.sampled_from([SE2_GROUP, SE3_GROUP]),
    st.sampled_from(["isotropic", "full"]),
    st.integers(-3, 3),
    st.integers(2, 6),
    st.integers(0, 6),
    seeds,
)
def test_information_over_twelve_decades(group, kind, log_ratio, num_poses, num_extra, seed):
    """Weights, and eigenvalues within one matrix, that differ by up to 1e12."""
    noise = Noise(group, kind, 100.0, 10.0**log_ratio, 1.0, spread=12.0)
    try:
        graph = random_pose_graph(np.random.default_rng(seed), noise, num_poses, num_extra)
    except InvalidGraphError:
        return
    assert_covered(graph)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP], ids=lambda group: group.name)
@pytest.mark.parametrize("decades", [4, 8, 10, 12, 13])
def test_one_measurement_whose_matrix_is_almost_singular(group, decades):
    """A single edge: J is the entropy of its noise, whose matrix is well scaled but strongly correlated."""
    rng = np.random.default_rng(decades)
    kappa = group.tangent_dim
    for _ in range(25):
        basis = np.linalg.qr(rng.normal(size=(kappa, kappa)))[0]
        eigenvalues = np.ones(kappa)
        eigenvalues[0] = 10.0**-decades
        omega = (basis * eigenvalues) @ basis.T
        poses = group.exp(rng.normal(size=(2, kappa)))
        try:
            graph = PoseGraph(poses, [(0, 1)], None, (omega + omega.T) / 2)
        except InvalidGraphError:
            continue
        assert_covered(graph)


@pytest.mark.parametrize("seed", range(6))
def test_far_from_the_origin_with_sharp_positions(seed):
    """14 poses, xi = 1e3 rad/m, coordinates of 1e4 m: H^T Omega H fails here, orthogonal triangles do not."""
    rng = np.random.default_rng(seed)
    n = 14
    poses = np.column_stack([rng.uniform(-1e4, 1e4, (n, 2)), rng.uniform(-math.pi, math.pi, n)])
    edges = [(i, i + 1) for i in range(n - 1)] + [
        (int(a), int(b)) for a, b in (rng.choice(n, 2, replace=False) for _ in range(6))
    ]
    graph = PoseGraph(poses, edges, None, np.diag([1e6, 1e6, 1.0]))
    assert_covered(graph)
    assert joint_entropy_estimate(graph).error < 1e-3


@pytest.mark.parametrize("log_ratio", [2, 4, 6, 7, 8, 9])
def test_a_straight_corridor_in_space(log_ratio):
    """Rolling about the corridor's axis is seen by the weak rotations alone: the worst conditioned block of SE(3)."""
    positions = np.outer(np.arange(3), [4.0, 4.0, 4.0])
    poses = np.column_stack([positions, np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))])
    ratio = 10.0**log_ratio / np.linalg.norm(positions[1])
    assert_covered(PoseGraph(poses, [(0, 1), (1, 2), (2, 0)], None, np.diag([1.0] * 3 + [ratio**-2] * 3)))


@settings(max_examples=80)
@given(noises(log_ratio=(-3.0, 7.0)), st.integers(2, 6), st.integers(0, 6), seeds)
@example(Noise(SE2_GROUP, "equal", 1.0, 1e5, 1.0), 6, 4, 0)
def test_each_part_has_a_covered_error(noise, num_poses, num_extra, seed):
    """I, I_pp, I_rr and L_r|p alike, whatever is held; a shifted Laplacian and Hadamard too."""
    graph = random_pose_graph(np.random.default_rng(seed), noise, num_poses, num_extra)
    rows, held = fisher_rows(graph), seed % num_poses
    solver = LogDetSolver(graph.edges, num_poses, held)
    for part in ("joint", "positions", "rotations", "rotations_given_positions"):
        found = solver.log_det(getattr(rows, part)())
        if math.isfinite(found.error):
            exact = log_det_exact(graph, part, held=held)
            assert abs(float(Decimal(found.value) - exact)) <= found.error, part
    blocks = sum(
        log_det_exact(graph, "rotations", held=[other for other in range(num_poses) if other != node])
        for node in range(num_poses)
        if node != held
    )
    hadamard = solver.hadamard(rows.rotations())
    if math.isfinite(hadamard.error):
        assert abs(float(Decimal(hadamard.value) - blocks)) <= hadamard.error


@pytest.mark.parametrize("log_ratio", [4, 5, 6, 7, 8])
def test_hadamard_is_not_refused_where_cholesky_answers(log_ratio):
    """The diagonal blocks of a corridor in space are as badly conditioned as the whole; their rows are not."""
    rng = np.random.default_rng(log_ratio)
    for _ in range(4):
        poses = np.column_stack([np.outer(np.arange(4), [4.0, 3.0, 2.0]), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1))])
        information = np.diag([1.0] * 3 + [10.0 ** (-2 * log_ratio)] * 3) * 10.0 ** rng.uniform(-2, 2, (5, 1, 1))
        graph = PoseGraph(poses, [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)], None, information)
        try:
            entropy_bounds(graph, determinant="cholesky")
        except IllConditionedError:
            continue
        entropy_bounds(graph, determinant="hadamard")
        assert_covered(graph)


# Long graphs whose roundings repeat ----------------------------------------------------------------------------------------


def long_graph(group, shape, ratio, *, correlated):
    """A chain of alike edges of 1 m with xi = ratio: open, closed to a ring, or laced every ten poses."""
    n = 200 if group is SE2_GROUP else 80
    turn = 2 * math.pi / n if shape == "ring" else 0.0
    angle = turn * np.arange(n)
    if group is SE2_GROUP:
        poses = np.column_stack([np.cumsum(np.cos(angle)), np.cumsum(np.sin(angle)), angle])
    else:
        zero = np.zeros(n)
        poses = np.column_stack(
            [
                np.cumsum(np.cos(angle)),
                np.cumsum(np.sin(angle)),
                0.1 * np.arange(n),
                zero,
                zero,
                np.sin(angle / 2),
                np.cos(angle / 2),
            ]
        )
    closures = {"chain": [], "ring": [(n - 1, 0)], "lace": [(i, i + 10) for i in range(0, n - 10, 10)]}[shape]
    k, q = group.position_dim, group.rotation_dim
    scale = np.sqrt(np.repeat([100.0, 100.0 / ratio**2], [k, q]))
    mixing = 0.7 * np.eye(k + q) + 0.3 if correlated else np.eye(k + q)
    return PoseGraph(poses, [(i, i + 1) for i in range(n - 1)] + closures, None, mixing * scale[:, None] * scale)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP], ids=lambda group: group.name)
@pytest.mark.parametrize("shape", ["chain", "ring", "lace"])
@pytest.mark.parametrize("ratio", [1.0, 1e2, 1e5])
def test_long_graphs_of_alike_edges(group, shape, ratio):
    graph = long_graph(group, shape, ratio, correlated=shape == "lace")
    assert_covered(graph)
    if ratio <= 1e2:
        assert joint_entropy_estimate(graph).error < 1e-4


@pytest.mark.parametrize("name", [RECORDED, "csail.g2o", "intel.g2o"])
def test_real_graphs_with_extreme_information(name):
    """intel has one edge of information 2.7e12."""
    from topobelief.io.g2o import read_g2o

    graph = read_g2o(data_file(name))
    estimate = joint_entropy_estimate(graph)
    assert abs(float(Decimal(estimate.value) - exact_entropy(graph))) <= estimate.error < 1e-2


# Numbers that overflow -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1e150, 1e300])
def test_units_do_not_overflow(scale):
    """One information matrix in absurd units."""
    graph = PoseGraph([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [(0, 1), (1, 2), (2, 0)], None, scale * np.eye(3))
    assert_covered(graph)


@pytest.mark.parametrize("length", [1e100, 1e160, 1e200, 1e300])
def test_absurd_lengths_are_measured_or_refused(length):
    """Squares of lengths overflow: an error of ours, not a floating-point warning."""
    graph = PoseGraph([[0, 0, 0], [length, 0, 0], [0, length, 0]], [(0, 1), (1, 2), (2, 0)], None, np.eye(3))
    assert_covered(graph)


@pytest.mark.parametrize("quantity", [joint_entropy_estimate, entropy_bounds])
def test_a_refusal_never_says_nan(quantity):
    graph = PoseGraph([[0, 0, 0], [1e300, 0, 0], [0, 1e300, 0]], [(0, 1), (1, 2), (2, 0)], None, np.eye(3))
    with pytest.raises(IllConditionedError, match="rounding leaves no digit") as refusal:
        quantity(graph)
    assert refusal.value.error_estimate == math.inf
    assert "nan" not in str(refusal.value)


def test_absurd_ratios_within_a_matrix_are_measured_or_refused():
    assert_covered(PoseGraph([[0, 0, 0], [1, 2, 0]], [(0, 1)], None, np.diag([1e200, 1e-200, 1.0])))
