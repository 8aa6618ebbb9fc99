"""What only Linux has is used where it is, and missed nowhere."""

import ctypes
import os
import signal
import sys
from pathlib import Path

import pytest

from jaxskel._runtime import compile_cache
from jaxskel._runtime.cores import take_core, usable_cores
from jaxskel._runtime.worker_processes import signals_ignored


def test_without_affinities_all_cores_are_usable_and_none_is_taken(monkeypatch):
    for name in ("sched_getaffinity", "sched_setaffinity"):
        monkeypatch.delattr(os, name, raising=False)
    assert usable_cores() == (os.cpu_count() or 1)
    take_core(0)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system knows no affinities")
def test_the_usable_cores_are_those_that_the_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 4, 5})
    assert usable_cores() == 3


def test_without_proc_the_processor_has_a_name_all_the_same(monkeypatch):
    def missing(path: Path, *_: object, **__: object) -> str:
        raise FileNotFoundError(path)

    here = compile_cache.processor.__wrapped__()
    monkeypatch.setattr(Path, "read_text", missing)
    monkeypatch.setattr(compile_cache.platform, "processor", lambda: "arm")
    there = compile_cache.processor.__wrapped__()
    assert there.endswith(" arm")
    assert there != here


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_memory_is_given_back_on_linux_only(monkeypatch, system):
    def refused(name: str | None) -> None:
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", refused)  # Windows has no library without a name
    monkeypatch.setattr(sys, "platform", system)
    compile_cache._give_memory_back()


def test_without_masks_of_signals_processes_start_all_the_same(monkeypatch):
    monkeypatch.delattr(signal, "pthread_sigmask", raising=False)
    before = signal.getsignal(signal.SIGINT)
    with signals_ignored():
        assert signal.getsignal(signal.SIGINT) is before
