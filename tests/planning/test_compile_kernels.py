"""What is compiled beforehand is all that decisions need."""

import importlib
import pkgutil

import numpy as np

import topobelief.forms
import topobelief.linalg
from engines import judge
from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, random_action, random_pose_graph
from topobelief.graph.action import posterior
from topobelief.planning.compile_kernels import compile_kernels


def compiled_signatures():
    """Argument types for which each kernel is compiled, by the kernel's name."""
    found = {}
    for package in (topobelief.linalg, topobelief.forms):
        for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
            for name, value in vars(importlib.import_module(module.name)).items():
                if hasattr(value, "signatures") and value.py_func.__module__ == module.name:
                    found[f"{module.name}.{name}"] = set(value.signatures)
    return found


def test_no_decision_compiles_anything_more():
    compile_kernels()
    before = compiled_signatures()
    assert sum(len(signatures) > 0 for signatures in before.values()) > 15
    assert before["topobelief.linalg.block_cholesky.copy_columns"]
    assert len(before["topobelief.linalg.selected_inverse._select"]) == 3  # block sizes 1, 3 and 6
    for group in (SE2_GROUP, SE3_GROUP):
        for kind in NOISES:
            rng = np.random.default_rng(1)
            noise = Noise(group, kind, 10.0, 0.5, 1.0)
            graph = random_pose_graph(rng, noise, 6, 4)
            actions = [random_action(rng, graph, noise) for _ in range(5)]
            for bounds, determinant in (
                ("fischer", "cholesky"),
                ("anchored", "cholesky"),
                ("chain", "cholesky"),
                ("paper", "hadamard"),
                ("paper", "cholesky"),
            ):
                if bounds == "paper" and kind != "equal":
                    continue
                for signature in ("spanning_trees", "von_neumann_approx"):
                    for objective in ("joint", "map"):
                        criteria = {
                            "bounds": bounds,
                            "determinant": determinant,
                            "signature": signature,
                            "objective": objective,
                        }
                        found = judge(graph, anchor=2, **criteria)
                        batch = found.batch(actions)
                        batch.signatures()
                        batch.bounds()
                        batch.entropies([0, 1])
                        grown = posterior(graph, actions[0])
                        found.extended(grown, 1).bounds([random_action(rng, grown, noise)])
    assert compiled_signatures() == before
