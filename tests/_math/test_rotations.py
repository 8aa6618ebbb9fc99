import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel._math.rotations import aligning, exponential, frame, turn_about

VECTORS = {
    "random": np.random.default_rng(0).normal(size=(20, 3)),
    "tiny": 1e-5 * np.random.default_rng(1).normal(size=(20, 3)),
    "where the series ends": 1e-4 * np.array([[0.999, 0, 0], [0, 1.001, 0]]),
    "half turn": np.pi * np.eye(3),
    "more than a turn": np.array([[0.0, 7.0, 0.0]]),
    "zero": np.zeros((1, 3)),
}


@pytest.mark.parametrize("vectors", VECTORS)
def test_exponential_is_scipys(vectors):
    expected = Rotation.from_rotvec(VECTORS[vectors]).as_matrix()
    with jax.enable_x64(True):
        np.testing.assert_allclose(jax.jit(exponential)(jnp.asarray(VECTORS[vectors])), expected, atol=1e-12)
    single = jax.jit(exponential)(jnp.asarray(VECTORS[vectors], jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, expected, atol=1e-6)


@pytest.mark.slow
def test_exponential_is_smooth_at_zero():
    derivative = jax.jacfwd(exponential)(jnp.zeros(3))
    # The generators of rotations: d R / d x_k has the entries -epsilon_ijk.
    epsilon = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        epsilon[i, j, k], epsilon[j, i, k] = 1.0, -1.0
    np.testing.assert_allclose(derivative, -epsilon, atol=1e-7)
    np.testing.assert_allclose(jax.jacrev(exponential)(jnp.zeros(3)), -epsilon, atol=1e-7)
    second = jax.hessian(lambda v: exponential(v)[0, 0])(jnp.zeros(3))
    np.testing.assert_allclose(second, np.diag([0.0, -1.0, -1.0]), atol=1e-6)


def test_aligning_takes_start_to_goal_by_the_smallest_turn():
    rng = np.random.default_rng(4)
    start, goal = rng.normal(size=(2, 40, 3))
    start /= np.linalg.norm(start, axis=1, keepdims=True)
    goal /= np.linalg.norm(goal, axis=1, keepdims=True)
    goal[:10] = -start[:10]  # opposite
    goal[10:13] = start[10:13]  # the same
    goal[13:16] = -start[13:16] + 4e-3 * goal[13:16]  # nearly opposite
    goal[16:19] = -start[16:19] + 1e-4 * goal[16:19]  # so nearly that the axis is arbitrary
    goal /= np.linalg.norm(goal, axis=1, keepdims=True)
    turn = aligning(start, goal)
    turned = np.einsum("nij,nj->ni", turn, start)
    np.testing.assert_allclose(turned[16:19], goal[16:19], atol=2e-4)
    np.testing.assert_allclose(np.delete(turned, np.s_[16:19], 0), np.delete(goal, np.s_[16:19], 0), atol=1e-6)
    np.testing.assert_allclose(turn @ turn.swapaxes(1, 2), np.tile(np.eye(3), (40, 1, 1)), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(turn), 1.0, atol=1e-6)
    angle = np.arccos(np.clip((start * goal).sum(1), -1, 1))
    np.testing.assert_allclose(Rotation.from_matrix(turn).magnitude(), angle, atol=2e-4)
    np.testing.assert_allclose(aligning(np.eye(3)[0], np.eye(3)[1]), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


def test_frame_by_hand():
    # Leaning to the front by 45 degrees, with a left that is not quite across.
    up, left = np.array([1.0, 0.0, 1.0]), np.array([0.3, 1.0, 0.3])
    r = np.sqrt(0.5)
    np.testing.assert_allclose(frame(up, left), [[r, 0, r], [0, 1, 0], [-r, 0, r]], atol=1e-12)


def test_turn_about_is_scipys():
    rng = np.random.default_rng(5)
    axes, angles = rng.normal(size=(20, 3)), rng.uniform(-4, 4, 20)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    expected = Rotation.from_rotvec(angles[:, None] * axes).as_matrix()
    np.testing.assert_allclose(turn_about(axes, angles), expected, atol=1e-12)
