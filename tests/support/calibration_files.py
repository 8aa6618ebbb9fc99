"""Random rigs, and calibration files of other tools as their documentation has them, written without the package."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from support import calibration_json as in_json


@dataclass(frozen=True)
class Rig:
    """Cameras around a person, in metres and OpenCV's convention; `dist` is k1, k2, p1, p2, k3, k4, k5, k6."""

    names: tuple[str, ...]
    K: np.ndarray
    R: np.ndarray
    t: np.ndarray
    dist: np.ndarray
    size: np.ndarray


@dataclass(frozen=True)
class Format:
    """How a file is written, how much of a lens it holds, and the reader's options and messages."""

    write: Callable[[Path, Rig], Path]
    coefficients: int
    format: str
    up: str | None
    unit: float | None = None
    has_size: bool = True


def a_rig(seed: int, coefficients: int = 8, cams: int = 4) -> Rig:
    rng = np.random.default_rng(seed)
    K, R, t = np.zeros((cams, 3, 3)), np.zeros((cams, 3, 3)), np.zeros((cams, 3))
    size = rng.integers(600, 2000, (cams, 2))
    for i in range(cams):
        angle, away = 2 * np.pi * (i + rng.random()) / cams, rng.uniform(2.5, 6)
        centre = np.array([away * np.cos(angle), away * np.sin(angle), rng.uniform(0.3, 2.5)])
        ahead = np.array([0, 0, 1]) + rng.normal(size=3) * 0.2 - centre
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1] + rng.normal(size=3) * 0.1)
        right /= np.linalg.norm(right)
        R[i] = right, np.cross(ahead, right), ahead
        t[i] = -R[i] @ centre
        K[i] = np.diag([*(rng.uniform(0.8, 1.5) * size[i].max() * rng.uniform(0.99, 1.01, 2)), 1.0])
        K[i, :2, 2] = size[i] / 2 + rng.normal(size=2) * 10
    dist = rng.uniform(-1, 1, (cams, 8)) * [0.15, 0.05, 0.003, 0.003, 0.02, 0.05, 0.02, 0.01]
    dist[:, coefficients:] = 0
    return Rig(tuple(f"cam_{i}" for i in (1, 2, 9, 10, 11)[:cams]), K, R, t, dist, size)


def seen_by_opencv(rig: Rig, index: int, points: np.ndarray) -> np.ndarray:
    """Where cv2.projectPoints sees world points (px)."""
    rvec = cv2.Rodrigues(rig.R[index])[0]
    return cv2.projectPoints(points, rvec, rig.t[index], rig.K[index], rig.dist[index])[0][:, 0]


def _quaternion(R: np.ndarray) -> np.ndarray:
    """Quaternion (x, y, z, w) of OpenCV's rotation vector."""
    vector = cv2.Rodrigues(R)[0][:, 0]
    angle = np.linalg.norm(vector)
    return np.append(vector / angle * np.sin(angle / 2), np.cos(angle / 2))


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _toml(path: Path, rig: Rig, coefficients: int, unit: float, metadata: str, head: str = "[{}]") -> Path:
    text = ""
    # Tools sort tables as text: cam_10 stands before cam_2.
    for name, i in sorted((name, i) for i, name in enumerate(rig.names)):
        rvec = cv2.Rodrigues(rig.R[i])[0][:, 0]
        text += (
            head.format(name.removeprefix("cam_") if "cameras" in head else name)
            + f"""
name = "{name}"
size = {rig.size[i].astype(float).tolist()}
matrix = {rig.K[i].tolist()}
distortions = {rig.dist[i, :coefficients].tolist()}
rotation = {rvec.tolist()}
translation = {(rig.t[i] / unit).tolist()}
fisheye = false

"""
        )
    path.write_text(text + metadata)
    return path


def pose2sim(folder: Path, rig: Rig) -> Path:
    return _toml(folder / "Calib_scene.toml", rig, 4, 1.0, "[metadata]\nadjusted = false\nerror = 0.0\n")


def anipose(folder: Path, rig: Rig) -> Path:
    return _toml(folder / "calibration.toml", rig, 5, 1.0, "[metadata]\nadjusted = false\nerror = 0.3\n")


def freemocap(folder: Path, rig: Rig) -> Path:
    return _toml(folder / "recording_camera_calibration.toml", rig, 5, 0.001,
                 "[metadata]\ncharuco_square_size = 39.0\ngroundplane_calibration = true\n")  # fmt: skip


def caliscope(folder: Path, rig: Rig) -> Path:
    ignored = "[cameras.5]\nsize = [4, 4]\nignore = true\n"
    path = _toml(folder / "camera_array.toml", rig, 5, 1.0, ignored, "[cameras.{}]\nrotation_count = 2\nexposure = -4")
    path.write_text(path.read_text().replace('name = "', 'device = "'))
    return path


def opencv(folder: Path, rig: Rig) -> Path:
    for i, name in enumerate(rig.names):
        file = cv2.FileStorage(str(folder / f"{name}.yml"), cv2.FILE_STORAGE_WRITE)
        file.write("calibration_time", "Thu 01 Jan 2026 10:00:00")
        file.write("image_width", int(rig.size[i, 0]))
        file.write("image_height", int(rig.size[i, 1]))
        file.write("camera_matrix", rig.K[i])
        file.write("distortion_coefficients", rig.dist[i][:, None])
        file.write("R", rig.R[i]) if i % 2 else file.write("rvec", cv2.Rodrigues(rig.R[i])[0])
        file.write("T", rig.t[i][:, None])
        file.release()
    return folder


def _easymocap(folder: Path, rig: Rig, keys: list[str], with_size: bool) -> Path:
    intri = cv2.FileStorage(str(folder / "intri.yml"), cv2.FILE_STORAGE_WRITE)
    extri = cv2.FileStorage(str(folder / "extri.yml"), cv2.FILE_STORAGE_WRITE)
    for file in (intri, extri):
        file.startWriteStruct("names", cv2.FileNode_SEQ)
        for name in rig.names:
            file.write("", name)
        file.endWriteStruct()
    for i, key in enumerate(keys):
        intri.write(f"K_{key}", rig.K[i])
        intri.write(f"dist_{key}", rig.dist[i, None, :5])
        if with_size:
            intri.write(f"W_{key}", int(rig.size[i, 0]))
            intri.write(f"H_{key}", int(rig.size[i, 1]))
        extri.write(f"R_{key}", cv2.Rodrigues(rig.R[i])[0])
        extri.write(f"Rot_{key}", rig.R[i])
        extri.write(f"T_{key}", rig.t[i][:, None])
    for file in (intri, extri):
        file.release()
    return folder


def easymocap(folder: Path, rig: Rig) -> Path:
    return _easymocap(folder, rig, list(rig.names), with_size=False)


def easymocap_with_size(folder: Path, rig: Rig) -> Path:
    return _easymocap(folder, rig, list(rig.names), with_size=True) / "extri.yml"


def easymocap_by_pose2sim(folder: Path, rig: Rig) -> Path:
    return _easymocap(folder, rig, [str(i + 1) for i in range(len(rig.names))], with_size=False) / "intri.yml"


def qualisys(folder: Path, rig: Rig) -> Path:
    """Cameras that look along -z with y up; a crop of the sensor; parts of 64 in a pixel; millimetres."""
    text = '<?xml version="1.0" encoding="ASCII"?>\n<calibration><cameras>\n'
    left, top = 7, 12
    for i, name in enumerate(rig.names):
        r = rig.R[i] * [[1], [-1], [-1]]
        x, y, z = -rig.R[i].T @ rig.t[i] * 1000
        k1, k2, p1, p2, k3 = rig.dist[i, :5]
        turn = " ".join(f'r{row + 1}{col + 1}="{r[row, col]}"' for row in range(3) for col in range(3))
        text += f"""<camera active="1" serial="{name}" model="Miqus Video" viewrotation="0">
<fov_video left="{left}" top="{top}" right="{left + rig.size[i, 0] - 1}" bottom="{top + rig.size[i, 1] - 1}"/>
<transform x="{x}" y="{y}" z="{z}" {turn}/>
<intrinsic focalLengthU="{64 * rig.K[i, 0, 0]}" focalLengthV="{64 * rig.K[i, 1, 1]}" skew="0"
 centerPointU="{64 * (rig.K[i, 0, 2] + left)}" centerPointV="{64 * (rig.K[i, 1, 2] + top)}"
 radialDistortion1="{k1}" radialDistortion2="{k2}" radialDistortion3="{k3}"
 tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/>
</camera>
"""
    marker = '<camera active="1" serial="9" model="Oqus 400"/><camera active="0" serial="8" model="Miqus Video"/>'
    (folder / "lab.qca.txt").write_text(text + marker + "</cameras></calibration>")
    return folder / "lab.qca.txt"


def vicon(folder: Path, rig: Rig, radial: tuple[float, float, float] = (0, 0, 0)) -> Path:
    """Pixels of half the height; world to camera as a quaternion (x, y, z, w); millimetres."""
    text = '<?xml version="1.0" encoding="UTF-8"?>\n<Cameras VERSION="1.2">\n<Camera DEVICEID="9" TYPE="MX-T40"/>\n'
    for i, name in enumerate(rig.names):
        centre = -rig.R[i].T @ rig.t[i] * 1000
        text += f"""<Camera DEVICEID="{name}" TYPE="Vue_VIDEO" SENSOR_SIZE="{_words(rig.size[i])}"
 PIXEL_ASPECT_RATIO="{rig.K[i, 0, 0] / rig.K[i, 1, 1]}"><KeyFrames><KeyFrame FRAME="0" WORLD_ERROR="0.1"
 FOCAL_LENGTH="{rig.K[i, 0, 0]}" PRINCIPAL_POINT="{_words(rig.K[i, :2, 2])}" POSITION="{_words(centre)}"
 ORIENTATION="{_words(_quaternion(rig.R[i]))}"
 VICON_RADIAL2="Vicon3Parameter {_words(rig.K[i, :2, 2])} {_words(np.array(radial))}"/></KeyFrames></Camera>
"""
    (folder / "trial.xcp").write_text(text + "</Cameras>")
    return folder / "trial.xcp"


def colmap(folder: Path, rig: Rig) -> Path:
    """World to camera as a quaternion (w, x, y, z); pixels from the corner of the first; an arbitrary unit."""
    cameras, images = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"], ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, ..."]
    for i, name in enumerate(rig.names):
        K = rig.K[i]
        middle = _words(K[:2, 2] + 0.5)
        x, y, z, w = _quaternion(rig.R[i])
        cameras.append(f"{i + 3} FULL_OPENCV {rig.size[i, 0]} {rig.size[i, 1]} {K[0, 0]} {K[1, 1]} {middle} "
                       + _words(rig.dist[i]))  # fmt: skip
        images.append(f"{i + 1} {_words(np.array([w, x, y, z]))} {_words(rig.t[i] / 0.37)} {i + 3} {name}/0001.jpg")
        images.append(["", "12.5 30.5 -1 100.25 2.5 17"][i % 2])
    (folder / "cameras.txt").write_text("\n".join(cameras) + "\n")
    (folder / "images.txt").write_text("\n".join(images) + "\n")
    return folder


def panoptic(folder: Path, rig: Rig) -> Path:
    cameras = [
        {"name": name, "type": "hd", "resolution": rig.size[i].tolist(), "panel": 0, "node": i, "K": rig.K[i].tolist(),
         "distCoef": rig.dist[i, :5].tolist(), "R": rig.R[i].tolist(), "t": (rig.t[i] * 100)[:, None].tolist()}
        for i, name in enumerate(rig.names)
    ]  # fmt: skip
    (folder / "calibration_161029.json").write_text(json.dumps({"calibDataSource": "x", "cameras": cameras}))
    return folder / "calibration_161029.json"


def _projections(rig: Rig) -> np.ndarray:
    """K (R | t) times any number: some negative."""
    factors = np.array([-1.0, 0.01, 30.0, -7.0, 2.0])[: len(rig.names), None, None]
    return factors * (rig.K @ np.concatenate([rig.R, rig.t[:, :, None]], axis=2))


def projections(folder: Path, rig: Rig) -> Path:
    np.savez(folder / "P.npz", **dict(zip(rig.names, _projections(rig), strict=True)))
    return folder / "P.npz"


FORMATS = {
    "pose2sim": Format(pose2sim, 4, "Pose2Sim TOML", "+Z"),
    "anipose": Format(anipose, 5, "Anipose TOML", None),
    "freemocap": Format(freemocap, 5, "FreeMoCap TOML", "+Z"),
    "caliscope": Format(caliscope, 5, "Caliscope TOML", None),
    "opencv": Format(opencv, 8, "OpenCV YAML", None),
    "easymocap": Format(easymocap, 5, "EasyMocap", "+Z", has_size=False),
    "easymocap with sizes": Format(easymocap_with_size, 5, "EasyMocap", "+Z"),
    "easymocap by pose2sim": Format(easymocap_by_pose2sim, 5, "EasyMocap", "+Z", has_size=False),
    "qualisys": Format(qualisys, 5, "Qualisys", "+Z"),
    "vicon": Format(vicon, 0, "Vicon", "+Z"),
    "colmap": Format(colmap, 8, "COLMAP", None, unit=0.37),
    "panoptic": Format(panoptic, 5, "CMU Panoptic JSON", "-Y"),
    "voxelpose": Format(in_json.voxelpose, 5, "VoxelPose JSON", "+Z", has_size=False),
    "multical": Format(in_json.multical, 5, "multical JSON", None),
    "calib.io": Format(in_json.calibio, 8, "calib.io JSON", None),
    "open3d": Format(in_json.open3d, 0, "Open3D JSON", None),
    "anipose in JSON": Format(in_json.anipose_list, 5, "Anipose JSON", None),
    "nerfstudio": Format(in_json.nerfstudio, 5, "nerfstudio JSON", None, unit=0.37),
    "by hand": Format(in_json.by_hand, 8, "JSON (K, R, t)", None),
    "xrprimer": Format(in_json.xrprimer, 8, "JSON (K, R, t)", None),
    "projections in JSON": Format(in_json.projections, 0, "projection matrices", None, has_size=False),
    "projections": Format(projections, 0, "projection matrices", None, has_size=False),
}


def sizes_of(rig: Rig) -> dict[str, tuple[int, int]]:
    return {name: (int(w), int(h)) for name, (w, h) in zip(rig.names, rig.size, strict=True)}
