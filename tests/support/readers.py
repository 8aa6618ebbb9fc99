"""Every reader of files, with small valid files for it, to be damaged or to be made to claim too much data."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from jaxskel import Recording, default_adult, make_body
from jaxskel.body import COCO_17
from jaxskel.camera_calibration.from_boards import some_frames
from jaxskel.io.calibrations import Calibration, read_calibration, write_calibration
from jaxskel.io.keypoints import read_keypoints
from jaxskel.io.mocap import Motion, read_asf_amc, read_bvh
from jaxskel.io.poses import read_poses, read_trc, read_truth, write_poses, write_trc
from jaxskel.io.proposals import propose_recording
from jaxskel.io.recordings import read_recording, write_recording
from jaxskel.io.recordings._view_table import read_view
from jaxskel.io.subjects import read_body, read_subject, write_subject
from jaxskel.segmentation import Cleaning
from support import calibration_json as in_json
from support import painted_masks as painted
from support.calibration_files import FORMATS, Format, Rig, a_rig, sizes_of
from support.calibration_texts import NUMBERED_FORMATS, TEXT_FORMATS
from support.files import a_recording as a_clip
from support.files import some_poses
from support.motion_texts import AMC, ASF, BVH, is_valid
from support.poses import moving
from support.recording_folders import a_recording, write_folder

SIZE = (24, 16)  # width and height


@dataclass(frozen=True)
class Reader:
    """How a file or a set of files is written, and how it is read."""

    write: Callable[[Path], Path]
    """Writes into a folder; returns the path to read."""
    read: Callable[[Path], Any]
    check: Callable[[Any], None]
    """Fails where a result is not valid."""


def _calibration(form: Format) -> Reader:
    rig = a_rig(0, form.coefficients)
    sizes = None if form.has_size else sizes_of(rig)
    return Reader(
        lambda folder: form.write(folder, rig),
        lambda path: read_calibration(path, unit=form.unit, sizes=sizes),
        is_a_rig,
    )


def _named(write: Callable[[Path, Rig], Path], names: str, unit: float | None = None) -> Reader:
    """A format that does not take any name, or has a unit of its own."""
    rig = replace(a_rig(0, 0), names=tuple(names.split()))
    return Reader(
        lambda folder: write(folder, rig),
        lambda path: read_calibration(path, unit=unit, sizes=sizes_of(rig)),
        is_a_rig,
    )


def _unposed(folder: Path) -> Path:
    path = FORMATS["caliscope"].write(folder, a_rig(0, 5))
    path.write_text(re.sub("(rotation|translation) = .*", r'\1 = "null"', path.read_text(), count=2))
    return path


def _matrices(name: str) -> Reader:
    rig = a_rig(0, 0)
    matrices = rig.K @ np.concatenate([rig.R, rig.t[:, :, None]], axis=2)
    sizes = {f"cam{i}": size for i, size in enumerate(sizes_of(rig).values())}

    def write(folder: Path) -> Path:
        np.save(folder / name, matrices) if name.endswith(".npy") else np.savetxt(
            folder / name, matrices.reshape(-1, 4)
        )
        return folder / name

    return Reader(write, lambda path: read_calibration(path, sizes=sizes), is_a_rig)


def is_a_rig(found: Calibration) -> None:
    cameras = found.cameras
    assert len(cameras) > 0
    assert all(np.isfinite(a).all() for a in (cameras.K, cameras.R, cameras.t, cameras.dist))


def is_a_recording(found: Recording) -> None:
    assert found.fps > 0
    assert found.silhouettes.shape[:2] == (len(found.frame_index), len(found.cameras))
    some = found.silhouettes[:8]
    assert some.dtype == np.uint8


def is_finite(found: Any) -> None:
    arrays = [a for a in vars(found).values() if isinstance(a, np.ndarray) and a.dtype.kind == "f"]
    assert arrays
    assert not any(np.isinf(a).any() for a in arrays)


def _clip(folder: Path, save: Callable | None = None) -> Path:
    path = folder / "clip.npz"
    write_recording(path, a_clip())
    if save is not None:
        save(path, **dict(np.load(path)))
    return path


def _poses(folder: Path) -> Path:
    path, table = write_poses(folder, some_poses())
    table.unlink()
    return path


def _rig_file(folder: Path) -> Path:
    write_calibration(folder / "rig.npz", a_recording().cameras, "+Z")
    return folder / "rig.npz"


def _subject(folder: Path) -> Path:
    write_subject(folder / "subject.toml", default_adult(), make_body(default_adult()))
    return folder / "subject.toml"


def _pictures(folder: Path, suffix: str, *flags: int) -> Path:
    """Grey, and of the same size grey and opaque in colours with alpha, where the format has it."""
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[4:12, 6:14] = 255
    cv2.imwrite(str(folder / f"0{suffix}"), mask, flags)
    wide = mask.astype(np.uint16) * 257 if suffix in (".png", ".tif") else mask
    colours = np.repeat(wide[..., None], 3, axis=2)
    if suffix in (".png", ".tif"):
        colours = np.dstack([colours, np.full_like(wide, 65535)])
    cv2.imwrite(str(folder / f"1{suffix}"), colours, flags)
    return folder


def film(folder: Path, name: str, codec: str) -> Path:
    writer = cv2.VideoWriter(str(folder / name), cv2.VideoWriter.fourcc(*codec), 25.0, SIZE)
    for number in range(4):
        image = np.zeros((*SIZE[::-1], 3), np.uint8)
        image[4:12, number : number + 8] = 255
        writer.write(image)
    writer.release()
    return folder / name


def _masks(path: Path) -> list[np.ndarray]:
    """Masks of a folder, a video or the array `cam` of an archive, as a recording reads them."""
    place, name = (path, ".") if path.is_dir() else (path.parent, path.name)
    masks = f"{name}:cam" if name.endswith(".npz") else name
    view = read_view(place / "recording.toml", "cam", {"masks": masks}, 25.0, Cleaning(), True)
    first, last = view.span
    return [view.silhouette(number) for number in range(first, min(last, first + 8) + 1)]


def _painted(kind: str) -> Reader:
    return Reader(painted.READ[kind], _masks, are_masks)


def are_masks(found: list[np.ndarray]) -> None:
    assert found
    assert all(image.dtype == bool and image.ndim == 2 and image.size > 0 for image in found)


def are_images(found: list[np.ndarray]) -> None:
    assert found
    assert all(image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3 for image in found)


def _bare(folder: Path, kind: str) -> Path:
    (write_folder(folder, kind) / "recording.toml").unlink()
    return folder


def _keypoints(folder: Path) -> Path:
    values = np.random.default_rng(0).uniform(1, 9, 51).round(2).tolist()
    (folder / "front_json").mkdir()
    for name, persons in (("4", [values]), ("9", [values, values[::-1]])):
        table = {"people": [{"pose_keypoints_2d": each} for each in persons]}
        (folder / "front_json" / f"{name}.json").write_text(json.dumps(table))
    return folder


def are_keypoints(found: np.ndarray) -> None:
    assert found.shape == (2, 3, 17, 3)
    assert not np.isinf(found).any()


def _acclaim(folder: Path) -> Path:
    (folder / "a.asf").write_text(ASF)
    (folder / "a.amc").write_text(AMC)
    return folder


def _bvh(folder: Path) -> Path:
    (folder / "a.bvh").write_text(BVH)
    return folder / "a.bvh"


def is_a_motion(found: Motion) -> None:
    is_valid(found)


def _read_in_parts(path: Path) -> Recording:
    return read_recording(path, in_memory=0)


def _recording(kind: str) -> Reader:
    return Reader(lambda folder: write_folder(folder, kind), read_recording, is_a_recording)


def _film_reader(name: str, codec: str) -> Reader:
    return Reader(lambda folder: film(folder, name, codec), _masks, are_masks)


def _picture_reader(suffix: str, *flags: int) -> Reader:
    return Reader(lambda folder: _pictures(folder, suffix, *flags), _masks, are_masks)


def _proposer(kind: str) -> Reader:
    return Reader(lambda folder: _bare(folder, kind), lambda folder: propose_recording(folder, fps=25.0), _is_text)


def _is_text(found: Any) -> None:
    assert found.text


# Of each format, depth and kind of value.
PAINTED = ("class labels", "large instance", "palette, several objects", "palette, background not opaque",
           "palette in a BMP", "palette in a TIFF", "palette in a GIF", "bits in a PNG", "bits in a TIFF",
           "bits in a PBM", "text in a PBM", "PPM", "WebP", "WebP without loss", "WebP with alpha", "grey with alpha",
           "a colour for each part", "labels of 64 bits", "ones with a point")  # fmt: skip

READERS = {
    **{name: _calibration(form) for name, form in FORMATS.items()},
    "open3d trajectory": _named(in_json.open3d_trajectory, "cam0 cam1 cam2 cam3"),
    "aist": _named(lambda folder, rig: in_json.anipose_list(folder, rig, 0.01), "c01 c02 c03 c04"),
    "mvhumannet": _named(in_json.mvhumannet, "CC0 CC1 CC2 CC3", 0.001),
    "caliscope unposed": Reader(_unposed, read_calibration, is_a_rig),
    **{name: _calibration(form) for name, form in (FORMATS | TEXT_FORMATS | NUMBERED_FORMATS).items()},
    "projections .npy": _matrices("P.npy"),
    "projections .txt": _matrices("P.txt"),
    "rig": Reader(_rig_file, read_calibration, is_a_rig),
    "sequence": Reader(_clip, read_recording, is_a_recording),
    "sequence in parts": Reader(lambda folder: _clip(folder, np.savez), _read_in_parts, is_a_recording),
    "poses": Reader(_poses, read_poses, is_finite),
    "truth": Reader(_clip, read_truth, lambda found: is_finite(found[0])),
    "subject": Reader(_subject, read_subject, is_finite),
    "body": Reader(_subject, read_body, lambda found: None if found is None else is_finite(found)),
    "folders": _recording("folders"),
    "archive": _recording("archive"),
    "video": _recording("video"),
    "backdrop": _recording("backdrop"),
    "plate": _recording("plate"),
    "png": _picture_reader(".png"),
    "bmp": _picture_reader(".bmp"),
    "tiff": _picture_reader(".tif"),
    "jpeg": _picture_reader(".jpg"),
    "progressive jpeg": _picture_reader(".jpg", cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    **{kind: _painted(kind) for kind in PAINTED},
    "avi": _film_reader("a.avi", "MJPG"),
    "mp4": _film_reader("a.mp4", "mp4v"),
    "mkv": _film_reader("a.mkv", "FFV1"),
    "film of a board": Reader(
        lambda folder: film(folder, "b.avi", "MJPG"), lambda path: list(some_frames(path, 3)), are_images
    ),
    "proposal of folders": _proposer("folders"),
    "proposal of an archive": _proposer("archive"),
    "proposal of videos": _proposer("video"),
    "trc": Reader(lambda folder: write_trc(folder / "a.trc", moving(3, 30.0)), read_trc, is_finite),
    "keypoints": Reader(_keypoints, lambda folder: read_keypoints(folder, a_clip(), COCO_17), are_keypoints),
    "bvh": Reader(_bvh, read_bvh, is_a_motion),
    "acclaim": Reader(_acclaim, lambda folder: read_asf_amc(folder / "a.asf", folder / "a.amc"), is_a_motion),
}
