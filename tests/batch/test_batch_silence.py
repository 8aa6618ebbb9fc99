"""A process that gives no sign of life costs its recording; the others go on."""

import time
from collections.abc import Callable
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import UInt8

from jaxskel.batch import Finished, Method, Outcome, Progress, Source, run_batch
from jaxskel.batch import _workers as workers
from jaxskel.batch._manifest import read_manifest
from jaxskel.batch._reading import Watched
from jaxskel.batch._workers import work_on
from jaxskel.recording import AbstractSilhouettes

TIMEOUT = 0.3  # s


class Worker(workers._Worker):
    """A worker without a process: the test sends its messages, and nobody works on its recordings."""

    made = 0

    def __init__(self, core: int, given: bytes):
        self.core = core
        self.pipe, self.theirs = Pipe()
        Worker.made += 1

    def begin(self, source: Source | None) -> None:
        self.source = source
        self.heard, self.doing = time.monotonic(), "starting"
        if source is not None and source.name != "hangs":
            self.theirs.send(workers._Sign("reading it"))
            self.theirs.send(Progress(source, 0, 1))
            self.theirs.send(Finished(source, read_manifest(Path(source.path))))

    def end(self) -> int | None:
        self.pipe.close()
        self.theirs.close()
        return None


@pytest.fixture
def sources(tmp_path, monkeypatch) -> list[Source]:
    monkeypatch.setattr(workers, "_Worker", Worker)
    Worker.made = 0
    manifest = workers.failed(workers.Work("x", {}, {}, "1"), "as it is")
    workers.ResultFolder(tmp_path, "x").fail(manifest)
    return [Source(name, tmp_path / "x.failed.json") for name in ("a", "hangs", "b", "c")]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_silent_process_is_replaced_and_the_others_go_on(sources, tmp_path, jobs):
    events = list(work_on(sources, tmp_path / "out", Method(), jobs, timeout=TIMEOUT))
    assert not any(isinstance(event, workers._Sign) for event in events)
    found = {event.source.name: event.manifest for event in events if isinstance(event, Finished)}
    assert sorted(found) == ["a", "b", "c", "hangs"]
    assert found["hangs"].outcome is Outcome.FAILED
    assert found["hangs"].problem == (
        f"{sources[1].path}: its process gave no sign of life for 0.3 s (starting) and was killed; check its files and "
        "disk, or give a longer --timeout"
    )
    assert read_manifest(tmp_path / "out/hangs.failed.json") == found["hangs"]
    assert all(found[name].problem == "as it is" for name in "abc")
    assert Worker.made == jobs + 1


def test_every_sign_starts_the_time_anew(sources, tmp_path):
    """Ten signs, each after half of the timeout, then none."""
    (source,) = sources[1:2]
    signs = []

    class Slow(Worker):
        def listen(self) -> Progress | Finished | workers._Sign | None:
            event = super().listen()
            if len(signs) < 10:
                time.sleep(TIMEOUT / 2)
                signs.append(time.monotonic())
                self.theirs.send(workers._Sign(f"part {len(signs)}"))
            return event

        def begin(self, source: Source | None) -> None:
            super().begin(source)
            if source is not None:
                self.theirs.send(workers._Sign("part 0"))

    workers._Worker = Slow  # put back by the fixture
    ((finished),) = work_on([source], tmp_path / "out", Method(), 1, timeout=TIMEOUT)
    assert isinstance(finished, Finished)
    assert len(signs) == 10
    assert "(part 10) and was killed" in str(finished.manifest.problem)


def test_while_this_process_is_stopped_nobody_is_silent(sources, tmp_path, monkeypatch):
    """The first wait lasts too long, as if the machine had slept; during the second there is no message."""
    waits: list[float] = []

    def slept(pipes: list, timeout: float) -> list:
        waits.append(timeout)
        if len(waits) == 1:
            time.sleep(timeout + 2 * lost)
        return []

    lost = 0.1
    monkeypatch.setattr(workers, "_LOST", lost)
    monkeypatch.setattr(workers, "wait", slept)
    list(work_on(sources[1:2], tmp_path / "out", Method(), 1, timeout=TIMEOUT))
    assert len(waits) > 1
    assert waits[1] > TIMEOUT / 2


@pytest.mark.parametrize("timeout", [0.0, -1.0, float("nan")])
def test_a_timeout_that_is_not_positive_is_refused(tmp_path, timeout):
    with pytest.raises(ValueError, match="timeout of"):
        run_batch([], tmp_path / "out", Method(), timeout=timeout)


class Numbers(AbstractSilhouettes):
    """100 frames, each of which holds its number."""

    shape = (100, 1, 1, 1)

    def __init__(self, on_read: Callable[[np.ndarray], None]):
        self.on_read = on_read

    def read(self, frames: np.ndarray) -> UInt8[np.ndarray, "some cams h w8"]:
        self.on_read(frames)
        return frames.astype(np.uint8).reshape(-1, 1, 1, 1)


def test_reading_tells_of_itself_and_reads_the_same():
    read, told = [], []
    watched = Watched(Numbers(lambda frames: read.append(frames.tolist())), lambda: told.append(len(read)))
    np.testing.assert_array_equal(watched[:].ravel(), np.arange(100))
    assert [len(frames) for frames in read] == [32, 32, 32, 4]
    assert told == [1, 2, 3, 4]
    read.clear()
    np.testing.assert_array_equal(watched[np.array([0, 1, 50, 99])].ravel(), [0, 1, 50, 99])
    assert read == [[0, 1], [50], [99]]
    assert watched[5:5].shape == (0, 1, 1, 1)
