"""Compiled functions from the disk are those that were compiled, and are found only where they are the same."""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from jaxskel import _kept
from jaxskel._kept import Kept
from jaxskel._skeleton import Pose

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


def test_a_function_from_the_disk_is_not_traced_and_gives_the_same(folder: Path):
    first = Kept(solved)(*given())
    assert same(first, eqx.filter_jit(solved)(*given()))
    assert len(list(folder.iterdir())) == 1
    TRACED.clear()
    again = Kept(solved)
    assert same(again(*given()), first)
    assert same(again(*given()), first)
    assert TRACED == []


@pytest.mark.parametrize("value", [2, True, 1.0])
def test_other_static_values_are_other_functions(value):
    Kept(solved)(*given())
    TRACED.clear()
    found = Kept(solved)(*given(), value)
    assert len(TRACED) == 1
    np.testing.assert_allclose(found["pose"].root, solved(*given(), value)["pose"].root, rtol=1e-5)


def test_other_shapes_types_switches_and_code_are_other_functions(monkeypatch: pytest.MonkeyPatch):
    function = Kept(solved)
    function(*given())
    TRACED.clear()
    assert same(function(*given(4)), eqx.filter_jit(solved)(*given(4)))
    matrix, right = given()
    whole = np.eye(3, dtype=np.int32)
    assert same(function(whole, right), eqx.filter_jit(solved)(whole, right))
    with jax.enable_x64(True):
        doubles = jax.tree.map(lambda a: a.astype(np.float64), given())
        assert function(*doubles)["pose"].root.dtype == np.float64
    assert len(TRACED) == 5
    monkeypatch.setattr(_kept, "_surroundings", lambda: b"another version")
    Kept(solved)(matrix, right)
    assert len(TRACED) == 6


def test_doubles_in_a_world_of_singles_are_what_jax_makes_of_them():
    doubles = jax.tree.map(lambda a: a.astype(np.float64), given())
    assert same(Kept(solved)(*doubles), Kept(solved)(*given()))


def test_what_is_not_known_by_its_name_is_not_kept(folder: Path):
    class Norm(eqx.Module):
        def __call__(self, value: jax.Array) -> jax.Array:
            return jnp.abs(value).sum()

    for norm in (lambda value: jnp.abs(value).sum(), Norm(), given_norm):
        kept = Kept(solved)
        assert same(kept(*given(), 1, norm), eqx.filter_jit(solved)(*given(), 1, norm))
        assert same(kept(*given(), 1, norm), kept(*given(), 1, norm))
        assert not folder.exists()


def given_norm(value: jax.Array) -> jax.Array:
    return jnp.abs(value).max()


@pytest.mark.parametrize("damage", [lambda raw: raw[:100], lambda raw: b"", lambda raw: raw[:-9] + bytes(9)])
def test_a_damaged_file_is_made_anew(folder: Path, damage: Callable[[bytes], bytes]):
    first = Kept(solved)(*given())
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert same(Kept(solved)(*given()), first)
    assert len(file.read_bytes()) > len(whole) // 2
    TRACED.clear()
    assert same(Kept(solved)(*given()), first)
    assert TRACED == []


def test_a_folder_that_cannot_be_written_is_said_and_does_no_harm(folder: Path):
    folder.write_text("not a folder")
    with pytest.warns(UserWarning, match="could not be kept"):
        found = Kept(solved)(*given())
    assert same(found, eqx.filter_jit(solved)(*given()))


def test_traced_itself_it_is_a_function_like_others(folder: Path):
    function = Kept(solved)
    matrix, right = given()
    slope = jax.grad(lambda m: function(m, right)["pose"].root.sum())(matrix)
    np.testing.assert_allclose(slope, jax.grad(lambda m: solved(m, right)["pose"].root.sum())(matrix), rtol=1e-5)
    stacked = jax.vmap(lambda m: function(m, right)["pose"].root)(jnp.stack([matrix, 2 * matrix]))
    np.testing.assert_allclose(stacked[0], 2 * stacked[1], rtol=1e-4)
    assert not folder.exists()


def test_without_a_folder_nothing_is_kept(folder: Path):
    jax.config.update("jax_compilation_cache_dir", None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Kept(solved)(*given())
    assert not folder.exists()
