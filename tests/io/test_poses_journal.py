"""Journals of poses: what was written is read again, wherever the writer was killed."""

from dataclasses import replace

import numpy as np
import pytest
from support.files import same
from support.live_sessions import step_of
from support.poses import moving

from jaxskel.io.poses import JOURNAL_FILE, PosesJournal, read_poses, write_poses
from jaxskel.poses import Status, join_poses

FRAMES = 6


def journal_of(path, poses, rows=range(FRAMES)):
    journal = PosesJournal(path / JOURNAL_FILE, poses.fps, poses.up)
    for row in rows:
        journal.append(step_of(poses, row))
    journal.close()
    return journal.path


def test_a_journal_holds_what_was_written(tmp_path):
    poses = moving(FRAMES, up="-Y", without=(2,))
    found = read_poses(journal_of(tmp_path, poses))
    archive, _ = write_poses(tmp_path, poses)
    assert same(found, read_poses(archive))
    assert found.stature_deviation is None


def test_a_record_that_was_cut_off_is_left_out(tmp_path):
    poses = moving(FRAMES)
    path = journal_of(tmp_path, poses)
    whole, header = path.read_bytes(), len(journal_of(tmp_path / "none", poses, []).read_bytes())
    record = (len(whole) - header) // FRAMES
    for left in (1, record - 1):
        path.write_bytes(whole[: header + 3 * record + left])
        assert same(read_poses(path), join_poses([step_of(poses, row) for row in range(3)]))


def test_dropped_frames_are_frames_without_images(tmp_path):
    poses = moving(FRAMES, start=3)
    found = read_poses(journal_of(tmp_path, poses, (0, 1, 5)))
    assert found.frame_index.tolist() == [3, 4, 5, 6, 7, 8]
    assert [Status(s).name for s in found.status] == ["OK", "OK", "EMPTY", "EMPTY", "EMPTY", "OK"]
    np.testing.assert_array_equal(found.joints[[0, 1, 5]], poses.joints[[0, 1, 5]])
    assert np.isnan(found.joints[2:5]).all()
    assert same(read_poses(write_poses(tmp_path, found)[0]), found)


def test_the_template_is_the_last_one(tmp_path):
    poses = moving(2)
    journal = PosesJournal(tmp_path / JOURNAL_FILE, poses.fps, poses.up)
    journal.append(step_of(poses, 0))
    better = replace(step_of(poses, 1), skeleton=poses.skeleton.scaled(0.9), stature_deviation=0.02)
    journal.append(better)
    found = read_poses(journal.path)  # which is open still
    journal.close()
    assert found.skeleton.stature == pytest.approx(0.9 * poses.skeleton.stature)
    assert found.stature_deviation == pytest.approx(0.02)


def test_what_settings_do_not_give_is_missing(tmp_path):
    poses = replace(moving(FRAMES, without=(0,)), rotations=None, skeleton=None, covariance=None)
    assert same(read_poses(journal_of(tmp_path, poses)), poses)


def test_a_journal_replaces_nothing(tmp_path):
    path = journal_of(tmp_path, moving(FRAMES))
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        PosesJournal(path, 25.0, "+Z")
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda b: b"PK" + b, "no journal of poses"),
        (lambda b: b[: b.index(b"}") + 2], "holds no frame"),
        (lambda b: b.replace(b'"fps"', b'"fpx"'), "damaged header"),
        (lambda b: b.replace(b'"+Z"', b'"+W"'), "key 'up'"),
        (lambda b: b + b[-2000:] * 2, "does not ascend"),
    ],
)
def test_a_damaged_journal_is_named(tmp_path, spoil, told):
    path = journal_of(tmp_path, moving(FRAMES))
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(ValueError, match=told) as error:
        read_poses(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_a_record_that_claims_a_late_frame_does_not_fill_the_memory(tmp_path):
    late = replace(step_of(moving(FRAMES), 1), frame_index=np.array([10**15]))
    journal = PosesJournal(tmp_path / JOURNAL_FILE, 25.0, "+Z")
    journal.append(step_of(moving(FRAMES), 0))
    journal.append(late)
    journal.close()
    with pytest.raises(ValueError, match="the file is damaged"):
        read_poses(journal.path)
