"""Numbers with estimates of their rounding errors: one number, or one for each of K actions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import IllConditionedError

LOG_2_PI_E = math.log(2 * math.pi * math.e)

UNIT_ROUNDOFF = float(np.finfo(np.float64).eps) / 2

MAX_ERROR_NATS = 0.1
"""An entropy or a signature that is not known to this is refused: it could not rank candidates."""

Number = TypeVar("Number", float, FloatArray)
"""A float, or an array of shape (K,)."""


@dataclass(frozen=True, slots=True)
class Estimate(Generic[Number]):
    """A quantity and an estimate of its absolute rounding error.

    Attributes
    ----------
    value, error : float, or shape (K,)
        nan and inf where rounding leaves no digit.
    """

    value: Number
    error: Number

    __array_ufunc__: ClassVar[None] = None  # array * Estimate is for `__rmul__`

    def __add__(self, other: Estimate[Number]) -> Estimate[Number]:
        return Estimate(self.value + other.value, self.error + other.error)

    def __sub__(self, other: Estimate[Number]) -> Estimate[Number]:
        return Estimate(self.value - other.value, self.error + other.error)

    def __rmul__(self, factor: float | Number) -> Estimate[Number]:
        return Estimate(factor * self.value, abs(factor) * self.error)

    def plus(self, constant: float | Number) -> Estimate[Number]:
        """A constant added, with the rounding that the sum costs."""
        value = self.value + constant
        return Estimate(value, self.error + UNIT_ROUNDOFF * (abs(constant) + abs(self.value) + abs(value)))

    def known(self, what: str) -> Estimate[Number]:
        """Itself, if its error is small enough; of K values, those with larger errors become nan.

        Raises
        ------
        IllConditionedError
            If the error of a single value exceeds `MAX_ERROR_NATS`; says of `what`.
        """
        if isinstance(self.value, np.ndarray):
            return Estimate(np.where(self.error <= MAX_ERROR_NATS, self.value, np.nan), self.error)
        if not self.error <= MAX_ERROR_NATS:
            raise IllConditionedError(what, float(self.error))
        return self
