"""Derivatives of a solve that has not converged are NaN, and those of a loss that leaves it out are right."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel.refinement._trusted_gradient import trusted_gradient

CONVERGED = jnp.array([True, False, True])
AT = jnp.array([1.0, 2.0, 3.0])


def squares(x):
    """The squares of three frames, as if each were solved for; the second has not converged."""
    return jax.lax.map(
        lambda each: trusted_gradient(each[0] ** 2, each[1], {"x": each[0], "count": 3}), (x, CONVERGED), batch_size=2
    )


def trusted(x):
    return jnp.where(CONVERGED, squares(x), 0.0).sum()


@pytest.mark.parametrize("of", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("compiled", [lambda f: f, jax.jit], ids=["eager", "jit"])
def test_only_what_converged_has_derivatives(of, compiled):
    np.testing.assert_array_equal(compiled(squares)(AT), AT**2)
    slopes = np.asarray(compiled(of(squares))(AT))
    np.testing.assert_array_equal(np.isnan(slopes), np.diag(~np.asarray(CONVERGED)))
    np.testing.assert_allclose(np.diag(slopes)[[0, 2]], [2.0, 6.0])


@pytest.mark.parametrize("of", [jax.grad, jax.jacfwd])
def test_a_loss_that_leaves_it_out_has_the_right_gradient(of):
    np.testing.assert_allclose(jax.jit(of(trusted))(AT), [2.0, 0.0, 6.0])


def test_second_derivatives_too():
    curved = jax.jit(jax.hessian(lambda x: jnp.where(CONVERGED, squares(x) ** 2, 0.0).sum()))(AT)
    np.testing.assert_allclose(curved, np.diag([12.0, 0.0, 108.0]))


def test_several_weights_at_once():
    slopes = jax.jit(jax.vmap(jax.grad(lambda weight: trusted(weight * AT))))(jnp.array([1.0, 2.0]))
    np.testing.assert_allclose(slopes, [20.0, 40.0])


def test_changes_that_cancel_out_are_changes():
    def turned(angle):
        point = angle * jnp.array([1.0, -1.0])
        return trusted_gradient(point, jnp.asarray(False), point)

    assert np.isnan(jax.jacfwd(turned)(0.3)).all()
    assert np.isnan(jax.jacrev(turned)(0.3)).all()


def test_nothing_goes_through_what_has_not_converged():
    """The solve itself is given no NaN: its own derivative would refuse it."""

    @jax.custom_vjp
    def solve(x):
        return x**2

    seen = []
    solve.defvjp(lambda x: (x**2, x), lambda x, g: (seen.append(g), (2 * x * g,))[1])
    slope = jax.grad(lambda x: trusted_gradient(solve(x), jnp.asarray(False), x))(jnp.asarray(3.0))
    assert np.isnan(slope)
    assert [float(g) for g in seen] == [0.0]
