"""The forms after each of many actions, from those of the prior (docs, the mathematics, section 7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np

from topobelief.arrays import BoolArray, FloatArray
from topobelief.forms.action_batch import ActionBatch
from topobelief.forms.prior_factors import PriorFactors, SolvedName, form_of
from topobelief.forms.protocol import ClosureForms, FormName, Forms, Part, PositionsName, RotationsName, Rows
from topobelief.graph.action import posterior
from topobelief.graph.information import log_dets_of_noise
from topobelief.graph.topology import Topology
from topobelief.linalg.elimination_paths import FormFactor
from topobelief.linalg.estimate import UNIT_ROUNDOFF, Estimate
from topobelief.linalg.increments import Increments, Wanted, diagonal_increments, log_det_increments
from topobelief.linalg.inverse import error_worth_a_qr

_LARGEST_ERROR = 1.0  # nats; a factor with a larger error is not used
_QR_SIZE = 1200  # up to here an evaluation from scratch may do better, by QR, than a factor
_QR_ERROR = 1e-3  # nats; only beyond it is that worth its time
_QR_RELATIVE_ERROR = 1e-8  # of a trace; up to here no QR is worth its time either
_LARGEST_RELATIVE_ERROR = 0.02
_GAIN_ERRORS = 3.0  # I + R enters once, what is seen of the solutions twice
_OPERATIONS = 64
_LEAST_HEAVY = 400  # rows of closures up to which increments of a trace cost less than anything else
_CUBES_A_VARIABLE = 25_000  # of rows of closures, per variable of the graph: there a new factor costs as much as increments


class IncrementalForms(Forms[FloatArray], ClosureForms[FloatArray]):
    """The forms after each action of a batch; each is computed when it is first needed and kept.

    A value is nan where a factor of the prior is not to be trusted, or where it is not shared by enough actions.

    Parameters
    ----------
    prior
    batch
        At least one action.
    """

    def __init__(self, prior: PriorFactors, batch: ActionBatch) -> None:
        self._prior, self._batch = prior, batch
        self._known: dict[tuple[FormName, float, Wanted], Increments] = {}
        self._traced: dict[SolvedName, Increments] = {}

    @property
    def tangent_dim(self) -> int:
        return self._prior.graph.tangent_dim

    @property
    def num_existing(self) -> int:
        return self._prior.graph.num_nodes

    @property
    def landmarks(self) -> BoolArray:
        return self._prior.graph.is_landmark

    @property
    def num_new(self) -> FloatArray:
        return self._batch.num_new.astype(np.float64)

    def of_topology(self, quantity: Callable[[Topology], float]) -> FloatArray:
        return np.array([quantity(posterior(self._prior.graph, action).topology) for action in self._batch.actions])

    def degree_sum(self) -> FloatArray:
        return self._prior.degrees.of_extensions(self._batch.edges, self._batch.edge_start, self._batch.num_new)

    def mean_log_noise(self) -> FloatArray:
        total = self._prior.log_noise + self._batch.sums(log_dets_of_noise(self._batch.information))
        return total / np.maximum(self._prior.graph.num_edges + self._batch.num_edges, 1)

    @property
    def weights(self) -> tuple[FloatArray, FloatArray]:
        return self._weights

    @cached_property
    def _weights(self) -> tuple[FloatArray, FloatArray]:
        pairs = zip(self._prior.scalar_weights, self._batch.scalar_weights, strict=True)
        w_p, w_r = (np.concatenate(pair) for pair in pairs)
        return w_p, w_r

    @property
    def isotropic(self) -> bool:
        return self._prior.rows.weights is not None and self._batch.rows.weights is not None

    def largest_lever_sum(self) -> FloatArray:
        batch, before = self._batch, self._prior.lever_sums
        count = len(before) + batch.extensions.node_start[-1]
        action = np.repeat(np.arange(batch.count), batch.num_edges)
        keys, which = np.unique(action * count + batch.extensions.edges[:, 0], return_inverse=True)
        weights = batch.scalar_weights[0] * batch.rows.squared_lengths()
        added = np.bincount(which, weights=weights, minlength=len(keys)).astype(np.float64)  # without edges it counts integers
        action, source = np.divmod(keys, count)
        old = source < len(before)
        added[old] += before[source[old]]
        largest = np.full(batch.count, before.max(initial=0.0))
        np.maximum.at(largest, action, added)
        return largest

    def log_det(self, form: FormName, *, shift: float | FloatArray = 0.0, part: Part = "all") -> Estimate[FloatArray]:
        """With a shift for each action, of those that have the most frequent one; the others are nan."""
        if isinstance(part, tuple):  # no factor of the prior holds these
            return Estimate(np.full(self._batch.count, np.nan), np.full(self._batch.count, np.inf))
        if part == "new":
            added = self._increments_of_new_poses(form)
            return Estimate(added.forest + added.closures_held, added.error)
        if isinstance(shift, np.ndarray):
            values, counts = np.unique(shift, return_counts=True)
            common = float(values[np.argmax(counts)])
            whole = self.log_det(form, shift=common)
            return Estimate(np.where(shift == common, whole.value, np.nan), whole.error)
        added = self._increments(form, shift)
        return self._extended(form, shift, added, added.closures)

    def hadamard(self, form: FormName, *, shift: float | FloatArray = 0.0) -> Estimate[FloatArray]:
        shifts = np.broadcast_to(shift, self._batch.count).astype(np.float64)
        distinct, which = np.unique(shifts, return_inverse=True)
        prior = [self._prior.hadamard(form, float(value)) for value in distinct]
        rows, held = form_of(form, self._prior), self._prior.anchor
        increments, errors = diagonal_increments(rows, held, self._batch.extensions, form_of(form, self._batch), shifts)
        values = np.array([estimate.value for estimate in prior])[which] + increments
        return Estimate(values, np.array([estimate.error for estimate in prior])[which] + errors)

    def sheared_rotations(self, step: float, *, hadamard: bool) -> Estimate[FloatArray]:
        """Not by increments: an action changes D and so N at the poses that it touches."""
        return Estimate(np.full(self._batch.count, np.nan), np.full(self._batch.count, np.inf))

    def mean_resistance(self) -> Estimate[FloatArray]:
        return self._trace("trees_p")

    def aligned_trace(self, form: PositionsName) -> Estimate[FloatArray]:
        return self._trace(form)

    def coupled_trace(self, rotations: RotationsName) -> Estimate[FloatArray]:
        """Not by increments: an action changes N everywhere, and `aligned_trace` of the joint form costs less."""
        return Estimate(np.full(self._batch.count, np.nan), np.full(self._batch.count, np.inf))

    def knows_trace(self, form: PositionsName) -> bool:
        return form in self._traced

    def _trace(self, name: SolvedName) -> Estimate[FloatArray]:
        """The prior's trace less what closures gain; nan after actions for which that is not worth its time.

        Both are known relative to the errors of M and of I + R.
        """
        factor = self._prior.factor(name, 0.0)
        light = self._light(factor)
        if not light.any():
            return Estimate(np.full(self._batch.count, np.nan), np.full(self._batch.count, np.inf))
        if not (light & (self._batch.num_closures > 0)).any():  # without closures there is no gain, and no need of solutions
            found = self._prior.trace(name)
            value, error = np.where(light, found.value, np.nan), np.full(self._batch.count, found.error)
            return 1 / self._prior.alignment.count * Estimate(value, error)
        prior, trusted = self._prior.solutions(name), self._trusted(name, 0.0)
        if name not in self._traced:
            self._traced[name] = log_det_increments(
                factor, self._batch.extensions, form_of(name, self._batch), solutions=prior.values, wanted_of=light
            )
            if light.all():
                self._known.setdefault((name, 0.0, "closures"), self._traced[name])
        added, trace = self._traced[name], prior.trace
        relative = trusted.error + _GAIN_ERRORS * added.error + _OPERATIONS * UNIT_ROUNDOFF
        value = trace.value - added.gains
        error = np.where(added.gains == 0, trace.error, relative * (trace.value + added.gains))
        from_scratch = max(_QR_RELATIVE_ERROR, error_worth_a_qr(factor.tree.num_free * factor.block_size))
        known = math.isfinite(trusted.value) & (error <= min(from_scratch, _LARGEST_RELATIVE_ERROR) * value)
        return 1 / self._prior.alignment.count * Estimate(np.where(known, value, np.nan), error)

    def _light(self, factor: FormFactor) -> BoolArray:
        """Actions after which a trace costs less by increments than by a new factor of a large graph, shape (K,).

        A solution costs m^2 with the dense factor of m rows of closures, and as much as there are entries in that of the graph.
        """
        rows = factor.block_size * self._batch.num_closures
        return rows**2 <= max(_LEAST_HEAVY**2, len(factor.tree.rows) * factor.block_size**2)

    @property
    def increments(self) -> IncrementalForms:
        return self

    def base(self) -> Estimate[FloatArray]:
        added = self._known_of("joint") or self._increments("joint", 0.0, "parts")
        return self._extended("joint", 0.0, added, np.zeros(self._batch.count))

    def closures(self, form: FormName, rows: Rows = "all") -> Estimate[FloatArray]:
        if rows == "all":
            added = self._increments(form, 0.0)
            return self._of_closures(form, added, added.closures)
        if rows == "positions":
            added = self._increments(form, 0.0, "parts")
            return self._of_closures(form, added, added.first_rows)
        chained = [added for (name, _, wanted), added in self._known.items() if name == form and isinstance(wanted, int)]
        added = chained[0] if chained else self._increments(form, 0.0, "parts")
        return self._of_closures(form, added, added.other_rows)

    def chained_closures(self, window: int) -> Estimate[FloatArray]:
        added = self._increments("joint", 0.0, window)
        return self._of_closures("joint", added, added.chained)

    def knows(self, form: FormName) -> bool:
        return (form, 0.0, "closures") in self._known or (form, 0.0, "parts") in self._known

    def _extended(self, form: FormName, shift: float, added: Increments, closures: FloatArray) -> Estimate[FloatArray]:
        """ln det of the prior extended by the forests of new poses, plus what closures are said to add."""
        prior = self._trusted(form, shift)
        return Estimate(prior.value + added.forest + closures, prior.error + added.error)

    def _of_closures(self, form: FormName, added: Increments, values: FloatArray) -> Estimate[FloatArray]:
        """Exactly 0 where there are none."""
        prior = self._trusted(form, 0.0)
        known = values if math.isfinite(prior.value) else np.full_like(values, np.nan)
        return Estimate(known, np.where(known == 0, 0.0, prior.error + added.error))

    def _trusted(self, form: FormName, shift: float) -> Estimate[float]:
        """ln det M of the prior with the error that all actions have in common; nan where that is too large."""
        factor = self._prior.factor(form, shift)
        value, error = factor.log_det.value, 2 * factor.log_det.error
        limit = _QR_ERROR if _is_small(factor) else _LARGEST_ERROR
        return Estimate(value if error <= limit else math.nan, error)

    def _increments(self, form: FormName, shift: float, wanted: Wanted = "closures") -> Increments:
        """What actions add to ln det of a form, by as little as is `wanted` of it."""
        if wanted == "closures" and (form, shift, "parts") in self._known:
            wanted = "parts"
        key = form, shift, wanted
        if key not in self._known:
            rows = form_of(form, self._batch)
            self._known[key] = log_det_increments(
                self._prior.factor(form, shift),
                self._batch.extensions,
                rows,
                shift=shift,
                wanted=wanted,
                first_rows=self._prior.graph.group.position_dim,
                wanted_of=self._cheaper(rows.block_size),
            )
        return self._known[key]

    def _cheaper(self, block_size: int) -> BoolArray:
        """Actions after which a log-determinant costs less by increments than by a new factor of the graph, shape (K,).

        The former takes a dense factor of m rows of closures, m^3; the latter grows with the graph.
        """
        num_rows = block_size * self._batch.num_closures
        return num_rows**3 <= _CUBES_A_VARIABLE * block_size * self._prior.graph.num_poses

    def _increments_of_new_poses(self, form: FormName) -> Increments:
        """Those of a computation of the whole form will do; without one, the prior need not be factored."""
        for wanted in ("closures", "parts"):
            if (form, 0.0, wanted) in self._known:
                return self._known[form, 0.0, wanted]
        rows = form_of(form, self._batch)
        return log_det_increments(None, self._batch.extensions, rows, wanted_of=self._cheaper(rows.block_size))

    def _known_of(self, form: FormName) -> Increments | None:
        """Any computation of a form so far."""
        return next((added for (name, shift, _), added in self._known.items() if name == form and not shift), None)


def _is_small(factor: FormFactor) -> bool:
    return factor.tree.num_free * factor.block_size <= _QR_SIZE
