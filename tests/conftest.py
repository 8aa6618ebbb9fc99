import jax
import pytest


@pytest.fixture(autouse=True, scope="session")
def no_silent_broadcasting():
    """The classic bug of geometry: a vector meets a stack of vectors, and every shape still fits."""
    jax.config.update("jax_numpy_rank_promotion", "raise")
