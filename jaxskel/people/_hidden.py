"""What other people hide of a person: pixels of their silhouettes, unless they surely stand behind."""

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..cameras import Cameras
from ..hull import body_middles
from ..recording import (
    MIN_VIEWS,
    AbstractSilhouettes,
    Recording,
    Silhouettes,
    find_empty_views,
    pack_silhouettes,
    silhouette_areas,
    unpack_silhouettes,
)

# Somebody whose middle is this much farther from a camera stands behind with the arms, too (m).
_BEHIND = 0.6
# Masks of people who overlap often leave a gap between them, which is no background (px).
_GAP = 2


def hide_others(people: Mapping[str, Recording]) -> dict[str, Recording]:
    """Recordings of people in one room, in which each knows what the others may hide of them.

    Args:
        people: The recording of each person by name: the same cameras and frames, and silhouettes of this person alone
            (instance masks), as far as they are seen.

    Returns:
        The same with `hidden`: the silhouettes of all others, except where they stand behind.

    Raises:
        ValueError: The recordings are not of the same cameras and frames.
    """
    first = next(iter(people.values()), None)
    for name, recording in people.items():
        assert first is not None
        if recording.silhouettes.shape != first.silhouettes.shape or recording.cameras.names != first.cameras.names:
            raise ValueError(
                f"{name}: silhouettes of shape {recording.silhouettes.shape}, but {first.silhouettes.shape} of the "
                "first person; give the same cameras and frames for all"
            )
    found = {}
    for name, recording in people.items():
        others = tuple(other.silhouettes for key, other in people.items() if key != name)
        hidden = _Hidden(recording.silhouettes, others, recording.cameras) if others else None
        found[name] = replace(recording, hidden=hidden)
    return found


def everybody(people: Mapping[str, Recording]) -> Recording:
    """The recording of a room in which the silhouettes show all people: the union of theirs.

    Raises:
        ValueError: There is nobody.
    """
    if not people:
        raise ValueError("people: there is nobody; give a recording for each person")
    first, *others = people.values()
    silhouettes = _Union((first.silhouettes, *(other.silhouettes for other in others)))
    return replace(first, silhouettes=silhouettes, hidden=None, skeleton=None, truth=None, name="everybody")


class _Union(AbstractSilhouettes):
    """The silhouettes of all people."""

    def __init__(self, parts: tuple[Silhouettes, ...]):
        self.shape = tuple(parts[0].shape)  # pyright: ignore[reportAttributeAccessIssue]
        self._parts = parts

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        found = np.array(self._parts[0][frames])
        for part in self._parts[1:]:
            found |= part[frames]
        return found


class _Hidden(AbstractSilhouettes):
    """Packed bits of the pixels where others may stand before a person, computed on access."""

    def __init__(self, own: Silhouettes, others: tuple[Silhouettes, ...], cameras: Cameras):
        self.shape = own.shape
        self._own, self._others, self._cameras = own, others, cameras

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        own = self._own[frames]
        ways = _distances(own, self._cameras)
        hidden = np.zeros_like(own)
        for other in self._others:
            theirs = other[frames]
            # NaN, where a distance is not known, is not behind.
            before = ~(_distances(theirs, self._cameras) > ways + _BEHIND)
            hidden |= np.where(before[:, :, None, None], _widened(theirs), np.uint8(0))
        return hidden & ~own


def _distances(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"], cameras: Cameras
) -> Float[np.ndarray, "frames cams"]:
    """Distance of the middle of a person from each camera (m); NaN in frames where too few views show the person."""
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    middles = body_middles(cameras, silhouettes, empty_views)
    middles[(~empty_views).sum(1) < MIN_VIEWS] = np.nan
    return np.linalg.norm(middles[:, None] - cameras.centres, axis=-1)


def _widened(silhouettes: UInt8[np.ndarray, "frames cams h w8"]) -> UInt8[np.ndarray, "frames cams h w8"]:
    """Silhouettes with a margin of the width of a gap."""
    around = np.ones((2 * _GAP + 1, 2 * _GAP + 1), np.uint8)
    wide: Bool[np.ndarray, "frames cams h w"] = np.stack(
        [
            [
                cv2.dilate(unpack_silhouettes(view, 8 * view.shape[1]).view(np.uint8), around).view(bool)
                for view in frame
            ]
            for frame in silhouettes
        ]
    )
    return pack_silhouettes(wide)
