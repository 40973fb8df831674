"""Numbers that know their rounding error: one, or one for each of K actions."""

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

MAX_RELATIVE_ERROR = 0.01
"""An expected error of the map, metres, that is not known to this part of itself is refused."""

Number = TypeVar("Number", float, FloatArray)
"""A float, or an array of shape (K,)."""


@dataclass(frozen=True, slots=True)
class Estimate(Generic[Number]):
    """A quantity and an estimate of its absolute rounding error.

    Attributes
    ----------
    value, error : float, or shape (K,)
        nan and inf where rounding leaves nothing.
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
        """Itself, if its error is small enough to mean anything; of K values, those that are not become nan.

        Raises
        ------
        IllConditionedError
            If the error of a single value exceeds `MAX_ERROR_NATS`; says of `what`.
        """
        return self._known(what, MAX_ERROR_NATS, "nats")

    def known_length(self, what: str) -> Estimate[Number]:
        """The same for a length of at least 0, metres: its error has to be small relative to itself.

        Raises
        ------
        IllConditionedError
            If the error of a single value exceeds `MAX_RELATIVE_ERROR` of it; says of `what`.
        """
        return self._known(what, MAX_RELATIVE_ERROR * abs(self.value), "m")

    def _known(self, what: str, limit: float | Number, unit: str) -> Estimate[Number]:
        if isinstance(self.value, np.ndarray):
            return Estimate(np.where(self.error <= limit, self.value, np.nan), self.error)
        if not self.error <= limit:
            raise IllConditionedError(what, float(self.error), unit=unit)
        return self

    def root(self) -> Estimate[Number]:
        """The square root of a quantity that is at least 0; |sqrt(x + e) - sqrt(x)| is at most sqrt(e) and e / sqrt(x)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.sqrt(np.maximum(self.value, 0.0))
            error = np.fmin(np.sqrt(self.error), np.divide(self.error, value)) + UNIT_ROUNDOFF * value
        if isinstance(self.value, np.ndarray):
            return Estimate(value, error)
        return Estimate(float(value), float(error))  # pyright: ignore[reportReturnType]  (a float is what Number is here)
