"""Poses of several people on disk: one `poses.npz` with an axis of people, and a table for each person."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int

from ..._runtime.atomic_files import written_whole
from ...poses import WITH_POSE, Poses
from ...recording import Truth
from ..files import fault, keys_of, texts
from ..recordings import people_in_file
from ._journal import JOURNAL_FILE
from ._poses_file import (
    PEOPLE_KEY,
    archived_poses,
    arrays_of,
    poses_of,
    read_poses,
    read_truth,
    write_archive,
    write_table,
)

# Arrays that each person has; all others are the same for all people.
_OF_EACH = (
    "joints", "tips", "confidence", "side_confidence", "status", "rotations", "rest_joints", "rest_tips", "sigma",
    "stature_sigma",
)  # fmt: skip
# Those that some people may not have: they are NaN there.
_NOT_OF_ALL = ("rotations", "rest_joints", "rest_tips", "sigma", "stature_sigma")
ONLY_PERSON = "person"
"""Name of the person in a file of one person."""


def write_people_poses(folder: str | Path, people: Mapping[str, Poses]) -> tuple[Path, ...]:
    """Write `poses.npz`, with an axis of people first, and a table for each person, ``poses_anna.csv``.

    Args:
        folder: Folder to write to, which is created if missing.
        people: Poses by name, of the same frames and template. Of one person, the files are those of `write_poses`.

    Returns:
        The paths.

    Raises:
        ValueError: There is nobody, or the frames or templates differ.
    """
    folder = Path(folder)
    archive = write_people_archive(folder / "poses.npz", people)
    return archive, *(
        write_table(folder / name, poses) for name, poses in zip(tables_of(people), people.values(), strict=True)
    )


def tables_of(people: Mapping[str, Any]) -> list[str]:
    """Name of the table of each person."""
    return ["poses.csv"] if len(people) == 1 else [f"poses_{name}.csv" for name in people]


def write_people_archive(path: str | Path, people: Mapping[str, Poses]) -> Path:
    """Write the `poses.npz` of [`write_people_poses`][] alone, under any name; return its path.

    Raises:
        ValueError: There is nobody, or the people have other frames or templates than each other.
    """
    path = Path(path)
    if not people:
        raise ValueError(f"{path}: there is nobody to write")
    first = next(iter(people.values()))
    for name, poses in people.items():
        if poses.template != first.template or not np.array_equal(poses.frame_index, first.frame_index):
            raise ValueError(f"{path}: {name} has other frames or another template; write each by write_archive")
    if len(people) == 1:
        return write_archive(path, first)
    each = [arrays_of(poses) for poses in people.values()]
    arrays: dict[str, Any] = {PEOPLE_KEY: list(people)}
    for key, array in each[0].items():
        arrays[key] = array if key not in _OF_EACH else np.stack([_known(one, key, array) for one in each])
    for key in {key for one in each for key in one} - set(arrays):
        arrays[key] = np.stack([_known(one, key, next(o[key] for o in each if key in o)) for one in each])
    with written_whole(path) as file:
        np.savez_compressed(file, **arrays)
    return path


def _known(arrays: dict[str, Any], key: str, like: Any) -> np.ndarray:
    """An array of somebody; NaN if somebody else has it, but not this person."""
    return np.asarray(arrays[key]) if key in arrays else np.full_like(np.asarray(like, np.float64), np.nan)


def read_people_poses(path: str | Path) -> dict[str, Poses]:
    """Read the poses of everybody in a `poses.npz`, by name; somebody who is alone in it is named ``person``.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    if path.suffix == Path(JOURNAL_FILE).suffix:
        return {ONLY_PERSON: read_poses(path)}
    arrays = archived_poses(path)
    if PEOPLE_KEY not in arrays:
        return {ONLY_PERSON: poses_of(path, arrays)}
    names = texts(path, arrays, PEOPLE_KEY)
    if len(set(names)) < len(names) or not names:
        raise fault(path, PEOPLE_KEY, f"is {names}; give different names")
    for name in names:
        if name in ("", "..") or set(name) & set("/\\"):  # each gets files of that name
            raise fault(path, PEOPLE_KEY, f"has {name!r}, which is no name of a file; give another")
    own = [key for key in _OF_EACH if key in arrays]
    for key in own:
        if arrays[key].shape[:1] != (len(names),):
            raise fault(path, key, f"has shape {arrays[key].shape}; give one row for each of {len(names)} people")
    shared = {key: array for key, array in arrays.items() if key not in (*own, PEOPLE_KEY)}
    found = {}
    for place, name in enumerate(names):
        each = {key: np.asarray(arrays[key][place]) for key in own}
        known = {key: array for key, array in each.items() if key not in _NOT_OF_ALL or _is_known(key, each)}
        found[name] = poses_of(path, shared | known)
    return found


def _is_known(key: str, arrays: dict[str, np.ndarray]) -> bool:
    """Whether a person has one of `_NOT_OF_ALL`; without any pose, rotations and covariances are NaN all the same."""
    without_pose = not np.isin(arrays["status"], WITH_POSE).any()
    return bool(np.isfinite(arrays[key]).any()) or (without_pose and key in ("rotations", "sigma"))


def read_people_truth(path: str | Path) -> dict[str, tuple[Truth, str, Int[np.ndarray, " frames"]]]:
    """What the poses of several people can be scored against, by name, as `read_truth` reads it of one person.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    names = people_in_file(path)
    if names:
        return {name: read_truth(path, f"_{name}") for name in names}
    if PEOPLE_KEY in keys_of(path):
        found = read_people_poses(path)
        return {
            name: (Truth(poses.joints.astype(np.float64), template=poses.template), poses.up, poses.frame_index)
            for name, poses in found.items()
        }
    return {ONLY_PERSON: read_truth(path)}
