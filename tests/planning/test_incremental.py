"""Many actions at once against one at a time from scratch, dense formulas and exact arithmetic."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from data_files import RECORDED, data_file
from engines import DenseEngine, judge
from graphs import SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph, sessions, shares_isotropic_noise
from references import LOG_2_PI_E, log_det_exact
from topobelief.errors import IllConditionedError, InvalidGraphError
from topobelief.forms import increments, prior_factors
from topobelief.forms.action_batch import ActionBatch
from topobelief.graph.action import Action, posterior
from topobelief.graph.fisher import fisher_rows
from topobelief.graph.pose_graph import PoseGraph
from topobelief.io.g2o import read_g2o
from topobelief.planning.engine import ScratchEngine
from topobelief.planning.incremental_engine import IncrementalEngine

OBJECTIVES = ("joint", "map", "per_pose")
SIGNATURES = ("spanning_trees", "von_neumann", "von_neumann_approx")
seeds = st.integers(0, 2**32 - 1)


def from_scratch(graph, actions, kind=ScratchEngine, **settings):
    """Signatures, lower and upper bounds, entropies and their errors, each action alone."""
    alone = judge(graph, kind, **settings)
    return alone.signatures(actions)[0], *alone.bounds(actions), *alone.entropies(actions)


@given(
    sessions(log_ratio=(-3.0, 2.0)),
    st.sampled_from(OBJECTIVES),
    st.sampled_from(SIGNATURES),
    st.sampled_from(["fischer", "paper"]),
    st.sampled_from(["cholesky", "hadamard"]),
    st.booleans(),
    seeds,
)
def test_all_quantities_are_those_from_scratch(session, objective, signature, family, determinant, normalized, seed):
    graph, actions = session.graph, session.actions
    assume(family == "fischer" or shares_isotropic_noise(session))
    settings = {"objective": objective, "signature": signature, "bounds": family, "determinant": determinant}
    settings |= {"normalized": normalized, "anchor": int(np.random.default_rng(seed).integers(graph.num_poses))}
    signatures, lower, upper, entropies, errors = from_scratch(graph, actions, **settings)
    found = judge(graph, **settings)
    np.testing.assert_allclose(found.signatures(actions)[0], signatures, rtol=1e-9, atol=1e-9)
    values, found_errors = found.entropies(actions)
    np.testing.assert_allclose(values, entropies, rtol=1e-9, atol=1e-9)
    widths = 4 * (errors + found_errors).max()  # bounds are widened by errors that the two estimate differently
    for ours, theirs in zip(found.bounds(actions), (lower, upper), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 + widths)


@given(
    sessions(log_ratio=(-2.0, 1.0)),
    st.sampled_from(OBJECTIVES),
    st.sampled_from(["fischer", "paper", "anchored", "chain"]),
    st.sampled_from([ScratchEngine, IncrementalEngine]),
    seeds,
)
def test_all_quantities_are_those_of_an_engine_in_dense_numpy(session, objective, bounds, kind, seed):
    graph, actions = session.graph, session.actions
    assume(bounds != "paper" or shares_isotropic_noise(session))
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    found, dense = (judge(graph, each, objective=objective, bounds=bounds, anchor=anchor) for each in (kind, DenseEngine))
    np.testing.assert_allclose(found.signatures(actions)[0], dense.signatures(actions)[0], rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(found.entropies(actions)[0], dense.entropies(actions)[0], rtol=1e-7, atol=1e-6)
    if kind is IncrementalEngine or bounds in ("fischer", "paper"):  # from scratch the others are the exact value
        np.testing.assert_allclose(found.bounds(actions), dense.bounds(actions), rtol=1e-7, atol=1e-6)
    else:
        np.testing.assert_allclose(found.bounds(actions), np.tile(dense.entropies(actions)[0], (2, 1)), rtol=1e-7, atol=1e-6)


@given(
    sessions(log_ratio=(-3.0, 5.0), max_actions=3),
    st.sampled_from(["fischer", "anchored"]),
    st.sampled_from(["cholesky", "hadamard"]),
    seeds,
)
def test_bounds_and_errors_hold_in_exact_arithmetic_at_any_condition(session, family, determinant, seed):
    graph, actions = session.graph, session.actions
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    found = judge(graph, bounds=family, determinant=determinant, anchor=anchor)
    for action in actions:
        after = posterior(graph, action)
        log_det = float(log_det_exact(after, "joint", held=anchor))
        exact = (after.num_poses - 1) * after.tangent_dim / 2 * LOG_2_PI_E - log_det / 2
        rounding = 1e-14 * (abs(exact) + abs(log_det))  # of the reference, as a double
        try:
            (value,), (error,) = found.entropies([action])
            (lower,), (upper,) = found.bounds([action])
        except IllConditionedError:
            continue
        assert abs(value - exact) <= error + rounding
        assert lower <= exact + rounding
        assert upper >= exact - rounding


@given(sessions(log_ratio=(-3.0, 2.0)), st.sampled_from(OBJECTIVES), seeds)
def test_anchored_bounds_hold_and_meet_where_nothing_is_closed(session, objective, seed):
    graph, actions = session.graph, session.actions
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    found = judge(graph, bounds="anchored", objective=objective, anchor=anchor)
    lower, upper = found.bounds(actions)
    values, errors = found.entropies(actions)
    assert (lower <= values + errors).all()
    assert (values - errors <= upper).all()
    for k, action in enumerate(actions):
        if action.num_closures == 0:
            assert lower[k] == values[k] - errors[k]
            assert upper[k] == values[k] + errors[k]


@given(sessions(log_ratio=(-2.0, 1.0)), seeds)
def test_anchored_bounds_are_section_8_s_formulas(session, seed):
    graph, actions = session.graph, session.actions
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    k = graph.group.position_dim
    lower, upper = judge(graph, bounds="anchored", anchor=anchor).bounds(actions)
    batch = ActionBatch(graph, actions)
    for n, action in enumerate(actions):
        after = posterior(graph, action)
        planted = batch.extensions.planted[batch.edge_start[n] : batch.edge_start[n + 1]]
        in_base = np.r_[np.ones(graph.num_edges, bool), planted]
        joint = dense_rows(fisher_rows(after).joint(), after.num_poses, anchor)
        closures = joint[~in_base]
        base = information(joint[in_base])
        variables = np.arange(len(base)).reshape(-1, graph.tangent_dim)
        positions = variables[:, :k].ravel()
        seen_p, seen_r = (matrix(closures[:, part]) for part in (slice(None, k), slice(k, None)))
        log_det = np.linalg.slogdet(base)[1]
        p = log_det_of_increment(seen_p, base)
        r = log_det_of_increment(seen_r, base)
        p_given_r = log_det_of_increment(seen_p[:, positions], base[np.ix_(positions, positions)])
        constant = (after.num_poses - 1) * graph.tangent_dim / 2 * LOG_2_PI_E
        assert lower[n] == pytest.approx(constant - (log_det + p + r) / 2, rel=1e-7, abs=1e-6)
        assert upper[n] == pytest.approx(constant - (log_det + p_given_r + r) / 2, rel=1e-7, abs=1e-6)


def dense_rows(form, num_poses, anchor):
    """Whitened rows on all variables but the anchor's, (m, r, variables)."""
    m, r, b = form.rows_i.shape
    rows = np.zeros((m, r, num_poses, b))
    rows[np.arange(m), :, form.edges[:, 0]] = form.rows_i
    rows[np.arange(m), :, form.edges[:, 1]] = form.rows_j
    return np.delete(rows, anchor, axis=2).reshape(m, r, (num_poses - 1) * b)


def matrix(rows):
    return rows.reshape(rows.shape[0] * rows.shape[1], rows.shape[2])


def information(rows):
    return matrix(rows).T @ matrix(rows)


def log_det_of_increment(rows, base):
    """ln det (I + rows base^-1 rows^T)."""
    return np.linalg.slogdet(np.eye(len(rows)) + rows @ np.linalg.solve(base, rows.T))[1] if len(base) else 0.0


def a_session(group=SE2_GROUP, kind="equal", *, num_poses=40, num_actions=12, seed=0):
    rng = np.random.default_rng(seed)
    noise = Noise(group, kind, 100.0, 0.4, 2.0)
    graph = random_pose_graph(rng, noise, num_poses, num_poses // 2)
    return graph, [random_action(rng, graph, noise, max_new=10, max_closures=8) for _ in range(num_actions)]


@pytest.mark.parametrize("family", ["fischer", "anchored"])
@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("kind", ["isotropic", "full"])
def test_neither_their_order_nor_their_company_changes_actions(family, group, kind):
    graph, actions = a_session(group, kind)
    together = judge(graph, bounds=family)
    expected = [*together.signatures(actions), *together.bounds(actions), *together.entropies(actions)]
    turned = judge(graph, bounds=family)
    found = [*turned.signatures(actions[::-1]), *turned.bounds(actions[::-1]), *turned.entropies(actions[::-1])]
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours[::-1], theirs, rtol=1e-12, atol=1e-11)
    alone = judge(graph, bounds=family)
    for n, action in enumerate(actions):
        one = [*alone.signatures([action]), *alone.bounds([action]), *alone.entropies([action])]
        np.testing.assert_allclose(np.ravel(one), [values[n] for values in expected], rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("determinant", ["cholesky", "hadamard"])
def test_the_badly_conditioned_noise_of_one_action_does_not_widen_the_others(determinant):
    graph, actions = a_session(kind="full")
    n = graph.num_poses
    near = 1e8 * np.array([[1, 0, 1 - 1e-9], [0, 1, 0], [1 - 1e-9, 0, 1]])
    odd = Action(graph.poses[-1:], [(n - 1, n), (n, 0)], near)
    before, after = (judge(graph, determinant=determinant) for _ in range(2))
    assert (after.entropies([*actions, odd])[1][:-1] <= 1.01 * before.entropies(actions)[1]).all()
    for wider, bound in zip(after.bounds([*actions, odd]), before.bounds(actions), strict=True):
        np.testing.assert_allclose(wider[:-1], bound, rtol=0, atol=1e-9)


OMEGA = np.diag([100.0, 100.0, 400.0])
PRIOR = PoseGraph(
    [[0, 0, 0], [2, 0, 0.5], [3, 2, 1.5], [1, 3, 3.0], [-1, 2, -2.0]],
    [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (1, 3)],
    None,
    OMEGA,
)
NAMED = {
    "stay": Action(np.zeros((0, 3)), [], OMEGA),
    "explore": Action([[0, 4, 0], [1, 5, 0]], [(4, 5), (5, 6)], OMEGA),
    "a chain from another pose": Action([[4, 1, 0], [5, 1, 0]], [(1, 5), (5, 6), (6, 2)], OMEGA),
    "a branch": Action([[0, 4, 0], [1, 5, 0], [-1, 5, 2]], [(4, 5), (5, 6), (5, 7), (6, 3), (7, 2)], OMEGA),
    "two chains": Action([[0, 4, 0], [4, 1, 0]], [(4, 5), (1, 6), (6, 5)], OMEGA),
    "closures stored old to new": Action([[0, 4, 0], [1, 5, 0]], [(5, 4), (6, 5), (2, 6), (0, 5)], OMEGA),
    "closures among new poses": Action([[0, 4, 0], [1, 5, 0], [2, 4, 1]], [(4, 5), (5, 6), (6, 7), (7, 5)], OMEGA),
    "measurements alone": Action(np.zeros((0, 3)), [(0, 2), (4, 2)], OMEGA),
    "what is there already": Action(np.zeros((0, 3)), [(0, 1), (0, 1), (1, 0)], OMEGA),
    "parallel closures": Action([[0, 4, 0]], [(4, 5), (5, 0), (5, 0), (0, 5)], OMEGA),
    "stems that are parallel": Action([[0, 4, 0]], [(4, 5), (4, 5), (5, 4)], OMEGA),
    "other noise": Action([[0, 4, 0]], [(4, 5), (5, 0)], [np.diag([1.0, 5.0, 2.0]), OMEGA + 7.0]),
}


@pytest.mark.parametrize("anchor", [0, 2, 4])
@pytest.mark.parametrize("objective", OBJECTIVES)
def test_every_shape_of_action(anchor, objective):
    actions = list(NAMED.values())
    settings = {"anchor": anchor, "objective": objective}
    signatures, lower, upper, entropies, _ = from_scratch(PRIOR, actions, **settings)
    found = judge(PRIOR, **settings)
    np.testing.assert_allclose(found.signatures(actions)[0], signatures, rtol=1e-12)
    np.testing.assert_allclose(found.entropies(actions)[0], entropies, rtol=1e-12)
    np.testing.assert_allclose(found.bounds(actions), [lower, upper], rtol=1e-11)
    same_noise = actions[:-1]  # scalar Laplacians instead of blocks
    np.testing.assert_allclose(judge(PRIOR, **settings).bounds(same_noise), [lower[:-1], upper[:-1]], rtol=1e-11)
    for family in ("paper", "anchored"):
        low, high = judge(PRIOR, bounds=family, **settings).bounds(same_noise)
        assert (low <= entropies[:-1] + 1e-9).all()
        assert (high >= entropies[:-1] - 1e-9).all()


def test_a_prior_of_one_pose():
    prior = PoseGraph([[0, 0, 0]], [], None, OMEGA)
    actions = [
        Action([[1, 0, 0], [2, 1, 1]], [(0, 1), (1, 2), (2, 0)], OMEGA),
        Action(np.zeros((0, 3)), [], OMEGA),
        Action([[1, 0, 0]], [(1, 0), (0, 1)], 4 * OMEGA),
    ]
    for family in ("fischer", "anchored"):
        signatures, lower, upper, entropies, _ = from_scratch(prior, actions)
        found = judge(prior, bounds=family)
        np.testing.assert_allclose(found.signatures(actions)[0], signatures, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(found.entropies(actions)[0], entropies, rtol=1e-12, atol=1e-12)
        if family == "fischer":
            np.testing.assert_allclose(found.bounds(actions), [lower, upper], rtol=1e-12, atol=1e-12)


def test_the_paper_s_family_where_an_action_raises_psi():
    """One factor serves the actions that leave Psi as it is; the others are bounded from scratch."""
    far = Action([[0, 4, 0], [30, 40, 0]], [(4, 5), (5, 6), (6, 0), (6, 1)], OMEGA)
    for determinant in ("cholesky", "hadamard"):
        settings = {"bounds": "paper", "determinant": determinant}
        for actions in ([NAMED["explore"], far, NAMED["parallel closures"]], [NAMED["stay"]]):
            _, lower, upper, _, _ = from_scratch(PRIOR, actions, **settings)
            np.testing.assert_allclose(judge(PRIOR, **settings).bounds(actions), [lower, upper], rtol=1e-12)
    with pytest.raises(InvalidGraphError, match="paper's bounds expect"):
        judge(PRIOR, bounds="paper").bounds([NAMED["other noise"]])


def test_the_prior_is_factored_once_a_session(monkeypatch):
    factored = []
    of = prior_factors.FormFactor.of
    monkeypatch.setattr(prior_factors.FormFactor, "of", lambda *args, **more: factored.append(0) or of(*args, **more))
    graph, actions = a_session()
    found = judge(graph)
    for batch in (actions, actions[:3], actions[3:]):
        found.signatures(batch)
        found.bounds(batch)
        found.entropies(batch)
    assert len(factored) == 3  # one Laplacian for the signature, I_pp and L_r|p; I_rr; I


def test_bounds_share_the_signature_s_increments_and_exact_values_those_of_anchored_bounds(monkeypatch):
    added = []
    compute = increments.log_det_increments
    monkeypatch.setattr(increments, "log_det_increments", lambda *a, **more: added.append(0) or compute(*a, **more))
    graph, actions = a_session()
    batch = judge(graph, bounds="anchored").batch(actions)
    batch.signatures()
    batch.bounds()
    assert len(added) == 2
    values, errors = batch.entropies().value, batch.entropies().error
    again = batch.entropies([2, 3, 4])
    assert len(added) == 2
    np.testing.assert_array_equal(again.value, values[2:5])
    expected, _ = judge(graph).entropies(actions)
    np.testing.assert_allclose(values, expected, rtol=1e-14, atol=errors.max())


@pytest.mark.parametrize("family", ["fischer", "anchored", "chain"])
def test_after_many_closures_a_new_factor_of_the_graph_takes_the_place_of_increments(monkeypatch, family):
    graph, actions = a_session(num_poses=12)
    rows = 3 * np.array([action.num_closures for action in actions])
    limit = int(np.median(rows))
    expected = judge(graph, bounds=family).bounds(actions)
    monkeypatch.setattr(increments, "_CUBES_A_VARIABLE", limit**3 / (3 * graph.num_poses))
    signatures, _, _, entropies, _ = from_scratch(graph, actions)
    found = judge(graph, bounds=family)
    anew = []
    alone = IncrementalEngine.from_scratch
    monkeypatch.setattr(IncrementalEngine, "from_scratch", lambda self, action: anew.append(action) or alone(self, action))
    np.testing.assert_allclose(found.entropies(actions)[0], entropies, rtol=1e-12)
    assert anew == [action for action, count in zip(actions, rows, strict=True) if count > limit]
    assert 0 < len(anew) < len(actions)
    np.testing.assert_allclose(found.signatures(actions)[0], signatures, rtol=1e-12)
    low, high = found.bounds(actions)
    assert (low <= entropies + 1e-9).all()
    assert (entropies <= high + 1e-9).all()
    few = rows <= limit
    np.testing.assert_allclose(np.array([low, high])[:, few], np.array(expected)[:, few], rtol=1e-10)


def test_many_closures_are_few_on_a_larger_graph():
    """What a new factor costs grows with the graph, what a dense factor of the closures costs does not."""
    for num_poses, anew in ((30, True), (3000, False)):
        rng = np.random.default_rng(0)
        graph = random_pose_graph(rng, Noise(SE2_GROUP, "equal", 100.0, 0.4, 2.0), num_poses, 0)
        pairs = np.stack([rng.integers(0, 10, 100), rng.integers(15, 25, 100)], axis=1)
        action = Action([], pairs, np.eye(3) * 100)
        forms = judge(graph).engine.groups([action])[0][1]
        assert np.isnan(forms.log_det("joint").value[0]) == anew


@pytest.mark.parametrize("name", [RECORDED, "csail.g2o", "intel.g2o", "parking-garage.g2o"])
def test_real_graphs(name):
    """One edge of intel.g2o carries information 2.7e12; there the evaluation from scratch is the less accurate."""
    graph = read_g2o(data_file(name))
    rng = np.random.default_rng(2)
    n, k = graph.num_poses, graph.group.position_dim
    actions = []
    for start in (n - 1, n - 1, 100):
        poses = np.tile(graph.poses[start], (20, 1))
        poses[:, :k] += np.cumsum(rng.normal(size=(20, k)), axis=0)
        edges = [
            (start, n),
            *((n + i, n + i + 1) for i in range(19)),
            *((n + int(rng.integers(20)), int(rng.integers(n))) for _ in range(8)),
        ]
        actions.append(Action(poses, edges, graph.information[rng.integers(graph.num_edges, size=len(edges))]))
    signatures, lower, upper, entropies, errors = from_scratch(graph, actions)
    found = judge(graph)
    np.testing.assert_allclose(found.signatures(actions)[0], signatures, rtol=1e-9)
    values, found_errors = found.entropies(actions)
    assert (np.abs(values - entropies) <= 1e-9 * np.abs(entropies) + errors * (name == "intel.g2o")).all()
    assert (found_errors < 0.01).all()
    np.testing.assert_allclose(found.bounds(actions), [lower, upper], rtol=1e-9, atol=4 * errors.max())
    low, high = judge(graph, bounds="anchored").bounds(actions)
    assert (low <= values + found_errors).all()
    assert (values - found_errors <= high).all()
    assert (high - low < upper - lower).all()


@pytest.mark.parametrize("scale", [1e100, 1e200])
@pytest.mark.parametrize("family", ["fischer", "paper", "anchored"])
def test_numbers_that_overflow_are_refused_without_a_warning(scale, family):
    poses = PRIOR.poses * [scale, scale, 1.0]
    prior = PoseGraph(poses, PRIOR.edges, None, np.diag([1e300, 1e300, 1.0]))
    action = Action([[scale, 0, 0]], [(4, 5), (5, 1)], prior.information[0])
    found = judge(prior, bounds=family)
    for quantity in (found.bounds, found.entropies):
        with pytest.raises(IllConditionedError):
            quantity([action])


def test_a_prior_that_double_precision_cannot_factor_is_refused():
    poses = 1e6 * np.random.default_rng(0).normal(size=(1300, 3))
    edges = [(i, i + 1) for i in range(1299)] + [(0, 700)]
    prior = PoseGraph(poses, edges, None, np.diag([1e8, 1e8, 1e-8]))
    with pytest.raises(IllConditionedError):
        judge(prior).entropies([Action(np.zeros((0, 3)), [(3, 900)], np.diag([1e8, 1e8, 1e-8]))])
