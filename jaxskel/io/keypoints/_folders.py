"""Folders of keypoints: one folder a camera, one JSON file a frame, as OpenPose and Pose2Sim write them."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..._runtime.kinds import check_kind
from ...body import KeypointSet
from ...recording import Recording
from ..files import fault
from ._openpose import read_people
from ._undistort import undistort_keypoints

# Words that tools put behind a camera's name.
_WORDS = {"json", "pose", "poses", "keypoints", "openpose"}
# A file's last number is its frame's; a longer one is none.
_MOST_DIGITS = 18


def read_keypoints(
    folder: str | Path, recording: Recording, keypoint_set: KeypointSet
) -> Float[np.ndarray, "frames cams keypoints 3"]:
    """Read the keypoints of a recording: x and y (px) without lens distortion, and confidence; NaN where missing.

    Folders are matched to cameras by name, whatever its case, punctuation and leading zeros, and whether ``_json``
    follows: ``cam01_json`` is that of ``cam01`` or ``cam_1``. Files are matched to frames by the last number in their
    names: ``cam01.0012.json`` and ``walk_000000000012_keypoints.json`` are frame 12 of `Recording.frame_index`.

    Of several people in an image, the one with the largest sum of confidences is taken. A camera without a folder and a
    frame without a file or a person are missing.

    Args:
        folder: Holds a folder for each camera.
        recording: Its cameras and frame numbers. The keypoints are those of the same images, not of smaller copies.
        keypoint_set: Which keypoints the files hold.

    Raises:
        ValueError: One line: a file is no such file; or a folder belongs to no camera, or has no file of any frame of
            the recording; or two files hold people of the same frame.
    """
    check_kind("keypoint_set", keypoint_set, KeypointSet, "a KeypointSet, such as jaxskel.body.COCO_17")
    place, count = Path(folder), len(keypoint_set)
    found = np.full((len(recording), len(recording.cameras), count, 3), np.nan)
    for camera, path in _folders(place, recording.cameras.names).items():
        files = _files(path)
        numbers = [int(number) for number in recording.frame_index]
        if not files.keys() & set(numbers):
            told = f"{min(files)} to {max(files)}" if files else "not there"
            raise fault(
                path, None, f"files are {told}, but the recording's frames are {min(numbers)} to {max(numbers)}; name "
                "each by its frame's number, such as 000000.json",
            )  # fmt: skip
        for row, number in enumerate(numbers):
            found[row, camera] = _one_person(files.get(number, []), count)
    return undistort_keypoints(found, recording.cameras)


def _one_person(files: list[Path], count: int) -> Float[np.ndarray, "keypoints 3"]:
    """The person with the largest sum of confidences in the files of one frame."""
    people = {file: read_people(file, count) for file in files}
    filled = [file for file in files if len(people[file])]
    if len(filled) > 1:
        raise fault(filled[1], None, f"is of the same frame as {filled[0].name}, by its last number; keep one of them")
    if not filled:
        return np.full((count, 3), np.nan)
    own = people[filled[0]]
    return own[int(np.nansum(own[:, :, 2], axis=1).argmax())]


def _folders(place: Path, names: tuple[str, ...]) -> dict[int, Path]:
    """The folder of each camera that has one, by the camera's index."""
    try:
        folders = sorted(path for path in place.iterdir() if path.is_dir() and not path.name.startswith("."))
    except OSError as error:
        raise fault(place, None, f"cannot be opened as a folder ({error.strerror}); check the path") from None
    if not folders:
        raise fault(place, None, f"has no folders; give one for each camera, such as {names[0]}")
    known, found = [_plain(name) for name in names], {}
    for path in folders:
        own = [camera for camera, name in enumerate(known) if name == _plain(path.name)]
        if len(own) != 1:
            raise fault(
                path, None, f"is of no camera, or of several; name it as one of {', '.join(names)}, or remove it"
            )
        if own[0] in found:
            raise fault(path, None, f"is of {names[own[0]]}, as {found[own[0]].name} is; keep one of them")
        found[own[0]] = path
    return found


def _plain(name: str) -> str:
    words = [word for word in re.split(r"[\W_]+", name.lower()) if word]
    kept = [word for number, word in enumerate(words) if number == 0 or word not in _WORDS]
    return re.sub(r"0*(\d+)", r"\1", "".join(kept))


def _files(folder: Path) -> dict[int, list[Path]]:
    """The files of each frame number."""
    found: dict[int, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        digits = re.findall("[0-9]+", path.stem)
        if path.suffix.lower() == ".json" and not path.name.startswith(".") and digits:
            if len(digits[-1]) <= _MOST_DIGITS:
                found.setdefault(int(digits[-1]), []).append(path)
    return found
