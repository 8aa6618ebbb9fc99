"""The progress line says how many programs are compiled, and nothing when none is."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.cached_functions import folder, given, solved

from jaxskel._runtime.compilations import COMPILATIONS, Compilations
from jaxskel._runtime.compile_cache import cached_jit
from jaxskel.cli._progress import progress_bar

__all__ = ["folder"]  # a fixture


def test_programs_are_counted_while_they_are_compiled():
    counted = Compilations()
    assert str(counted) == ""
    with counted.one_more():
        assert str(counted) == "compiling, once: 0 of 1"
        with counted.one_more():
            assert str(counted) == "compiling, once: 0 of 2"
        assert str(counted) == "compiling, once: 1 of 2"
    assert str(counted) == ""


def test_one_that_fails_is_done_too():
    counted = Compilations()
    with pytest.raises(ValueError, match="no"), counted.one_more():
        raise ValueError("no")
    assert (counted.begun, counted.done) == (1, 1)


def test_threads_do_not_lose_any():
    counted = Compilations()

    def count(_: int) -> None:
        with counted.one_more():
            pass

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(count, range(2000)))
    assert (counted.begun, counted.done) == (2000, 2000)


def test_a_function_counts_once_for_each_shape(folder: Path):
    solve, before = cached_jit(solved), COMPILATIONS.begun
    for size in (3, 3, 4):
        solve(*given(size))
    assert COMPILATIONS.begun == before + 2
    assert COMPILATIONS.done == COMPILATIONS.begun
    # What is kept on disk is not compiled again.
    solve.forget()
    solve(*given(3))
    assert COMPILATIONS.begun == before + 2


def test_the_progress_bar_shows_it():
    progress, task = progress_bar("fitting the body", 3)
    with COMPILATIONS.one_more():
        columns = [column.render(progress.tasks[task]) for column in progress.columns if not isinstance(column, str)]
    assert any("compiling, once:" in str(column) for column in columns)
