"""Recordings that are folders: the same recording as in one file, and what is refused."""

import re

import numpy as np
import pytest
from support.recording_folders import FRAMES, SIZE, a_recording, write_folder

from jaxskel import default_adult, make_cameras
from jaxskel.cameras import ImageChange, project
from jaxskel.io.calibrations import write_calibration, write_pose2sim_calibration
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.io.subjects import write_subject


@pytest.mark.parametrize("kind", ["folders", "archive", "video", "backdrop", "plate"])
def test_a_folder_is_the_recording_that_went_into_it(tmp_path, kind):
    read, wanted = read_recording(write_folder(tmp_path, kind)), a_recording()
    np.testing.assert_array_equal(read.silhouettes[:], wanted.silhouettes)
    assert (read.fps, read.up, read.name, len(read)) == (25.0, "+Z", tmp_path.name, FRAMES)
    assert read.cameras.names == wanted.cameras.names
    np.testing.assert_array_equal(read.cameras.size, wanted.cameras.size)
    for field in ("K", "R", "t"):
        np.testing.assert_allclose(getattr(read.cameras, field), getattr(wanted.cameras, field), atol=1e-9)
    assert read.skeleton is None


def test_the_file_itself_can_be_named(tmp_path):
    assert len(read_recording(write_folder(tmp_path) / "recording.toml")) == FRAMES


def test_the_subject_is_found_beside_the_recording_or_where_it_is_said_to_be(tmp_path):
    write_subject(tmp_path / "subject.toml", default_adult().scaled(0.9))
    skeleton = read_recording(write_folder(tmp_path)).skeleton
    assert skeleton is not None
    assert skeleton.stature == pytest.approx(0.9 * default_adult().stature, abs=1e-5)


def test_views_are_given_the_cameras_that_they_name_in_any_order(tmp_path):
    wanted = a_recording().cameras
    write_folder(tmp_path, left='camera = "right"', right='camera = "left"')
    cameras = read_recording(tmp_path).cameras
    assert cameras.names == ("left", "front", "right")
    np.testing.assert_allclose(cameras.t, np.asarray(wanted.t)[[2, 1, 0]], atol=1e-9)


def test_a_view_with_an_offset_shows_other_images(tmp_path):
    write_folder(tmp_path, top="frames = [-1, 5]", front="offset = 2")
    read, wanted = read_recording(tmp_path), a_recording()
    assert read.frame_index.tolist() == list(range(-1, 6))
    np.testing.assert_array_equal(read.silhouettes[:][:-2, 1], np.asarray(wanted.silhouettes)[1:, 1])
    assert not read.silhouettes[:][-2:, 1].any()
    assert not read.silhouettes[0, 0].any()


def test_a_calibration_for_another_size_is_used_where_the_file_says_so(tmp_path):
    write_folder(tmp_path)
    wanted = a_recording().cameras
    larger = make_cameras(wanted.K, wanted.R, wanted.t, wanted.size + 8, names=wanted.names)
    write_pose2sim_calibration(tmp_path / "calibration.toml", larger)
    with pytest.raises(ValueError, match="images are 40 x 30 px, but calibration.toml is for 48 x 38"):
        read_recording(tmp_path)
    text = (tmp_path / "recording.toml").read_text()
    for name in wanted.names:
        text = text.replace(f"[views.{name}]", f"[views.{name}]\ncalibrated_size = [48, 38]")
    (tmp_path / "recording.toml").write_text(text)
    np.testing.assert_array_equal(read_recording(tmp_path).cameras.size, wanted.size)


@pytest.mark.parametrize(
    ("keys", "size", "change"),
    [
        ("turn = 90\ncalibrated_size = [30, 40]", (30, 40), ImageChange(turn=90)),
        ("turn = 90", (30, 40), ImageChange(turn=90)),
        ("turn = 180", (40, 30), ImageChange(turn=180)),
        ("scale = 0.5", (80, 60), ImageChange(scale=(0.5, 0.5))),
        ("scale = [0.5, 1]", (80, 30), ImageChange(scale=(0.5, 1.0))),
        ("scale = 0.333", (120, 91), ImageChange(scale=(0.333, 0.333))),  # sizes are rounded
        ("crop = [3, -2.5]", (48, 38), ImageChange(crop=(3.0, -2.5))),
        ("turn = 270\ncrop = [3, 4]\nscale = 2", (30, 40), ImageChange(270, (3.0, 4.0), (2.0, 2.0))),
    ],
)
def test_cameras_follow_what_was_done_to_the_images(tmp_path, keys, size, change):
    write_folder(tmp_path, **dict.fromkeys(a_recording().cameras.names, keys))
    wanted = a_recording().cameras
    before = make_cameras(wanted.K, wanted.R, wanted.t, size, names=wanted.names)
    write_pose2sim_calibration(tmp_path / "calibration.toml", before)
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3)) + [0, 0, 1]
    found, given = (project(cameras, points)[:2] for cameras in (read_recording(tmp_path).cameras, before))
    for camera in range(3):
        moved = change.matrix((float(size[0]), float(size[1]))) @ [given[0][camera], given[1][camera], np.ones(20)]
        np.testing.assert_allclose([found[0][camera], found[1][camera]], moved[:2], atol=1e-6)
    np.testing.assert_array_equal(read_recording(tmp_path).cameras.size, [SIZE] * 3)


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ("turn = 45", "views.left.turn': is 45; give 90, 180 or 270"),
        ("turn = true", "views.left.turn': is True"),
        ("crop = 3", "views.left.crop': is 3; give [x, y]"),
        ("crop = [nan, 0]", "views.left.crop': is [nan, 0]"),
        ("crop = [1, 2, 3]", "views.left.crop': is [1, 2, 3]"),
        ("scale = 0", "views.left.scale': is 0; give a positive number of pixels for each calibrated one"),
        ("scale = [1, inf]", "views.left.scale': is inf"),
        ("scale = 0.5", "for 40 x 30, which turn and scale make 20 x 15"),
        ("turn = 90", "for 40 x 30, which turn and scale make 30 x 40"),
        ("crop = [40, 0]", "views.left.crop': the image of 40 x 30 px would show nothing"),
        ("crop = [0, -30]", "would show nothing of the calibrated one of 40 x 30"),
        ("calibrated_size = [80, 60]", "views.left.calibrated_size': is [80, 60], but calibration.toml is for 40 x 30"),
    ],
)
def test_wrong_changes_are_named_in_one_line(tmp_path, keys, told):
    write_folder(tmp_path, left=keys)
    with pytest.raises(ValueError, match=re.escape(told)) as error:
        read_recording(tmp_path)
    assert "\n" not in str(error.value)


def test_where_a_calibration_has_no_sizes_a_crop_of_turned_images_needs_one(tmp_path):
    write_folder(tmp_path, **dict.fromkeys(a_recording().cameras.names, "turn = 90"))
    cameras = a_recording().cameras
    matrices = np.asarray(cameras.K) @ np.concatenate([cameras.R, np.asarray(cameras.t)[..., None]], -1)
    np.savez(tmp_path / "rig.npz", **dict(zip(cameras.names, matrices, strict=True)))
    path = tmp_path / "recording.toml"
    path.write_text(path.read_text().replace("calibration.toml", "rig.npz").replace("fps = 25", 'fps = 25\nup = "+Z"'))
    # Images of 40 x 30 px that were turned by 90 degrees were 30 x 40 px before.
    np.testing.assert_allclose(
        read_recording(tmp_path).cameras.K[:, 0, 2], 39 - np.asarray(cameras.K)[:, 1, 2], atol=1e-6
    )
    path.write_text(path.read_text().replace("turn = 90", "turn = 90\ncrop = [1, 1]"))
    with pytest.raises(ValueError, match=r"crop': comes with turn, but rig.npz says no size; state calibrated_size"):
        read_recording(tmp_path)
    path.write_text(path.read_text().replace("turn = 90", "turn = 90\ncalibrated_size = [30, 40]"))
    assert len(read_recording(tmp_path)) == FRAMES


@pytest.mark.parametrize(
    ("wrong", "right", "told"),
    [
        ("fps = 25", "fps = 0", "'fps': is 0"),
        ("fps = 25", "", "'fps': is missing"),
        ("fps = 25", "fsp = 25", "did you mean fps"),
        ('"calibration.toml"', '"none.toml"', "none.toml: cannot be opened"),
        ('"calibration.toml"', "3", "'calibration': is 3; give text"),
        ("fps = 25", 'fps = 25\nup = "Z"', "'up': is 'Z'; give one of +X"),
        ("fps = 25", "fps = 25\nunit = -1", "'unit': is -1"),
        ("fps = 25", "fps = 25\nunit = 0.001", "give unit"),
        ("fps = 25", "fps = 25\nframes = [3]", "'frames': is [3]"),
        ("fps = 25", "fps = 25\nframes = [0, 6]", "there are images of frames 0 to 5 only"),
        ("[views.left]", '[views.left]\ncamera = "top"', "top"),
        ("[views.left]", '[views.left]\ncamera = "front"', "two views have the camera front"),
        ("[views.left]", "[views.left]\ncalibrated_size = [1]", "views.left.calibrated_size': is [1]"),
        ("[views.left]", "[views.left]\noffset = 0.5", "views.left.offset': is 0.5"),
        ("[views.left]", "[views.left]\noffset = 1", "state frames = [0, 4]"),
        ("[views.left]", "[views.left]\noffset = 99", "check their offsets"),
        ("[views.left]", "[views.left]\nmedian = true", "masks need no background"),
        ("[views.left]", '[views.left]\nimages = "masks/left"', "give either masks"),
        ("[views.left]", "[views.left]\nmask = 1", "did you mean masks"),
        ('masks = "masks/left"', 'images = "masks/left"', "comes without a background"),
        ('masks = "masks/left"', 'images = "masks/left"\nbackdrop = [1, 2]', "[red, green, blue]"),
        ('masks = "masks/left"', 'images = "masks/left"\nmedian = "yes"', "median': is 'yes'; give true"),
        ('masks = "masks/left"', 'images = "masks/left"\nplate = "none.png"', "none.png: cannot be opened"),
        ('masks = "masks/left"', 'images = "masks/left"\nbackdrop = true', "saturated colour"),
        ('masks = "masks/left"', "masks = 3", "views.left.masks': is 3"),
        ('masks = "masks/left"', 'masks = "masks/top"', "top: cannot be opened"),
        ("smooth = false", "smooth = 1", "cleaning.smooth': is 1; give true or false"),
        ("smooth = false", "smoth = true", "did you mean smooth"),
        ("[cleaning]", "[cleaning", "is not TOML"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(tmp_path, wrong, right, told):
    path = write_folder(tmp_path) / "recording.toml"
    text = path.read_text()
    assert wrong in text
    path.write_text(text.replace(wrong, right))
    with pytest.raises(ValueError, match=re.escape(told)) as error:
        read_recording(tmp_path)
    assert str(tmp_path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_folder_without_the_file_says_what_writes_it(tmp_path):
    with pytest.raises(ValueError, match="jaxskel init"):
        read_recording(tmp_path)


def test_a_folder_with_a_sequence_file_instead_says_to_give_that(tmp_path):
    file = tmp_path / "walk.npz"
    write_recording(file, a_recording())
    np.savez(tmp_path / "cameras.npz", K=np.eye(3))
    with pytest.raises(ValueError, match=re.escape(f"holds no recording.toml; give {file}")):
        read_recording(tmp_path)
    with pytest.raises(ValueError, match=re.escape(f"{file} is a recording by itself")):
        propose_recording(tmp_path)


def test_calibration_of_a_sequence_file_will_do_too(tmp_path):
    write_folder(tmp_path)
    write_calibration(tmp_path / "rig.npz", a_recording().cameras, "+Y")
    path = tmp_path / "recording.toml"
    path.write_text(path.read_text().replace("calibration.toml", "rig.npz"))
    assert read_recording(tmp_path).up == "+Y"
