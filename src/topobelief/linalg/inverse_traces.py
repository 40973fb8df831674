"""Traces tr(A^T M^-1 A) of forms for which it does not matter which node is held: the strongest one is.

Large forms are factored in blocks by compiled kernels where numba is installed: many columns at once, no solution kept.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import Estimate
from topobelief.linalg.inverse import InverseSolver
from topobelief.optional import has_kernels

COMPILED_SIZE = 1200  # variables beyond which loading compiled kernels is worth its time, and a QR takes too long


def inverse_traces(form: EdgeForm, num_nodes: int, wanted: list[tuple[IntArray, FloatArray]]) -> list[Estimate[float]]:
    """tr(A^T M^-1 A) of several A, the form's multiplicity left out.

    Parameters
    ----------
    form
    num_nodes
    wanted
        For each A the different nodes at which it is not zero, shape (t,), and what it is there, shape (t, b, s).
    """
    held = form.strongest_node()
    if num_nodes * form.block_size > COMPILED_SIZE and has_kernels():
        from topobelief.linalg.elimination_paths import FormFactor
        from topobelief.linalg.elimination_tree import EliminationTree
        from topobelief.linalg.solutions import inverse_trace

        factor = FormFactor.of(EliminationTree.build(form.edges, num_nodes, held), form).or_with_strong_rows_last(form)
        return [inverse_trace(factor, nodes, columns) for nodes, columns in wanted]
    solver, traces = InverseSolver(form.edges, num_nodes, held), list[Estimate[float]]()
    for nodes, columns in wanted:
        dense = np.zeros((num_nodes, *columns.shape[1:]))
        dense[nodes] = columns
        traces.append(solver.solve(form, dense).trace)
    return traces
