"""Noise added to registered factors, so that its level changes the graph and not the driving.

The levels are those of Kitanov and Indelman (arXiv 1903.00927): sigma_p = 0.1 m and xi = sigma_theta / sigma_p of 0.1, 0.35 and
0.85 rad/m. `physical` adds nothing: there slip, encoders and the laser are all the noise there is.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from topobelief.arrays import FloatArray
from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.graph.noise import Noise
from topobelief.simulation.factor import Factor

PHYSICAL = "physical"


class InjectedNoise(Noise):
    """Noise that is drawn and added to measurements."""

    __slots__ = ()

    def disturbed(self, measurements: FloatArray, *, rng: np.random.Generator) -> FloatArray:
        """Measurements with noise, shape (..., 3)."""
        tangent = rng.standard_normal(measurements.shape) * (self.sigma_p, self.sigma_p, self.sigma_theta)
        return SE2_GROUP.compose(measurements, SE2_GROUP.exp(tangent))

    def added_to(self, factor: Factor, *, rng: np.random.Generator) -> Factor:
        """The factor with noise in its measurement, and this noise as its information."""
        return replace(factor, measurement=self.disturbed(factor.measurement, rng=rng), information=self.information)


def parse_noise(text: str) -> InjectedNoise | None:
    """`physical` (None), a ratio xi, or `sigma_p,sigma_theta`.

    Raises
    ------
    InvalidInputError
        For anything else.
    """
    if text == PHYSICAL:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    match numbers:
        case [xi]:
            return InjectedNoise.of_ratio(xi)
        case [sigma_p, sigma_theta]:
            return InjectedNoise(sigma_p, sigma_theta)
        case _:
            raise InvalidInputError(
                f'expected noise as "physical", a ratio such as 0.35, or "sigma_p,sigma_theta" in m and rad, got {text!r}'
            )
