"""The projection that takes out rigid motions of all positions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from references import alignment_reference
from topobelief.graph.alignment import Alignment, sample_of


@given(st.integers(1, 8), st.sampled_from([2, 3]), st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_it_is_a_projection_that_no_rigid_motion_survives(count, k, decades, seed):
    positions = 10**decades * np.random.default_rng(seed).normal(size=(count, k)) + 3.0
    projection = Alignment.of(positions, 500).projection.columns(k).reshape(count * k, count * k)
    np.testing.assert_allclose(projection, alignment_reference(positions), atol=1e-9)
    np.testing.assert_allclose(projection @ projection, projection, atol=1e-12)
    moved = np.tile(np.eye(k), (count, 1))
    np.testing.assert_allclose(projection @ moved, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("k", "positions", "turns"), [(2, [[1, 1]] * 3, 0), (3, [[1, 1, 1], [2, 2, 2], [4, 4, 4]], 2), (3, np.eye(3), 3)]
)
def test_turns_that_move_nothing_are_left_out(k, positions, turns):
    found = Alignment.of(np.array(positions, dtype=float), 500)
    assert found.turns.shape == (3, k, turns)


def test_other_variables_of_a_pose_are_not_seen():
    columns = Alignment.of(np.eye(3)[:, :2], 500).projection.columns(3)
    assert columns.shape == (3, 3, 6)
    assert not columns[:, 2].any()


def test_a_sample_is_evenly_spaced_and_has_both_ends():
    assert sample_of(5, 500).tolist() == [0, 1, 2, 3, 4]
    assert sample_of(10, 4).tolist() == [0, 3, 6, 9]
    assert sample_of(1, 500).tolist() == [0]
