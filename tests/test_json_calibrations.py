"""What a file in JSON means, told by its keys, and where nothing tells, refused."""

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import json_calibration_files as files
import numpy as np
import pytest
from calibration_files import Rig, a_rig, sizes_of
from test_calibration_refusals import refused

from jaxskel._camera import Cameras
from jaxskel.io import read_calibration
from jaxskel.io.calibrations import contents_of


def renamed(rig: Rig, *names: str) -> Rig:
    return dataclasses.replace(rig, names=names)


def without_lens(seed: int) -> Rig:
    return a_rig(seed, 0)


def assert_same(cameras: Cameras, rig: Rig) -> None:
    assert cameras.names == rig.names
    np.testing.assert_array_equal(cameras.size, rig.size)
    for key in ("K", "R", "t", "dist"):
        np.testing.assert_allclose(getattr(cameras, key), getattr(rig, key), atol=1e-7, rtol=1e-9)


def edited(path: Path, change: Any) -> Path:
    table = json.loads(path.read_text())
    change(table)
    return files.saved(path, table)


def relative(R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same rig in the frame of its first camera."""
    turns = R @ R[0].T
    return turns, t - np.einsum("cij,j->ci", turns, t[0])


# A camera 3 m before the origin and 1 m high, which looks along +Y; its lens is 500 px long, its middle at (320, 240).
# Its right is +X and its down is -Z.
R, T = [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [0, 1, 3]
K = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
LENS = {"K": K, "size": [640, 480]}
BACK = [[1, 0, 0, 0], [0, 0, 1, -3], [0, -1, 0, 1]]
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
    # The camera that is the frame need not have a pose of its own: it has none then, and is left out.
    edited(path, lambda table: table["camera_poses"].pop(rig.names[0]))
    found = read_calibration(path)
    assert found.unposed == rig.names[:1]
    np.testing.assert_allclose(found.cameras.t, t[1:], atol=1e-9)


def test_cameras_of_multical_that_are_none(tmp_path):
    rig = a_rig(2, 5)
    path = files.multical(tmp_path, rig)
    text = path.read_text()
    edited(path, lambda table: table["cameras"]["cam_2"].update(dist=[[0.1, 0.02, 0.003, 0.004]]))
    assert [entry.fisheye for entry in contents_of(path).entries] == [False, True, False, False]
    edited(path, lambda table: table["cameras"]["cam_2"].update(dist=[0, 0, 0, 0]))
    assert "camera cam_2: has four coefficients of zero" in refused(path)
    path.write_text(text)
    edited(path, lambda table: table["camera_poses"].pop("cam_9"))
    assert read_calibration(path).unposed == ("cam_9",)
    circle = {
        f"{a}_to_{b}": {"R": np.eye(3).tolist(), "T": [0, 0, 0]} for a, b in (("cam_1", "cam_2"), ("cam_2", "cam_1"))
    }
    edited(path, lambda table: table.update(camera_poses=circle))
    assert "camera cam_1: its pose is relative to cam_1, and that to it" in refused(path)
    edited(path, lambda table: table.pop("camera_poses"))
    assert "holds intrinsics only; export the calibration of the rig" in refused(path)


def test_a_trajectory_of_open3d_old_and_new(tmp_path):
    rig = renamed(without_lens(3), "cam0", "cam1", "cam2", "cam3")
    path = files.open3d_trajectory(tmp_path, rig)
    assert_same(read_calibration(path).cameras, rig)

    def by_row(table):
        camera = table["parameters"][1]
        camera["extrinsic"] = np.reshape(camera["extrinsic"], (4, 4)).T.ravel().tolist()

    assert "camera cam1: extrinsic does not end in the row [0, 0, 0, 1]; give it column by column" in refused(
        edited(path, by_row)
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
    edited(path, lambda table: table["frames"][1].update(change))
    assert says in refused(path, unit=1.0)


def test_nerfstudio_has_no_scale_and_says_which_lenses_are_fisheye(tmp_path):
    path = files.nerfstudio(tmp_path, a_rig(7, 5))
    assert "nerfstudio JSON has no scale" in refused(path)
    edited(path, lambda table: table.update(camera_model="OPENCV_FISHEYE"))
    assert all(entry.fisheye and len(entry.dist) == 4 for entry in contents_of(path).entries)


def test_lens_models_of_calibio(tmp_path):
    rig = a_rig(8, 8)
    path = files.calibio(tmp_path, rig)
    text = path.read_text()

    def cameras(table):
        return table["Calibration"]["cameras"]

    edited(path, lambda table: cameras(table)[2]["model"]["ptr_wrapper"]["data"]["parameters"]["s1"].update(val=0.1))
    assert "camera cam_9: 14 distortion coefficients" in refused(path)
    for kind, fisheye in (("OpenCVFisheye", True), ("Matlab", False)):
        path.write_text(text.replace("CameraModelOpenCV", f"CameraModel{kind}"))
        assert all(entry.fisheye is fisheye for entry in contents_of(path).entries)
    path.write_text(text.replace("CameraModelOpenCV", "CameraModelDivision"))
    assert "camera cam_1: has the lens model CameraModelDivision, which is not read" in refused(path)
    path.write_text(text)
    edited(path, lambda table: [camera.pop("serial") for camera in cameras(table)])
    edited(path, lambda table: cameras(table)[3].update(transform=None))
    found = read_calibration(path)
    assert (found.cameras.names, found.unposed) == (("cam0", "cam1", "cam2"), ("cam3",))


def _way_back(camera):
    pose = np.linalg.inv(files.whole(np.array(camera["R"]), np.array(camera["t"])))
    camera |= {"R": pose[:3, :3].tolist(), "t": pose[:3, 3].tolist()}


def _centre(camera):
    camera["t"] = (-np.array(camera["R"]).T @ camera["t"]).tolist()


def _opengl(camera):
    flip = np.diag([1.0, -1.0, -1.0])
    camera |= {"R": (flip @ camera["R"]).tolist(), "t": (flip @ camera["t"]).tolist()}


def _both(camera):
    _opengl(camera)
    _way_back(camera)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (_way_back, "its poses were from camera to world: "),
        (_centre, "its translations were the optical centres"),
        (_opengl, "its cameras looked along -z"),
        (_both, "its poses were from camera to world in OpenGL's axes"),
    ],
)
@pytest.mark.parametrize("seed", range(4))
def test_poses_that_were_meant_in_another_way(seed, change, says, tmp_path):
    rig = a_rig(seed, 0)
    cameras = {
        name: {"K": rig.K[i].tolist(), "R": rig.R[i].tolist(), "t": rig.t[i].tolist(), "size": rig.size[i].tolist()}
        for i, name in enumerate(rig.names)
    }
    path = files.saved(tmp_path / "rig.json", cameras)
    assert_same(read_calibration(path).cameras, rig)
    for camera in cameras.values():
        change(camera)
    told = refused(files.saved(path, cameras))
    assert "its cameras look apart or stand on a heap, read as JSON (K, R, t); all would look at one point if" in told
    assert says in told


def test_translations_under_the_name_of_voxelposes_centres(tmp_path):
    rig = a_rig(9, 5)
    path = files.voxelpose(tmp_path, rig)
    edited(path, lambda table: [table[n].update(T=(1000 * rig.t[i]).tolist()) for i, n in enumerate(rig.names)])
    assert "if its optical centres were translations" in refused(path)


def test_two_cameras_side_by_side_are_taken_at_their_word(tmp_path):
    poses = [{"R": np.eye(3).tolist(), "t": [x, 0, 0]} for x in (0.0, -0.3, -0.6, -0.9)]
    path = files.saved(tmp_path / "rig.json", [LENS | pose for pose in poses])
    assert read_calibration(path).cameras.names == ("cam0", "cam1", "cam2", "cam3")


CAMERA = LENS | {"R": R, "t": T}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"R": None, "pose": BACK}, "pose does not say what it means; give R and t"),
        ({"R": [1, 0, 0, 0]}, "R is a quaternion, whose order nothing says"),
        ({"R": [90, 0, 0]}, "R is not a rotation vector in radians"),
        ({"T": T}, "t and T are both there; keep one"),
        ({"RT": BACK}, "RT and R are both there; keep one"),
        ({"C": [3, 0, 1]}, "t and C do not agree"),
        ({"convention": "pytorch3d"}, "convention is 'pytorch3d'; convert the cameras"),
        ({"K": np.eye(4)[[0, 1, 3, 2]].tolist()}, "K is no matrix K with a row and a column of the unit"),
        ({"K": [500, 500, 320, 240]}, "K holds 4 numbers; give 9 or 16"),
        ({"K": np.transpose(K).tolist()}, "K is not an upper triangular intrinsic matrix"),
        ({"mtx": K}, "K and mtx are both there; keep one"),
        ({"camera_model": "omnidir"}, "camera_model is 'omnidir', which is not read"),
        ({"unit": "inch"}, "unit is 'inch'; give m, cm or mm"),
        ({"unit": "mm"}, "key 'unit': differs between the cameras"),
        ({"t": [0, float("nan"), 0]}, "t holds nan; give finite numbers"),
        ({"t": [0, 10**400, 0]}, "t holds a number of 1329 bits"),
        ({"dist": {"a": 1}}, "dist holds {'a': 1}; give finite numbers"),
    ],
)
def test_a_camera_written_by_hand_that_is_in_doubt(change, says, tmp_path):
    cameras = {"a": CAMERA | {"unit": "m"}, "b": {**CAMERA, "t": [2, 1, 3], **change}}
    cameras["b"] = {key: value for key, value in cameras["b"].items() if value is not None}
    told = refused(files.saved(tmp_path / "rig.json", cameras))
    assert says in told
    assert "camera b" in told or "differs" in told


def test_cameras_written_by_hand_without_a_pose(tmp_path):
    cameras = {"a": CAMERA, "b": {**CAMERA, "t": [2, 1, 3]}, "c": {**CAMERA, "R": None, "t": None}}
    path = files.saved(tmp_path / "rig.json", cameras)
    found = read_calibration(path)
    assert (found.cameras.names, found.unposed) == (("a", "b"), ("c",))
    assert "camera c: was not posed" in refused(path, sizes={name: (640, 480) for name in "abc"})
    assert "none of its cameras has a pose under a key that is known" in refused(files.saved(path, {"c": cameras["c"]}))


@pytest.mark.parametrize(
    ("mark", "fisheye"),
    [({"fisheye": True}, True), ({"distortion_model": "equidistant"}, True), ({"model": "Fisheye"}, True),
     ({"model": "GoPro Hero 7"}, False), ({"class_name": "FisheyeCameraParameter"}, False),
     ({"fisheye": False}, False)],
)  # fmt: skip
def test_a_fisheye_lens_says_so(mark, fisheye, tmp_path):
    path = files.saved(tmp_path / "rig.json", {"a": CAMERA | mark | {"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4}})
    (entry,) = contents_of(path).entries
    assert entry.fisheye is fisheye
    assert entry.dist.tolist() == ([0.1, 0.2, 0.3, 0.4] if fisheye else [0.1, 0.2, 0, 0, 0.3, 0.4, 0, 0])


@pytest.mark.parametrize(
    "text", ["{}", "[]", "3", "null", '"K"', '{"people": [{"pose_keypoints_2d": [1, 2]}]}', '{"cameras": {}}', "[[1]]"]
)
def test_json_of_no_known_format(text, tmp_path):
    (tmp_path / "a.json").write_text(text)
    assert re.search(
        r"is of no known format; these are read: TOML .*\.json \(CMU Panoptic", refused(tmp_path / "a.json")
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
    files.saved(tmp_path / "cam_1.json", CAMERA)
    assert "holds cameras of JSON (K, R, t) and Open3D JSON; keep those of one format" in refused(tmp_path)
