from pathlib import Path

import cv2
import numpy as np
import pytest
import test_folders as folders

from jaxskel import make_cameras
from jaxskel.io import read_recording, write_pose2sim_calibration
from jaxskel.io.proposals import match_names, propose_recording
from jaxskel.io.view_sets import find_view_sets


@pytest.mark.parametrize(
    ("views", "cameras", "matched", "by_order"),
    [
        (["cam01", "cam02"], ["cam_02", "cam_01"], ["cam_01", "cam_02"], False),
        (["Cam 1", "Cam 10"], ["cam10", "cam01"], ["cam01", "cam10"], False),
        (["video_3", "video_4"], ["GoPro4", "GoPro3", "GoPro5"], ["GoPro3", "GoPro4"], False),
        (["left", "right"], ["right", "left"], ["left", "right"], False),
        (["left", "right"], ["int_0", "int_1"], ["int_0", "int_1"], True),
        (["cam1", "cam2"], ["cam2", "cam3"], ["cam2", "cam3"], True),
    ],
)
def test_views_go_with_cameras_by_name_then_by_number_then_by_order(views, cameras, matched, by_order):
    assert match_names(views, cameras) == (dict(zip(views, matched, strict=True)), by_order)


@pytest.mark.parametrize("cameras", [["int_0"], ["a", "b", "c"], ["left", "front", "back"]])
def test_names_and_numbers_that_do_not_fit_are_no_guess(cameras):
    with pytest.raises(ValueError, match="by hand"):
        match_names(["left", "right"], cameras)


def bare(folder: Path, kind: str) -> Path:
    """A folder that nobody has described yet."""
    (folders.write_folder(folder, kind) / "recording.toml").unlink()
    return folder


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
    assert (abs(seen - 1) < 0.1).all()  # corners are rounded where pictures are cut out
    assert read.fps == 25.0


def test_colour_without_an_empty_scene_is_a_median_to_be_checked(tmp_path):
    proposal = propose_recording(bare(tmp_path, "backdrop"))
    assert "median = true  # CHECK" in proposal.text
    assert len(proposal.doubts) == 3


def test_where_it_had_to_choose_it_says_so(tmp_path):
    bare(tmp_path, "video")
    cameras = folders.a_recording().cameras
    renamed = make_cameras(cameras.K, cameras.R, cameras.t, cameras.size + 8, names=["int_1", "int_2", "int_3"])
    write_pose2sim_calibration(tmp_path / "calibration.toml", renamed)
    folders.write_video(tmp_path / "left.avi", np.zeros((4, 30, 40, 3), np.uint8))
    proposal = propose_recording(tmp_path)
    text = proposal.text
    for part in ('camera = "int_1"  # CHECK', "calibrated_size = [48, 38]  # CHECK", "frames = [0, 3]  # CHECK"):
        assert part in text
    assert len(proposal.doubts) == 5
    (tmp_path / "recording.toml").write_text(text)
    assert len(read_recording(tmp_path)) == 4


def test_several_sets_are_a_question_and_masks_go_before_colour(tmp_path):
    bare(tmp_path, "folders")
    folders.write_views(tmp_path, folders.a_recording(), "video")
    assert 'masks = "masks/left"' in propose_recording(tmp_path, fps=25.0).text
    assert 'masks = "left.avi"' in propose_recording(tmp_path, views="*.avi").text
    (tmp_path / "masks").rename(tmp_path / "pictures")
    with pytest.raises(ValueError, match=r"choose by --views PATTERN") as error:
        propose_recording(tmp_path)
    assert "*.avi (front, left, right), pictures/* (front, left, right)" in str(error.value)
    with pytest.raises(ValueError, match=r"--views \*.mov: there are"):
        propose_recording(tmp_path, views="*.mov")


def test_views_are_found_at_any_place_of_a_path(tmp_path):
    for name in ("1", "2", "10"):
        for what in ("video", "background", "checkerboard"):
            (tmp_path / f"cam{name}").mkdir(exist_ok=True)
            (tmp_path / f"cam{name}" / f"{what}.avi").write_bytes(b"")
    found = {view_set.pattern: view_set for view_set in find_view_sets(tmp_path)}
    assert list(found["*/video.avi"].sources) == ["cam1", "cam2", "cam10"]
    assert found["*/background.avi"].is_background
    assert found["*/checkerboard.avi"].is_accessory
    assert list(found["cam1/*.avi"].sources) == ["background", "checkerboard", "video"]


@pytest.mark.parametrize(
    ("spoil", "told"),
    [("calibration", "holds no calibration"), ("views", "holds no view for each of"), ("rate", "give --fps")],
)
def test_what_is_missing_is_named(tmp_path, spoil, told):
    bare(tmp_path, "folders")
    if spoil == "calibration":
        (tmp_path / "calibration.toml").unlink()
    elif spoil == "views":
        (tmp_path / "masks").rename(tmp_path / ".masks")
    with pytest.raises(ValueError, match=told):
        propose_recording(tmp_path)


def test_views_of_different_rates_need_a_word(tmp_path):
    bare(tmp_path, "video")
    writer = cv2.VideoWriter(str(tmp_path / "left.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 30.0, folders.SIZE)
    for _ in range(folders.FRAMES):
        writer.write(np.zeros((30, 40, 3), np.uint8))
    writer.release()
    with pytest.raises(ValueError, match=r"different rates \(front 25.0, left 30.0, right 25.0\)"):
        propose_recording(tmp_path)
