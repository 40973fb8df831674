"""The benchmark's sessions are what they say, its methods agree, and its result is complete."""

import json
import math
import time

import numpy as np
import pytest

from graphs import SE2_GROUP, SE3_GROUP, Noise, random_pose_graph
from landmark_graphs import with_landmarks
from references import error_reference
from topobelief import (
    PoseGraph,
    joint_entropy,
    learn_closures,
    log_num_spanning_trees,
    posterior,
    von_neumann_entropy,
    write_g2o,
)
from topobelief.benchmark import run
from topobelief.benchmark.baselines import Baseline, baselines
from topobelief.benchmark.certificates import error_bounds, proof_size
from topobelief.benchmark.memory import peak_gigabytes
from topobelief.benchmark.predicted import bounds_of_candidates, predicted_candidates
from topobelief.benchmark.run import BenchmarkPlan, run_benchmark
from topobelief.benchmark.sessions import BenchmarkSession, candidate_paths, city_drive
from topobelief.benchmark.timing import MethodTime, SessionTimes, time_session
from topobelief.errors import InvalidInputError
from topobelief.graph.information import block_isotropic
from topobelief.report.benchmark_tables import candidate_table, session_table
from topobelief.signatures.von_neumann import von_neumann_entropy_approx

INFORMATION = block_isotropic(0.1, 0.035)


def city(num_poses, seed=0, **options):
    return city_drive(num_poses, INFORMATION, rng=np.random.default_rng(seed), **options)


def tangle(kind, num_poses):
    """A pose graph in SE(3)."""
    noise = Noise(SE3_GROUP, kind, position_weight=100.0, ratio=0.5, length=1.0, spread=1.0)
    return random_pose_graph(np.random.default_rng(3), noise, num_poses, 10)


@pytest.mark.parametrize("closures", ["scattered", "bursts"])
def test_a_drive_has_metre_steps_and_closures_between_near_poses_far_apart_in_time(closures):
    graph = city(2000, closures=closures)
    chain, found = graph.edges[:1999], graph.edges[1999:]
    assert (chain == np.column_stack([np.arange(1999), np.arange(1, 2000)])).all()
    lengths = np.linalg.norm(graph.positions[graph.edges[:, 1]] - graph.positions[graph.edges[:, 0]], axis=1)
    np.testing.assert_allclose(lengths[:1999], 1.0)
    assert len(found) > 500
    assert lengths[1999:].max() <= (3.0 if closures == "scattered" else 4.5)
    assert (found[:, 0] - found[:, 1] >= 10).all()
    side = math.ceil(math.sqrt(2000))
    assert graph.positions.min() >= 0
    assert graph.positions.max() < side


def test_a_drive_is_the_same_for_the_same_seed():
    assert (city(300, 5).edges.tolist(), city(300, 5).poses.tolist()) == (
        city(300, 5).edges.tolist(),
        city(300, 5).poses.tolist(),
    )
    assert city(300, 5).edges.tolist() != city(300, 6).edges.tolist()


@pytest.mark.parametrize(("num_poses", "closures"), [(1, "scattered"), (10, "many")])
def test_a_drive_that_cannot_be_is_refused(num_poses, closures):
    with pytest.raises(InvalidInputError, match="expected"):
        city(num_poses, closures=closures)


def test_candidates_close_as_many_loops_as_asked_for_on_average_each_with_the_nearest_pose():
    graph = city(400)
    actions = candidate_paths(graph, 50, num_new_poses=40, num_closures=8, rng=np.random.default_rng(1))
    assert np.mean([action.num_closures for action in actions]) == 8
    assert len({action.num_closures for action in actions}) > 3
    for action in actions:
        assert action.num_new_poses == 40
        path = np.concatenate([graph.poses[-1:, :2], action.poses[:, :2]])
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() == pytest.approx(1.0)
        for new, old in action.edges[40:]:
            distances = np.linalg.norm(graph.positions - action.poses[new - 400, :2], axis=1)
            assert distances[old] == distances.min()


def test_candidates_in_three_dimensions():
    graph = tangle("isotropic", 30)
    action = candidate_paths(graph, 3, num_new_poses=5, num_closures=2, rng=np.random.default_rng(0))[0]
    assert action.poses.shape == (5, 7)


@pytest.mark.parametrize("wrong", [{"count": 0}, {"num_new_poses": 0}, {"num_closures": 101}])
def test_candidates_that_leave_nothing_to_decide_are_refused(wrong):
    with pytest.raises(InvalidInputError, match="at least one path"):
        candidate_paths(city(50), **{"count": 5, **wrong}, rng=np.random.default_rng(0))


@pytest.mark.parametrize("three_dimensional", [False, True])
def test_all_ways_to_evaluate_agree(three_dimensional):
    graph = tangle("full", 40) if three_dimensional else city(120)
    action = candidate_paths(graph, 1, num_new_poses=12, num_closures=4, rng=np.random.default_rng(2))[0]
    after = posterior(graph, action)
    kappa = graph.tangent_dim
    log_det = (after.num_poses - 1) * kappa * math.log(2 * math.pi * math.e) - 2 * joint_entropy(after)
    expected = {
        "log det I": log_det,
        "tau": log_num_spanning_trees(after.topology),
        "s_VN": von_neumann_entropy(after.topology),
        "s_VN by degrees": von_neumann_entropy_approx(after.topology),
        "E": error_reference(graph, after),
    }
    for method in baselines():
        assert method.prepare(graph)(action)() == pytest.approx(expected[method.quantity], rel=1e-9), method.name


def test_a_session_is_timed_by_every_method_that_suits_its_size():
    graph = city(60)
    session = BenchmarkSession(
        "small", graph, candidate_paths(graph, 8, num_new_poses=10, num_closures=3, rng=np.random.default_rng(0))
    )
    told: list[str] = []
    times = time_session(session, num_actions=4, repetitions=2, progress=told.append)
    names = [method.name for method in times.methods]
    assert names == [method.name for method in baselines()] + [
        "signature s_ST",
        "signature ŝ_VN",
        "signature and Fischer bounds",
        "signature and anchored bounds",
        "signature and chain bounds",
        "proven optimum",
        "exact J of all",
        "signature resistance",
        "resistance and bounds of E",
        "proven optimum of E",
        "exact E of all",
    ]
    assert len(told) == len(names) + 1
    assert times.largest_deviation < 1e-9
    assert times.gtsam is min(times.methods[:2], key=lambda method: method.total)
    assert times.best_from_scratch in times.methods[:5]
    assert (times.num_actions, times.num_new_poses) == (4, 10)
    large = city_drive(3600, INFORMATION, rng=np.random.default_rng(0))
    assert not any(large.num_poses <= method.largest_graph < math.inf for method in baselines())


def test_a_method_that_fails_on_a_graph_is_reported_and_the_rest_goes_on():
    def prepare(graph):
        def ready(action):
            raise RuntimeError("Indeterminate linear system detected while working near variable 7,\nand so on")

        return ready

    graph = city(40)
    session = BenchmarkSession(
        "hard", graph, candidate_paths(graph, 4, num_new_poses=5, num_closures=1, rng=np.random.default_rng(0))
    )
    failing = Baseline("standard BSP, GTSAM, COLAMD", "log det I", "standard", math.inf, prepare)
    times = time_session(session, num_actions=2, repetitions=1, methods=[failing])
    assert times.methods[0].note == "fails: Indeterminate linear system detected while working near variable 7"
    assert len(times.methods) == 12
    assert times.gtsam is times.best_from_scratch is None
    result = run.BenchmarkResult(BenchmarkPlan(), {}, (times,))
    row = json.loads(json.dumps(result.to_dict(), allow_nan=False))["sessions"][0]["methods"][0]
    assert row["total"] is row["times_faster_than_gtsam"] is None
    assert "fails" in " ".join(str(cell) for column in session_table(times, None).columns for cell in column.cells)


def test_error_bounds_compare_the_families_on_the_same_candidates():
    found = error_bounds(
        closures="bursts", num_poses=80, num_actions=10, seeds=range(3), sigma_position=0.1, sigma_rotation=0.035
    )
    assert found.ratio["paper"] == 1
    assert (
        found.error_bound["chain"]
        <= found.error_bound["anchored"]
        <= found.error_bound["fischer"]
        <= found.error_bound["paper"]
    )


def test_a_proof_takes_fewer_exact_values_where_the_noise_couples_less():
    sizes = [
        proof_size(
            "city",
            city(200),
            num_actions=30,
            bounds="anchored",
            sigma_position=0.1,
            sigma_rotation=sigma,
            repetitions=1,
            seed=0,
        )
        for sigma in (1e-4, 0.3)
    ]
    assert sizes[0].num_evaluations <= sizes[1].num_evaluations
    assert sizes[0].num_survivors <= sizes[1].num_survivors


def test_peak_memory_is_that_of_the_process_alone():
    held = np.ones(60_000_000)  # 0.48 GB here, none of it there
    assert 0.03 < peak_gigabytes(20, 3, "exact", seed=0) < 0.4
    assert held[0] == 1


def test_the_result_grows_part_by_part_and_goes_into_json(tmp_path):
    graph = city(40)
    write_g2o(PoseGraph(graph.poses, graph.edges, graph.measurements, INFORMATION), tmp_path / "drive.g2o")
    plan = BenchmarkPlan(
        sizes=(30,),
        files=(tmp_path / "drive.g2o",),
        num_actions=3,
        repetitions=1,
        num_seeds=2,
        bounds_size=40,
        bounds_actions=4,
        memory_sizes=(20,),
        small=(25, 2),
        predicted_actions=4,
    )
    results = list(run_benchmark(plan))
    counts = [
        len(result.sessions) + len(result.memory) + len(result.error_bounds) + len(result.proofs) + len(result.candidates)
        for result in results
    ]
    assert counts == [0, 1, 2, 3, 4, 5, 6, 7, 16, 28]
    document = json.loads(json.dumps(results[-1].to_dict(), allow_nan=False))
    assert document["schema"] == run.SCHEMA
    assert document["plan"]["files"] == ["drive.g2o"]
    assert [session["num_poses"] for session in document["sessions"]] == [25, 40, 30]
    first = document["sessions"][0]["methods"]
    assert {row["times_faster_than_gtsam"] for row in first if "GTSAM" in row["name"]} >= {1.0}


def test_ratios_are_of_whole_sessions():
    methods = (
        MethodTime("standard BSP, GTSAM, COLAMD", "standard", 0.0, 0.2, 20.0, 5),
        MethodTime("standard BSP, GTSAM, METIS", "standard", 0.0, 0.1, 10.0, 5),
        MethodTime("standard BSP, sparse LDLᵀ", "standard", 0.0, 0.08, 8.0, 5),
        MethodTime("signature s_ST", "engine", 0.01, 0.001, 0.1, 5),
    )
    times = SessionTimes("x", 10, 12, 100, 5.0, 2.0, methods, 0.1, 1e-12)
    rows = run.BenchmarkResult(BenchmarkPlan(), {}, (times,)).to_dict()["sessions"][0]["methods"]
    assert [row["times_faster_than_gtsam"] for row in rows] == pytest.approx([0.5, 1.0, 1.25, 100.0])
    assert [row["times_faster_than_best_from_scratch"] for row in rows] == pytest.approx([0.4, 0.8, 1.0, 80.0])


def test_ratios_compare_methods_of_one_objective():
    methods = (
        MethodTime("standard BSP, GTSAM, COLAMD", "standard", 0.0, 0.2, 20.0, 5),
        MethodTime("E from GTSAM's marginals", "error", 0.0, 1.0, 100.0, 5, objective="error"),
        MethodTime("E from scratch", "error", 0.0, 0.5, 50.0, 5, objective="error"),
        MethodTime("exact J of all", "engine", 0.1, 0.0, 0.2, 5),
        MethodTime("exact E of all", "engine", 0.1, 0.0, 0.5, 5, objective="error"),
    )
    times = SessionTimes("x", 10, 12, 100, 5.0, 2.0, methods, 0.1, 1e-12)
    assert times.gtsam is times.best_from_scratch is methods[0]
    assert times.ratios(methods[3]) == pytest.approx((100, 100))
    assert times.ratios(methods[4]) == pytest.approx((200, 100))


def test_one_path_has_few_closures_those_of_its_graph_s_history_or_those_of_the_paper_s_rule():
    graph = city(400)
    found = {kind: predicted_candidates(graph, 10, kind, seed=1)[0] for kind in ("nearest", "learned", "paper")}
    for few, learned, many in zip(*found.values(), strict=True):
        assert few.num_new_poses == 30
        np.testing.assert_allclose(few.poses[-1, :2], learned.poses[-1, :2])
        np.testing.assert_allclose(learned.poses, many.poses)
        assert learned.expected_closures <= learned.num_closures
        assert learned.num_closures <= learn_closures(graph).max_per_pose * learned.num_new_poses
    mean = {kind: np.mean([action.num_closures for action in actions]) for kind, actions in found.items()}
    assert mean["nearest"] == 6
    assert mean["nearest"] < mean["learned"] < mean["paper"]


def test_candidates_of_three_kinds_are_bounded_by_every_family_and_by_their_errors():
    rows = list(bounds_of_candidates("city", city(150), num_actions=5, repetitions=1, seed=0))
    assert [(row.candidates, row.objective, row.bounds) for row in rows] == [
        (kind, *pair)
        for kind in ("nearest", "learned", "paper")
        for pair in (("joint", "fischer"), ("joint", "anchored"), ("joint", "chain"), ("error", "exact"))
    ]
    for row in rows:
        assert 1 <= row.num_survivors <= row.num_actions == 5
        assert 0 < row.width < (1e-6 if row.objective == "error" else math.inf)
    shown = " ".join(str(cell) for column in candidate_table(rows).columns for cell in column.cells)
    assert "learned" in shown
    assert f"{rows[0].num_survivors} of 5" in shown


@pytest.mark.parametrize("kind", ["nearest", "learned", "paper"])
def test_candidates_in_three_dimensions_lead_to_the_same_places(kind):
    graph = tangle("isotropic", 20)
    actions, _ = predicted_candidates(graph, 3, kind, seed=0)
    expected = predicted_candidates(graph, 3, "nearest", seed=0)[0]
    for action, other in zip(actions, expected, strict=True):
        np.testing.assert_allclose(action.poses[-1, :3], other.poses[-1, :3], atol=1e-6)


def test_sessions_with_landmarks_agree_with_gtsam():
    """Candidates observe landmarks as the graph's poses did; rows that need joint marginals of poses alone are left out."""
    rng, noise = np.random.default_rng(4), Noise(SE2_GROUP, "isotropic", 100.0, 0.5, 1.0)
    graph = with_landmarks(rng, random_pose_graph(rng, noise, 30, 10), noise, 5)

    actions = candidate_paths(graph, 4, num_new_poses=5, num_closures=1, rng=rng)
    assert sum(action.num_observations for action in actions) > 0
    times = time_session(BenchmarkSession("seen", graph, actions), num_actions=2, repetitions=2)
    names = {row.name for row in times.methods}
    assert "standard BSP, GTSAM, COLAMD" in names
    assert "rAMDL on the dense covariance" not in names
    assert times.largest_deviation < 1e-9
    assert "5 landmarks" in session_table(times, None).title


def test_time_is_that_of_the_clock():
    graph = city(40)
    session = BenchmarkSession(
        "small", graph, candidate_paths(graph, 4, num_new_poses=5, num_closures=1, rng=np.random.default_rng(0))
    )
    ticks = iter(range(100_000))
    times = time_session(session, num_actions=2, repetitions=1, clock=lambda: float(next(ticks)))
    assert {method.total for method in times.methods if method.kind == "engine"} == {1.0}
    assert BenchmarkPlan(cpu_time=True).clock is time.process_time


@pytest.mark.parametrize("wrong", [{"num_actions": 1}, {"repetitions": 0}, {"sizes": (1,)}, {"seed": -1}])
def test_a_plan_that_measures_nothing_is_refused(wrong):
    with pytest.raises(InvalidInputError, match=f"expected {next(iter(wrong))} of at least"):
        BenchmarkPlan(**wrong)
