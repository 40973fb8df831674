"""Scans: what the beams met, and what a scan is not."""

from __future__ import annotations

import numpy as np
import pytest

from topobelief.errors import InvalidInputError
from topobelief.simulation.scan import Scan


def test_points_are_the_finite_returns_in_the_base_frame() -> None:
    scan = Scan(np.array([1.0, np.inf, 2.0, np.nan]), np.array([0.0, 0.5, np.pi / 2, 1.0]), time=3.0, max_range=5.0)
    np.testing.assert_allclose(scan.points, [[1, 0], [0, 2]], atol=1e-15)
    assert scan.hits.tolist() == [True, False, True, False]


def test_a_scan_without_returns_has_no_points() -> None:
    assert Scan(np.full(3, np.nan), np.arange(3.0), time=0.0, max_range=5.0).points.shape == (0, 2)


def test_a_scan_keeps_its_own_copy() -> None:
    ranges = np.ones(2)
    scan = Scan(ranges, np.zeros(2), time=0.0, max_range=5.0)
    ranges[0] = 4.0
    assert scan.ranges.tolist() == [1.0, 1.0]
    with pytest.raises(ValueError, match="read-only"):
        scan.ranges[0] = 2.0


@pytest.mark.parametrize(
    ("ranges", "angles", "message"),
    [
        ([1.0, 2.0], [0.0], r"expected a range for each angle, shapes \(B,\), got \(2,\) and \(1,\)"),
        ([1.0], [np.nan], "expected finite angles, got nan"),
        ([1.0, -0.1], [0.0, 1.0], r"expected ranges from 0 to 5 m, inf or nan, got -0.1 at beam 1"),
        ([5.1], [0.0], "got 5.1 at beam 0"),
    ],
)
def test_what_is_no_scan_is_refused(ranges: list[float], angles: list[float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        Scan(np.array(ranges), np.array(angles), time=0.0, max_range=5.0)
