"""Laws that hold across rooms: signatures, bounds, entropies and decisions of the same graphs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import topobelief as tb
from graphs import connected_topologies, noises, pose_graphs, random_poses, relabelled, sessions, shares_isotropic_noise
from references import LOG_2_PI_E, entropy_reference, log_det_reference
from topobelief.entropy import joint_entropy_estimate

seeds = st.integers(0, 2**32 - 1)
SIGNATURES = ("spanning_trees", "von_neumann", "von_neumann_approx")
OBJECTIVES = ("joint", "map", "per_pose")


def close(value):
    return pytest.approx(value, rel=1e-9, abs=1e-6)


def session_values(session, objective):
    """The objective plus cost of each action, by dense QR."""
    values = []
    for action in session.actions:
        after = tb.posterior(session.graph, action)
        kappa, n0 = after.tangent_dim, session.graph.num_poses
        log_det = log_det_reference(after, "joint")
        free = after.num_poses - 1
        if objective == "map":
            log_det -= log_det_reference(after, "joint", held=range(n0))
            free = n0 - 1
        value = free * kappa / 2 * LOG_2_PI_E - log_det / 2
        values.append((value / max(1, free) if objective == "per_pose" else value) + action.cost)
    return np.array(values)


# Signature, bounds, entropy -------------------------------------------------------------------------------------------------


@given(connected_topologies(max_extra=0), noises(), seeds)
def test_on_a_tree_the_signature_is_minus_the_entropy_and_both_bounds_say_so(topology, noise, seed):
    rng = np.random.default_rng(seed)
    poses = random_poses(rng, noise.group, topology.edges, topology.num_nodes, noise.length)
    information = noise.draw(rng, topology.num_edges)
    graph = tb.PoseGraph(poses, topology.edges, None, information if topology.num_edges else np.eye(noise.group.tangent_dim))
    J = tb.joint_entropy(graph)
    assert tb.spanning_tree_signature(topology, graph.information) == close(-J)
    assert tb.entropy_bounds(graph).upper == close(J)


@given(pose_graphs(min_poses=2, kinds=("equal", "isotropic")))
def test_with_block_isotropic_noise_the_signature_is_minus_the_upper_bound(graph):
    assert tb.spanning_tree_signature(graph.topology, graph.information) == close(-tb.entropy_bounds(graph).upper)


@given(pose_graphs(min_poses=2), seeds)
def test_one_more_edge_raises_trees_and_signature_and_lowers_entropy_and_upper_bound(graph, seed):
    rng = np.random.default_rng(seed)
    edge = rng.choice(graph.num_poses, 2, replace=False)
    information = graph.information[rng.integers(graph.num_edges)]
    more = tb.PoseGraph(
        graph.poses, np.concatenate([graph.edges, [edge]]), None, np.concatenate([graph.information, information[None]])
    )
    assert tb.log_num_spanning_trees(more.topology) > tb.log_num_spanning_trees(graph.topology)
    s, s_more = (tb.spanning_tree_signature(g.topology, g.information) for g in (graph, more))
    assert s_more > s - 1e-9 * abs(s)
    before, after = joint_entropy_estimate(graph), joint_entropy_estimate(more)
    assert after.value <= before.value + before.error + after.error
    upper, upper_more = (tb.entropy_bounds(g).upper for g in (graph, more))
    assert upper_more <= upper + 1e-9 * abs(upper)


@given(pose_graphs(min_poses=2), st.floats(0.05, 0.95))
def test_a_measurement_split_in_two_parallel_ones_changes_nothing(graph, share):
    """Parallel edges add everywhere; von Neumann signatures collapse them."""
    halves = tb.PoseGraph(
        graph.poses,
        np.concatenate([graph.edges, graph.edges]),
        None,
        np.concatenate([share * graph.information, (1 - share) * graph.information]),
    )
    assert tb.joint_entropy(halves) == close(tb.joint_entropy(graph))
    for determinant in ("cholesky", "hadamard"):
        whole, split = (tb.entropy_bounds(g, determinant=determinant) for g in (graph, halves))
        assert (split.lower, split.upper) == (close(whole.lower), close(whole.upper))
    s, s_split = (tb.spanning_tree_signature(g.topology, g.information) for g in (graph, halves))
    assert s_split == close(s)
    assert tb.von_neumann_entropy(halves.topology) == pytest.approx(tb.von_neumann_entropy(graph.topology), abs=1e-10)
    assert tb.von_neumann_entropy_approx(halves.topology) == pytest.approx(tb.von_neumann_entropy_approx(graph.topology))


@given(pose_graphs(min_poses=2), seeds)
def test_a_turned_measurement_says_the_same_seen_from_the_other_end(graph, seed):
    """T_j_i with information Ad^T Omega Ad is the same knowledge: J agrees, whatever the direction."""
    group = graph.group
    rng = np.random.default_rng(seed)
    turned = rng.random(graph.num_edges) < 0.5
    i, j = graph.edges.T
    edges = np.where(turned[:, None], graph.edges[:, ::-1], graph.edges)
    adjoint = group.adjoint(group.between(graph.poses[j], graph.poses[i]))  # body of i -> body of j
    seen = adjoint.transpose(0, 2, 1) @ graph.information @ adjoint
    information = np.where(turned[:, None, None], (seen + seen.transpose(0, 2, 1)) / 2, graph.information)
    try:
        other = tb.PoseGraph(graph.poses, edges, None, information)
    except ValueError:
        return  # the lever made the matrix singular to double precision
    try:
        J = joint_entropy_estimate(other)
    except ArithmeticError:
        return
    expected = entropy_reference(graph)
    assert J.value == pytest.approx(expected, abs=1e-6 * (1 + abs(expected)) + J.error)


# Decisions ------------------------------------------------------------------------------------------------------------------


@settings(max_examples=100)
@given(
    sessions(),
    st.sampled_from(OBJECTIVES),
    st.sampled_from(SIGNATURES),
    st.sampled_from(["fischer", "paper"]),
    st.sampled_from(["cholesky", "hadamard"]),
)
def test_the_best_action_is_always_among_the_survivors(session, objective, signature, family, determinant):
    """And the theorem: epsilon <= Delta J_max, for any signature that chose."""
    if not shares_isotropic_noise(session):
        family = "fischer"
    planner = tb.Planner(session.graph, objective=objective, signature=signature, bounds=family, determinant=determinant)
    decision = planner.decide(session.actions)
    values = session_values(session, objective)
    slack = 1e-8 * (1 + np.abs(values).max())
    assert values[decision.survivors].min() <= values.min() + slack
    assert values[decision.best] - values.min() <= decision.error_bound + slack
    quality = tb.decision_quality(values, -np.argsort(decision.ranking).astype(float))  # the ranking as a signature
    assert quality.error <= decision.error_bound + slack


@settings(max_examples=200)
@given(sessions(min_actions=2, max_actions=5), st.sampled_from(OBJECTIVES), st.sampled_from(SIGNATURES))
def test_an_optimal_proof_finds_the_least_objective(session, objective, signature):
    decision = tb.Planner(session.graph, objective=objective, signature=signature).decide(session.actions, proof="optimal")
    values = session_values(session, objective)
    assert decision.proven_optimal
    assert values[decision.best] <= values.min() + 1e-8 * (1 + np.abs(values).max())


@settings(max_examples=40)
@given(sessions(min_actions=2, max_actions=5, log_ratio=(2.0, 6.0)), st.sampled_from(OBJECTIVES))
def test_proofs_hold_on_ill_conditioned_graphs_or_are_refused(session, objective):
    try:
        decision = tb.Planner(session.graph, objective=objective).decide(session.actions, proof="optimal")
    except ArithmeticError:
        return
    values = session_values(session, objective)
    assert values[decision.best] <= values.min() + 1e-6 * (1 + np.abs(values).max())


@given(sessions(min_actions=2), seeds)
def test_the_order_in_which_actions_are_listed_does_not_matter(session, seed):
    order = np.random.default_rng(seed).permutation(len(session.actions))
    planner = tb.Planner(session.graph)
    before, after = (
        planner.decide(actions, proof="optimal") for actions in (session.actions, [session.actions[index] for index in order])
    )
    values = session_values(session, "joint")
    assert values[order[after.best]] == close(values[before.best])
    assert np.allclose(after.signatures, before.signatures[order], rtol=0, atol=0)


@settings(max_examples=20)
@given(sessions(max_actions=3), seeds)
def test_the_names_of_the_priors_poses_do_not_matter(session, seed):
    graph = session.graph
    permutation = np.random.default_rng(seed).permutation(graph.num_poses)
    renamed = relabelled(graph, permutation)
    every = np.concatenate([permutation, np.arange(graph.num_poses, graph.num_poses + 20)])
    actions = [tb.Action(a.poses, every[a.edges], a.information, cost=a.cost) for a in session.actions]
    for objective in OBJECTIVES:
        before = tb.Planner(graph, objective=objective, anchor=0).decide(session.actions)
        after = tb.Planner(renamed, objective=objective, anchor=int(permutation[0])).decide(actions)
        for name in ("signatures", "lower", "upper"):
            assert getattr(after, name).tolist() == [close(value) for value in getattr(before, name)], (objective, name)


@settings(max_examples=40)
@given(sessions(max_actions=3))
def test_joint_entropy_is_the_maps_and_that_of_the_new_poses_given_the_map(session):
    """Chain rule: J = J_map + H(new | old), H from I_nn, the new poses' information with the prior held."""
    graph = session.graph
    joint, existing = (tb.Planner(graph, objective=objective).entropies(session.actions) for objective in ("joint", "map"))
    for action, whole, old in zip(session.actions, joint, existing, strict=True):
        after = tb.posterior(graph, action)
        log_det = log_det_reference(after, "joint", held=range(graph.num_poses))
        given_map = action.num_new_poses * graph.tangent_dim / 2 * LOG_2_PI_E - log_det / 2
        assert whole == close(old + given_map)


@settings(max_examples=40)
@given(sessions(max_actions=1), seeds)
def test_the_map_never_gets_worse_by_looking(session, seed):
    """J_map(U) <= J of the prior, and one more closure lowers it further: information never hurts."""
    graph, action = session.graph, session.actions[0]
    total = graph.num_poses + action.num_new_poses
    planner = tb.Planner(graph, objective="map")
    before, after = joint_entropy_estimate(graph), planner.entropies([action])[0]
    assert after <= before.value + 1e-9 * (1 + abs(before.value)) + 10 * before.error
    if total > 1 and graph.num_edges:
        edge = np.random.default_rng(seed).choice(total, 2, replace=False)
        more = tb.Action(
            action.poses, np.concatenate([action.edges, [edge]]), np.concatenate([action.information, graph.information[:1]])
        )
        assert planner.entropies([more])[0] <= after + 1e-9 * (1 + abs(after)) + 10 * before.error


@given(pose_graphs(min_poses=2, log_ratio=(-2.0, 1.0)), seeds)
def test_parts_that_touch_the_map_at_one_pose_each_bring_it_nothing(graph, seed):
    """Whatever closures they have within: they follow the pose that they touch. The signature says so too."""
    rng = np.random.default_rng(seed)
    n = graph.num_poses
    touched = rng.integers(n, size=2)
    rings = [[(t, a), (a, a + 1), (a + 2, a + 1), (a + 2, t)] for t, a in zip(touched, (n, n + 3), strict=True)]
    poses = graph.poses[np.repeat(touched, 3)]
    poses[:, : graph.group.position_dim] += np.ptp(graph.positions) * rng.normal(size=(6, graph.group.position_dim))
    action = tb.Action(poses, np.concatenate(rings), graph.information[rng.integers(graph.num_edges, size=8)])
    stay = tb.Action(poses[:0], np.empty((0, 2), dtype=int), graph.information[0])
    decision = tb.Planner(graph, objective="map").decide([stay, action])
    values = tb.Planner(graph, objective="map").entropies([stay, action])
    assert values[1] == close(values[0])
    assert decision.signatures[1] == close(decision.signatures[0])


def test_the_signature_of_the_map_is_no_bound_of_its_entropy():
    """Three poses on a line: det I / det I_nn = 45/16 is less than the trees' (3/2)^3, so J_map lies above c - s_map."""
    line = tb.PoseGraph([[0, 0, 0], [1, 0, 0]], [(0, 1)], None, np.eye(3))
    loop = tb.Action([[2, 0, 0]], [(1, 2), (2, 0)], np.eye(3))
    planner = tb.Planner(line, objective="map")
    c, (entropy,) = 1.5 * LOG_2_PI_E, planner.entropies([loop])
    assert entropy == close(c - math.log(45 / 16) / 2)
    assert c - planner.decide([loop]).signatures[0] == close(c - math.log(27 / 8) / 2)


@given(sessions(min_actions=2))
def test_sequential_actions_are_one_action(session):
    """The posterior of a posterior is the posterior of both at once: same entropy, bounds and signature."""
    graph, first = session.graph, session.actions[0]
    middle = tb.posterior(graph, first)
    n, shift = graph.num_poses, first.num_new_poses
    second = session.actions[1]
    moved = np.where(second.edges >= n, second.edges + shift, second.edges)
    later = (
        tb.Action(second.poses, moved, second.information)
        if len(second.edges)
        else tb.Action(second.poses, [], np.eye(graph.tangent_dim))
    )
    both = (
        tb.Action(
            np.concatenate([first.poses, second.poses]),
            np.concatenate([first.edges, moved]),
            np.concatenate([first.information, second.information]),
        )
        if len(first.edges) + len(moved)
        else first
    )
    step_by_step, at_once = tb.posterior(middle, later), tb.posterior(graph, both)
    assert tb.joint_entropy(step_by_step) == close(tb.joint_entropy(at_once))
    a, b = tb.entropy_bounds(step_by_step), tb.entropy_bounds(at_once)
    assert (a.lower, a.upper) == (close(b.lower), close(b.upper))


def test_public_names_load():
    for name in tb.__all__:
        assert getattr(tb, name) is not None
    assert math.isclose(tb.log_num_spanning_trees(tb.Topology(3, [(0, 1), (1, 2), (2, 0)])), math.log(3))
