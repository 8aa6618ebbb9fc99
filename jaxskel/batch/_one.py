"""One recording of a batch, from its files to its result."""

import json
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import jax
from filelock import FileLock, Timeout

from .._advice import advice
from .._pipeline import batches_from
from .._prepare import prepare
from .._smooth import smooth
from ..io.inputs import input_paths
from ._folders import ResultFolder
from ._inputs import read_inputs
from ._manifest import Manifest, Work, current_version, done, failed
from ._method import Method
from ._sources import Source

# Another process that is about to end lets go of a recording within this time (s): a cluster starts a task again
# while the one before still has half a minute to end.
_PATIENCE = 60.0


def finished_before(source: Source, output: Path, method: Method, request: str = "") -> Manifest | None:
    """The manifest of a recording whose result is there, whole, would be the same again and answers the request."""
    folder = ResultFolder(output, source.name)
    try:
        found = folder.finished()
        if found is None or request not in ("", found.request):
            return None
        if not _work(source, method, found.work).same(found.work):
            return None
        # What went wrong since, as long as the recording was another one, is over.
        folder.failure.unlink(missing_ok=True)
    except OSError:
        return None
    return found


def reconstruct_one(
    source: Source,
    output: Path,
    method: Method,
    request: str = "",
    on_frames: Callable[[int, int], None] = lambda done, total: None,
) -> Manifest:
    """Reconstruct a recording, or go on with it, and put the result in its place.

    Args:
        source: The recording.
        output: Folder of the results.
        method: How to reconstruct.
        request: Name of a request to compute again what is there already; empty: it is left alone.
        on_frames: Called with the number of frames done and of all frames.

    Returns:
        The manifest of the result. Whatever goes wrong, it says so: nothing is raised for a recording's sake.
    """
    folder = ResultFolder(output, source.name)
    work = Work(str(source.path), {}, method.described, current_version())
    try:
        folder.lock.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(folder.lock, timeout=_PATIENCE):
            folder.take_place()
            before = finished_before(source, output, method, request)
            if before is not None:
                return before
            work = _work(source, method)
            return _reconstructed(source, folder, work, method, request, on_frames)
    except Timeout:
        return failed(work, f"{source.path}: another process works on it; wait for that one")
    except ValueError as error:
        return recorded(folder, failed(work, str(error)))
    except OSError as error:
        told = f"{error.filename or folder.path}: {error.strerror or error}; mend that and run again"
        return recorded(folder, failed(work, told))
    except (MemoryError, jax.errors.JaxRuntimeError) as error:
        told = f"{source.path}: out of memory ({error}); give fewer jobs, a coarser spacing or a smaller box"
        return recorded(folder, failed(work, told))
    except Exception as error:  # a defect of this package: the other recordings go on
        told = f"{source.path}: {type(error).__name__}: {error}; please report it, {folder.failure.name} says more"
        return recorded(folder, failed(work, told, traceback.format_exc()))


def _reconstructed(
    source: Source,
    folder: ResultFolder,
    work: Work,
    method: Method,
    request: str,
    on_frames: Callable[[int, int], None],
) -> Manifest:
    seconds: dict[str, float] = {}
    with _timed(seconds, "read"):
        recording = method.read(source.path)
    on_frames(0, len(recording))
    with _timed(seconds, "prepare"):
        settings = method.settings_for_subject()
        prepared = prepare(recording, settings)
    journal = folder.journal(json.dumps(asdict(replace(work, source=""))), request)
    resumed = journal.frames
    with _timed(seconds, "reconstruct"):
        for poses, track in batches_from(resumed, journal.track, recording, settings, prepared):
            journal.append(poses, track)
            on_frames(journal.frames, len(recording))
    with _timed(seconds, "write"):
        poses = journal.poses(recording.fps, recording.up)
        if method.smooth_hz is not None:
            poses = smooth(poses, method.smooth_hz)
        told = advice(poses, recording)
        problem = None if told is None else f"{source.path}: {told}"
        manifest = done(work, poses, problem, seconds, request, resumed)
        folder.finish(poses, manifest)
    return manifest


def _work(source: Source, method: Method, known: Work | None = None) -> Work:
    paths = input_paths(source.path)
    if method.subject is not None:
        paths["--subject"] = method.subject
    inputs = read_inputs(paths, None if known is None else known.inputs)
    return Work(str(source.path), inputs, method.described, current_version())


def recorded(folder: ResultFolder, manifest: Manifest) -> Manifest:
    """Write down that a recording failed, and return its manifest."""
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
