"""Calibrations in JSON as written by tools or by hand, made from a rig without the package."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from support.calibration_files import Rig

_OPENGL = np.diag([1.0, -1.0, -1.0])


def saved(path: Path, table: Any) -> Path:
    path.write_text(json.dumps(table))
    return path


def changed_file(path: Path, change: Callable[[Any], Any]) -> Path:
    table = json.loads(path.read_text())
    change(table)
    return saved(path, table)


def rotation_vector(R: np.ndarray) -> list[float]:
    return cv2.Rodrigues(R)[0].ravel().tolist()


def centre(rig: "Rig", i: int) -> np.ndarray:
    return -rig.R[i].T @ rig.t[i]


def whole(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]])


def voxelpose(folder: Path, rig: "Rig") -> Path:
    """The optical centre under T, in millimetres; columns for k and p."""
    table = {
        name: {
            "R": rig.R[i].tolist(), "T": (1000 * centre(rig, i))[:, None].tolist(),
            "fx": rig.K[i, 0, 0], "fy": rig.K[i, 1, 1], "cx": rig.K[i, 0, 2], "cy": rig.K[i, 1, 2],
            "k": rig.dist[i, [0, 1, 4], None].tolist(), "p": rig.dist[i, [2, 3], None].tolist(),
        }
        for i, name in enumerate(rig.names)
    }  # fmt: skip
    return saved(folder / "calibration_shelf.json", dict(reversed(table.items())))


def multical_lens(rig: "Rig", i: int, coefficients: int) -> dict[str, Any]:
    return {"model": "standard", "image_size": rig.size[i].tolist(), "K": rig.K[i].tolist(),
            "dist": rig.dist[i, None, :coefficients].tolist()}  # fmt: skip


def multical(folder: Path, rig: "Rig") -> Path:
    """Poses in the frame of a rig, each under the name of its camera."""
    lenses = {name: multical_lens(rig, i, 5) for i, name in enumerate(rig.names)}
    poses = {name: {"R": rig.R[i].tolist(), "T": rig.t[i].tolist()} for i, name in enumerate(rig.names)}
    images = {"rgb": [{name: f"{name}/1.png" for name in rig.names}]}
    table = {"cameras": lenses, "camera_poses": poses, "image_sets": images}
    return saved(folder / "calibration.json", table)


def calibio_camera(rig: "Rig", i: int, keys: dict[str, float], base: str) -> dict[str, Any]:
    values = {"f": rig.K[i, 0, 0], "ar": rig.K[i, 1, 1] / rig.K[i, 0, 0], "cx": rig.K[i, 0, 2], "cy": rig.K[i, 1, 2]}
    width, height = rig.size[i].tolist()
    data = {
        "CameraModelCRT": {"CameraModelBase": {"imageSize": {"width": width, "height": height}}},
        "parameters": {key: {"state": 1, "val": float(value)} for key, value in (values | keys).items()},
    }
    # An archive gives the name of a class at its first use, and its number afterwards.
    model = {"polymorphic_id": 1, "ptr_wrapper": {"valid": 1, "data": data}}
    if i == 0:
        model |= {"polymorphic_id": 2147483649, "polymorphic_name": f"libCalib::{base}"}
    turn = dict(zip(("rx", "ry", "rz"), rotation_vector(rig.R[i]), strict=True))
    shift = dict(zip("xyz", rig.t[i].tolist(), strict=True))
    return {"model": model, "serial": rig.names[i], "transform": {"rotation": turn, "translation": shift}}


def calibio(folder: Path, rig: "Rig") -> Path:
    keys = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    rest = dict.fromkeys(("s1", "s2", "s3", "s4", "tauX", "tauY"), 0.0)
    cameras = [
        calibio_camera(rig, i, dict(zip(keys, rig.dist[i], strict=True)) | rest, "CameraModelOpenCV")
        for i in range(len(rig.names))
    ]
    return saved(folder / "calib.json", {"Calibration": {"cereal_class_version": 0, "cameras": cameras, "poses": []}})


def open3d_camera(rig: "Rig", i: int) -> dict[str, Any]:
    """Both matrices column by column."""
    width, height = rig.size[i].tolist()
    return {
        "class_name": "PinholeCameraParameters",
        "extrinsic": whole(rig.R[i], rig.t[i]).T.ravel().tolist(),
        "intrinsic": {"width": width, "height": height, "intrinsic_matrix": rig.K[i].T.ravel().tolist()},
        "version_major": 1,
        "version_minor": 0,
    }


def open3d(folder: Path, rig: "Rig") -> Path:
    """A file for each camera."""
    for i, name in enumerate(rig.names):
        saved(folder / f"{name}.json", open3d_camera(rig, i))
    return folder


def open3d_trajectory(folder: Path, rig: "Rig") -> Path:
    cameras = [open3d_camera(rig, i) for i in range(len(rig.names))]
    table = {"class_name": "PinholeCameraTrajectory", "parameters": cameras, "version_major": 1, "version_minor": 0}
    return saved(folder / "trajectory.json", table)


def anipose_list(folder: Path, rig: "Rig", unit: float = 1.0) -> Path:
    table = [
        {"name": name, "size": rig.size[i].tolist(), "matrix": rig.K[i].tolist(),
         "rotation": rotation_vector(rig.R[i]), "translation": (rig.t[i] / unit).tolist(),
         "distortions": rig.dist[i, :5].tolist()}
        for i, name in enumerate(rig.names)
    ]  # fmt: skip
    return saved(folder / "setting1.json", table)


def mvhumannet(folder: Path, rig: "Rig") -> Path:
    """One lens for all cameras, which is the first's."""
    saved(folder / "camera_intrinsics.json", {"intrinsics": rig.K[0].tolist(), "dist": rig.dist[0, :5].tolist()})
    poses = {
        f"1_{name}.png": {"rotation": rig.R[i].tolist(), "translation": (1000 * rig.t[i]).tolist()}
        for i, name in enumerate(rig.names)
    }
    return saved(folder / "camera_extrinsics.json", poses)


def nerfstudio(folder: Path, rig: "Rig") -> Path:
    """Camera to world in OpenGL's axes; pixels from the corner of the first; an arbitrary unit."""
    frames = []
    for i, name in enumerate(rig.names):
        width, height = rig.size[i].tolist()
        u, v = (rig.K[i, :2, 2] + 0.5).tolist()
        pose = whole(rig.R[i].T @ _OPENGL, centre(rig, i) / 0.37)
        lens = dict(zip(("k1", "k2", "p1", "p2", "k3"), rig.dist[i, :5].tolist(), strict=True))
        frames.append({
            "file_path": f"images/{name}/0001.png", "transform_matrix": pose.tolist(), "w": width, "h": height,
            "fl_x": rig.K[i, 0, 0], "fl_y": rig.K[i, 1, 1], "cx": u, "cy": v, **lens,
        })  # fmt: skip
    return saved(folder / "transforms.json", {"camera_model": "OPENCV", "frames": frames})


def by_hand(folder: Path, rig: "Rig") -> Path:
    """Every camera spelled in its own way."""
    cameras: dict[str, Any] = {}
    for i, name in enumerate(rig.names):
        K, R, t, dist, (width, height) = rig.K[i], rig.R[i], rig.t[i], rig.dist[i].tolist(), rig.size[i].tolist()
        C = centre(rig, i).tolist()
        keys = dict(zip(("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), dist, strict=True))
        focal = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2]}
        cameras[name] = [
            {"K": K.tolist(), "R": R.tolist(), "t": t.tolist(), "dist": dist, "size": [width, height]},
            {"intrinsics": focal | {"width": width, "height": height}, "distortion": keys, "c2w":
             whole(R.T, np.array(C)).tolist()},
            {"mtx": K.ravel().tolist(), "rvec": rotation_vector(R), "C": C, "distCoeffs": [dist],
             "resolution": {"width": width, "height": height}},
            {"camera_matrix": K.tolist(), "D": dist, "RT": whole(R, t)[:3].tolist(), "w": width, "h": height},
        ][i % 4]  # fmt: skip
    return saved(folder / "cameras.json", {"note": "ours", "cameras": dict(reversed(cameras.items()))})


def xrprimer(folder: Path, rig: "Rig") -> Path:
    """One file per camera, with a class named after a fisheye for an ordinary lens."""
    for i, name in enumerate(rig.names):
        width, height = rig.size[i].tolist()
        keys = dict(zip(("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), rig.dist[i].tolist(), strict=True))
        to_camera = i % 2 == 0
        R, t = (rig.R[i], rig.t[i]) if to_camera else (rig.R[i].T, centre(rig, i))
        saved(folder / f"{name}.json", keys | {
            "class_name": "FisheyeCameraParameter", "convention": "opencv", "name": name, "world2cam": to_camera,
            "extrinsic_r": R.tolist(), "extrinsic_t": t.tolist(), "height": height, "width": width,
            "intrinsic": whole(rig.K[i], np.zeros(3)).tolist(),
        })  # fmt: skip
    return folder


def projections(folder: Path, rig: "Rig") -> Path:
    matrices = {name: (rig.K[i] @ whole(rig.R[i], rig.t[i])[:3] / 7).tolist() for i, name in enumerate(rig.names)}
    return saved(folder / "P.json", {name: {"P": P} if i % 2 else P for i, (name, P) in enumerate(matrices.items())})
