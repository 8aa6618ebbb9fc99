"""Programs that are compiled ahead or found again by their text, and the options of the compiler."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
import pytest
from support.cached_functions import TRACED, folder, given, same, solved

from jaxskel._runtime import compile_cache as _kept
from jaxskel._runtime.compile_cache import CachedJit
from jaxskel._runtime.compiler_options import OPTIONS, accepted

__all__ = ["folder"]  # a fixture


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


def test_arguments_that_share_their_shape_have_the_same_program_as_others(folder):
    # Arrays of one JAX program share the tuple of their shapes; stand-ins that programs are compiled ahead for do not.
    one = jax.numpy.ones((3, 3))
    for matrices in ((one, one), (np.ones((3, 3), np.float32), np.ones((3, 3), np.float32))):
        CachedJit(halved)(*matrices)
    assert len(list(folder.iterdir())) == 1


def test_a_kept_program_does_not_hold_which_lines_it_comes_from(folder):
    CachedJit(halved)(given()[0])
    (program,) = folder.iterdir()
    assert Path(__file__).name.encode() not in program.read_bytes()
    assert b"/div" not in program.read_bytes()


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
    with pytest.raises(ValueError, match="inconsistent size|must have shapes"):  # JAX has said it in both ways
        function(*wrong)


def test_programs_give_the_same_with_these_options_kept_or_not():
    found = CachedJit(solved)(*given())
    np.testing.assert_allclose(found["pose"].root, solved(*given())["pose"].root, rtol=1e-4)
    jax.config.update("jax_compilation_cache_dir", None)
    np.testing.assert_array_equal(CachedJit(solved)(*given())["pose"].root, found["pose"].root)


def test_options_that_the_compiler_does_not_know_are_left_out():
    assert accepted({"xla_no_such_option": True}) == {}
    assert accepted(OPTIONS) in (OPTIONS, {})


def halved(matrix: jax.Array, unused: jax.Array | None = None) -> jax.Array:
    return matrix / 2


def test_an_argument_that_is_not_used_makes_another_program():
    matrix = given()[0]
    for more in ((), (matrix,), (given(4)[0],)):
        np.testing.assert_array_equal(CachedJit(halved)(matrix, *more), matrix / 2)
