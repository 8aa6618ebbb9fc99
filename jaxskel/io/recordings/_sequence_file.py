"""The sequence file: a recording in one NumPy `.npz` archive.

Every fault is a `ValueError` of one line that names the file, the key and how to mend it.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ..._runtime.atomic_files import written_whole
from ...body import HUMAN_15, Skeleton, SkeletonTemplate, make_skeleton
from ...cameras import Cameras, make_cameras
from ...recording import Recording, Silhouettes, Truth
from ..calibrations import up_axis
from ..files import StoredRows, fault, keys_of, numbers, read_arrays, short, switches, texts
from ._stored import StoredSilhouettes
from ._template import TEMPLATE_KEYS, template_arrays, template_of

# A person with outstretched arms spans less than this (m); ground truth in millimetres spans a thousand times more.
_WIDEST_PERSON = 5.0
# No animal is longer (m).
_LONGEST = 50.0
# Packed silhouettes larger than this (bytes) stay on disk: a minute at 30 frames per second fits, half an hour does
# not.
IN_MEMORY = 256 << 20
SILHOUETTES_OF = "silhouettes_"
"""Begins the keys of the silhouettes of several people."""
# Keys that each of several people has.
_OF_PERSON = ("rest_joints", "rest_tips", "joints", "tips")
# Of keys that hold data of one's own.
_PREFIX = "data_"


def read_sequence_file(path: Path, in_memory: int = IN_MEMORY) -> Recording:
    """Read a sequence file.

    Keys: `silhouettes` (frames, cams, h, w/8) packed bits or (frames, cams, h, w) masks of 0 and 1 or 255;
    `K`, `R`, `t` (world to camera, m), `size` (px), `fps`; optional `up` ("+Z" if missing), `dist`, `fisheye` (whether
    each lens is a cv2.fisheye one), `camera_names`, `frame_index`, the subject's `rest_joints` and `rest_tips` (m), the
    ground truth `joints` and `tips` (world, m, NaN where unknown). `template` is the text of the template that all of
    these are of (`SkeletonTemplate.text`), if it is not the paper's human. Keys that begin with `data_` are data for
    terms of one's own, with a row for each frame, see `Recording.with_data`. `hidden`, packed like `silhouettes`, says
    where somebody else may stand before the person. Other keys are ignored.

    Args:
        path: The file.
        in_memory: Packed silhouettes larger than this (bytes) stay in the file and are read when they are needed.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    people = people_in_file(path)
    if people:
        raise fault(path, "silhouettes", f"is of several people: {', '.join(people)}; read them with read_people")
    return _read(path, in_memory)


def _read(path: Path, in_memory: int, person: str | None = None) -> Recording:
    """The recording of one of several people, whose own keys end in the name, or of the only one."""
    of = "" if person is None else f"_{person}"
    stored = StoredRows(path, f"silhouettes{of}")
    own = [key for key in keys_of(path) if key.startswith(_PREFIX)]
    arrays = read_arrays(
        path,
        required=("K", "R", "t", "size", "fps"),
        optional=("up", "dist", "fisheye", "camera_names", "frame_index", *TEMPLATE_KEYS, *own,
                  *(f"{key}{of}" for key in _OF_PERSON)),
    )  # fmt: skip
    arrays |= {key: arrays[f"{key}{of}"] for key in _OF_PERSON if f"{key}{of}" in arrays}
    template = template_of(path, arrays)
    cameras = _cameras(path, arrays)
    silhouettes = StoredSilhouettes(stored, cameras)
    frames = len(silhouettes)
    hidden = StoredSilhouettes(StoredRows(path, "hidden"), cameras) if "hidden" in keys_of(path) else None
    return Recording(
        cameras=cameras,
        silhouettes=_kept(silhouettes, in_memory),
        hidden=None if hidden is None else _kept(hidden, in_memory),
        fps=frame_rate(path, arrays),
        up=up_axis(path, arrays),
        frame_index=frame_numbers(path, arrays, frames),
        skeleton=skeleton_of(path, arrays, template),
        truth=truth(path, arrays, frames, template),
        name=path.stem if person is None else person,
    ).with_data(**{key.removeprefix(_PREFIX): rows_of(path, arrays, key, frames) for key in own})


def _kept(stored: StoredSilhouettes, in_memory: int) -> Silhouettes:
    """In memory, unless they are too large for it."""
    return stored if math.prod(stored.shape) > in_memory else stored[:]


def people_in_file(path: Path) -> list[str]:
    """Names of the people of a sequence file of several; empty if it is of one."""
    keys = keys_of(path)
    return (
        []
        if "silhouettes" in keys
        else [key.removeprefix(SILHOUETTES_OF) for key in keys if key.startswith(SILHOUETTES_OF)]
    )


def read_people_file(path: Path, in_memory: int = IN_MEMORY) -> dict[str, Recording]:
    """Read a sequence file of several people: each has their own ``silhouettes_anna``, and so on.

    Raises:
        ValueError: As `read_sequence_file` raises it.
    """
    return {name: _read(path, in_memory, name) for name in people_in_file(path)}


def write_recording(path: str | Path, recording: Recording, made_by: str | None = None) -> None:
    """Write a sequence file for [`read_recording`][]; an interrupted write leaves no file behind.

    Args:
        path: File to write, `.npz`.
        recording: Recording to write.
        made_by: A note for people, by which a program can also recognise its own files.

    Raises:
        ValueError: Skeleton and truth are of different templates.
    """
    _write(path, {"": recording}, made_by)


def write_people(path: str | Path, people: Mapping[str, Recording], made_by: str | None = None) -> None:
    """Write the recordings of several people in one room as one file, for `read_people`.

    Keys that each person has end in the name: ``silhouettes_anna``, and so on. `hidden` follows from the silhouettes
    of the others and is not written.

    Raises:
        ValueError: Skeletons and truths are of different templates.
    """
    _write(path, {f"_{name}": recording for name, recording in people.items()}, made_by)


def _write(path: str | Path, recordings: dict[str, Recording], made_by: str | None) -> None:
    """Write the recordings by the ends of their keys, with what is common to all from the first one."""
    recording = next(iter(recordings.values()))
    cameras = recording.cameras
    templates = [
        known.template for each in recordings.values() for known in (each.skeleton, each.truth) if known is not None
    ] or [HUMAN_15]
    for other in templates:
        if templates[0] != other:
            raise ValueError(
                f"{path}: skeleton and truth are of the templates {templates[0].name} and {other.name}; a file holds "
                "one, so leave one of them out"
            )
    arrays: dict[str, Any] = {
        "K": cameras.K, "R": cameras.R, "t": cameras.t,
        "size": cameras.size[0] if (cameras.size == cameras.size[0]).all() else cameras.size,
        "dist": cameras.dist, "camera_names": cameras.names,
        "fps": recording.fps, "up": recording.up, "frame_index": recording.frame_index,
        "joint_names": templates[0].joint_names, "tip_names": templates[0].tip_names, **template_arrays(templates[0]),
    }  # fmt: skip
    if cameras.fisheye is not None:
        arrays |= {"fisheye": cameras.fisheye}
    for end, each in recordings.items():
        own: dict[str, Any] = {"silhouettes": each.silhouettes}
        if each.hidden is not None and not end:
            own |= {"hidden": each.hidden}
        if each.skeleton is not None:
            own |= {"rest_joints": each.skeleton.rest_joints, "rest_tips": each.skeleton.rest_tips}
        if each.truth is not None:
            own |= {"joints": each.truth.joints} | ({} if each.truth.tips is None else {"tips": each.truth.tips})
        arrays |= {f"{key}{end}": array for key, array in own.items()}
    arrays |= {_PREFIX + name: array for name, array in recording.data.items()}
    if made_by is not None:
        arrays["made_by"] = made_by
    with written_whole(Path(path)) as file:
        np.savez_compressed(file, **arrays)


def _cameras(path: Path, arrays: dict[str, np.ndarray]) -> Cameras:
    K = numbers(path, arrays, "K", (None, 3, 3))
    n = len(K)
    if n < 2:
        raise fault(path, "K", f"{n} camera; a visual hull needs at least 2 calibrated views")
    names = [f"cam{i}" for i in range(n)]
    if "camera_names" in arrays:
        names = texts(path, arrays, "camera_names")
        if len(names) != n or len(set(names)) != n:
            raise fault(path, "camera_names", f"give {n} different names, one for each camera of K, not {names}")
    # Check one key at a time, with valid values for the others, so that the faulty key is known.
    given: dict[str, Any] = {"K": K, "R": np.tile(np.eye(3), (n, 1, 1)), "t": np.zeros((n, 3)), "size": (1, 1)}
    cameras = None
    for key in ("K", "R", "t", "size", "fisheye", "dist"):
        if key in arrays:
            given[key] = switches(path, arrays, key, n) if key == "fisheye" else numbers(path, arrays, key, None)
            try:
                cameras = make_cameras(**given, names=names)
            except ValueError as error:
                raise fault(path, key, str(error)) from None
    assert cameras is not None
    return cameras


def skeleton_of(path: Path, arrays: dict[str, np.ndarray], template: SkeletonTemplate) -> Skeleton | None:
    """Check the subject's dimensions (m), if the file has them.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    given = [key for key in ("rest_joints", "rest_tips") if key in arrays]
    if not given:
        return None
    if len(given) == 1:
        missing = "rest_tips" if given[0] == "rest_joints" else "rest_joints"
        raise fault(path, given[0], f"comes without {missing}; give both or neither")
    joints = numbers(path, arrays, "rest_joints", (len(template.joint_names), 3))
    tips = numbers(path, arrays, "rest_tips", (len(template.tip_names), 3))
    try:
        return make_skeleton(joints, tips, template)
    except ValueError as error:
        raise fault(path, "rest_joints", str(error)) from None


def truth(path: Path, arrays: dict[str, np.ndarray], frames: int | None, template: SkeletonTemplate) -> Truth | None:
    """Check the ground truth of a file (world, m); NaN stands for unknown.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    if "joints" not in arrays:
        if "tips" in arrays:
            raise fault(path, "tips", "comes without joints; give both or neither")
        return None
    joints = numbers(path, arrays, "joints", (frames, len(template.joint_names), 3), nan=True)
    shape = len(joints), len(template.tip_names), 3
    tips = numbers(path, arrays, "tips", shape, nan=True) if "tips" in arrays else None
    what, widest = ("person", _WIDEST_PERSON) if template == HUMAN_15 else ("subject", _LONGEST)
    together = {"joints": joints} if tips is None else {"joints": joints, "tips": np.concatenate([joints, tips], 1)}
    for key, points in together.items():
        # fmax and fmin skip NaN without a warning.
        extent = (np.fmax.reduce(points, axis=1) - np.fmin.reduce(points, axis=1)).max(axis=1)
        if (extent > widest).any():
            frame = int(np.argmax(extent > widest))
            raise fault(
                path,
                key,
                f"the {what} spans {extent[frame]:.0f} m in frame {frame}; lengths are metres, so divide by "
                "1000 if these are millimetres",
            )
    return Truth(joints, tips, template)


def frame_rate(path: Path, arrays: dict[str, np.ndarray]) -> float:
    """Check `fps`.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    fps = arrays["fps"]
    if fps.size != 1 or fps.dtype.kind not in "iuf" or not 0 < float(fps.reshape(())) < np.inf:
        raise fault(path, "fps", f"give one positive number of frames per second, not {short(fps)}")
    return float(fps.reshape(()))


def frame_numbers(path: Path, arrays: dict[str, np.ndarray], frames: int) -> Int[np.ndarray, " frames"]:
    """Check `frame_index`; the default is 0, 1, 2, ...

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    index = arrays.get("frame_index", np.arange(frames))
    if index.shape != (frames,) or index.dtype.kind not in "iu":
        raise fault(path, "frame_index", f"{index.dtype} of shape {index.shape}; give {frames} whole numbers")
    if (index.dtype.itemsize == 8) and (index > np.iinfo(np.int64).max).any():
        raise fault(path, "frame_index", "holds numbers beyond 63 bits; number the frames from 0")
    return index.astype(np.int64)


def rows_of(path: Path, arrays: dict[str, np.ndarray], key: str, frames: int) -> Float[np.ndarray, "frames ..."]:
    """Check an array of data of one's own."""
    array = numbers(path, arrays, key, None, nan=True)
    if array.shape[:1] != (frames,):
        raise fault(path, key, f"has shape {array.shape}; give one row for each of the {frames} frames")
    return array
