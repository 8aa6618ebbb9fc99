"""Residuals of rays: what is drawn from noise and depths is told apart again, and a bias of the rig is found."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import exponnorm

from jaxskel._camera_step import OneSided
from jaxskel._frontier import _DEPTHS, Frontier, fit_frontier

NOISE = 0.25
KINDS = len(_DEPTHS) + 1


def drawn(depth: float, count: int = 40_000, wrong: int = 0) -> np.ndarray:
    rng = np.random.default_rng(0)
    right = rng.normal(0, NOISE, count) - rng.exponential(depth, count)
    return np.concatenate([right, rng.uniform(-30, 30, wrong)])


def only(kind: int) -> Frontier:
    return Frontier(np.array(NOISE), np.eye(KINDS)[kind])


@pytest.mark.parametrize("depth", [0.3, 0.5])
def test_noise_and_depths_of_a_tight_hull_are_found(depth):
    found = fit_frontier(drawn(depth))
    assert found.noise == pytest.approx(NOISE, rel=0.05)
    assert found.shares.sum() == pytest.approx(1)
    assert found.shares[:-1] @ _DEPTHS == pytest.approx(depth, rel=0.1)
    assert found.tight


@pytest.mark.parametrize("depth", [3.0, 10.0])
def test_a_wide_hull_is_told_from_a_tight_one(depth):
    found = fit_frontier(drawn(depth))
    # Few rays are near the surface, of which alone noise is seen.
    assert found.shares[:-1] @ _DEPTHS == pytest.approx(depth, rel=0.1)
    assert not found.tight


def test_wrong_masks_are_set_apart():
    found = fit_frontier(drawn(0.3, 9_000, wrong=1_000))
    # Half of those that are wrong look like deep rays.
    assert 0.04 < found.shares[-1] < 0.12
    assert found.noise == pytest.approx(NOISE, rel=0.2)


@pytest.mark.parametrize("kind", [1, 3])
def test_slopes_and_curvatures_are_those_of_the_density(kind):
    # SciPy has the distribution the other way round: normal plus exponential.
    depth, at = _DEPTHS[kind], np.linspace(-3, 1, 9)
    with jax.enable_x64(True):
        found = jax.tree.map(np.asarray, only(kind).pull(jnp.asarray(at)))
    step = 1e-4
    low, middle, high = (exponnorm.logpdf(-(at + by), depth / NOISE, scale=NOISE) for by in (-step, 0, step))
    np.testing.assert_allclose(found.slope, (high - low) / (2 * step), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(found.curvature, -(high - 2 * middle + low) / step**2, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("kind", [0, 2])
def test_true_residuals_pull_nowhere_on_average(kind):
    depth = _DEPTHS[kind]

    def drawn_by(residual: float) -> float:
        with jax.enable_x64(True):
            slope = only(kind).pull(jnp.array([residual])).slope[0]
        return float(slope) * exponnorm.pdf(-residual, depth / NOISE, scale=NOISE)

    assert quad(drawn_by, -12 * depth - 5, 3, limit=200)[0] == pytest.approx(0, abs=1e-4)


def test_a_wide_hull_is_evidence_on_one_side_only():
    with jax.enable_x64(True):
        found = jax.tree.map(np.asarray, OneSided(np.array(0.5)).pull(jnp.array([-5.0, 0.1, 0.75, 50.0])))
    # A quarter of a pixel is forgiven: half a pixel is left, a deviation, and weighs 1 / (1 + (1.5 / 3)^2)^2 of 4.
    np.testing.assert_allclose(found.slope[:3], [0, 0, -0.5 * 4 * 0.64])
    np.testing.assert_array_equal(found.curvature[:2], 0)
    assert 0 < -found.slope[3] < 0.01
