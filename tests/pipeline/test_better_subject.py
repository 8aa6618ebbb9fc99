"""A subject that becomes better: different frames are kept, and another process finds the subject in them."""

import threading
from multiprocessing import Pipe

import numpy as np
import pytest

from jaxskel import Recording, Status, default_adult, join_poses, paper_settings, reconstruct
from jaxskel.pipeline import _better_subject as better
from jaxskel.synthetic import camera_ring, make_scene


class Thread:
    """A worker that is a thread of this process: it answers with what `answer` makes of a task."""

    answers: list = []

    def __init__(self, core: int, work: bytes):
        self.pipe, self.theirs = Pipe()
        self.process = self
        self.tasks = []

    def give(self, task) -> None:
        self.tasks.append(task)
        self.theirs.send(self.answers.pop(0)) if self.answers else self.theirs.close()

    def receive(self):
        return self.pipe.recv()

    def kill(self) -> None: ...

    def end(self) -> None:
        self.pipe.close()


@pytest.fixture(scope="module")
def scene() -> Recording:
    """The whole motion: a dozen different postures."""
    return make_scene(24, fps=2.0, cameras=camera_ring(4, size=(160, 120)))


def seen(scene: Recording, frames, again: better.BetterSubject) -> None:
    poses = reconstruct(scene, paper_settings())
    for frame in frames:
        one = join_poses([poses])  # the same, sliced by hand
        part = type(one)(
            one.joints[frame : frame + 1], one.tips[frame : frame + 1], one.rotations[frame : frame + 1], one.skeleton,
            one.confidence[frame : frame + 1], one.side_confidence[frame : frame + 1], np.array([int(Status.OK)]),
            one.fps, one.up, one.frame_index[frame : frame + 1],
        )  # fmt: skip
        again.see(scene.silhouettes[frame : frame + 1], part)


def test_frames_that_are_alike_are_kept_once(scene, monkeypatch):
    monkeypatch.setattr(better, "WorkerProcess", Thread)
    again = better.BetterSubject(scene[:0], paper_settings())
    seen(scene, [3] * 20, again)
    assert len(again._frames) == 1
    assert again.found() is None
    again.close()
