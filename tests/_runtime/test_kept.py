"""Compiled functions loaded from disk give the same results, and are used only for the same function and versions."""

import hashlib
import os
import pickle
import warnings
from collections.abc import Callable
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cached_functions import TRACED, folder, given, same, solved

from jaxskel._runtime import compile_cache as _kept
from jaxskel._runtime import private_folders as _private
from jaxskel._runtime.compile_cache import CachedJit
from jaxskel._runtime.program_files import usable

__all__ = ["folder"]  # a fixture


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
