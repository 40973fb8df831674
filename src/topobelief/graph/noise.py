"""The noise of relative measurements in the plane by two standard deviations, and the information that goes with it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.graph.information import block_isotropic


@dataclass(frozen=True, slots=True)
class Noise:
    """N(0, diag(sigma_p², sigma_p², sigma_theta²)) in the tangent at the measured pose.

    Attributes
    ----------
    sigma_p, sigma_theta
        Metres and radians.

    Raises
    ------
    InvalidInputError
        For a standard deviation that is not above 0.
    """

    sigma_p: float
    sigma_theta: float

    def __post_init__(self) -> None:
        if not (0 < self.sigma_p < math.inf and 0 < self.sigma_theta < math.inf):
            raise InvalidInputError(
                f"expected standard deviations above 0, got sigma_p = {self.sigma_p:g} and sigma_theta = {self.sigma_theta:g}"
            )

    @classmethod
    def of_ratio(cls, xi: float, *, sigma_p: float = 0.1) -> Self:
        """The noise of a ratio xi = sigma_theta / sigma_p, rad/m."""
        return cls(sigma_p, xi * sigma_p)

    @property
    def xi(self) -> float:
        """sigma_theta / sigma_p, rad/m; ξ of the paper."""
        return self.sigma_theta / self.sigma_p

    @property
    def information(self) -> FloatArray:
        """Shape (3, 3)."""
        return block_isotropic(self.sigma_p, self.sigma_theta)
