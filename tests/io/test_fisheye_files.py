"""Fisheye lenses in files: read as other tools write them, written so that they are read back the same."""

import re
from typing import Any

import cv2
import numpy as np
import pytest
from support.files import arrays_of, recording_file, same
from support.fisheyes import BARREL, FISHEYES, FOLDS, by_opencv, mixed_ring

from jaxskel import Cameras, make_cameras
from jaxskel.cameras import project
from jaxskel.io.calibrations import (
    read_calibration,
    write_calibration,
    write_easymocap_calibration,
    write_pose2sim_calibration,
)
from jaxskel.io.recordings import read_recording, write_recording

POINTS = np.random.default_rng(0).normal([0, 0, 1], 0.4, (100, 3))


def fisheye_ring() -> Cameras:
    """Four cameras, all of them fisheyes without skew."""
    rig = mixed_ring(4)
    K = np.array(rig.K)
    K[:, 0, 1] = 0.0
    return make_cameras(K, rig.R, rig.t, rig.size, list(FISHEYES.values()), ["a", "b", "c", "d"], fisheye=True)


def mixed() -> Cameras:
    """The same rig, except for the second camera."""
    rig = fisheye_ring()
    lenses = np.array(rig.dist)
    lenses[1] = BARREL
    return make_cameras(rig.K, rig.R, rig.t, rig.size, lenses, rig.names, fisheye=[True, False, True, True])


def refused(path, says: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}.*{says}") as refusal:
        read_calibration(path)
    assert "\n" not in str(refusal.value)


def same_rig(one: Cameras, other: Cameras) -> None:
    assert one.names == other.names
    np.testing.assert_array_equal(one.are_fisheye, other.are_fisheye)
    np.testing.assert_array_equal(one.size, other.size)
    for field in ("K", "R", "t", "dist", "max_radius"):
        np.testing.assert_allclose(getattr(one, field), getattr(other, field), atol=1e-12)


@pytest.mark.parametrize("rig", [fisheye_ring, mixed])
def test_what_is_written_is_read_back(rig, tmp_path):
    write_pose2sim_calibration(tmp_path / "Calib.toml", rig())
    same_rig(read_calibration(tmp_path / "Calib.toml").cameras, rig())
    write_calibration(tmp_path / "rig.npz", rig(), "+Y")
    same_rig(read_calibration(tmp_path / "rig.npz").cameras, rig())


def test_sequence_files_hold_the_lens_models(tmp_path):
    clip = recording_file(tmp_path)
    assert "fisheye" not in arrays_of(clip)
    arrays: dict[str, Any] = arrays_of(clip) | {"fisheye": np.array([True, False, True])}
    arrays["dist"] = np.vstack([np.pad(FISHEYES["mild"], (0, 4)), BARREL, np.pad(FISHEYES["strong"], (0, 4))])
    np.savez(clip, **arrays)
    recording = read_recording(clip)
    assert recording.cameras.are_fisheye.tolist() == [True, False, True]
    write_recording(tmp_path / "again.npz", recording)
    assert same(read_recording(tmp_path / "again.npz").cameras, recording.cameras)
    same_rig(read_calibration(clip).cameras, recording.cameras)
    arrays["fisheye"] = np.array([1, 0, 1], np.uint8)
    np.savez(clip, **arrays)
    assert read_recording(clip).cameras.are_fisheye.tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("key", "change", "says"),
    [
        ("fisheye", {"fisheye": np.array([True, False])}, r"give \(3,\) values, true or false"),
        ("fisheye", {"fisheye": np.array([0, 1, 2])}, "true or false"),
        ("fisheye", {"fisheye": np.array([0.0, 1.0, 0.0])}, "true or false"),
        ("fisheye", {"fisheye": np.array(["no", "yes", "no"])}, "true or false"),
        ("fisheye", {"fisheye": np.array(True)}, "true or false"),
        (
            "dist",
            {"dist": np.tile([0.1, 0.0, 0.0, 0.0, 0.01], (3, 1))},
            "camera left.* the four|camera left.*four coefficients",
        ),
        ("dist", {"dist": np.tile([0.1, 0.0, 0.0, np.nan], (3, 1))}, "holds nan at index"),
        ("dist", {"dist": np.tile([-3.0, 0.0, 0.0, 0.0], (3, 1))}, "camera left .*folds its image at 19 degrees"),
    ],
)
def test_wrong_lens_models_in_sequence_files(key, change, says, tmp_path):
    clip = recording_file(tmp_path)
    np.savez(clip, **(arrays_of(clip) | {"fisheye": np.array([False, True, False])} | change))
    with pytest.raises(ValueError, match=f"^{re.escape(str(clip))}: key '{key}': .*{says}") as refusal:
        read_recording(clip)
    assert "\n" not in str(refusal.value)
    refused(clip, says)


def test_tables_of_fisheyes_do_not_tell_whose_file_it_is(tmp_path):
    # Four distortions are Pose2Sim's habit, and with it a world with Z up; but fisheyes have four in every file.
    write_pose2sim_calibration(tmp_path / "cameras.toml", fisheye_ring())
    assert read_calibration(tmp_path / "cameras.toml").format == "Anipose TOML"
    assert read_calibration(tmp_path / "cameras.toml").up is None
    write_pose2sim_calibration(tmp_path / "Calib.toml", fisheye_ring())
    assert read_calibration(tmp_path / "Calib.toml").up == "+Z"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("fisheye = true", 'fisheye = "no"', "camera a: fisheye is 'no'; give true or false"),
        ("fisheye = true", "fisheye = 1", "camera a: fisheye is '1'; give true or false"),
        ("distortions = .*", "distortions = [0.1, 0.0, 0.0, 0.0, 0.0]", "camera a: is a fisheye lens of 5 distortion"),
        ("distortions = .*", "distortions = []", "camera a: is a fisheye lens of 0 distortion"),
        ("distortions = .*", "distortions = [0.1, nan, 0.0, 0.0]", "camera a: distortions holds nan"),
        ("distortions = .*", "distortions = [-3.0, 0.0, 0.0, 0.0]", r"camera a \(index 0\): .*folds its image at 19"),
    ],
)
def test_tables_that_are_no_fisheyes(old, new, says, tmp_path):
    path = tmp_path / "Calib.toml"
    write_pose2sim_calibration(path, fisheye_ring())
    path.write_text(re.sub(old, new, path.read_text(), count=1))
    refused(path, says)


def test_caliscopes_tables(tmp_path):
    path, rig = tmp_path / "camera_array.toml", mixed()
    write_pose2sim_calibration(path, rig)
    text = path.read_text().replace("name = ", "device = ")
    for i, name in enumerate(rig.names):
        text = text.replace(f'["{name}"]', f"[cameras.{i}]")
    path.write_text(text)
    found = read_calibration(path)
    assert found.format == "Caliscope TOML"
    assert found.cameras.are_fisheye.tolist() == [True, False, True, True]
    np.testing.assert_allclose(found.cameras.dist, rig.dist, atol=1e-12)


def opencv_file(folder, rig: Cameras, i: int, **more) -> None:
    file = cv2.FileStorage(str(folder / f"{rig.names[i]}.yml"), cv2.FILE_STORAGE_WRITE)
    file.write("image_width", int(rig.size[i, 0]))
    file.write("image_height", int(rig.size[i, 1]))
    for key, value in more.items():
        file.write(key, value)
    file.write("camera_matrix", np.asarray(rig.K[i]))
    count = 4 if rig.are_fisheye[i] else 5
    file.write("distortion_coefficients", np.array(rig.dist[i, :count])[:, None])
    file.write("R", np.asarray(rig.R[i]))
    file.write("T", np.asarray(rig.t[i])[:, None])
    file.release()


@pytest.mark.parametrize(
    ("wide", "straight"),
    [
        ({"fisheye_model": 1}, {"fisheye_model": 0}),
        ({"distortion_model": "equidistant"}, {"distortion_model": "plumb_bob"}),
        ({"distortion_model": "fisheye"}, {}),
        ({"fisheye_model": "true"}, {"fisheye_model": "false"}),
    ],
)
def test_opencvs_yaml(wide, straight, tmp_path):
    rig = mixed()
    for i, is_wide in enumerate(rig.are_fisheye):
        opencv_file(tmp_path, rig, i, **(wide if is_wide else straight))
    same_rig(read_calibration(tmp_path).cameras, rig)


def test_opencvs_yaml_that_does_not_say_what_it_is(tmp_path):
    rig = fisheye_ring()
    opencv_file(tmp_path, rig, 0, fisheye_model="perhaps")
    refused(tmp_path / "a.yml", "camera a: fisheye_model is 'perhaps'; give 1")


MODELS = {
    "SIMPLE_FISHEYE": ("60 80 60", [0, 0, 0, 0]),
    "FISHEYE": ("60 60 80 60", [0, 0, 0, 0]),
    "SIMPLE_RADIAL_FISHEYE": ("60 80 60 0.05", [0.05, 0, 0, 0]),
    "RADIAL_FISHEYE": ("60 80 60 0.05 -0.01", [0.05, -0.01, 0, 0]),
    "OPENCV_FISHEYE": ("60 60 80 60 0.05 -0.01 0.004 -0.001", [0.05, -0.01, 0.004, -0.001]),
}


@pytest.mark.parametrize("model", MODELS)
def test_colmaps_models(model, tmp_path):
    parameters, lens = MODELS[model]
    (tmp_path / "cameras.txt").write_text(f"1 {model} 160 120 {parameters}\n2 OPENCV 160 120 60 60 80 60 .1 0 .01 0\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 3 1 a.png\n\n2 1 0 0 0 1 0 3 2 b.png\n\n")
    cameras = read_calibration(tmp_path, unit=1.0).cameras
    assert cameras.are_fisheye.tolist() == [True, False]
    K = np.array([[60.0, 0, 79.5], [0, 60, 59.5], [0, 0, 1]])  # COLMAP counts from the corner of a pixel
    expected, _ = cv2.fisheye.projectPoints(
        POINTS[:, None], np.zeros(3), np.array([0, 0, 3.0]), K, np.array(lens, float)
    )
    np.testing.assert_allclose(np.stack(project(cameras, POINTS)[:2], -1)[0], expected[:, 0], atol=1e-9)
    np.testing.assert_array_equal(cameras.dist[1], [0.1, 0, 0.01, 0, 0, 0, 0, 0])


@pytest.mark.parametrize("model", ["THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE", "FOV", "EUCM"])
def test_models_of_colmap_that_are_not_opencvs(model, tmp_path):
    (tmp_path / "cameras.txt").write_text(f"1 {model} 160 120 60 60 80 60 0 0 0 0 0 0 0 0\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 3 1 a.png\n\n")
    with pytest.raises(ValueError, match=f"has the model {model}, which is not read"):
        read_calibration(tmp_path, unit=1.0)


def test_easymocap_has_no_fisheye(tmp_path):
    with pytest.raises(ValueError, match="camera a: EasyMocap has no fisheye lens; undistort"):
        write_easymocap_calibration(tmp_path, mixed())


def test_rigs_that_were_read_see_as_opencv_does(tmp_path):
    write_pose2sim_calibration(tmp_path / "Calib.toml", mixed())
    cameras = read_calibration(tmp_path / "Calib.toml").cameras
    uv = np.stack(project(cameras, POINTS)[:2], -1)
    for i in (0, 2, 3):
        np.testing.assert_allclose(uv[i], by_opencv(mixed(), i, POINTS), atol=1e-9)


def test_numbers_of_an_ordinary_lens_that_fold_a_fisheye(tmp_path):
    rig = fisheye_ring()
    lens = np.array(rig.dist)
    write_pose2sim_calibration(tmp_path / "Calib.toml", make_cameras(rig.K, rig.R, rig.t, rig.size, lens, rig.names))
    text = (tmp_path / "Calib.toml").read_text().replace("fisheye = false", "fisheye = true")
    (tmp_path / "Calib.toml").write_text(re.sub("distortions = .*", f"distortions = {FOLDS}", text, count=1))
    refused(tmp_path / "Calib.toml", "camera a .*folds its image at 66 degrees to its axis, 46 px from its centre")
