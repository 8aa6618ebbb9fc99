"""Several processes: the same poses, in order, whatever finishes first."""

import os
import pickle
import subprocess
import sys
import threading
import time
from dataclasses import replace
from multiprocessing import Pipe

import numpy as np
import pytest

from jaxskel import (
    Pose,
    RefinementSettings,
    Settings,
    Stream,
    Tracking,
    join_poses,
    paper_settings,
    reconstruct_batches,
    reconstruct_parallel,
)
from jaxskel._runtime.worker_processes import WorkerProcess
from jaxskel.hull import Seen
from jaxskel.pipeline import _parallel as parallel
from jaxskel.pipeline._assemble import FramesOf
from jaxskel.pipeline._film_decision import RefinedBatch
from jaxskel.refinement.terms import paper_objective
from jaxskel.search import Track
from jaxskel.synthetic import camera_ring, make_scene

pytestmark = pytest.mark.slow


def test_two_processes_give_what_one_gives():
    scene = make_scene(70, cameras=camera_ring(4, size=(160, 120)))  # three batches
    settings = paper_settings()
    alone = join_poses(reconstruct_batches(scene, settings))
    together = join_poses(reconstruct_parallel(scene, 2, settings))
    np.testing.assert_array_equal(together.frame_index, alone.frame_index)
    np.testing.assert_array_equal(together.status, alone.status)
    np.testing.assert_array_equal(together.joints, alone.joints)


def test_zero_jobs_are_refused():
    with pytest.raises(ValueError, match="0 jobs: give at least one"):
        next(reconstruct_parallel(make_scene(2, cameras=camera_ring(3, size=(160, 120))), 0))


def test_frames_that_are_followed_stay_together():
    tracked = Settings(tracking=Tracking())
    assert parallel._stretches(100, 2, Settings()) == [[0], [32], [64], [96]]
    assert parallel._stretches(100, 2, tracked) == [[0, 32], [64, 96]]
    assert parallel._stretches(70, 2, tracked) == [[0, 32], [64]]
    assert parallel._stretches(10, 8, tracked) == [[0]]


class WorkerThread(WorkerProcess):
    """A worker that is a thread of this process, so that its work can be replaced."""

    def __init__(self, core: int, work: bytes):
        self.pipe, self.theirs = Pipe()
        call = pickle.loads(work)
        self.thread = threading.Thread(target=self.run, args=(call,))
        self.thread.start()

    def run(self, call) -> None:
        while (task := self.theirs.recv()) is not None:
            call(task, self.theirs.send)

    def give(self, task) -> None:
        self.pipe.send(task)

    def receive(self):
        return self.pipe.recv()

    def end(self) -> None:
        self.give(None)
        self.thread.join()


def test_an_exception_of_a_process_is_raised_here(monkeypatch):
    def broken(*_, **__):
        raise ValueError("camera 2: no silhouettes")

    monkeypatch.setattr(parallel, "refined_batch", broken)
    monkeypatch.setattr(parallel, "WorkerProcess", WorkerThread)
    scene = make_scene(4, cameras=camera_ring(4, size=(160, 120)))
    with pytest.raises(ValueError, match="camera 2: no silhouettes"):
        list(reconstruct_parallel(scene, 2, paper_settings()))


def test_functions_that_only_this_process_knows_are_told():
    own = RefinementSettings(objective=lambda body: paper_objective())
    settings, scene = replace(paper_settings(), refinement=own), make_scene(2, cameras=camera_ring(4, size=(160, 120)))
    told = r"settings: cannot be sent to another process \(.*\); define its functions at the top of a file"
    with pytest.raises(ValueError, match=f"{told}.*, or call reconstruct"):
        list(reconstruct_parallel(scene, 2, settings))
    with pytest.raises(ValueError, match=f"{told}.*, or give a subject"):
        Stream(scene.cameras, settings)
    Stream(scene.cameras, settings, scene.skeleton).close()


def test_a_killed_process_is_told(monkeypatch):
    class Killed(WorkerProcess):
        def give(self, task) -> None:
            self.process.kill()

    monkeypatch.setattr(parallel, "WorkerProcess", Killed)
    scene = make_scene(4, cameras=camera_ring(4, size=(160, 120)))
    with pytest.raises(MemoryError, match="one of 2 processes was killed, probably out of memory"):
        list(reconstruct_parallel(scene, 2, paper_settings()))


def test_batches_come_in_order_and_tracks_are_handed_on(monkeypatch):
    scene = make_scene(200, cameras=camera_ring(4, size=(160, 120)))
    first = {scene.silhouettes[start].tobytes(): start for start in range(0, 200, 32)}
    followed = []
    somewhere = Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1)))

    def at(start: int) -> Track:
        return Track(somewhere, somewhere, start, np.zeros(1))

    def batch(part, prepared, settings, track):
        start = first[part.silhouettes[0].tobytes()]
        time.sleep(0.02 if start < 64 else 0.0)  # the first batches finish last
        followed.append((track and track.since, start))
        count = len(part)
        nobody = Seen(np.full(count, start), np.zeros(0, int), np.zeros((count, 4), bool), None)
        frames = FramesOf(np.eye(3), "+Z", 30.0, part.frame_index)
        return RefinedBatch(frames, nobody, None, None, at(start), track is None, scene.skeleton)

    monkeypatch.setattr(parallel, "refined_batch", batch)
    monkeypatch.setattr(parallel, "WorkerProcess", WorkerThread)
    monkeypatch.setattr(parallel, "_stretches", lambda *_: [[0, 32], [64, 96], [128], [160, 192]])
    found = list(reconstruct_parallel(scene, 2, paper_settings()))
    assert [int(poses.status[0]) for poses in found] == [0, 32, 64, 96, 128, 160, 192]
    np.testing.assert_array_equal(np.concatenate([poses.frame_index for poses in found]), scene.frame_index)
    assert sorted(followed, key=lambda pair: pair[1]) == [
        (None, 0), (0, 32), (None, 64), (64, 96), (None, 128), (None, 160), (160, 192),
    ]  # fmt: skip


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity") or not os.path.exists("/proc/self/task"), reason="not Linux")
def test_all_threads_of_a_process_keep_to_its_core():
    code = (
        "import os, jaxskel, jax.numpy as jnp\n"
        "from jaxskel._runtime.cores import take_core\n"
        "def jax_has_begun():\n"
        "    names = [open(f'/proc/self/task/{thread}/comm').read() for thread in os.listdir('/proc/self/task')]\n"
        "    return any('XLA' in name for name in names)\n"
        "assert not jax_has_begun()\n"
        "before = os.sched_getaffinity(0)\n"
        "take_core(1)\n"
        "jnp.ones((500, 500)).dot(jnp.ones((500, 500))).block_until_ready()\n"
        "assert jax_has_begun()\n"
        "threads = os.listdir('/proc/self/task')\n"
        "assert len(threads) > 2\n"
        "mine = {core for thread in threads for core in os.sched_getaffinity(int(thread))}\n"
        "assert mine == {sorted(before)[1 % len(before)]}, mine\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
