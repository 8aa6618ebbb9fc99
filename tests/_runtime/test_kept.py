"""Compiled functions loaded from disk give the same results, and are used only for the same function and versions."""

import hashlib
import os
import pickle
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from jaxskel._runtime import compile_cache as _kept
from jaxskel._runtime import private_folders as _private
from jaxskel._runtime.compile_cache import CachedJit
from jaxskel._runtime.compiler_options import QUICK, accepted
from jaxskel._runtime.program_files import usable
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


def test_a_function_from_the_disk_is_not_traced_and_gives_the_same(folder: Path):
    first = CachedJit(solved)(*given())
    assert same(first, eqx.filter_jit(solved)(*given()))
    assert len(list(folder.iterdir())) == 1
    TRACED.clear()
    again = CachedJit(solved)
    assert same(again(*given()), first)
    assert same(again(*given()), first)
    assert TRACED == []


@pytest.mark.parametrize("value", [2, True, 1.0])
def test_other_static_values_are_other_functions(value):
    CachedJit(solved)(*given())
    TRACED.clear()
    found = CachedJit(solved)(*given(), value)
    assert len(TRACED) == 1
    np.testing.assert_allclose(found["pose"].root, solved(*given(), value)["pose"].root, rtol=1e-5)


def test_other_shapes_types_switches_and_code_are_other_functions(monkeypatch: pytest.MonkeyPatch):
    function = CachedJit(solved)
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
    CachedJit(solved)(matrix, right)
    assert len(TRACED) == 6


def test_doubles_in_a_world_of_singles_are_what_jax_makes_of_them():
    doubles = jax.tree.map(lambda a: a.astype(np.float64), given())
    assert same(CachedJit(solved)(*doubles), CachedJit(solved)(*given()))


def test_what_is_not_known_by_its_name_is_not_kept(folder: Path):
    class Norm(eqx.Module):
        def __call__(self, value: jax.Array) -> jax.Array:
            return jnp.abs(value).sum()

    for norm in (lambda value: jnp.abs(value).sum(), Norm(), given_norm):
        kept = CachedJit(solved)
        assert same(kept(*given(), 1, norm), eqx.filter_jit(solved)(*given(), 1, norm))
        assert same(kept(*given(), 1, norm), kept(*given(), 1, norm))
        assert not folder.exists()


def given_norm(value: jax.Array) -> jax.Array:
    return jnp.abs(value).max()


@pytest.mark.parametrize("damage", [lambda raw: raw[:100], lambda raw: b"", lambda raw: raw[:-9] + bytes(9)])
def test_a_damaged_file_is_made_anew(folder: Path, damage: Callable[[bytes], bytes]):
    first = CachedJit(solved)(*given())
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert same(CachedJit(solved)(*given()), first)
    assert len(file.read_bytes()) > len(whole) // 2
    TRACED.clear()
    assert same(CachedJit(solved)(*given()), first)
    assert TRACED == []


def test_a_folder_that_cannot_be_written_is_said_and_does_no_harm(folder: Path):
    folder.write_text("not a folder")
    with pytest.warns(UserWarning, match="could not be kept"):
        found = CachedJit(solved)(*given())
    assert same(found, eqx.filter_jit(solved)(*given()))


def spoilt_program(file: Path, mark: Path) -> None:
    """A malicious object that leaves a mark if it is unpickled."""
    content = bytes(32) + pickle.dumps(Marking(mark))
    file.write_bytes(hashlib.sha256(content).digest() + content)


class Marking:
    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


OWNERS = pytest.mark.skipif(not hasattr(os, "getuid"), reason="the system knows no owners")


def others_may_write(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path.chmod(0o777)


def group_may_write(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path.chmod(0o770)


def of_another_user(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getuid", lambda: path.stat().st_uid + 1)


@OWNERS
@pytest.mark.parametrize("spoil", [others_may_write, group_may_write, of_another_user])
@pytest.mark.parametrize("what", ["file", "folder", "folder of JAX"])
def test_what_others_may_have_written_is_not_loaded_and_said_once(folder, capsys, monkeypatch, tmp_path, spoil, what):
    first = CachedJit(solved)(*given())
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o077 == 0
    assert folder.stat().st_mode & 0o077 == 0
    capsys.readouterr()
    mark = tmp_path / "mark"
    spoilt_program(file, mark)
    before = file.read_bytes()
    spoil({"file": file, "folder": folder, "folder of JAX": tmp_path}[what], monkeypatch)
    monkeypatch.setattr(_private, "_said", False)
    usable.cache_clear()
    for n in (3, 4):
        CachedJit(solved)(*given(n))
    assert not mark.exists()
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "chmod" in said
    if what != "file":
        assert [file.read_bytes() for file in folder.iterdir()] == [before]
    elif spoil is not of_another_user:  # its folder is private still, so it is made anew
        assert file.read_bytes() != before
        assert same(CachedJit(solved)(*given()), first)


@OWNERS
def test_a_file_of_ones_own_is_loaded_and_nothing_said(folder, capsys, tmp_path):
    CachedJit(solved)(*given())
    (file,) = folder.iterdir()
    spoilt_program(file, mark := tmp_path / "mark")
    capsys.readouterr()
    with pytest.raises(TypeError):  # what Path.touch returns is no program
        CachedJit(solved)(*given())
    assert mark.exists(), "the test above cannot fail"
    assert capsys.readouterr().err == ""


@OWNERS
def test_a_link_is_not_followed_and_a_fifo_not_waited_for(folder, tmp_path):
    first = CachedJit(solved)(*given())
    (file,) = folder.iterdir()
    spoilt_program(elsewhere := tmp_path / "elsewhere", mark := tmp_path / "mark")
    before = elsewhere.read_bytes()
    file.unlink()
    file.symlink_to(elsewhere)
    assert same(CachedJit(solved)(*given()), first)
    assert not mark.exists()
    assert elsewhere.read_bytes() == before
    assert not file.is_symlink()
    file.unlink()
    os.mkfifo(file)
    with pytest.warns(UserWarning, match="no regular file"):
        assert same(CachedJit(solved)(*given()), first)


@pytest.mark.parametrize("missing", ["getuid", "O_NOFOLLOW"])  # O_NONBLOCK: locks of JAX want it, too
def test_it_works_where_the_system_lacks(folder, monkeypatch, missing):
    monkeypatch.delattr(os, missing, raising=False)
    first = CachedJit(solved)(*given())
    TRACED.clear()
    assert same(CachedJit(solved)(*given()), first)
    assert TRACED == []


def test_traced_itself_it_is_a_function_like_others(folder: Path):
    function = CachedJit(solved)
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
        CachedJit(solved)(*given())
    assert not folder.exists()


def no_compilation(*_: object) -> None:
    raise AssertionError("a program was compiled again")


def test_after_a_change_of_other_code_a_function_is_traced_and_not_compiled(folder, monkeypatch):
    first = CachedJit(solved)(*given())
    monkeypatch.setattr(_kept, "_surroundings", lambda: b"another version")
    monkeypatch.setattr(_kept, "write_program", no_compilation)
    TRACED.clear()
    assert same(CachedJit(solved)(*given()), first)
    assert len(TRACED) == 1
    assert len(list(folder.iterdir())) == 2
    # From now on it is not even traced.
    assert same(CachedJit(solved)(*given()), first)
    assert len(TRACED) == 1


def test_after_a_change_of_the_function_it_is_compiled(folder, monkeypatch):
    CachedJit(solved)(*given())
    monkeypatch.setattr(_kept, "write_program", no_compilation)
    with pytest.raises(AssertionError, match="compiled again"):
        CachedJit(solved)(*given(), 2)


def test_what_is_compiled_ahead_is_not_compiled_again():
    function = CachedJit(solved)
    with ThreadPoolExecutor(2) as threads:
        for _ in range(3):
            function.ahead(threads, *given())
        found = function(*given())
    assert len(TRACED) == 1
    assert same(found, eqx.filter_jit(solved)(*given()))


def test_ahead_nothing_is_compiled_for_switches_that_hold_in_one_thread_only():
    function = CachedJit(solved)
    doubles = jax.tree.map(lambda a: a.astype(np.float64), given())
    with jax.enable_x64(True), ThreadPoolExecutor(1) as threads:
        function.ahead(threads, *doubles)
        threads.shutdown()
        assert TRACED == []
        assert function(*doubles)["pose"].root.dtype == np.float64


def test_a_fault_ahead_is_raised_where_the_function_is_called():
    function = CachedJit(solved)
    wrong = given(3)[0], given(4)[1]
    with ThreadPoolExecutor(1) as threads:
        function.ahead(threads, *wrong)
    with pytest.raises(ValueError, match="inconsistent size"):
        function(*wrong)


def test_quickly_compiled_programs_give_the_same():
    for function in (CachedJit(solved), CachedJit(solved, QUICK)):
        found = function(*given())
        np.testing.assert_allclose(found["pose"].root, solved(*given())["pose"].root, rtol=1e-4)
    jax.config.update("jax_compilation_cache_dir", None)
    np.testing.assert_array_equal(CachedJit(solved, QUICK)(*given())["pose"].root, found["pose"].root)


def test_options_that_the_compiler_does_not_know_are_left_out():
    assert accepted({"xla_no_such_option": True}) == {}
    assert accepted(QUICK) in (QUICK, {})
