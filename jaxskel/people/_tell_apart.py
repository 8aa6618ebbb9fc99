"""People told apart where their silhouettes are one mask: by the separate bodies of the hull, followed in time."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from jaxtyping import Bool, Int, UInt8

from .._runtime.kinds import check_count, check_kind
from ..recording import AbstractSilhouettes, Recording, Silhouettes
from ._bodies import CELL, bodies_of_frames, cells_of
from ._follow import Whereabouts, follow, present
from ._room import SPACING, Room, make_room

MOST_PEOPLE = 8
"""Largest number of people that are told apart."""
# Pixels this far from where a person is in the image are still theirs if nobody else is nearer (m): thin limbs fall
# between coarse voxels.
_REACH = 0.35
# Pixels of others this near may hide the person, or show them: where people touch, the border between them is not
# known (m).
_BORDER = 0.2


def tell_people_apart(
    recording: Recording, people: int | None = None, on_frames: Callable[[int], None] | None = None
) -> dict[str, Recording]:
    """Recordings of each person in a room, from silhouettes that show all of them as one mask.

    Hulls of everybody are carved coarsely. Their bodies, without ghosts, are followed in time, forwards and backwards
    from frames in which as many as possible are apart; where people touch, the common body is divided by where each
    was before. In each view, pixels that only one person explains are theirs; pixels that several explain are hidden
    from all of these. Somebody who leaves and comes back keeps the name if the body is as tall.

    Args:
        recording: Silhouettes of everybody.
        people: Number of people; by default as many as are apart for half a second or longer, eight at most.
        on_frames: Called with the number of frames in which bodies were looked for, to show progress.

    Returns:
        A recording for each person, named ``person_1`` and so on, with `hidden`; frames in which somebody is not seen
        have empty silhouettes. Empty where there is nobody.

    Raises:
        ValueError: `people` is not a number from 1 to 8.
    """
    check_kind("recording", recording, Recording, "a Recording, as read_recording(path) reads it")
    most = MOST_PEOPLE if people is None else people
    check_count("people", most, 1)
    if most > MOST_PEOPLE:
        raise ValueError(f"people: {most} are too many to be told apart; give {MOST_PEOPLE} or less")
    room = make_room(recording)
    if room.table is None:
        return {}
    bodies = bodies_of_frames(recording, room, on_frames)
    whereabouts = follow(bodies, SPACING, recording.fps, most, people is not None)
    numbers = present(whereabouts)
    divided = _Divided(recording.silhouettes, room, whereabouts, numbers)
    return {
        f"person_{place + 1}": replace(
            recording, silhouettes=_Share(divided, place, 0), hidden=_Share(divided, place, 1), truth=None,
            name=f"person_{place + 1}",
        )
        for place in range(len(numbers))
    }  # fmt: skip


class _Divided:
    """The silhouettes of everybody, divided among people on access."""

    def __init__(
        self, everybody: Silhouettes, room: Room, whereabouts: Whereabouts, numbers: Int[np.ndarray, " people"]
    ):
        self.everybody = everybody
        self._room, self._whereabouts, self._numbers = room, whereabouts, numbers
        self._frames: Int[np.ndarray, " some"] = np.zeros(0, int)
        self._shares = np.zeros((0, 0, 0, 0, 0, 0), np.uint8)

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "people 2 some cams h w8"]:
        """Own and hidden pixels of each person; the last frames are kept, because people ask for them in turn."""
        if not np.array_equal(frames, self._frames):
            packed = np.asarray(self.everybody[frames])
            self._shares = np.zeros((len(self._numbers), 2, *packed.shape), np.uint8)
            for place, frame in enumerate(frames.tolist()):
                self._shares[:, :, place] = self._divide(packed[place], frame)
            self._frames = frames
        return self._shares

    def _divide(self, packed: UInt8[np.ndarray, "cams h w8"], frame: int) -> UInt8[np.ndarray, "people 2 cams h w8"]:
        there = [self._whereabouts[frame].get(int(number)) for number in self._numbers]
        some = [place for place, voxels in enumerate(there) if voxels is not None]
        found = np.zeros((len(there), 2, *packed.shape), np.uint8)
        if not some:
            return found
        cells = np.stack([cells_of(there[place], self._room) for place in some])  # pyright: ignore
        for view in range(len(packed)):
            away = np.stack([cv2.distanceTransform(1 - one.view(np.uint8), cv2.DIST_L2, 3) for one in cells[:, view]])
            away[~cells[:, view].any((1, 2))] = np.inf
            focal = float(self._room.cameras.K[view, 0, 0])
            for place, own, hidden in zip(some, *_shares(away, self._per_metre(there, some, view, focal)), strict=True):
                for kind, mask in enumerate((own, hidden)):
                    found[place, kind, view] = packed[view] & _bytes(mask, packed.shape[1])
        return found

    def _per_metre(self, there: list, some: list[int], view: int, focal: float) -> np.ndarray:
        """Cells per metre at the middle of each person."""
        grid = self._room.table.grid  # pyright: ignore[reportOptionalMemberAccess]
        middles = np.stack([there[place].mean(0) for place in some]) * grid.spacing + np.asarray(grid.origin)
        return focal / np.linalg.norm(middles - self._room.cameras.centres[view], axis=1) / CELL


def _shares(away: np.ndarray, per_metre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cells that are each person's, and cells of others that may hide them, from distances (cells) to each person."""
    there = away == 0
    nearest = (away == away.min(0)) & (away <= _REACH * per_metre[:, None, None])
    # Of several who are equally near, nobody has it for themselves.
    own = np.where(there.any(0), there, nearest)
    common = own.sum(0) > 1
    of_others = (own.any(0) & ~own) | common
    hidden = of_others & (away <= _BORDER * per_metre[:, None, None])
    return own & ~common, hidden


def _bytes(mask: Bool[np.ndarray, "rows columns"], height: int) -> UInt8[np.ndarray, "h columns"]:
    """A mask of cells as packed bits of pixels."""
    return np.repeat(np.where(mask, np.uint8(0xFF), np.uint8(0)), CELL, axis=0)[:height]


class _Share(AbstractSilhouettes):
    """Own (0) or hidden (1) pixels of one person."""

    def __init__(self, divided: _Divided, place: int, kind: int):
        self.shape = tuple(divided.everybody.shape)  # pyright: ignore[reportAttributeAccessIssue]
        self._divided, self._place, self._kind = divided, place, kind

    def read(self, frames: Int[np.ndarray, " some"]) -> UInt8[np.ndarray, "some cams h w8"]:
        return self._divided.read(frames)[self._place, self._kind]
