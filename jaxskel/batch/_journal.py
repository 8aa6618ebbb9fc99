"""Poses on the disk as they come, so that a recording goes on where it broke off."""

import hashlib
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .._runtime.atomic_files import written_whole
from ..body import HUMAN_15, Pose, Skeleton, SkeletonTemplate, default_adult
from ..io.files import numbers, read_arrays, texts
from ..io.recordings import template_of
from ..poses import Poses
from ..search import Rival, Track, no_alternatives
from ._disk import remove_unfinished

_ROWS, _STATE = "rows.bin", "state.npz"
_AT_REST = ("rest_joints", "rest_tips")  # of the skeleton
_NOWHERE = Pose(np.zeros(3), np.zeros((len(HUMAN_15.segment_names), 3, 3)))
_ALONE = Track(_NOWHERE, _NOWHERE, 0, np.zeros(0))
# What a track may have besides, and what it looks like.
_PARTS = {"rival": Rival(_NOWHERE, _NOWHERE, 0.0), "alternatives": no_alternatives(_NOWHERE, 1)}
_WHOLE = jax.tree.structure(replace(_ALONE, **_PARTS))


class Journal:
    """A folder with the poses of a recording's frames so far.

    A file of rows grows; another one, replaced whole, says how many of them count and what the next batch goes on
    with. What was written for other work, or is damaged, is thrown away: these two files, and no other.
    """

    def __init__(self, folder: Path, work: str, request: str = ""):
        """Open the folder, or make it.

        Args:
            folder: The folder.
            work: What the poses depend on: anything that is the same only if they are.
            request: Name of a request to compute again: poses from before it do not count. Empty: all do.
        """
        self.folder = folder
        self._rows, self._state = folder / _ROWS, folder / _STATE
        self._request = request
        self._work = hashlib.sha256(work.encode(errors="surrogateescape")).hexdigest()
        self.frames, self._digest, self.track, self._skeleton = 0, 0, None, default_adult()
        try:
            self._resume()
        except (OSError, ValueError):
            self.frames, self._digest, self.track = 0, 0, None
            discard_journal(folder)
            folder.mkdir(parents=True, exist_ok=True)
        with open(self._rows, "ab") as file:
            file.truncate(self.frames * row_of(self._skeleton.template).itemsize)

    def append(self, poses: Poses, track: Track | None) -> None:
        """Add the next frames, and what the ones after them go on with."""
        if poses.skeleton is not None:
            self._skeleton = poses.skeleton
        rows = np.zeros(len(poses), row_of(poses.template))
        for name in rows.dtype.names or ():
            rows[name] = getattr(poses, name)
        content = rows.tobytes()
        with open(self._rows, "ab") as file:
            file.write(content)
        self.frames += len(poses)
        self._digest = zlib.crc32(content, self._digest)
        self.track = track
        state: dict[str, Any] = {"work": self._work, "frames": self.frames, "digest": str(self._digest)}
        state["request"] = self._request
        state |= {key: np.asarray(getattr(self._skeleton, key)) for key in _AT_REST}
        state["template"] = self._skeleton.template.text
        if track is not None:
            state |= {f"track{i}": leaf for i, leaf in enumerate(jax.tree.leaves(track))}
            state["parts"] = " ".join(name for name in _PARTS if getattr(track, name) is not None)
        with written_whole(self._state) as file:
            np.savez(file, **state)

    def poses(self, fps: float, up: str, stature_deviation: float | None) -> Poses:
        """All poses so far."""
        skeleton = self._skeleton
        rows = np.fromfile(self._rows, row_of(skeleton.template))
        return Poses(
            **{name: rows[name] for name in rows.dtype.names or ()}, fps=fps, up=up, skeleton=skeleton,
            stature_deviation=stature_deviation, template=skeleton.template,
        )  # fmt: skip

    def _resume(self) -> None:
        leaves = tuple(f"track{i}" for i in range(_WHOLE.num_leaves))
        arrays = read_arrays(
            self._state, ("work", "request", "frames", "digest", "template", *_AT_REST), ("parts", *leaves)
        )
        frames, template = int(numbers(self._state, arrays, "frames", ())), template_of(self._state, arrays)
        size = row_of(template).itemsize
        with open(self._rows, "rb") as file:
            found = 0
            for _ in range(frames):
                found = zlib.crc32(file.read(size), found)
        written = [*texts(self._state, arrays, "work"), *texts(self._state, arrays, "digest")]
        if written != [self._work, str(found)]:
            raise ValueError(f"{self.folder}: the poses of other work, or damaged ones")
        if self._request not in ("", *texts(self._state, arrays, "request")):
            raise ValueError(f"{self.folder}: the poses are from before they were to be computed again")
        self.frames, self._digest = frames, found
        self._skeleton = Skeleton(arrays["rest_joints"], arrays["rest_tips"], template)
        if "parts" in arrays:
            parts = " ".join(texts(self._state, arrays, "parts")).split()
            self.track = self._track_of(parts, [arrays[key] for key in leaves if key in arrays])

    def _track_of(self, parts: list[str], leaves: list[np.ndarray]) -> Track:
        """The tracking state with some parts, from its arrays."""
        if not set(parts) <= set(_PARTS):
            raise ValueError(f"{self._state}: a track with unknown parts")
        structure = jax.tree.structure(replace(_ALONE, **{name: _PARTS[name] for name in parts}))
        if structure.num_leaves != len(leaves):
            raise ValueError(f"{self._state}: a part of the track is lost")
        track = jax.tree.unflatten(structure, leaves)
        # Numbers that were Python's are so again: JAX compiles anew for others.
        rival = track.rival and replace(track.rival, excess=float(track.rival.excess))
        return replace(track, since=int(track.since), sides=float(track.sides), rival=rival, calm=bool(track.calm))


def row_of(template: SkeletonTemplate) -> np.dtype:
    """What is kept of each frame."""
    joints, tips, segments = len(template.joint_names), len(template.tip_names), len(template.segment_names)
    return np.dtype([
        ("joints", "<f4", (joints, 3)), ("tips", "<f4", (tips, 3)), ("rotations", "<f4", (segments, 3, 3)),
        ("covariance", "<f4", (joints, 3, 3)), ("confidence", "<f4", (joints,)), ("side_confidence", "<f4"),
        ("status", "<i8"), ("frame_index", "<i8"),
    ])  # fmt: skip


def discard_journal(folder: Path) -> None:
    """Remove a journal's files, and its folder where nothing else is in it."""
    if not folder.is_dir():
        return
    remove_unfinished(folder / _STATE)
    for name in (_STATE, _ROWS):
        (folder / name).unlink(missing_ok=True)
    with suppress(OSError):  # something else is in it
        folder.rmdir()
