"""The expected error of the map as objective, and resistance as its signature: both engines, bounds, proofs and laws."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from data_files import RECORDED, data_file
from engines import DenseEngine, judge
from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph, sessions
from references import error_reference
from topobelief.errors import IllConditionedError, InvalidInputError
from topobelief.forms import increments, prior_factors
from topobelief.graph.action import Action, posterior, staying
from topobelief.graph.alignment import sample_of
from topobelief.graph.pose_graph import PoseGraph
from topobelief.graph.topology import Topology
from topobelief.io.g2o import read_g2o
from topobelief.linalg import inverse_traces
from topobelief.planning.decision import Decision
from topobelief.planning.engine import Engine, ScratchEngine
from topobelief.planning.incremental_engine import IncrementalEngine
from topobelief.planning.planner import Planner
from topobelief.position_errors import expected_errors
from topobelief.signatures.resistance import resistance_signature

OMEGA = np.diag([100.0, 100.0, 400.0])
MODERATE = {"log_ratio": (-2.0, 1.0)}
ERROR = {"objective": "error", "signature": "resistance"}
seeds = st.integers(0, 2**32 - 1)
samples = st.sampled_from([500, 4])
from_scratch = Engine.from_scratch


def a_session(seed, *, group=SE2_GROUP, kind="equal", num_poses=30, num_actions=10):
    rng = np.random.default_rng(seed)
    noise = Noise(group, kind, 100.0, float(rng.choice([0.05, 0.3, 1.0])), 2.0)
    graph = random_pose_graph(rng, noise, num_poses, num_poses // 4)
    actions = [random_action(rng, graph, noise, max_new=8, max_closures=6) for _ in range(num_actions)]
    return graph, [Action(a.poses, a.edges, a.information, cost=0.01 * a.cost) for a in actions]


@given(sessions(**MODERATE), st.sampled_from([ScratchEngine, IncrementalEngine]), samples, seeds)
def test_all_quantities_are_those_of_dense_numpy(session, kind, sample_size, seed):
    graph, actions = session.graph, session.actions
    assume(graph.num_poses > 1)  # the error of a single pose is the root of what rounding leaves of 0
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    found, dense = (judge(graph, each, anchor=anchor, sample_size=sample_size, **ERROR) for each in (kind, DenseEngine))
    for ours, theirs in ((found.signatures, dense.signatures), (found.entropies, dense.entropies)):
        np.testing.assert_allclose(ours(actions)[0], theirs(actions)[0], rtol=1e-7, atol=1e-10)
    if kind is ScratchEngine:  # by increments they are exact
        fischer = [forms_bounds(dense, action) for action in actions]
        np.testing.assert_allclose(np.array(found.bounds(actions)).T, fischer, rtol=1e-6)


def forms_bounds(dense, action):
    """Section 12's two traces, from dense matrices."""
    [(_, forms)] = dense.engine.groups([action])
    known = forms.aligned_trace("positions").value
    added = [forms.coupled_trace(form).value for form in ("rotations", "rotations_given_positions")]
    return [math.sqrt(max(0.0, known + each)) for each in added]


@given(sessions(log_ratio=(-2.0, 1.0), max_poses=9), samples)
def test_increments_are_what_an_evaluation_from_scratch_gives(session, sample_size):
    graph, actions = session.graph, session.actions
    found, alone = (judge(graph, kind, sample_size=sample_size, **ERROR) for kind in (IncrementalEngine, ScratchEngine))
    for ours, theirs in ((found.signatures, alone.signatures), (found.entropies, alone.entropies)):
        (values, errors), (expected, expected_errors) = ours(actions), theirs(actions)
        np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-12 + (errors + expected_errors).max())
    lower, upper = found.bounds(actions)
    values, errors = found.entropies(actions)
    np.testing.assert_array_equal(lower, values - errors)
    np.testing.assert_array_equal(upper, values + errors)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP])
@pytest.mark.parametrize("kind", NOISES)
def test_engines_agree_to_nine_digits(group, kind):
    graph, actions = a_session(1, group=group, kind=kind, num_poses=60)
    for sample_size in (500, 23):
        found, alone = (judge(graph, each, sample_size=sample_size, **ERROR) for each in (IncrementalEngine, ScratchEngine))
        np.testing.assert_allclose(found.entropies(actions)[0], alone.entropies(actions)[0], rtol=1e-9)
        np.testing.assert_allclose(found.signatures(actions)[0], alone.signatures(actions)[0], rtol=1e-9)
        nodes = sample_of(graph.num_poses, sample_size)
        expected = [error_reference(graph, posterior(graph, action), sample=nodes) for action in actions]
        np.testing.assert_allclose(found.entropies(actions)[0], expected, rtol=1e-9)


@settings(max_examples=300)
@given(sessions(log_ratio=(-3.0, 3.0), max_poses=8), st.sampled_from(["fischer", "anchored"]), seeds)
def test_bounds_enclose_the_error(session, family, seed):
    graph, actions = session.graph, session.actions
    anchor = int(np.random.default_rng(seed).integers(graph.num_poses))
    found = judge(graph, ScratchEngine, bounds=family, anchor=anchor, **ERROR)
    for action in actions:
        expected = error_reference(graph, posterior(graph, action))
        try:
            (lower,), (upper,) = found.bounds([action])
        except IllConditionedError:
            continue
        assert lower <= expected * (1 + 1e-7) + 1e-12
        assert upper >= expected * (1 - 1e-7) - 1e-12


@settings(max_examples=100)
@given(sessions(log_ratio=(-3.0, 6.0), max_actions=3), st.sampled_from([ScratchEngine, IncrementalEngine]))
def test_errors_of_rounding_are_covered_or_the_value_is_refused(session, kind):
    """The reference is an inverse by QR, which is off by no more than the root of what the Gram matrix loses."""
    found = judge(session.graph, kind, **ERROR)
    for action in session.actions:
        after = posterior(session.graph, action)
        references = [error_reference(session.graph, after, held=held) for held in {0, after.num_poses - 1}]
        doubt = np.ptp(references) + 1e-9 * max(references)
        try:
            (value,), (error,) = found.entropies([action])
        except IllConditionedError:
            continue
        assert abs(value - references[0]) <= error + 10 * doubt


@pytest.mark.parametrize("engine", ["scratch", "incremental"])
@pytest.mark.parametrize("bounds", ["fischer", "anchored", "chain", "auto"])
@pytest.mark.parametrize("kind", ["equal", "full"])
def test_proofs_find_the_least_value(engine, bounds, kind):
    for seed in range(6):
        graph, actions = a_session(seed, kind=kind, num_poses=14, num_actions=8)
        decision = Planner(graph, engine=engine, bounds=bounds, **ERROR).decide(actions, proof="optimal")
        values = [error_reference(graph, posterior(graph, action)) + action.cost for action in actions]
        assert decision.proven_optimal
        assert values[decision.best] == pytest.approx(min(values), rel=1e-9)


def test_algorithm_1_in_metres():
    graph, actions = a_session(2)
    planner = Planner(graph, engine="scratch", **ERROR)
    decision = planner.decide(actions)
    exact = planner.entropies(actions) + [action.cost for action in actions]
    assert exact[decision.best] - exact.min() <= decision.error_bound
    upper = decision.upper[decision.best]
    assert planner.decide(actions, margin=1.01 * upper).margin_met
    assert not planner.decide(actions, margin=0.99 * upper).margin_met
    with pytest.raises(InvalidInputError, match="finite margin in m, got nan"):
        planner.decide(actions, margin=math.nan)


def test_without_closures_nothing_is_gained_and_the_cheaper_way_wins():
    graph, _ = a_session(3)
    n, now = graph.num_poses, expected_errors(graph).map_rmse
    far = Action([[1, 2, 0], [3, 4, 1]], [(2, n), (n, n + 1)], graph.information[0], cost=0.02)
    near = Action([[1, 2, 0]], [(n, 2)], graph.information[0], cost=0.01)
    for engine in ("scratch", "incremental"):
        planner = Planner(graph, engine=engine, **ERROR)
        np.testing.assert_allclose(planner.entropies([far, near]), now, rtol=1e-9)
        decision = planner.decide([far, near], proof="optimal")
        assert decision.best == 1
        assert decision.ranking.tolist() == [1, 0]


@settings(max_examples=40)
@given(sessions(**MODERATE), st.sampled_from(["scratch", "incremental"]))
def test_no_action_makes_the_map_worse(session, engine):
    planner = Planner(session.graph, engine=engine, **ERROR)
    before = expected_errors(session.graph).map_rmse
    assert (planner.entropies(session.actions) <= before * (1 + 1e-7) + 1e-12).all()


def test_costs_in_metres_are_taken_from_a_signature_in_metres_only():
    graph, actions = a_session(4)
    dear = [Action(a.poses, a.edges, a.information, cost=float(cost)) for cost, a in enumerate(actions)]
    assert Planner(graph, **ERROR).decide(dear, proof="none").ranking.tolist() == list(range(len(dear)))
    for choice in ({"objective": "error"}, {"objective": "map", "signature": "resistance"}):
        planner = Planner(graph, **choice)
        assert planner.decide(dear, proof="none").ranking.tolist() == planner.decide(actions, proof="none").ranking.tolist()


def test_the_signature_is_the_public_function_s():
    graph, actions = a_session(5, kind="full")
    for size in (500, 7):
        decision = Planner(graph, sample_size=size, **ERROR).decide(actions, proof="none")
        for action, found in zip(actions, decision.signatures, strict=True):
            after = posterior(graph, action)
            expected = resistance_signature(after.topology, after.information, graph.num_poses, sample_size=size)
            assert found == pytest.approx(expected, rel=1e-9)


def test_resistance_works_with_any_objective_and_any_signature_with_the_error():
    graph, actions = a_session(6)
    for objective in ("joint", "map", "per_pose", "error"):
        for signature in ("spanning_trees", "von_neumann", "von_neumann_approx", "resistance"):
            decision = Planner(graph, objective=objective, signature=signature).decide(actions, proof="optimal")
            assert decision.proven_optimal
            units = {"error": "m", "per_pose": "nats per pose"}
            assert decision.unit == units.get(objective, "nats")


def test_families_that_the_error_does_not_have_are_named():
    graph, _ = a_session(7)
    for family in ("paper", "fischer_step"):
        message = f'bounds of objective "error" to be one of "fischer", "anchored", "chain", "auto", got \'{family}\''
        with pytest.raises(InvalidInputError, match=message):
            Planner(graph, objective="error", bounds=family)
    with pytest.raises(InvalidInputError, match="sample of at least 2 poses, got 1"):
        Planner(graph, sample_size=1, **ERROR)


def test_a_decision_speaks_of_centimetres():
    graph, actions = a_session(8)
    decision = Planner(graph, engine="scratch", **ERROR).decide(actions)
    assert "can be better by more than" in decision.summary()
    assert " cm" in decision.summary()
    assert "bounds of the expected error of the map plus cost in cm" in str(decision)
    assert f"{100 * decision.upper[decision.best]:.2f}" in str(decision)
    assert decision.to_dict()["unit"] == "m"
    assert Decision.from_dict(decision.to_dict()).unit == "m"
    optimal = Planner(graph, engine="scratch", **ERROR).decide(actions, proof="optimal")
    assert "is optimal (expected error of the map)" in optimal.summary()


def test_a_planner_that_has_grown_or_was_pickled_gives_the_same():
    graph, actions = a_session(9)
    planner = Planner(graph, engine="incremental", **ERROR)
    expected = planner.entropies(actions)
    np.testing.assert_allclose(pickle.loads(pickle.dumps(planner)).entropies(actions), expected, rtol=1e-12)
    grown = posterior(graph, next(action for action in actions if action.num_new_poses))
    n = grown.num_poses
    follow = [Action([[0, 0, 0]], [(n - 1, n), (n, old)], graph.information[0]) for old in range(5)]
    found, fresh = planner.extended(grown), Planner(grown, engine="scratch", **ERROR)
    np.testing.assert_allclose(found.entropies(follow), fresh.entropies(follow), rtol=1e-9)
    np.testing.assert_allclose(planner.entropies(actions), expected, rtol=0)


def test_exact_values_come_with_bounds_by_increments():
    graph, actions = a_session(10)
    batch = judge(graph, **ERROR).batch(actions)
    batch.bounds()
    assert batch.knows_entropies


def test_a_decision_by_exact_values_says_so_and_keeps_them():
    graph, actions = a_session(10)
    planner = Planner(graph, engine="incremental", **ERROR)
    ranked = planner.decide(actions)
    assert ranked.exact_bounds
    assert (ranked.best, ranked.num_evaluations) == (ranked.ranking[0], 0)
    few = planner.decide(actions, proof="optimal", max_evaluations=2)
    assert few.num_evaluations <= 2
    decision = planner.decide(actions, proof="optimal")
    np.testing.assert_array_equal(decision.entropies, planner.entropies(actions))
    assert decision.num_evaluations == len(actions)
    assert decision.exact_bounds
    assert decision.proven_optimal
    assert decision.best == np.argmin(decision.entropies + [action.cost for action in actions])
    assert "The exact values of all 10 were computed, since they cost no more than bounds." in decision.summary()
    assert Decision.from_dict(decision.to_dict()).exact_bounds
    one = planner.decide(actions, margin=1e3)
    assert one.num_evaluations == 0
    assert not one.exact_bounds


def test_after_many_closures_a_large_graph_is_factored_anew(monkeypatch):
    graph, actions = a_session(12)
    n, rng = graph.num_poses, np.random.default_rng(0)
    many = Action([], rng.permuted(np.tile(np.arange(n), (20, 1)), axis=1)[:, :2], graph.information[0])
    alone = Planner(graph, engine="scratch", **ERROR)
    expected, signatures = alone.entropies([*actions, many]), alone.decide([*actions, many], proof="none").signatures
    evaluated = []
    monkeypatch.setattr(Engine, "from_scratch", lambda self, action: evaluated.append(action) or from_scratch(self, action))
    monkeypatch.setattr(inverse_traces, "COMPILED_SIZE", 10)
    monkeypatch.setattr(increments, "_LEAST_HEAVY", 0)
    planner = Planner(graph, engine="incremental", **ERROR)
    found = planner.entropies([*actions, many])
    assert evaluated == [many]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    np.testing.assert_allclose(planner.decide([*actions, many], proof="none").signatures, signatures, rtol=1e-9)


def test_a_large_map_as_it_is_needs_no_solutions(monkeypatch):
    graph, _ = a_session(9)
    expected = Planner(graph, engine="scratch", **ERROR).entropies([staying(graph)])
    monkeypatch.setattr(prior_factors, "COMPILED_SIZE", 10)
    monkeypatch.setattr(prior_factors, "solutions", None)
    found = Planner(graph, engine="incremental", **ERROR).entropies([staying(graph)])
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_what_a_factor_from_scratch_would_not_know_better_is_taken_from_increments(monkeypatch):
    """Edges that know hardly anything in one direction make all errors of rounding larger."""
    rng, noise = np.random.default_rng(13), Noise(SE2_GROUP, "full", 100.0, 0.3, 2.0, spread=7.0)
    graph = random_pose_graph(rng, noise, 80, 20)
    actions = [random_action(rng, graph, noise, max_new=8, max_closures=6) for _ in range(4)]
    expected = Planner(graph, engine="scratch", **ERROR).entropies(actions)
    values, errors = judge(graph, **ERROR).entropies(actions)
    assert (errors > 1e-8 * values).any()
    monkeypatch.delattr(Engine, "from_scratch")
    np.testing.assert_allclose(Planner(graph, engine="incremental", **ERROR).entropies(actions), expected, rtol=1e-9)


def test_an_action_beyond_double_precision_is_named():
    graph, actions = a_session(11, num_actions=2)
    n = graph.num_poses
    far = [[1e14, 0, 0], [2e14, 0, 0]]
    hopeless = Action(far, [(n - 1, n), (n, n + 1), (n + 1, n - 1), (n + 1, 3)], np.diag([1e20, 1e20, 1e-20]), label="hopeless")
    for engine in ("scratch", "incremental"):
        with pytest.raises(IllConditionedError, match=r"action 2 \('hopeless'\): expected error of the map.* m\)"):
            Planner(graph, engine=engine, **ERROR).entropies([*actions, hopeless])


def test_the_recorded_drive_by_both_engines():
    graph = read_g2o(data_file(RECORDED))
    n, rng = graph.num_poses, np.random.default_rng(0)
    actions = [Action(graph.poses[n - 2 :: -20] + 0.1, chain(n, rng), graph.information[0]) for _ in range(3)]
    found, alone = (Planner(graph, engine=engine, **ERROR).entropies(actions) for engine in ("incremental", "scratch"))
    np.testing.assert_allclose(found, alone, rtol=1e-9)


def chain(n, rng):
    count = len(range(n - 2, -1, -20))
    return [*((n - 1 + i, n + i) for i in range(count)), *((n + i, int(rng.integers(n))) for i in range(count))]


# The signature alone ----------------------------------------------------------------------------------------------------


def test_known_resistances():
    """Path: R_ij = |i - j|; cycle of n: d (n - d) / n; complete graph: 2 / n; star: 1 to the hub, 2 between leaves."""
    n, omega = 6, np.eye(3)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    cases = {
        "path": ([(i, i + 1) for i in range(n - 1)], lambda i, j: abs(i - j)),
        "cycle": ([(i, (i + 1) % n) for i in range(n)], lambda i, j: abs(i - j) * (n - abs(i - j)) / n),
        "complete": (pairs, lambda i, j: 2 / n),
        "star": ([(0, i) for i in range(1, n)], lambda i, j: 1 if j == 0 else 2),
    }
    for edges, resistance in cases.values():
        total = sum(resistance(i, j) for i, j in pairs)
        assert resistance_signature(Topology(n, edges), omega, n) == pytest.approx(-math.sqrt(2 * total) / n, rel=1e-12)
    path = Topology(n, cases["path"][0])
    assert resistance_signature(path, omega, 2) == pytest.approx(-math.sqrt(2) / 2, rel=1e-12)  # of the first two alone
    assert resistance_signature(path, 4 * omega, n) == pytest.approx(resistance_signature(path, omega, n) / 2, rel=1e-12)
    assert resistance_signature(Topology(1, []), omega, 1) == 0.0


@given(sessions(**MODERATE), seeds)
def test_another_edge_never_lowers_the_signature(session, seed):
    graph = session.graph
    assume(graph.num_poses > 1)
    i, j = np.random.default_rng(seed).choice(graph.num_poses, 2, replace=False)
    more = Topology(graph.num_poses, np.concatenate([graph.edges, [(i, j)]]))
    information = np.concatenate([graph.information, graph.information[:1]])
    before = resistance_signature(graph.topology, graph.information, graph.num_poses)
    assert resistance_signature(more, information, graph.num_poses) >= before * (1 + 1e-9)


def test_what_the_signature_refuses():
    path = Topology(3, [(0, 1), (1, 2)])
    for existing in (0, 4):
        with pytest.raises(InvalidInputError, match=f"between 1 and 3 existing nodes, got {existing}"):
            resistance_signature(path, OMEGA, existing)


def test_with_rotations_known_it_is_the_error_but_for_the_turn():
    graph, _ = a_session(12)
    stiff = PoseGraph(graph.poses, graph.edges, None, np.diag([100.0, 100.0, 1e12]))
    s_R = resistance_signature(stiff.topology, stiff.information, stiff.num_poses)
    error = expected_errors(stiff).map_rmse
    assert error < -s_R < 1.2 * error
