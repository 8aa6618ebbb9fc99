"""A function to compile and keep, and a folder to keep it in."""

from collections.abc import Callable, Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from jaxskel.body import Pose

TRACED: list[str] = []


def solved(matrix: jax.Array, right: Pose, times: int = 1, norm: Callable = optx.max_norm) -> dict[str, Pose]:
    """Has a Cholesky decomposition, a tree of arguments and a tree of results."""
    TRACED.append("solved")
    factor = jax.scipy.linalg.cho_factor(matrix)
    root = times * jax.scipy.linalg.cho_solve(factor, jnp.asarray(right.root))
    return {"pose": Pose(root, norm(matrix) * jnp.asarray(right.rotations))}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> Iterator[Path]:
    """JAX told to keep what it compiles, though only we do: it remembers its first folder for good."""
    before = jax.config.jax_compilation_cache_dir, jax.config.jax_enable_compilation_cache  # pyright: ignore
    jax.config.update("jax_enable_compilation_cache", False)
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    TRACED.clear()
    yield tmp_path / "jaxskel"
    jax.config.update("jax_compilation_cache_dir", before[0])
    jax.config.update("jax_enable_compilation_cache", before[1])


def given(n: int = 3) -> tuple[np.ndarray, Pose]:
    rng = np.random.default_rng(n)
    matrix = rng.normal(size=(n, n)).astype(np.float32)
    return matrix @ matrix.T + np.eye(n, dtype=np.float32), Pose(
        rng.normal(size=(n, 3)).astype(np.float32), rng.normal(size=(n, 17, 3, 3)).astype(np.float32)
    )


def same(one: dict[str, Pose], other: dict[str, Pose]) -> bool:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    return all(np.array_equal(a, b) for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True))
