"""Traces tr(A^T M^-1 A) of forms for which it does not matter which node is held: the strongest one is.

Large forms are factored in blocks by compiled kernels where numba is installed: many columns at once, no solution kept;
projections by diagonal blocks of the inverse.
"""

from __future__ import annotations

import numpy as np

from topobelief.arrays import FloatArray, IntArray
from topobelief.linalg.edge_form import EdgeForm
from topobelief.linalg.estimate import Estimate
from topobelief.linalg.inverse import InverseSolver, Projection
from topobelief.optional import has_kernels

COMPILED_SIZE = 1200  # variables beyond which loading compiled kernels is worth its time, and a QR takes too long


def is_compiled(size: int) -> bool:
    """Whether traces of a form of so many variables are taken by compiled kernels."""
    return size > COMPILED_SIZE and has_kernels()


def inverse_traces(
    form: EdgeForm, num_nodes: int, wanted: list[Projection | tuple[IntArray, FloatArray]]
) -> list[Estimate[float]]:
    """tr(A^T M^-1 A) of several A, or tr(Pi M^-1 Pi) of projections Pi, the form's multiplicity left out.

    Parameters
    ----------
    form
    num_nodes
    wanted
        Projections; or for each A the different nodes at which it is not zero, shape (t,), and what it is there, shape
        (t, b, s).
    """
    held = form.strongest_node()
    if is_compiled(num_nodes * form.block_size):
        from topobelief.linalg.elimination_paths import FormFactor
        from topobelief.linalg.elimination_tree import EliminationTree
        from topobelief.linalg.selected_inverse import projected_trace
        from topobelief.linalg.solutions import inverse_trace

        factor = FormFactor.of(EliminationTree.build(form.edges, num_nodes, held), form).or_with_strong_rows_last(form)
        return [
            projected_trace(factor, each) if isinstance(each, Projection) else inverse_trace(factor, *each) for each in wanted
        ]
    solver, traces = InverseSolver(form.edges, num_nodes, held), list[Estimate[float]]()
    for each in wanted:
        nodes, columns = (each.nodes, each.columns(form.block_size)) if isinstance(each, Projection) else each
        dense = np.zeros((num_nodes, *columns.shape[1:]))
        dense[nodes] = columns
        traces.append(solver.solve(form, dense).trace)
    return traces
