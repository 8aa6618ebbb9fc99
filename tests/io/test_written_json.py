"""Cameras in JSON that people write by hand: what a key says is taken, what it leaves open is refused."""

import numpy as np
import pytest
from support.calibration_files import a_rig
from support.calibration_json import changed_file, saved, voxelpose, whole
from support.json_camera import BACK, LENS, K, R, T
from support.refused_calibrations import refused

from jaxskel.io.calibrations import contents_of, read_calibration


def _way_back(camera):
    pose = np.linalg.inv(whole(np.array(camera["R"]), np.array(camera["t"])))
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
    path = saved(tmp_path / "rig.json", cameras)
    np.testing.assert_allclose(read_calibration(path).cameras.t, rig.t, atol=1e-9)
    for camera in cameras.values():
        change(camera)
    told = refused(saved(path, cameras))
    assert "its cameras look apart or stand on a heap, read as JSON (K, R, t); all would look at one point if" in told
    assert says in told


def test_translations_under_the_name_of_voxelposes_centres(tmp_path):
    rig = a_rig(9, 5)
    path = voxelpose(tmp_path, rig)
    changed_file(path, lambda table: [table[n].update(T=(1000 * rig.t[i]).tolist()) for i, n in enumerate(rig.names)])
    assert "if its optical centres were translations" in refused(path)


def test_two_cameras_side_by_side_are_taken_at_their_word(tmp_path):
    poses = [{"R": np.eye(3).tolist(), "t": [x, 0, 0]} for x in (0.0, -0.3, -0.6, -0.9)]
    path = saved(tmp_path / "rig.json", [LENS | pose for pose in poses])
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
    told = refused(saved(tmp_path / "rig.json", cameras))
    assert says in told
    assert "camera b" in told or "differs" in told


def test_cameras_written_by_hand_without_a_pose(tmp_path):
    cameras = {"a": CAMERA, "b": {**CAMERA, "t": [2, 1, 3]}, "c": {**CAMERA, "R": None, "t": None}}
    path = saved(tmp_path / "rig.json", cameras)
    found = read_calibration(path)
    assert (found.cameras.names, found.unposed) == (("a", "b"), ("c",))
    assert "camera c: was not posed" in refused(path, sizes={name: (640, 480) for name in "abc"})
    assert "none of its cameras has a pose under a key that is known" in refused(saved(path, {"c": cameras["c"]}))


@pytest.mark.parametrize(
    ("mark", "fisheye"),
    [({"fisheye": True}, True), ({"distortion_model": "equidistant"}, True), ({"model": "Fisheye"}, True),
     ({"model": "GoPro Hero 7"}, False), ({"class_name": "FisheyeCameraParameter"}, False),
     ({"fisheye": False}, False)],
)  # fmt: skip
def test_a_fisheye_lens_says_so(mark, fisheye, tmp_path):
    path = saved(tmp_path / "rig.json", {"a": CAMERA | mark | {"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4}})
    (entry,) = contents_of(path).entries
    assert entry.fisheye is fisheye
    assert entry.dist.tolist() == ([0.1, 0.2, 0.3, 0.4] if fisheye else [0.1, 0.2, 0, 0, 0.3, 0.4, 0, 0])
