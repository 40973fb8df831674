"""The laws of SE(2) and SE(3), near the identity and near half a turn too, against homogeneous matrices."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from topobelief.errors import InvalidInputError
from topobelief.geometry import SE2_GROUP, SE3_GROUP, group_of_size

GROUPS = (SE2_GROUP, SE3_GROUP)
BY_NAME = pytest.mark.parametrize("group", GROUPS, ids=lambda group: group.name)

angles = st.one_of(
    st.floats(-math.pi, math.pi),
    st.floats(-12, -3).map(lambda decade: 10**decade),  # near the identity
    st.floats(-12, -3).map(lambda decade: math.pi - 10**decade),  # near half a turn
    st.sampled_from([0.0, 1e-4, 1e-3, -1e-3, math.pi / 2, -math.pi, math.nextafter(math.pi, 0.0)]),
)
seeds = st.integers(0, 2**32 - 1)
lengths = st.sampled_from([0.0, 1e-6, 1.0, 1e3])


def tangent(group, angle, length, seed):
    """A twist that turns by `angle` about a random axis."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=group.rotation_dim)
    axis = np.ones(1) if group is SE2_GROUP else axis / np.linalg.norm(axis)
    return np.concatenate([length * rng.normal(size=group.position_dim), angle * axis])


@st.composite
def twists(draw, group):
    return tangent(group, draw(angles), draw(lengths), draw(seeds))


@st.composite
def poses(draw, group):
    return group.exp(draw(twists(group)))


def matrix(group, pose):
    """Homogeneous matrix, from scratch."""
    k = group.position_dim
    result = np.eye(k + 1)
    result[:k, k] = pose[:k]
    if group is SE2_GROUP:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        result[:2, :2] = [[c, -s], [s, c]]
    else:
        result[:3, :3] = Rotation.from_quat(pose[3:]).as_matrix()
    return result


def twist_matrix(group, t):
    """The Lie algebra element of a tangent."""
    if group is SE2_GROUP:
        return np.array([[0, -t[2], t[0]], [t[2], 0, t[1]], [0, 0, 0]])
    x, y, z = t[3:]
    return np.array([[0, -z, y, t[0]], [z, 0, -x, t[1]], [-y, x, 0, t[2]], [0, 0, 0, 0]])


def assert_same(group, a, b, *, tolerance=1e-12):
    """The same motion, to rounding at the size of its translation."""
    size = 1 + np.linalg.norm(a[: group.position_dim]) + np.linalg.norm(b[: group.position_dim])
    assert np.abs(matrix(group, a) - matrix(group, b)).max() <= tolerance * size


@BY_NAME
def test_dimensions_add_up(group):
    k, q = group.position_dim, group.rotation_dim
    assert (group.tangent_dim, group.identity().shape) == (k + q, (group.pose_size,))
    assert group_of_size(group.pose_size) is group


def test_poses_of_another_size_belong_to_no_group():
    with pytest.raises(InvalidInputError, match=r"expected poses with 3 columns .* or 7 .*, got 4"):
        group_of_size(4)


@BY_NAME
@given(data=st.data())
def test_composition_is_the_product_of_matrices(group, data):
    a, b = data.draw(poses(group)), data.draw(poses(group))
    size = 1 + np.abs(a[: group.position_dim]).max() + np.abs(b[: group.position_dim]).max()
    product = matrix(group, a) @ matrix(group, b)
    assert np.abs(matrix(group, group.compose(a, b)) - product).max() <= 1e-13 * size


@BY_NAME
@given(data=st.data())
def test_composition_is_associative_with_identity_and_inverse(group, data):
    a, b, c = (data.draw(poses(group)) for _ in range(3))
    assert_same(group, group.compose(group.compose(a, b), c), group.compose(a, group.compose(b, c)))
    assert_same(group, group.compose(a, group.identity()), a)
    assert_same(group, group.compose(group.identity(), a), a)
    assert_same(group, group.compose(a, group.inverse(a)), group.identity(), tolerance=1e-12 * (1 + np.abs(a).max()))
    assert_same(group, group.inverse(group.inverse(a)), a)


@BY_NAME
@given(data=st.data())
def test_between_is_what_leads_from_one_pose_to_the_other(group, data):
    a, b = data.draw(poses(group)), data.draw(poses(group))
    assert_same(group, group.between(a, group.compose(a, b)), b, tolerance=1e-12 * (1 + np.abs(a).max()))
    assert_same(group, group.compose(a, group.between(a, b)), b, tolerance=1e-12 * (1 + np.abs(a).max()))


@BY_NAME
@given(data=st.data())
def test_exp_is_the_matrix_exponential(group, data):
    t = data.draw(twists(group))
    expected = expm(twist_matrix(group, t))
    assert np.abs(matrix(group, group.exp(t)) - expected).max() <= 1e-13 * (1 + np.abs(t).max())


@BY_NAME
@given(data=st.data())
def test_log_undoes_exp(group, data):
    t = data.draw(twists(group))
    back = group.log(group.exp(t))
    angle = np.linalg.norm(t[group.position_dim :])
    assert np.linalg.norm(back[group.position_dim :]) <= math.pi + 1e-15
    if angle < math.pi - 1e-9:
        assert np.abs(back - t).max() <= 1e-11 * (1 + np.abs(t).max())
    assert_same(group, group.exp(back), group.exp(t), tolerance=1e-11)


@BY_NAME
@given(data=st.data())
def test_exp_undoes_log(group, data):
    pose = data.draw(poses(group))
    assert_same(group, group.exp(group.log(pose)), pose, tolerance=1e-12)


@BY_NAME
@given(data=st.data())
def test_tiny_angles_survive_with_relative_precision(group, data):
    t = tangent(group, 10 ** data.draw(st.floats(-15, -5)), 1.0, data.draw(seeds))
    back = group.log(group.exp(t))
    rotation = slice(group.position_dim, None)
    assert np.abs(back[rotation] - t[rotation]).max() <= 1e-12 * np.abs(t[rotation]).max()


@BY_NAME
@given(data=st.data())
def test_adjoint_moves_a_twist_across_a_pose(group, data):
    pose, other = data.draw(poses(group)), data.draw(poses(group))
    t = tangent(group, data.draw(st.floats(-1, 1)), 1.0, data.draw(seeds))
    size = 1 + np.abs(pose).max()
    assert_same(
        group,
        group.compose(pose, group.exp(t)),
        group.compose(group.exp(group.adjoint(pose) @ t), pose),
        tolerance=1e-12 * size,
    )
    product = group.adjoint(pose) @ group.adjoint(other)
    assert np.abs(group.adjoint(group.compose(pose, other)) - product).max() <= 1e-12 * size * (1 + np.abs(other).max())
    assert np.linalg.det(group.adjoint(pose)) == pytest.approx(1, abs=1e-9)


@BY_NAME
@given(data=st.data())
def test_rotations_agree_with_an_independent_library(group, data):
    pose = data.draw(poses(group))
    R = group.rotation_matrix(pose)
    assert np.abs(R - matrix(group, pose)[:-1, :-1]).max() <= 1e-15 * 8
    vector = group.rotation_vector(pose)
    expected = pose[2:] if group is SE2_GROUP else Rotation.from_quat(pose[3:]).as_rotvec()
    if np.linalg.norm(expected) < math.pi - 1e-9:
        assert np.abs(vector - expected).max() <= 1e-14


@BY_NAME
@given(data=st.data())
def test_lever_is_minus_the_cross_product(group, data):
    rng = np.random.default_rng(data.draw(seeds))
    d, phi = rng.normal(size=(5, group.position_dim)), rng.normal(size=(5, group.rotation_dim))
    crossed = phi * np.column_stack([-d[:, 1], d[:, 0]]) if group is SE2_GROUP else np.cross(phi, d)
    assert np.allclose((group.lever(d) @ phi[..., None])[..., 0], -crossed, rtol=0, atol=1e-15)


@BY_NAME
@given(data=st.data())
def test_canonical_poses_are_the_same_motions(group, data):
    pose = data.draw(poses(group))
    if group is SE2_GROUP:
        other = pose + np.array([0, 0, 2 * math.pi * data.draw(st.integers(-3, 3))])
        canonical = group.normalized(other)
        assert -math.pi <= canonical[2] < math.pi
    else:
        other = np.concatenate([pose[:3], data.draw(st.sampled_from([-3.0, -1.0, 0.1, 7.0])) * pose[3:]])
        canonical = group.normalized(other)
        assert canonical[6] >= 0
        assert np.linalg.norm(canonical[3:]) == pytest.approx(1, abs=4e-16)
    assert_same(group, canonical, pose, tolerance=4e-15)
    assert np.array_equal(group.normalized(canonical), canonical)


@pytest.mark.parametrize(
    "angle",
    [math.pi, -math.pi, math.nextafter(-math.pi, -4), math.nextafter(math.pi, 4), 3 * math.pi, -3 * math.pi, 1e6, -1e6],
)
def test_angles_come_out_below_pi_however_close(angle):
    wrapped = SE2_GROUP.normalized(np.array([0.0, 0.0, angle]))[2]
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@BY_NAME
@given(data=st.data())
def test_residual_is_zero_where_prediction_and_measurement_agree_and_linear_nearby(group, data):
    measured = data.draw(poses(group))
    k = group.position_dim
    size = 1 + np.abs(measured[:k]).max()
    assert np.abs(group.residual(measured, measured)).max() <= 1e-12 * size
    t = 1e-6 * tangent(group, 1.0, 1.0, data.draw(seeds))
    assert np.abs(group.residual(measured, group.compose(measured, group.exp(t))) - t).max() <= 1e-11 * size


@BY_NAME
def test_operations_broadcast_over_leading_axes(group):
    rng = np.random.default_rng(0)
    twists_ = rng.normal(size=(4, 1, group.tangent_dim))
    a, b = group.exp(twists_), group.exp(rng.normal(size=(5, group.tangent_dim)))
    for operation in (group.compose, group.between, group.residual):
        together = operation(a, b)
        assert together.shape[:2] == (4, 5)
        assert np.allclose(together[2, 3], operation(a[2, 0], b[3]), rtol=0, atol=1e-14)
    for operation in (group.inverse, group.log, group.adjoint, group.rotation_matrix, group.rotation_vector, group.normalized):
        assert np.allclose(operation(a)[3, 0], operation(a[3, 0]), rtol=0, atol=1e-14)


@BY_NAME
def test_operations_leave_their_arguments_alone(group):
    rng = np.random.default_rng(1)
    t = rng.normal(size=(3, group.tangent_dim))
    pose = group.exp(t)
    pose[:, group.position_dim :] *= 1.0 if group is SE3_GROUP else 3.0
    for array in (t, pose):
        array.flags.writeable = False
    group.compose(pose, pose)
    group.exp(t)
    group.log(pose)
    group.normalized(pose)
    group.adjoint(pose)
    group.lever(group.position(pose))
