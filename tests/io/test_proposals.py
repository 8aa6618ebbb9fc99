"""Proposals for folders as people have them, each with the expected messages."""

import shutil
import subprocess

import cv2
import numpy as np
import pytest
from support import recording_folders as folders
from support.proposals import bare, proposed, refusal
from support.undescribed_folders import FRAMES, SIZE, rig, shrunk, undescribed

from jaxskel import make_cameras
from jaxskel.cameras import ImageChange
from jaxskel.io.calibrations import write_calibration, write_pose2sim_calibration
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording

NAMES = rig().names


@pytest.mark.parametrize("kind", ["folders", "archive", "video", "plate"])
def test_what_is_proposed_is_the_recording(tmp_path, kind):
    proposal = propose_recording(bare(tmp_path, kind), fps=None if kind in ("video", "plate") else 25.0)
    assert proposal.doubts == ()
    assert "CHECK" not in proposal.text
    (tmp_path / "recording.toml").write_text(
        proposal.text.replace("[views.left]", "[cleaning]\nfill=false\n[views.left]")
    )
    read, wanted = read_recording(tmp_path), folders.a_recording()
    order = [wanted.cameras.names.index(name) for name in read.cameras.names]
    seen = np.bitwise_count(read.silhouettes[:]).sum((2, 3)) / np.bitwise_count(wanted.silhouettes[:, order]).sum(
        (2, 3)
    )
    assert (abs(seen - 1) < 0.1).all()  # corners become rounded when the person is cut out of pictures
    assert read.fps == 25.0


def test_colour_without_an_empty_scene_is_a_median_to_be_checked(tmp_path):
    proposal = propose_recording(bare(tmp_path, "backdrop"))
    assert "median = true  # CHECK" in proposal.text
    assert sum("median over time" in doubt for doubt in proposal.doubts) == 3


# What was done to the images.


@pytest.mark.parametrize(
    ("change", "size", "keys"),
    [
        (shrunk, SIZE, {"scale": 0.5}),
        (lambda image: image[12:-12], (256, 216), {"crop": [0, 12]}),
        (lambda image: np.rot90(image, -1), SIZE, {"turn": 90}),
        (lambda image: image[::-1, ::-1], SIZE, {"turn": 180}),
        (lambda image: np.pad(image, ((0, 8), (0, 0))), (256, 200), {"calibrated_size": [256, 200]}),
    ],
)
def test_what_was_done_to_the_images_is_written_and_said(tmp_path, change, size, keys):
    table, doubts = proposed(undescribed(tmp_path, change, size=size))
    for view in table["views"].values():
        assert {key: view[key] for key in ("turn", "crop", "scale", "calibrated_size") if key in view} == keys
    (doubt,) = doubts
    assert "cam1, cam2, cam3, cam4, cam5: images are" in doubt
    assert "px, calibrated are" in doubt
    assert table["up"] == "+Z"
    turns = read_recording(tmp_path).turns
    assert turns is not None
    assert turns.tolist() == [keys.get("turn", 0)] * len(NAMES)
    assert "# CHECK: " in (tmp_path / "recording.toml").read_text()


def test_what_silhouettes_leave_open_is_refused_and_can_be_said(tmp_path):
    undescribed(tmp_path, lambda image: image[5:-19], size=(256, 216))
    told = refusal(tmp_path)
    for part in ("256 x 192 px, calibrated are 256 x 216", "--turn, --crop X,Y or --scale", "turn, crop and scale in"):
        assert part in told
    table, doubts = proposed(tmp_path, change=ImageChange(crop=(0.0, 5.0)))
    assert table["views"]["cam3"]["crop"] == [0, 5]
    assert "as stated; silhouettes miss each other by 0." in doubts[0]


def test_mirrored_images_are_said_to_be_mirrored(tmp_path):
    table, doubts = proposed(undescribed(tmp_path, lambda image: image[:, ::-1]))
    assert not {"turn", "crop", "scale"} & set(table["views"]["cam1"])
    assert "all images look mirrored" in doubts[0]


def test_an_upright_that_contradicts_a_habit_goes_before_it(tmp_path):
    table, doubts = proposed(undescribed(tmp_path, calibration=rig().rotated(np.diag([1.0, -1.0, -1.0]))))
    assert table["up"] == "-Z"
    assert "stand as if -Z pointed up" in doubts[0]


def test_black_views_are_not_taken_for_checked(tmp_path):
    _, doubts = proposed(undescribed(tmp_path, np.zeros_like))
    assert doubts == ("too few silhouettes to tell whether the views agree",)


# Frames.


def test_numbers_that_have_nothing_in_common_become_offsets(tmp_path):
    place = lambda camera, frame: f"masks/{camera}/{1000 * int(camera[3:]) + frame:06d}.png"  # noqa: E731
    table, doubts = proposed(undescribed(tmp_path, place=place))
    assert [view["offset"] for view in table["views"].values()] == [1000, 2000, 3000, 4000, 5000]
    assert "frames" not in table
    assert "no image numbers in common" in doubts[0]
    assert len(read_recording(tmp_path)) == FRAMES


def test_offsets_of_views_of_different_lengths_come_with_frames(tmp_path):
    place = lambda camera, frame: f"masks/{camera}/{1000 * int(camera[3:]) + frame:06d}.png"  # noqa: E731
    (undescribed(tmp_path, place=place) / "masks" / "cam2" / "002002.png").unlink()
    assert proposed(tmp_path)[0]["frames"] == [0, 1]


def test_where_it_had_to_choose_it_says_so(tmp_path):
    bare(tmp_path, "video")
    cameras = folders.a_recording().cameras
    renamed = make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, names=["int_1", "int_2", "int_3"])
    order = [cameras.names.index(name) for name in sorted(cameras.names)]
    renamed = make_cameras(renamed.K[order], renamed.R[order], renamed.t[order], renamed.size, names=renamed.names)
    write_pose2sim_calibration(tmp_path / "calibration.toml", renamed)
    pictures = np.repeat(folders.masks_of(folders.a_recording(), 0)[:4, ..., None], 3, axis=-1)
    folders.write_video(tmp_path / "left.avi", pictures)
    table, doubts = proposed(tmp_path, fps=None)
    assert table["views"]["left"]["camera"] == "int_2"
    assert table["frames"] == [0, 3]
    assert len(doubts) == 2


# Which files are the views.


@pytest.mark.parametrize(
    "place",
    [
        "masks_clean/{}/{:06d}.png", "masks_rembg/{}/{:06d}.png", "skateboard/{}/{:06d}.png", "{}/masks/{:06d}.png",
        "template/{}/{:06d}.png", "calib/{}/{:06d}.png", "s1/t2/{0}/masks/{1:06d}.png", "empty/{}/{:06d}.png",
    ],
)  # fmt: skip
def test_words_do_not_leave_nothing(tmp_path, place):
    table, doubts = proposed(undescribed(tmp_path, place=place.format))
    assert list(table["views"]) == list(NAMES)
    assert doubts == ()


def test_masks_go_before_pictures_whatever_they_are_called(tmp_path):
    def coloured(image: np.ndarray) -> np.ndarray:
        picture = np.where(image[..., None] > 0, np.uint8([60, 70, 200]), np.uint8([40, 180, 50]))
        picture[..., 0] += np.arange(image.shape[1], dtype=np.uint8) // 2  # light from one side
        return picture

    undescribed(tmp_path, coloured, "masks/{}/{:06d}.png".format)
    undescribed(tmp_path, place="out/{}/{:06d}.png".format)
    assert proposed(tmp_path)[0]["views"]["cam1"]["masks"] == "out/cam1"


def test_several_sets_are_a_question_and_masks_go_before_colour(tmp_path):
    undescribed(tmp_path, place="one/{}/{:06d}.png".format)
    undescribed(tmp_path, place="two/{}/{:06d}.png".format)
    told = refusal(tmp_path)
    assert "several sets of views, one/* (cam1, cam2, cam3, cam4, cam5), two/*" in told
    assert "--views PATTERN" in told
    assert proposed(tmp_path, views="two/*")[0]["views"]["cam2"]["masks"] == "two/cam2"
    assert "one/* (cam1, cam2, cam3, cam4, cam5)" in refusal(tmp_path, views="*.mov")
    (tmp_path / "two").rename(tmp_path / "masks")
    assert proposed(tmp_path)[0]["views"]["cam2"]["masks"] == "masks/cam2"


def test_views_without_a_camera_and_cameras_without_a_view_are_named(tmp_path):
    undescribed(tmp_path)
    shutil.copytree(tmp_path / "masks" / "cam1", tmp_path / "masks" / "cam6")
    table, doubts = proposed(tmp_path)
    assert list(table["views"]) == list(NAMES)
    assert doubts == ("Calib_scene.toml has no camera for cam6: left out",)
    shutil.rmtree(tmp_path / "masks" / "cam4")
    assert "there is no view of cam4: the others are used" in proposed(tmp_path)[1]


def test_a_camera_without_a_view_needs_no_size(tmp_path):
    matrices = np.asarray(rig().K) @ np.concatenate([rig().R, np.asarray(rig().t)[..., None]], -1)
    shutil.rmtree(undescribed(tmp_path) / "masks" / "cam1")
    (tmp_path / "Calib_scene.toml").unlink()
    np.savez(tmp_path / "matrices.npz", **dict(zip(NAMES, matrices, strict=True)))
    assert list(proposed(tmp_path)[0]["views"]) == list(NAMES[1:])


def test_where_names_do_not_tell_which_view_has_no_camera_nothing_is_written(tmp_path):
    undescribed(tmp_path, place=lambda camera, frame: f"masks/{'abcde'[int(camera[3:]) - 1]}/{frame:06d}.png")
    assert "names in common" in proposed(tmp_path)[1][0]
    shutil.copytree(tmp_path / "masks" / "a", tmp_path / "masks" / "f")
    told = refusal(tmp_path)
    assert "masks/*: there are 6 views, a, b, c, d, e, f, but 5 cameras, cam1" in told


@pytest.mark.parametrize(
    ("place", "told", "command"),
    [
        ("masks/{}_{:06d}.png", "masks holds the images of 5 cameras", "for f in masks/*.png"),
        ("{}-{:03d}.png", "holds the images of 5 cameras (cam1", "for f in ./*.png"),
        ("masks/{1:06d}_{0}.png", "masks holds the images of 5 cameras", "for f in masks/*.png"),
        ("masks/{1:06d}/{0}.png", "masks/* has a folder for each frame", "for f in masks/*/*.png"),
        ("f{1}/{0}.png", "* has a folder for each frame", "for f in */*.png"),
    ],
)  # fmt: skip
def test_other_layouts_are_told_with_a_command_that_mends_them(tmp_path, place, told, command):
    message = refusal(undescribed(tmp_path, place=place.format))
    assert told in message
    assert command in message
    subprocess.run(["bash", "-c", message.partition("in a shell there: ")[2]], cwd=tmp_path, check=True)
    table, doubts = proposed(tmp_path)
    assert list(table["views"]) == list(NAMES)
    assert doubts == ()


def test_folders_of_cameras_with_numbered_images_are_no_frames(tmp_path):
    place = lambda camera, frame: f"{camera[3:]}/{frame + 1}.png"  # noqa: E731
    table, doubts = proposed(undescribed(tmp_path, place=place))
    assert list(table["views"]) == ["1", "2", "3", "4", "5"]
    assert doubts == ()


# The calibration.


def test_a_calibration_that_cannot_be_read_is_named_with_its_reason(tmp_path):
    undescribed(tmp_path)
    (tmp_path / "Calib_scene.toml").rename(tmp_path / "calib.pickle")
    told = refusal(tmp_path)
    assert "holds no calibration that can be read; " in told
    assert "is a pickle" in told
    (tmp_path / "calib.pickle").rename(tmp_path / "notes.pdf")
    assert "notes.pdf: is of no known format; these are read: " in refusal(tmp_path)
    (tmp_path / "notes.pdf").unlink()
    assert "these are read: " in refusal(tmp_path)


def test_sizes_of_nothing_are_never_written(tmp_path):
    undescribed(tmp_path)
    text = (tmp_path / "Calib_scene.toml").read_text()
    (tmp_path / "Calib_scene.toml").write_text(text.replace("size = [256.0, 192.0]", "size = [0.0, 0.0]"))
    assert "whole numbers of pixels" in refusal(tmp_path)


def test_a_stated_axis_stays(tmp_path):
    undescribed(tmp_path)
    (tmp_path / "Calib_scene.toml").unlink()
    write_calibration(tmp_path / "rig.npz", rig(), "-Z")
    table, doubts = proposed(tmp_path)
    assert table["up"] == "-Z"
    assert "but the cameras stand as if +Z did" in doubts[0]


@pytest.mark.parametrize(
    ("spoil", "told"),
    [("calibration", "holds no calibration"), ("views", "holds no view for each of"), ("rate", "give --fps")],
)
def test_what_is_missing_is_named(tmp_path, spoil, told):
    undescribed(tmp_path)
    if spoil == "calibration":
        (tmp_path / "Calib_scene.toml").unlink()
    elif spoil == "views":
        (tmp_path / "masks").rename(tmp_path / ".masks")
    assert told in refusal(tmp_path, fps=None)


def test_views_of_different_rates_need_a_word(tmp_path):
    bare(tmp_path, "video")
    writer = cv2.VideoWriter(str(tmp_path / "left.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 30.0, folders.SIZE)
    for _ in range(folders.FRAMES):
        writer.write(np.zeros((30, 40, 3), np.uint8))
    writer.release()
    assert "different rates (front 25.0, left 30.0, right 25.0)" in refusal(tmp_path, fps=None)


def test_names_of_any_signs_are_written_as_toml(tmp_path):
    names = ['a "quoted"', "b\\slash", "c\nline", "d\x7f", "e#"]
    undescribed(tmp_path, place=lambda camera, frame: f"masks/{names[int(camera[3:]) - 1]}/{frame:06d}.png")
    assert list(proposed(tmp_path)[0]["views"]) == names
