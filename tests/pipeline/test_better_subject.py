"""A subject that becomes better: different frames are kept, and another process finds the subject in them."""

import equinox as eqx
import numpy as np
import pytest
from support.answering import Answering
from support.recordings import graph_settings

from jaxskel import Poses, Prepared, Recording, Stream, join_poses, prepare, reconstruct
from jaxskel.pipeline import _better_subject as better
from jaxskel.pipeline._better_subject import BetterSubject
from jaxskel.synthetic import camera_ring, make_scene

pytestmark = pytest.mark.slow

GRAPH = graph_settings()


@pytest.fixture(scope="module")
def scene() -> Recording:
    """The whole motion: a dozen different postures and more."""
    return make_scene(24, fps=2.0, cameras=camera_ring(4, size=(160, 120)))


@pytest.fixture(scope="module")
def poses(scene) -> Poses:
    return reconstruct(scene, GRAPH)


@pytest.fixture
def worker(monkeypatch):
    monkeypatch.setattr(better, "WorkerProcess", Answering)
    Answering.answers, Answering.given = [], []
    return Answering


@pytest.fixture(scope="module")
def other(scene) -> Prepared:
    """What a process could send: a taller subject, without a grid."""
    found = prepare(scene, GRAPH)
    taller = found.skeleton.scaled(1.1)
    return eqx.tree_at(lambda p: (p.skeleton, p.table, p.edge), found, (taller, None, np.zeros((0, 0, 0), bool)))


def show(again: BetterSubject, scene: Recording, poses: Poses, frames) -> None:
    for frame in frames:
        one, turned, fine = slice(frame, frame + 1), poses.rotations, np.zeros(1, int)
        assert turned is not None
        parts = poses.joints[one], turned[one], fine
        pose = eqx.tree_at(lambda p: (p.joints, p.rotations, p.status), poses, parts)
        again.see(scene[one], pose)
        if again._giving.is_alive():
            again._giving.join()


def test_frames_that_are_alike_are_kept_once(scene, poses, worker):
    again = BetterSubject(GRAPH)
    show(again, scene, poses, [3] * 20)
    assert worker.given == []
    assert again.found() is None
    again.close()


def test_the_subject_is_found_again_when_more_has_been_seen(scene, poses, worker, other):
    worker.answers = [other, other]
    again = BetterSubject(GRAPH)
    show(again, scene, poses, range(12))
    first = worker.given[0]
    assert 6 <= first < 12
    assert again.found() is not None
    assert again.found() is None  # only once
    show(again, scene, poses, range(12, 24))
    assert len(worker.given) == 2
    assert worker.given[1] >= 12
    again.close()


@pytest.mark.parametrize("answers", [[], [ValueError("nobody")]], ids=["dead", "an exception"])
def test_without_an_answer_the_subject_stays(scene, poses, worker, answers):
    worker.answers = answers
    again = BetterSubject(GRAPH)
    show(again, scene, poses, range(24))
    assert again.found() is None
    assert worker.given  # it was asked
    show(again, scene, poses, range(24))
    assert len(worker.given) == 1  # and not again


def test_a_stream_takes_the_better_subject(scene, worker, other):
    worker.answers = [other]
    with Stream(scene.cameras, GRAPH, fps=2.0) as stream:
        found = join_poses([stream.push(frame) for frame in scene.silhouettes[:2]])
        assert found.skeleton is not None
        for frame in scene.silhouettes[2:16]:
            last = stream.push(frame)
    assert last.skeleton is not None
    assert last.skeleton.stature == pytest.approx(other.skeleton.stature)
    assert last.skeleton.stature > 1.05 * found.skeleton.stature
