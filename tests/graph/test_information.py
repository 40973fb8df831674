"""Information matrices: what is refused, and how the theory describes the rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graphs import NOISES, SE2_GROUP, SE3_GROUP, Noise, noises
from topobelief.errors import InvalidGraphError
from topobelief.graph.information import (
    block_isotropic,
    checked_information,
    isotropic_weights,
    rotation_information_given_position,
    scalar_weights,
    shared_information,
    tangent_split,
)

EYE = np.eye(3)


def with_entry(row, column, value):
    matrix = np.tile(EYE, (4, 1, 1))
    matrix[2, row, column] = matrix[2, column, row] = value
    return matrix


@pytest.mark.parametrize(
    ("information", "message"),
    [
        (with_entry(0, 0, np.nan), "expected a finite information matrix, got nan or inf at edge 2"),
        (with_entry(1, 2, np.inf), "expected a finite information matrix, got nan or inf at edge 2"),
        (with_entry(1, 1, 0.0), "got an indefinite or singular one at edge 2"),
        (with_entry(1, 1, -1.0), "got an indefinite or singular one at edge 2"),
        (with_entry(0, 1, 1.0), "got an indefinite or singular one at edge 2"),
        (with_entry(0, 1, 3.0), "got an indefinite or singular one at edge 2"),
        (np.zeros((4, 3, 3)), "got an indefinite or singular one at edge 0"),
        (
            np.array([[1, 1e-3, 0], [0, 1, 0], [0, 0, 1]]),
            "expected a symmetric information matrix, got an asymmetric one at edge 0",
        ),
        (
            np.ones((3, 3, 3)),
            r"expected information of shape \(4, 3, 3\) or \(3, 3\) \(one matrix for all edges\), got \(3, 3, 3\)",
        ),
        (np.eye(6), r"expected information of shape \(4, 3, 3\) or \(3, 3\).*got \(6, 6\)"),
        (2.0, r"expected information of shape .*got \(\)"),
    ],
)
def test_bad_matrices_are_refused_by_edge(information, message):
    with pytest.raises(InvalidGraphError, match=message):
        checked_information(information, num_edges=4, tangent_dim=3)


def test_badly_scaled_matrices_are_accepted():
    badly_scaled = np.diag([1e12, 1e-12, 1.0])
    assert np.array_equal(checked_information(badly_scaled, num_edges=2, tangent_dim=3), [badly_scaled, badly_scaled])


def test_one_matrix_serves_all_edges_and_is_read_only():
    shared = checked_information(2 * EYE, num_edges=5, tangent_dim=3)
    assert shared.shape == (5, 3, 3)
    with pytest.raises(ValueError, match="read-only"):
        shared[0, 0, 0] = 1


@pytest.mark.parametrize("empty", [EYE, np.zeros((0, 3, 3)), []], ids=["one matrix", "no matrices", "empty list"])
def test_no_edges_need_no_information(empty):
    assert checked_information(empty, num_edges=0, tangent_dim=3).shape == (0, 3, 3)


def test_tangents_of_other_sizes_are_refused():
    assert (tangent_split(3), tangent_split(6)) == ((2, 1), (3, 3))
    with pytest.raises(InvalidGraphError, match=r"expected information matrices of size 3 \(SE\(2\)\) or 6 \(SE\(3\)\), got 4"):
        tangent_split(4)


@given(noises(), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_kinds_of_noise_are_recognised(noise, count, seed):
    rng = np.random.default_rng(seed)
    information = noise.draw(rng, count)
    k = noise.group.position_dim
    weights = isotropic_weights(information)
    if noise.kind == "full":
        assert weights is None
    else:
        assert weights is not None
        assert np.array_equal(weights[0], information[:, 0, 0])
        assert np.array_equal(weights[1], information[:, k, k])
    shared = shared_information(information)
    if noise.kind == "equal" or count == 1:
        assert shared is not None
        assert np.array_equal(shared, information[0])
    else:
        assert shared is None


@given(noises(), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_what_is_left_of_rotations_is_a_block_of_the_inverse(noise, count, seed):
    """The Schur complement is the inverse of the covariance's rotation block, and the scalar weights split |Omega|."""
    information = noise.draw(np.random.default_rng(seed), count)
    k, q = noise.group.position_dim, noise.group.rotation_dim
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2))
    covariance = np.linalg.inv(information / (scale[:, :, None] * scale[:, None, :])) / (scale[:, :, None] * scale[:, None, :])
    expected = np.linalg.inv(covariance[:, k:, k:] * scale[:, None, k:] * scale[:, k:, None])
    found = rotation_information_given_position(information) / (scale[:, None, k:] * scale[:, k:, None])
    assert np.allclose(found, expected, rtol=1e-8, atol=1e-10)
    w_p, w_r = scalar_weights(information)
    log_det = np.linalg.slogdet(information / (scale[:, :, None] * scale[:, None, :]))[1] + 2 * np.log(scale).sum(axis=1)
    assert np.allclose(k * np.log(w_p) + q * np.log(w_r), log_det, rtol=1e-10, atol=1e-8)
    assert np.allclose(k * np.log(w_p), np.linalg.slogdet(information[:, :k, :k])[1], rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("group", [SE2_GROUP, SE3_GROUP], ids=lambda group: group.name)
def test_a_correlation_between_position_and_rotation_is_not_isotropy(group):
    information = np.tile(np.eye(group.tangent_dim), (3, 1, 1))
    information[1, 0, -1] = information[1, -1, 0] = 1e-6
    assert isotropic_weights(information) is None


def test_strategies_draw_what_they_say():
    """The strategies' own check: definite matrices, and xi times the edge length where it was asked for."""
    rng = np.random.default_rng(0)
    for group in (SE2_GROUP, SE3_GROUP):
        for kind in NOISES:
            noise = Noise(group, kind, position_weight=4.0, ratio=10.0, length=5.0)
            assert np.linalg.eigvalsh(noise.draw(rng, 50)).min() > 0
    w_p, w_r = isotropic_weights(Noise(SE3_GROUP, "equal", 4.0, 10.0, 5.0).draw(rng, 1))
    assert 5.0 * np.sqrt(w_p / w_r) == pytest.approx(10.0)


@pytest.mark.parametrize(("tangent_dim", "expected"), [(3, [4, 4, 16]), (6, [4, 4, 4, 16, 16, 16])])
def test_block_isotropic_noise_is_inverse_variances_on_the_diagonal(tangent_dim, expected):
    assert np.array_equal(block_isotropic(0.5, 0.25, tangent_dim=tangent_dim), np.diag(expected))
