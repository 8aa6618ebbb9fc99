"""Streams: frames that come one by one give what batches give, and whatever is lost comes back."""

from dataclasses import replace

import numpy as np
import pytest
from support.answering import Answering
from support.recordings import graph_settings, with_known_body

from jaxskel import (
    Pose,
    Poses,
    Recording,
    Settings,
    Status,
    Stream,
    Tracking,
    default_adult,
    join_poses,
    paper_settings,
    prepare,
    reconstruct,
    unpack_silhouettes,
)
from jaxskel.pipeline import reconstruct_batch
from jaxskel.synthetic import camera_ring, demo_motion, make_scene

pytestmark = pytest.mark.slow

ADULT = default_adult()
PAPER = paper_settings()


@pytest.fixture(scope="module")
def scene() -> Recording:
    """Two thirds of a second of a walk."""
    motion = demo_motion(ADULT, 66, 30.0)
    walk = Pose(np.asarray(motion.root)[46:], np.asarray(motion.rotations)[46:])
    return make_scene(fps=30.0, cameras=camera_ring(6, size=(240, 180)), motion=walk)


@pytest.fixture(scope="module")
def tracked(scene) -> Settings:
    return replace(with_known_body(scene), tracking=Tracking())


def streamed(recording: Recording, settings: Settings, masks=None) -> Poses:
    frames = recording.silhouettes if masks is None else masks
    with Stream(recording.cameras, settings, recording.skeleton, recording.up, recording.fps) as stream:
        return join_poses([stream.push(frame) for frame in frames])


def apart_mm(one: Poses, other: Poses) -> np.ndarray:
    return 1e3 * np.linalg.norm(one.joints - other.joints, axis=-1)


@pytest.mark.parametrize("settings", [graph_settings(), None], ids=["graph", "search"])
def test_the_length_of_a_stack_changes_nothing(scene, settings):
    settings = settings or with_known_body(scene)
    prepared = prepare(scene, settings)
    for frame in (0, 12):
        one = scene[frame : frame + 1]
        alone, together = (reconstruct_batch(one, prepared, settings, at_once=n)[0] for n in (1, 32))
        np.testing.assert_array_equal(alone.status, together.status)
        assert apart_mm(alone, together).max() < 1.0
        np.testing.assert_allclose(alone.confidence, together.confidence, atol=0.02)


def test_a_stream_of_a_film_is_the_tracked_batch(scene, tracked):
    poses = streamed(scene, tracked)
    np.testing.assert_array_equal(poses.frame_index, np.arange(len(scene)))
    assert set(poses.status) == {Status.OK}
    assert scene.truth is not None
    error = 1e3 * np.linalg.norm(poses.joints - scene.truth.joints, axis=-1)
    assert np.median(error) < 15
    assert error.max() < 80
    between = apart_mm(poses, reconstruct(scene, tracked))
    assert np.median(between) < 8  # a pixel is more than a centimetre wide
    assert between.max() < 60


def test_a_lost_person_has_a_status_and_is_found_again(scene, tracked):
    masks = scene.silhouettes.copy()
    masks[6:9] = 0  # nobody
    masks[10, 2:] = 0  # two views
    masks[12, 1] = 0  # all views but one
    poses = streamed(scene, tracked, masks)
    names = [Status(status).name for status in poses.status]
    assert names[:6] == ["OK"] * 6
    assert names[6:9] == ["EMPTY"] * 3
    assert names[10] == "TOO_FEW_VIEWS"
    assert names[12] == "VIEW_LOST"
    assert {*names[9:10], *names[11:12], *names[13:]} == {"OK"}
    assert scene.truth is not None
    there = poses.has_pose
    error = 1e3 * np.linalg.norm(poses.joints - scene.truth.joints, axis=-1)
    assert np.median(error[there]) < 15
    assert error[there].max() < 80


def test_frames_may_be_left_out(scene, tracked):
    with Stream(scene.cameras, tracked, scene.skeleton, scene.up, scene.fps) as stream:
        poses = [stream.push(scene.silhouettes[0])]
        poses += [stream.push(frame, skipped=1, hurry=True) for frame in scene.silhouettes[2::2]]
    found = join_poses(poses)
    assert found.has_pose.all()
    assert scene.truth is not None
    error = 1e3 * np.linalg.norm(found.joints - scene.truth.joints[::2], axis=-1)
    assert np.median(error) < 15
    assert error.max() < 80


def test_a_stream_waits_for_the_first_person(scene):
    masks = np.concatenate([np.zeros_like(scene.silhouettes[:2]), scene.silhouettes[:2]])
    poses = streamed(scene, PAPER, masks)
    assert poses.counts() == {"ok": 2, "empty": 2}
    assert poses.skeleton is not None


def test_a_subject_nobody_knows_is_found(scene):
    with Stream(scene.cameras, PAPER) as stream:
        poses = join_poses([stream.push(frame) for frame in scene.silhouettes[:3]])
    assert poses.has_pose.all()
    assert poses.skeleton is not None
    assert poses.skeleton.stature == pytest.approx(ADULT.stature, rel=0.08)


def test_the_first_pose_does_not_wait_for_all_that_is_known_about_the_subject(scene, monkeypatch):
    monkeypatch.setattr("jaxskel.pipeline._better_subject.WorkerProcess", Answering)
    Answering.answers, Answering.given = [], []
    with Stream(scene.cameras, fps=scene.fps) as stream:
        poses = stream.push(scene.silhouettes[0])
        assert stream._better is not None
        stream._better._giving.join()
    assert poses.has_pose.all()
    assert poses.skeleton is not None
    assert poses.skeleton.stature == pytest.approx(ADULT.stature, rel=0.04)
    assert scene.truth is not None
    assert 1e3 * np.linalg.norm(poses.joints - scene.truth.joints[:1], axis=-1).max() < 80
    assert Answering.given == [1]  # the same frame goes to the process that takes its time


def test_somebody_else_who_comes_is_found_too(scene):
    child = make_scene(2, cameras=scene.cameras, skeleton=ADULT.scaled(0.6))
    with Stream(scene.cameras, PAPER) as stream:
        first = join_poses([stream.push(frame) for frame in child.silhouettes])
        later = [stream.push(frame) for frame in scene.silhouettes[:8]]
    assert first.has_pose.all()
    assert [Status(pose.status[0]).name for pose in later] == ["NO_MATCH"] * 5 + ["OK"] * 3
    assert later[-1].skeleton is not None
    assert later[-1].skeleton.stature == pytest.approx(ADULT.stature, rel=0.08)


def test_masks_of_any_kind_are_the_same(scene):
    width = int(scene.cameras.size[0, 0])
    masks = unpack_silhouettes(scene.silhouettes[:1], width)
    packed = streamed(scene, PAPER, scene.silhouettes[:1])
    for same in (masks, masks.astype(np.uint8), 255 * masks.astype(np.uint8)):
        np.testing.assert_array_equal(streamed(scene, PAPER, same).joints, packed.joints)


def test_the_grid_follows_a_person_who_walks_through_a_hall():
    cameras = camera_ring(6, radius=7.0, size=(320, 240), volume=(5.0, 2.4))
    motion = demo_motion(ADULT, 15, 5.0)
    along = np.linspace(-2.0, 2.0, 15)[:, None] * [1.0, 0.0, 0.0]
    hall = make_scene(fps=5.0, cameras=cameras, motion=Pose(np.asarray(motion.root) + along, motion.rotations))
    poses = streamed(hall, PAPER)
    assert poses.has_pose.all()
    assert hall.truth is not None
    pelvis = np.linalg.norm(poses.joints[:, 0] - hall.truth.joints[:, 0], axis=-1)
    assert pelvis.max() < 0.15


def test_a_box_stays_where_it_is(scene):
    box = np.array([[-1.2, -1.2, -0.1], [1.2, 1.2, 1.0]])
    poses = streamed(scene, replace(PAPER, hull=replace(PAPER.hull, box=box)), scene.silhouettes[:2])
    assert [Status(status).name for status in poses.status] == ["PARTLY_OUTSIDE"] * 2


@pytest.mark.parametrize(
    ("shape", "kind"), [((5, 180, 240), bool), ((6, 180, 241), bool), ((6, 180, 30), bool), ((6, 180, 240), np.float32)]
)
def test_masks_that_are_not_the_cameras_are_refused(scene, shape, kind):
    stream = Stream(scene.cameras, PAPER, ADULT)
    with pytest.raises((ValueError, TypeError), match="masks|Type-check"):
        stream.push(np.zeros(shape, kind))


def test_what_makes_no_stream_is_refused(scene):
    with pytest.raises(ValueError, match="2 cameras: give 3 or more"):
        Stream(scene.cameras[:2])
    with pytest.raises(ValueError, match="frames per second"):
        Stream(scene.cameras, fps=0.0)
    with pytest.raises(ValueError, match="up axis"):
        Stream(scene.cameras, up="north")
