"""Reconstructs one recording of a batch, from its files to its result."""

import json
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import equinox as eqx
import jax
from filelock import FileLock, Timeout

from ..pipeline import advice, batches_from, prepare
from ..poses import smooth
from ..recording import AbstractSilhouettes
from ..verdict import doubts_before_work
from ._folders import ResultFolder
from ._manifest import Manifest, Work, current_version, done, failed
from ._method import Method
from ._overlaps import check_overlaps
from ._reading import Changed, Reading, Watched, current_work
from ._sources import Source

# Longest wait for a lock (s). A process that is ending releases it within this time: a cluster restarts a task while
# the old one still has half a minute to end.
_PATIENCE = 60.0


def finished_before(source: Source, output: Path, method: Method, request: str = "") -> Manifest | None:
    """The manifest if a complete result exists that would come out the same again and satisfies the request."""
    folder = ResultFolder(output, source.name)
    try:
        found = folder.finished()
        if found is None or request not in ("", found.request):
            return None
        if not current_work(source, method, found.work).same(found.work):
            return None
        # A failure since then came from a changed recording, which is now as it was.
        folder.forget_failure()
    except (OSError, ValueError):
        return None
    return found


def reconstruct_one(
    source: Source,
    output: Path,
    method: Method,
    request: str = "",
    on_frames: Callable[[int, int], None] = lambda done, total: None,
    on_sign: Callable[[str], None] = lambda doing: None,
) -> Manifest:
    """Reconstruct a recording, or resume it, and put the result into its folder.

    Args:
        source: The recording, or one of the people in it.
        output: Folder of the results.
        method: How to reconstruct.
        request: Name of a request to compute existing results again; empty: they are kept.
        on_frames: Called with the number of frames done and of all frames.
        on_sign: Called repeatedly with the current activity, as a sign of life.

    Returns:
        The manifest of the result. It reports any failure: a faulty recording raises no exception.
    """
    folder = ResultFolder(output, source.name)
    work = Work(str(source.path), {}, method.described, current_version())
    try:
        check_overlaps([source], output, method.subject)
    except (ValueError, OSError) as error:
        return failed(work, str(error))  # not written, because the place itself is at fault
    try:
        folder.check()
        folder.lock.parent.mkdir(parents=True, exist_ok=True)
        with _locked(folder.lock, on_sign):
            folder.take_place()
            before = finished_before(source, output, method, request)
            if before is not None:
                return before
            for note in ("", "started over, because its files were changed while they were read"):
                reading = Reading(source, method, on_sign)
                work = reading.work
                try:
                    return _reconstructed(folder, reading, request, note, on_frames)
                except Exception as error:
                    if not (isinstance(error, Changed) or reading.is_changed):
                        raise
                folder.discard_journal()
            raise ValueError(
                f"{source.path}: was changed while it was read, and again at the second attempt; wait until it is "
                "written, then run again"
            )
    except Timeout:
        return failed(work, f"{source.path}: another process works on it; wait until it has finished")
    except ValueError as error:
        return recorded(folder, failed(work, str(error)))
    except OSError as error:
        told = f"{error.filename or folder.path}: {error.strerror or error}; mend that and run again"
        return recorded(folder, failed(work, told))
    except (MemoryError, jax.errors.JaxRuntimeError) as error:
        told = f"{source.path}: out of memory ({error}); give fewer jobs, a coarser spacing or a smaller box"
        return recorded(folder, failed(work, told))
    except Exception as error:  # a defect of this package must not stop the other recordings
        told = f"{source.path}: {type(error).__name__}: {error}; please report it, with {folder.failure.name}"
        return recorded(folder, failed(work, told, traceback.format_exc()))


@contextmanager
def _locked(path: Path, on_sign: Callable[[str], None]) -> Iterator[None]:
    """Hold a lock; wait a limited time for it.

    Raises:
        Timeout: Another process holds it.
    """
    lock, end = FileLock(path), time.monotonic() + _PATIENCE
    while True:
        on_sign("waiting for another process that works on it")
        left = end - time.monotonic()
        try:
            lock.acquire(timeout=min(max(left, 0.0), 1.0))
            break
        except Timeout:
            if left <= 1.0:
                raise
    try:
        yield
    finally:
        lock.release()


def _reconstructed(
    folder: ResultFolder, reading: Reading, request: str, note: str, on_frames: Callable[[int, int], None]
) -> Manifest:
    source, method, on_sign = reading.source, reading.method, reading.on_sign
    seconds: dict[str, float] = {}
    on_sign("reading it")
    with _timed(seconds, "read"):
        recording = method.read(source.path, person=source.person)
    if isinstance(recording.silhouettes, AbstractSilhouettes):
        watched = Watched(recording.silhouettes, lambda: on_sign("reading its silhouettes"))
        recording = eqx.tree_at(lambda r: r.silhouettes, recording, watched)
    on_frames(0, len(recording))
    on_sign("checking whether its views agree")
    with _timed(seconds, "check"):
        doubts = doubts_before_work(source.path, recording, method.anyway)
    on_sign("preparing")
    with _timed(seconds, "prepare"):
        settings = method.settings_for_subject()
        prepared = prepare(recording, settings)
    work = replace(reading.work, source="")
    journal = folder.journal(json.dumps(asdict(work) | {"moment": reading.moment}), request)
    resumed = journal.frames
    on_sign("reconstructing")
    with _timed(seconds, "reconstruct"):
        for poses, track in batches_from(resumed, journal.track, recording, settings, prepared):
            journal.append(poses, track)
            on_frames(journal.frames, len(recording))
    with _timed(seconds, "write"):
        poses = journal.poses(recording.fps, recording.up, prepared.stature_deviation)
        if method.smooth_hz is not None:
            poses = smooth(poses, method.smooth_hz)
        told = advice(poses, recording)
        problem = None if told is None else f"{source.path}: {told}"
        on_sign("writing its poses")
        if reading.is_changed:
            raise Changed
        manifest = replace(
            done(reading.work, poses, problem, seconds, request, resumed), note="; ".join(filter(None, [note, *doubts]))
        )
        return folder.finish(poses, manifest)


def recorded(folder: ResultFolder, manifest: Manifest) -> Manifest:
    """Record that a recording failed, and return its manifest."""
    try:
        folder.fail(manifest)
    except OSError:  # the disk may be what failed
        pass
    return manifest


@contextmanager
def _timed(seconds: dict[str, float], part: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[part] = time.perf_counter() - start
