"""Injected noise has the covariance that it says, in the tangent at the measured pose."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP
from topobelief.simulation.noise import InjectedNoise, parse_noise


def test_noise_has_its_covariance_in_the_frame_of_the_measured_pose():
    noise = InjectedNoise.of_ratio(0.35)
    measured = np.tile([3.0, -1.0, 2.0], (20000, 1))
    disturbed = noise.disturbed(measured, rng=np.random.default_rng(0))
    tangents = SE2_GROUP.log(SE2_GROUP.between(measured, disturbed))
    np.testing.assert_allclose(np.cov(tangents.T), np.linalg.inv(noise.information), atol=3e-4)
    np.testing.assert_allclose(tangents.mean(axis=0), 0, atol=3e-3)


def test_the_first_rows_of_a_draw_do_not_depend_on_how_many_follow():
    noise = InjectedNoise.of_ratio(0.1)
    short, long = (noise.disturbed(np.zeros((size, 3)), rng=np.random.default_rng(7)) for size in (4, 9))
    np.testing.assert_array_equal(short, long[:4])


def test_noise_in_words():
    assert parse_noise("physical") is None
    assert parse_noise("0.35") == InjectedNoise(0.1, 0.35 * 0.1)
    assert parse_noise("0.2,0.01") == InjectedNoise(0.2, 0.01)
    assert parse_noise("0.85").xi == pytest.approx(0.85)


@pytest.mark.parametrize("text", ["loud", "1,2,3", "", "0", "-0.1", "0.1,0", "nan"])
def test_other_words_are_refused(text):
    with pytest.raises(InvalidInputError, match="expected"):
        parse_noise(text)
