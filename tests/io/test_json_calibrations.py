"""The keys of a JSON file decide its meaning; ambiguous files are refused."""

import dataclasses
import re

import numpy as np
import pytest
from support import calibration_json as files
from support.calibration_files import Rig, a_rig, sizes_of
from support.json_camera import BACK, LENS, K, R, T
from support.refused_calibrations import refused

from jaxskel.cameras import Cameras
from jaxskel.io.calibrations import contents_of, read_calibration


def renamed(rig: Rig, *names: str) -> Rig:
    return dataclasses.replace(rig, names=names)


def without_lens(seed: int) -> Rig:
    return a_rig(seed, 0)


def assert_same(cameras: Cameras, rig: Rig) -> None:
    assert cameras.names == rig.names
    np.testing.assert_array_equal(cameras.size, rig.size)
    for key in ("K", "R", "t", "dist"):
        np.testing.assert_allclose(getattr(cameras, key), getattr(rig, key), atol=1e-7, rtol=1e-9)


def relative(R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same rig in the frame of its first camera."""
    turns = R @ R[0].T
    return turns, t - np.einsum("cij,j->ci", turns, t[0])


DRAWN = {
    "voxelpose": {"0": {"R": R, "T": [[0], [-3000], [1000]], "fx": 500, "fy": 500, "cx": 320, "cy": 240,
                        "k": [[0], [0], [0]], "p": [[0], [0]]}},
    "multical": {"cameras": {"a": {"model": "standard", "image_size": [640, 480], "K": K, "dist": [[0] * 5]}},
                 "camera_poses": {"a": {"R": R, "T": T}}},
    "open3d": {"class_name": "PinholeCameraParameters",
               "extrinsic": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 3, 1],
               "intrinsic": {"width": 640, "height": 480, "intrinsic_matrix": [500, 0, 0, 0, 500, 0, 320, 240, 1]}},
    "aist": [{"name": "c01", "size": [640, 480], "matrix": K, "rotation": [np.pi / 2, 0, 0],
              "translation": [0, 100, 300], "distortions": [0] * 5}],
    # Columns: right, up, back, place; a pixel's corner is half a pixel before its centre.
    "nerfstudio": {"w": 640, "h": 480, "fl_x": 500, "cx": 320.5, "cy": 240.5, "frames": [
        {"file_path": "./a.png", "transform_matrix": [[1, 0, 0, 0], [0, 0, -1, -3], [0, 1, 0, 1], [0, 0, 0, 1]]}]},
    "opening": {"w": 640, "h": 480, "camera_angle_x": 2 * np.arctan(0.64), "frames": [
        {"file_path": "a", "cx": 320.5, "cy": 240.5,
         "transform_matrix": [[1, 0, 0, 0], [0, 0, -1, -3], [0, 1, 0, 1], [0, 0, 0, 1]]}]},
    "R and t": {"a": LENS | {"R": R, "t": T}},
    "R and centre": {"cameras": [LENS | {"name": "a", "R": R, "C": [0, -3, 1]}]},
    "w2c": {"a": LENS | {"w2c": [[*row, shift] for row, shift in zip(R, T, strict=True)]}},
    "c2w": {"a": LENS | {"c2w": [*BACK, [0, 0, 0, 1]]}},
    "extrinsics apart": [{"id": 7, "intrinsics": LENS, "extrinsics": {"rotation": R, "translation": T}}],
    "one lens for all": LENS | {"cameras": {"a": {"R": R, "T": T}}},
    "one camera": LENS | {"rvec": [np.pi / 2, 0, 0], "tvec": [[0], [1], [3]]},
    "millimetres": {"unit": "mm", "a": LENS | {"R": R, "t": [0, 1000, 3000]}},
}  # fmt: skip


@pytest.mark.parametrize("kind", DRAWN)
def test_a_camera_that_was_drawn_on_paper(kind, tmp_path):
    path = files.saved(tmp_path / "a.json", DRAWN[kind])
    contents = contents_of(path)
    unit = 1.0 if contents.unit is None else None
    sizes = {"0": (640, 480)} if kind == "voxelpose" else None
    cameras = read_calibration(path, unit=unit, sizes=sizes).cameras
    np.testing.assert_allclose(cameras.centres, [[0, -3, 1]], atol=1e-9)
    np.testing.assert_allclose(cameras.R[0], R, atol=1e-9)
    np.testing.assert_allclose(cameras.K[0], K, atol=1e-9)
    assert cameras.size.tolist() == [[640, 480]]


@pytest.mark.parametrize("chain", [False, True])
def test_cameras_of_multical_that_stand_relative_to_each_other(chain, tmp_path):
    rig = a_rig(1, 5)
    lenses = {name: files.multical_lens(rig, i, 5) for i, name in enumerate(rig.names)}
    poses = {rig.names[0]: {"R": np.eye(3).tolist(), "T": [0, 0, 0]}}
    for i in range(1, len(rig.names)):
        other = i - 1 if chain else 0
        step = files.whole(rig.R[i], rig.t[i]) @ np.linalg.inv(files.whole(rig.R[other], rig.t[other]))
        key = f"{rig.names[i]}_to_{rig.names[other]}"
        poses[key] = {"R": step[:3, :3].tolist(), "T": step[:3, 3].tolist()}
    path = files.saved(tmp_path / "calibration.json", {"cameras": lenses, "camera_poses": poses})
    R, t = relative(rig.R, rig.t)
    assert_same(read_calibration(path).cameras, dataclasses.replace(rig, R=R, t=t))
    # The reference camera need not have a pose of its own; without one it is left out.
    files.changed_file(path, lambda table: table["camera_poses"].pop(rig.names[0]))
    found = read_calibration(path)
    assert found.unposed == rig.names[:1]
    np.testing.assert_allclose(found.cameras.t, t[1:], atol=1e-9)


def test_cameras_of_multical_that_are_none(tmp_path):
    rig = a_rig(2, 5)
    path = files.multical(tmp_path, rig)
    text = path.read_text()
    files.changed_file(path, lambda table: table["cameras"]["cam_2"].update(dist=[[0.1, 0.02, 0.003, 0.004]]))
    assert [entry.fisheye for entry in contents_of(path).entries] == [False, True, False, False]
    files.changed_file(path, lambda table: table["cameras"]["cam_2"].update(dist=[0, 0, 0, 0]))
    assert "camera cam_2: has four coefficients of zero" in refused(path)
    path.write_text(text)
    files.changed_file(path, lambda table: table["camera_poses"].pop("cam_9"))
    assert read_calibration(path).unposed == ("cam_9",)
    circle = {
        f"{a}_to_{b}": {"R": np.eye(3).tolist(), "T": [0, 0, 0]} for a, b in (("cam_1", "cam_2"), ("cam_2", "cam_1"))
    }
    files.changed_file(path, lambda table: table.update(camera_poses=circle))
    assert "camera cam_1: its pose is relative to cam_1, and that to it" in refused(path)
    files.changed_file(path, lambda table: table.pop("camera_poses"))
    assert "holds intrinsics only; export the calibration of the rig" in refused(path)


def test_a_trajectory_of_open3d_old_and_new(tmp_path):
    rig = renamed(without_lens(3), "cam0", "cam1", "cam2", "cam3")
    path = files.open3d_trajectory(tmp_path, rig)
    assert_same(read_calibration(path).cameras, rig)

    def by_row(table):
        camera = table["parameters"][1]
        camera["extrinsic"] = np.reshape(camera["extrinsic"], (4, 4)).T.ravel().tolist()

    assert "camera cam1: extrinsic does not end in the row [0, 0, 0, 1]; give it column by column" in refused(
        files.changed_file(path, by_row)
    )
    poses = [files.open3d_camera(rig, i)["extrinsic"] for i in range(4)]
    old = {
        "class_name": "PinholeCameraTrajectory",
        "extrinsic": poses,
        "intrinsic": files.open3d_camera(rig, 2)["intrinsic"],
    }
    found = read_calibration(files.saved(path, old)).cameras
    np.testing.assert_allclose(found.t, rig.t, atol=1e-9)
    np.testing.assert_allclose(found.K, np.broadcast_to(rig.K[2], (4, 3, 3)))


def test_aist_has_centimetres_by_the_names_of_its_cameras(tmp_path):
    rig = renamed(a_rig(4, 5), "c01", "c02", "c03", "c04")
    found = read_calibration(files.anipose_list(tmp_path, rig, 0.01))
    assert_same(found.cameras, rig)
    assert (found.format, found.up) == ("AIST++ JSON", None)


def test_mvhumannet_wants_the_scale_that_lies_in_its_pickle(tmp_path):
    rig = renamed(a_rig(5, 5), "CC32871A000", "CC32871A001", "CC32871A002", "CC32871A010")
    rig = dataclasses.replace(rig, K=rig.K[[0] * 4], dist=rig.dist[[0] * 4])
    path = files.mvhumannet(tmp_path, rig)
    (tmp_path / "camera_scale.pkl").write_bytes(b"\x80\x04X\x05\x00\x00\x00never.")
    for given in (tmp_path, path, tmp_path / "camera_intrinsics.json"):
        assert_same(read_calibration(given, unit=0.001, sizes=sizes_of(rig)).cameras, rig)
    assert "camera_scale.pkl holds, a pickle, which is never read; give unit = 0.001 times" in refused(path)
    (tmp_path / "camera_intrinsics.json").write_text('{"K": 1}')
    assert "intrinsics is missing" in refused(path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"camera_model": "EQUIRECTANGULAR"}, "has the camera_model EQUIRECTANGULAR, which is not read"),
        ({"k4": 0.1}, "k4 is not OpenCV's: nerfstudio has it for r^8"),
        ({"fl_x": None}, "fl_x holds None"),
        ({"transform_matrix": np.eye(4)[[3, 1, 2, 0]].tolist()}, "does not end in the row"),
        ({"file_path": 3}, "camera number 1: file_path is missing or no text"),
        ({"file_path": "images/cam_1/0001.png"}, "several images of one camera"),
    ],
)
def test_frames_of_nerfstudio_that_are_none(change, says, tmp_path):
    path = files.nerfstudio(tmp_path, a_rig(6, 5))
    files.changed_file(path, lambda table: table["frames"][1].update(change))
    assert says in refused(path, unit=1.0)


def test_nerfstudio_has_no_scale_and_says_which_lenses_are_fisheye(tmp_path):
    path = files.nerfstudio(tmp_path, a_rig(7, 5))
    assert "nerfstudio JSON has no scale" in refused(path)
    files.changed_file(path, lambda table: table.update(camera_model="OPENCV_FISHEYE"))
    assert all(entry.fisheye and len(entry.dist) == 4 for entry in contents_of(path).entries)


def test_lens_models_of_calibio(tmp_path):
    rig = a_rig(8, 8)
    path = files.calibio(tmp_path, rig)
    text = path.read_text()

    def cameras(table):
        return table["Calibration"]["cameras"]

    files.changed_file(
        path, lambda table: cameras(table)[2]["model"]["ptr_wrapper"]["data"]["parameters"]["s1"].update(val=0.1)
    )
    assert "camera cam_9: 14 distortion coefficients" in refused(path)
    for kind, fisheye in (("OpenCVFisheye", True), ("Matlab", False)):
        path.write_text(text.replace("CameraModelOpenCV", f"CameraModel{kind}"))
        assert all(entry.fisheye is fisheye for entry in contents_of(path).entries)
    path.write_text(text.replace("CameraModelOpenCV", "CameraModelDivision"))
    assert "camera cam_1: has the lens model CameraModelDivision, which is not read" in refused(path)
    path.write_text(text)
    files.changed_file(path, lambda table: [camera.pop("serial") for camera in cameras(table)])
    files.changed_file(path, lambda table: cameras(table)[3].update(transform=None))
    found = read_calibration(path)
    assert (found.cameras.names, found.unposed) == (("cam0", "cam1", "cam2"), ("cam3",))


@pytest.mark.parametrize(
    "text", ["{}", "[]", "3", "null", '"K"', '{"people": [{"pose_keypoints_2d": [1, 2]}]}', '{"cameras": {}}', "[[1]]"]
)
def test_json_of_no_known_format(text, tmp_path):
    (tmp_path / "a.json").write_text(text)
    assert re.search(
        r"is of no known format; these are read: TOML .*\.json \(.*VoxelPose", refused(tmp_path / "a.json")
    )
    assert "is a folder without a calibration; these are read" in refused(tmp_path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[" * 100_000, "lists within lists"),
        ('{"a":' * 50_000, "lists within lists"),
        ("[" + "[]," * 600_000 + "[]]", "more than 500000 lists"),
        ('{"a": {"K": 1, "K": 2}}', "key 'K': is there twice"),
        ("[" + "{}," * 20_000 + "{}]", "holds 20001 cameras"),
        ("1" * 5000, "is not JSON"),
        ('{"a": ', "is not JSON"),
    ],
)
def test_json_that_would_fill_the_memory_or_the_stack(text, says, tmp_path):
    (tmp_path / "a.json").write_text(text)
    assert says in refused(tmp_path / "a.json")


def test_a_folder_of_cameras_of_two_formats(tmp_path):
    rig = a_rig(10, 0)
    files.open3d(tmp_path, rig)
    files.saved(tmp_path / "cam_1.json", LENS | {"R": R, "t": T})
    assert "holds cameras of JSON (K, R, t) and Open3D JSON; keep those of one format" in refused(tmp_path)
