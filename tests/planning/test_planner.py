"""Algorithm 1 and its proof, field by field, against exhaustive evaluation."""

import copy
import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graphs import SE2_GROUP, Noise, path, random_action, random_pose_graph, sessions, shares_isotropic_noise
from references import entropy_reference
from topobelief.bounds import entropy_bounds
from topobelief.errors import (
    DisconnectedGraphError,
    IllConditionedError,
    InvalidActionError,
    InvalidGraphError,
    InvalidInputError,
)
from topobelief.graph.action import Action, posterior
from topobelief.graph.pose_graph import PoseGraph
from topobelief.planning.planner import Planner
from topobelief.signatures.von_neumann import von_neumann_entropy, von_neumann_entropy_approx

SIGNATURES = ("spanning_trees", "von_neumann", "von_neumann_approx")
OBJECTIVES = ("joint", "map", "per_pose")
OMEGA = np.diag([100.0, 100.0, 400.0])
LINE = PoseGraph([[i, 0, 0] for i in range(5)], path(5).edges, None, OMEGA)

explore = Action([[5, 0, 0]], [(4, 5)], OMEGA, label="explore")
revisit = Action([[4, 1, 0]], [(4, 5), (5, 3), (5, 0)], OMEGA, label="revisit")
stay = Action([], [], OMEGA, label="stay")
close_ = Action([], [(0, 4)], OMEGA, label="close")

configurations = st.fixed_dictionaries(
    {
        "objective": st.sampled_from(OBJECTIVES),
        "signature": st.sampled_from(SIGNATURES),
        "determinant": st.sampled_from(["cholesky", "hadamard"]),
    }
)


def assert_ranked(decision, costs):
    """All actions by descending signature - cost (nats), by the raw signature for von Neumann's; ties by index."""
    score = decision.signatures - costs if decision.signature == "spanning_trees" else decision.signatures
    assert sorted(decision.ranking) == list(range(len(score)))
    along = score[decision.ranking]
    rounding = 1e-7 * (1 + np.abs(score).max())
    assert (along >= np.maximum.accumulate(along[::-1])[::-1] - rounding).all()
    for earlier, later in pairwise(decision.ranking):
        assert score[earlier] != score[later] or earlier < later


def contents(action):
    """What equal actions have in common."""
    return tuple(array.tobytes() for array in (action.poses, action.edges, action.information))


def exhaustive(session, objective):
    """J + cost of every action, from scratch."""
    planner = Planner(session.graph, objective=objective)
    return planner.entropies(session.actions) + np.array([action.cost for action in session.actions])


# The fields, without a proof ---------------------------------------------------------------------------------------------


@settings(max_examples=50)
@given(sessions(), configurations)
def test_fields_of_a_bounded_decision(session, configuration):
    """DESIGN's table: ranking, bounds, survivors, error bound, nothing evaluated."""
    decision = Planner(session.graph, **configuration).decide(session.actions)
    costs = np.array([action.cost for action in session.actions])
    assert_ranked(decision, costs)
    ranking = decision.ranking.tolist()
    first = ranking[0]
    assert decision.best == first
    survivors = [index for index in ranking if index == first or decision.lower[index] <= decision.upper[first]]
    assert decision.survivors.tolist() == survivors
    others = [index for index in ranking if index != first]
    gap = decision.upper[first] - min(decision.lower[others], default=math.inf)
    assert decision.error_bound == max(0.0, gap)
    assert decision.proven_optimal == (survivors == [first])
    assert decision.num_evaluations == 0
    assert np.isnan(decision.entropies).all()
    assert decision.margin_met is None
    J = exhaustive(session, configuration["objective"])
    assert J[first] - J.min() <= decision.error_bound + 1e-9 * (1 + np.abs(J).max())
    assert J[survivors].min() <= J.min() + 1e-9 * (1 + np.abs(J).max())


@given(sessions(), st.sampled_from(["cholesky", "hadamard"]), st.integers(0, 10**6))
def test_bounds_are_those_of_the_posterior_at_the_planners_anchor_plus_cost(session, determinant, seed):
    anchor = seed % session.graph.num_poses
    for family in ("fischer", "paper") if shares_isotropic_noise(session) else ("fischer",):
        for given_anchor, used in ((None, session.graph.num_poses - 1), (anchor, anchor)):
            planner = Planner(session.graph, bounds=family, determinant=determinant, anchor=given_anchor)
            decision = planner.decide(session.actions)
            for index, action in enumerate(session.actions):
                bounds = entropy_bounds(posterior(session.graph, action), family=family, determinant=determinant, anchor=used)
                expected = pytest.approx((bounds.lower + action.cost, bounds.upper + action.cost), rel=1e-9, abs=1e-7)
                assert (decision.lower[index], decision.upper[index]) == expected


@given(sessions())
def test_von_neumann_signatures_are_those_of_the_posterior(session):
    for name, entropy in (("von_neumann", von_neumann_entropy), ("von_neumann_approx", von_neumann_entropy_approx)):
        decision = Planner(session.graph, signature=name).decide(session.actions, proof="none")
        expected = [entropy(posterior(session.graph, action).topology) for action in session.actions]
        assert decision.signatures.tolist() == [pytest.approx(value, abs=1e-9) for value in expected]
    normalized = Planner(session.graph, signature="von_neumann_approx", normalized=True).decide(session.actions, proof="none")
    for action, found in zip(session.actions, normalized.signatures, strict=True):
        after = posterior(session.graph, action)
        assert found == pytest.approx(
            von_neumann_entropy_approx(after.topology, information=after.information), rel=1e-12, abs=1e-9
        )


@given(sessions(), configurations)
def test_signatures_only(session, configuration):
    """proof="none": bounds nan, all survive, nothing is certified but a choice of one."""
    decision = Planner(session.graph, **configuration).decide(session.actions, proof="none")
    K = len(session.actions)
    assert np.isnan([decision.lower, decision.upper, decision.entropies]).all()
    assert decision.survivors.tolist() == decision.ranking.tolist()
    assert (decision.error_bound, decision.proven_optimal) == ((0.0, True) if K == 1 else (math.inf, False))
    assert (decision.best, decision.num_evaluations, decision.margin_met) == (decision.ranking[0], 0, None)


# The margin --------------------------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(sessions(), configurations, st.sampled_from(["none", "bounded"]))
def test_a_margin_asks_for_one_upper_bound(session, configuration, proof):
    planner = Planner(session.graph, **configuration)
    bounded = planner.decide(session.actions)
    first = bounded.ranking[0]
    for margin, met in (
        (bounded.upper[first] + 1e-3, True),
        (bounded.upper[first], False),
        (bounded.upper[first] - 1e-3, False),
    ):
        decision = planner.decide(session.actions, margin=margin, proof=proof)
        assert decision.margin_met is met
        assert decision.best == first
        assert decision.survivors.tolist() == ([first] if met else bounded.ranking.tolist())
        assert decision.upper[first] == bounded.upper[first]
        assert np.isnan(decision.lower).all()
        assert np.isnan(np.delete(decision.upper, first)).all()
        assert decision.num_evaluations == 0
        if len(session.actions) > 1:
            assert (decision.error_bound, decision.proven_optimal) == (math.inf, False)
        else:
            assert (decision.error_bound, decision.proven_optimal) == (0.0, True)


def test_the_margin_counts_the_cost():
    planner = Planner(LINE)
    upper = planner.decide([explore]).upper[0]
    costly = Action(explore.poses, explore.edges, OMEGA, cost=5.0)
    assert planner.decide([explore], margin=upper + 1).margin_met
    assert not planner.decide([costly], margin=upper + 1).margin_met
    assert planner.decide([costly], margin=upper + 5.1).margin_met


# The proof ---------------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(sessions(min_actions=2), configurations)
def test_a_proof_returns_the_best_action(session, configuration):
    planner = Planner(session.graph, **configuration)
    decision = planner.decide(session.actions, proof="optimal")
    J = exhaustive(session, configuration["objective"])
    slack = 1e-9 * (1 + np.abs(J).max())
    assert decision.proven_optimal
    assert J[decision.best] <= J.min() + slack
    assert decision.error_bound <= slack
    assert decision.best in decision.survivors
    evaluated = np.flatnonzero(~np.isnan(decision.entropies))
    assert decision.num_evaluations == len({contents(session.actions[index]) for index in evaluated})
    costs = np.array([action.cost for action in session.actions])
    assert np.allclose(decision.entropies[evaluated] + costs[evaluated], J[evaluated], rtol=1e-9, atol=1e-9)
    # evaluated: both bounds are that value widened by its error
    assert (decision.lower[evaluated] <= J[evaluated]).all()
    assert (J[evaluated] <= decision.upper[evaluated]).all()
    assert (decision.upper[evaluated] - decision.lower[evaluated] <= 1e-6 * (1 + np.abs(J[evaluated]))).all()
    # not evaluated: ruled out by a bound
    skipped = np.setdiff1d(np.arange(len(J)), evaluated)
    if len(evaluated):
        known = decision.entropies + costs
        assert known[decision.best] == np.nanmin(known)
        assert (decision.lower[skipped] > decision.upper[decision.best]).all()
    else:
        assert decision.survivors.tolist() == [decision.best]


@settings(max_examples=50)
@given(sessions(min_actions=2, max_actions=8), configurations, st.integers(0, 3))
def test_an_interrupted_proof_keeps_its_certificate(session, configuration, limit):
    """max_evaluations 0, 1, 2, 3: no more are made, along the ranking, and no action is better by more than the error bound."""
    planner = Planner(session.graph, **configuration)
    decision = planner.decide(session.actions, proof="optimal", max_evaluations=limit)
    J = exhaustive(session, configuration["objective"])
    slack = 1e-9 * (1 + np.abs(J).max())
    assert decision.num_evaluations <= limit
    assert J[decision.best] - J.min() <= decision.error_bound + slack
    assert J[decision.survivors].min() <= J.min() + slack
    assert decision.survivors[0] == decision.ranking[0]
    order = {int(index): place for place, index in enumerate(decision.ranking)}
    places = sorted(order[int(index)] for index in np.flatnonzero(~np.isnan(decision.entropies)))
    if places:
        assert places[0] == 0
    if limit == 0:
        bounded = planner.decide(session.actions)
        assert decision.best == bounded.best
        assert decision.error_bound == bounded.error_bound
        assert decision.survivors.tolist() == bounded.survivors.tolist()
    if decision.proven_optimal:
        assert J[decision.best] <= J.min() + slack
    else:
        assert any(np.isnan(decision.entropies[index]) for index in decision.survivors)


def test_a_proof_evaluates_fewer_than_all():
    """200 actions that all add three poses: the bounds rule most of them out."""
    rng = np.random.default_rng(5)
    noise = Noise(SE2_GROUP, "equal", 100.0, 0.3, 1.0)
    graph = random_pose_graph(rng, noise, 12, 6)
    actions = []
    while len(actions) < 200:
        action = random_action(rng, graph, noise, max_new=3, max_closures=6)
        if action.num_new_poses == 3:
            actions.append(action)
    decision = Planner(graph).decide(actions, proof="optimal")
    J = Planner(graph).entropies(actions) + np.array([action.cost for action in actions])
    assert decision.best == int(np.argmin(J))
    assert decision.proven_optimal
    assert 1 <= decision.num_evaluations < 40


# Deadlines and progress ---------------------------------------------------------------------------------------------------


@given(sessions(min_actions=2), configurations)
def test_no_time_at_all_still_ranks(session, configuration):
    planner = Planner(session.graph, **configuration)
    decision = planner.decide(session.actions, proof="optimal", deadline=0.0)
    assert decision.ranking.tolist() == planner.decide(session.actions, proof="none").ranking.tolist()
    assert (decision.best, decision.num_evaluations) == (decision.ranking[0], 0)
    assert decision.survivors.tolist() == decision.ranking.tolist()
    assert (decision.error_bound, decision.proven_optimal) == (math.inf, False)
    assert np.isnan([decision.lower, decision.upper]).all()


@settings(max_examples=20)
@given(sessions(), configurations)
def test_time_enough_changes_nothing(session, configuration):
    planner = Planner(session.graph, **configuration)
    for proof in ("bounded", "optimal"):
        without = planner.decide(session.actions, proof=proof)
        within = planner.decide(session.actions, proof=proof, deadline=1e6)
        assert within.ranking.tolist() == without.ranking.tolist()
        assert within.best == without.best
        assert within.survivors.tolist() == without.survivors.tolist()
        assert np.allclose(within.lower, without.lower, rtol=1e-12, atol=1e-9)
        assert within.num_evaluations == without.num_evaluations


def test_an_interruption_while_bounding_certifies_nothing_yet_but_rules_out_nothing_wrongly(monkeypatch):
    """The deadline passes after the first bound: the rest may still be optimal."""
    from topobelief.planning import search

    ticks = iter([0.0, 0.0, 10.0, 10.0, 10.0, 10.0])
    monkeypatch.setattr(search.time, "monotonic", lambda: next(ticks))
    decision = Planner(LINE, engine="scratch").decide([explore, revisit, stay], proof="optimal", deadline=5.0)
    assert np.isfinite(decision.upper).sum() == 1
    assert decision.survivors.tolist() == decision.ranking.tolist()
    assert (decision.error_bound, decision.proven_optimal, decision.num_evaluations) == (math.inf, False, 0)


def test_progress_is_reported_by_stage():
    reports = []
    planner = Planner(LINE, engine="scratch")
    planner.decide([explore, revisit], proof="optimal", on_progress=lambda *report: reports.append(report))
    assert reports[:2] == [("signatures", 1, 2), ("signatures", 2, 2)]
    assert {stage for stage, _, _ in reports} <= {"signatures", "bounds", "evaluations"}
    assert all(1 <= done <= total for _, done, total in reports)
    reports.clear()
    planner.entropies([explore, revisit], on_progress=lambda *report: reports.append(report))
    assert reports == [("evaluations", 1, 2), ("evaluations", 2, 2)]


# Corner cases -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("proof", ["none", "bounded", "optimal"])
def test_a_single_action_is_optimal_without_an_evaluation(proof):
    decision = Planner(LINE).decide([revisit], proof=proof)
    assert (decision.best, decision.error_bound, decision.proven_optimal, decision.num_evaluations) == (0, 0.0, True, 0)
    assert decision.survivors.tolist() == [0]


@pytest.mark.parametrize("signature", SIGNATURES)
def test_identical_actions_tie_by_index_and_both_survive(signature):
    planner = Planner(LINE, signature=signature)
    decision = planner.decide([revisit, revisit, explore])
    assert [index for index in decision.ranking if index < 2] == [0, 1]
    proven = planner.decide([revisit, revisit], proof="optimal")
    assert (proven.best, proven.proven_optimal) == (0, True)
    assert proven.survivors.tolist() == [0, 1]
    assert proven.error_bound <= 1e-9


def test_of_identical_actions_the_cheaper_is_proven_best():
    costly = Action(revisit.poses, revisit.edges, OMEGA, cost=0.5)
    decision = Planner(LINE).decide([costly, revisit], proof="optimal")
    assert decision.best == 1
    assert decision.entropies[1] == pytest.approx(Planner(LINE).entropies([costly])[0])


@pytest.mark.parametrize("engine", ["scratch", "incremental"])
@pytest.mark.parametrize("signature", SIGNATURES)
def test_equal_actions_are_computed_once(engine, signature):
    """Labels, costs and the way in which a noise is given do not make a difference; poses, edges and noise do."""
    named = Action(revisit.poses, revisit.edges, [OMEGA] * 3, label="another name", cost=0.25)
    other_noise = Action(revisit.poses, revisit.edges, [OMEGA, OMEGA, 0.999 * OMEGA])
    other_place = Action([[4, 0.99, 0]], revisit.edges, OMEGA)
    actions = [explore, revisit, named, other_noise, revisit, other_place]
    planner, reports = Planner(LINE, signature=signature, engine=engine), []
    decision = planner.decide(actions, proof="optimal", on_progress=lambda *report: reports.append(report))
    assert ("signatures", 4, 4) in reports
    assert (decision.best, decision.proven_optimal) == (1, True)
    values = planner.entropies(actions, on_progress=lambda *report: reports.append(report))
    assert reports[-1] == ("evaluations", 4, 4)
    np.testing.assert_allclose(values, [Planner(LINE).entropies([action])[0] for action in actions], rtol=1e-12)
    for name in ("signatures", "entropies"):
        assert len(set(getattr(decision, name)[[1, 2, 4]])) == 1
    for bound in (decision.lower, decision.upper):
        assert (bound[1], bound[2]) == (bound[4], bound[4] + 0.25)
    evaluated = np.flatnonzero(~np.isnan(decision.entropies))
    assert decision.num_evaluations == len({contents(actions[index]) for index in evaluated}) < len(evaluated)
    limited = planner.decide(actions, proof="optimal", max_evaluations=1)
    assert limited.num_evaluations == 1


def test_a_margin_bounds_the_first_of_equal_actions_alone():
    decision = Planner(LINE).decide([revisit, revisit, explore], margin=0.0)
    assert np.isfinite(decision.upper).tolist() == [True, False, False]


def test_cost_is_left_out_of_entropies_and_kept_in_bounds():
    costly = Action(revisit.poses, revisit.edges, OMEGA, cost=3.0)
    planner = Planner(LINE)
    J = planner.entropies([costly])[0]
    assert abs(J - entropy_reference(posterior(LINE, revisit))) < 1e-9
    decision = planner.decide([costly, Action(revisit.poses, revisit.edges, OMEGA, cost=3.1)], proof="optimal")
    assert decision.entropies[0] == pytest.approx(J, abs=1e-12)
    assert decision.lower[0] <= J + 3.0 <= decision.upper[0]
    cheap, costly = (planner.decide([Action(revisit.poses, revisit.edges, OMEGA, cost=cost)]) for cost in (0.0, 3.0))
    assert costly.lower[0] == pytest.approx(cheap.lower[0] + 3)
    assert costly.upper[0] == pytest.approx(cheap.upper[0] + 3)
    assert costly.signatures[0] == cheap.signatures[0]


def test_staying_and_closing_without_new_poses_are_candidates():
    decision = Planner(LINE, objective="map").decide([stay, close_, explore], proof="optimal")
    assert decision.best == 1
    assert decision.candidates[0].num_new_poses == decision.candidates[1].num_new_poses == 0
    assert [candidate.num_closures for candidate in decision.candidates] == [0, 1, 0]


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("family", ["fischer", "paper"])
def test_a_robot_that_has_seen_nothing_yet_can_plan(objective, family):
    alone = PoseGraph([[0, 0, 0]], [], None, OMEGA)
    step = Action([[1, 0, 0]], [(0, 1)], OMEGA)
    loop = Action([[1, 0, 0], [1, 1, 0]], [(0, 1), (1, 2), (2, 0)], OMEGA)
    decision = Planner(alone, objective=objective, bounds=family).decide([step, loop, Action([], [], OMEGA)], proof="optimal")
    J = Planner(alone, objective=objective).entropies([step, loop, Action([], [], OMEGA)])
    assert decision.proven_optimal
    assert J[decision.best] == pytest.approx(J.min(), abs=1e-12)


def test_results_are_read_only_arrays():
    decision = Planner(LINE).decide([explore, revisit])
    for name in ("signatures", "lower", "upper", "entropies", "ranking", "survivors"):
        array = getattr(decision, name)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_a_planner_goes_through_pickle_and_copies():
    planner = Planner(LINE, objective="map", anchor=1)
    expected = planner.decide([explore, revisit, stay], proof="optimal").to_dict()
    for other in (pickle.loads(pickle.dumps(planner)), copy.deepcopy(planner), copy.copy(planner)):
        assert other.decide([explore, revisit, stay], proof="optimal").to_dict() == expected


def test_a_planner_decides_again_the_same():
    planner = Planner(LINE)
    first, second = planner.decide([explore, revisit, stay]), planner.decide([explore, revisit, stay])
    assert first.to_dict() == second.to_dict()


# Refusals -----------------------------------------------------------------------------------------------------------------


def test_no_action_is_an_error():
    for call in (Planner(LINE).decide, Planner(LINE).entropies):
        with pytest.raises(InvalidActionError, match="expected at least one action to choose from, got none"):
            call([])


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ({"margin": 3.0, "proof": "optimal"}, 'expected a margin or proof="optimal", got both'),
        ({"margin": math.nan}, "expected a finite margin in nats, got nan"),
        ({"margin": math.inf}, "expected a finite margin in nats, got inf"),
        ({"proof": "maybe"}, 'expected proof to be one of "none", "bounded", "optimal", got \'maybe\''),
        ({"max_evaluations": -1}, "expected max_evaluations of at least 0, got -1"),
        ({"deadline": -0.5}, "expected a deadline of at least 0 seconds, got -0.5"),
        ({"deadline": math.nan}, "expected a deadline of at least 0 seconds, got nan"),
    ],
)
def test_limits_that_make_no_sense_are_refused(limits, message):
    with pytest.raises(InvalidInputError, match=message):
        Planner(LINE).decide([explore], **limits)


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        (
            {"objective": "total"},
            'expected objective to be one of "joint", "map", "per_pose", "error", "focused", got \'total\'',
        ),
        ({"signature": "trees"}, 'expected signature to be one of "spanning_trees", "von_neumann", "von_neumann_approx"'),
        ({"bounds": "psi"}, 'expected bounds to be one of "paper", "fischer"'),
        ({"determinant": "lu"}, 'expected determinant to be one of "cholesky", "hadamard", got \'lu\''),
    ],
)
def test_unknown_choices_are_refused(choice, message):
    with pytest.raises(InvalidInputError, match=message):
        Planner(LINE, **choice)


def test_a_planner_needs_a_connected_graph_and_an_anchor_in_it():
    with pytest.raises(DisconnectedGraphError, match="node 2 does not reach: 0, 1"):
        Planner(PoseGraph(np.zeros((3, 3)), [(0, 1)], None, OMEGA))
    with pytest.raises(InvalidGraphError, match="expected an anchor from 0 to 4, got 5"):
        Planner(LINE, anchor=5)


def test_a_bad_action_is_named_before_any_work():
    reports = []
    bad = Action([[5, 0, 0]], [(4, 5), (5, 9)], OMEGA, label="bad")
    with pytest.raises(InvalidActionError, match=r"action 2 \('bad'\), edge 1: expected indices below 6"):
        Planner(LINE).decide([explore, revisit, bad], on_progress=lambda *report: reports.append(report))
    assert reports == []


@pytest.mark.parametrize("factor", [2.0, 1 + 1e-3, 1 + 1e-7], ids=["twice", "a thousandth", "a ten-millionth"])
def test_the_papers_bounds_name_the_action_whose_noise_differs(factor):
    other = Action([[5, 0, 0]], [(4, 5), (5, 0)], [OMEGA, factor * OMEGA], label="other")
    reports = []
    with pytest.raises(
        InvalidActionError, match=r"action 1 \('other'\), edge 1: .*expect the graph's information.*bounds=\"fischer\""
    ) as info:
        Planner(LINE, bounds="paper").decide([explore, other], on_progress=lambda *report: reports.append(report))
    assert (info.value.action, info.value.edge, reports) == (1, 1, [])


def test_the_papers_bounds_name_the_action_even_where_the_graph_has_no_edge_yet():
    alone = PoseGraph([[0, 0, 0]], [], None, OMEGA)
    skewed = Action([[1, 0, 0]], [(0, 1)], OMEGA + 1, label="skewed")
    with pytest.raises(InvalidActionError, match=r"action 0 \('skewed'\)"):
        Planner(alone, bounds="paper").decide([skewed])


def test_the_papers_bounds_refuse_a_graph_of_mixed_noise_when_the_planner_is_made():
    mixed = PoseGraph(LINE.poses, LINE.edges, None, [OMEGA, OMEGA, 2 * OMEGA, OMEGA])
    with pytest.raises(InvalidGraphError, match=r'expect the same noise on all edges.*use family="fischer"'):
        Planner(mixed, bounds="paper")


def test_a_dense_spectrum_above_3000_poses_must_be_allowed():
    n = 3001
    large = PoseGraph(np.column_stack([np.arange(n), np.zeros((n, 2))]), path(n).edges, None, OMEGA)
    with pytest.raises(
        InvalidInputError,
        match=r"von Neumann entropy of 3001 poses takes about \d+ s an action; use \"von_neumann_approx\", or pass allow",
    ):
        Planner(large, signature="von_neumann")
    Planner(large, signature="von_neumann", allow_dense_spectrum=True)
    Planner(large, signature="von_neumann_approx")


def test_an_action_beyond_double_precision_is_named():
    """One hopeless candidate among good ones: whoever reads the error must learn which."""
    omega = np.diag([1e6, 1e6, 1e6, 1.0, 1.0, 1.0])
    prior = PoseGraph([[0, 0, 0, 0, 0, 0, 1]], [], None, omega)
    step = Action([[1, 0, 0, 0, 0, 0, 1]], [(0, 1)], omega)
    hopeless = Action([[1e12, 0, 0, 0, 0, 0, 1], [2e12, 0, 0, 0, 0, 0, 1]], [(0, 1), (1, 2), (2, 0)], omega, label="hopeless")
    with pytest.raises(IllConditionedError):
        Planner(prior, engine="scratch").entropies([hopeless])
    for call in (Planner(prior, engine="scratch").entropies, Planner(prior, engine="scratch").decide):
        with pytest.raises(IllConditionedError, match=r"action 1 \('hopeless'\)"):
            call([step, hopeless])


@pytest.mark.parametrize("limit", [{"proof": "none"}, {"margin": 0.0}])
def test_a_signature_beyond_double_precision_does_not_blur_the_others(limit):
    """Rounding makes ties, but one hopeless candidate must not make all of them ties, nor rank as nan."""
    weak = Action([[5, 0, 0], [6, 0, 0]], [(4, 5), (5, 6)], [1e-40 * OMEGA, OMEGA], label="weak")
    try:
        decision = Planner(LINE).decide([explore, revisit, weak], **limit)
    except IllConditionedError:
        return
    assert not np.isnan(decision.signatures).any()
    assert decision.ranking.tolist() == [1, 0, 2]
