"""Simulates faults of real captures: fewer cameras, dirty masks, a mismeasured subject.

Each function takes a recording and returns a new one; the truth stays. Random numbers depend on the seed, the
recording's name and, for masks, the frame's number. So a frame is disturbed in the same way whichever other frames are
chosen, and two recordings are disturbed differently.
"""

import zlib
from collections.abc import Sequence

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool

from jaxskel import JOINT_NAMES, JOINT_PARENTS, Recording, make_skeleton, pack_silhouettes, unpack_silhouettes
from jaxskel.body import MIRROR_JOINTS, TIP_PARENTS

EDGE_SHIFT = 2
"""Largest error of an outline (px)."""
DISC_RADIUS = 20
"""Radius of a hole in, or of a blob beside, the person (px)."""
DISCS = 2
# A blob is centred within this of the person (px), so that it touches the silhouette or stands just beside it.
_BLOB_REACH = 2 * DISC_RADIUS
# Raggedness of an outline varies over about this length (px), as the noise of a background subtraction does.
_RAG_LENGTH = 4


def with_cameras(recording: Recording, indices: Sequence[int]) -> Recording:
    """The recording with only some of its cameras, in the given order."""
    count = len(recording.cameras)
    outside = [i for i in indices if not 0 <= i < count]
    if outside or not indices or len(set(indices)) < len(indices):
        raise ValueError(
            f"{recording.name}: cameras {list(indices)}: give different indices from 0 to {count - 1}, each once"
        )
    chosen = list(indices)
    return eqx.tree_at(
        lambda r: (r.cameras, r.silhouettes), recording, (recording.cameras[chosen], recording.silhouettes[:, chosen])
    )


def with_dirty_masks(recording: Recording, seed: int) -> Recording:
    """The recording with silhouettes like those of a poor segmentation.

    In each view of each frame the outline is off by up to `EDGE_SHIFT` ([`rough_edges`][]) and `DISCS` discs are cut
    out or added ([`holes_and_blobs`][]). In each frame one camera, drawn anew, sees nothing at all.
    """
    sizes, width = recording.cameras.size, 8 * recording.silhouettes.shape[3]
    masks = np.array(unpack_silhouettes(np.asarray(recording.silhouettes), width))
    for frame, number in zip(masks, recording.frame_index, strict=True):
        rng = _generator(seed, recording.name, int(number))
        black = rng.integers(len(frame))
        for view, (w, h) in zip(frame, sizes, strict=True):
            view[:h, :w] = holes_and_blobs(rough_edges(view[:h, :w], rng), rng)
        frame[black] = False
    return eqx.tree_at(lambda r: r.silhouettes, recording, pack_silhouettes(masks))


def rough_edges(mask: Bool[np.ndarray, "h w"], rng: np.random.Generator) -> Bool[np.ndarray, "h w"]:
    """Grow or shrink a silhouette by a whole number of pixels, -2 to 2, and by one pixel more or less here and there.

    A pixel changes only if the nearest pixel of the other kind is at most `EDGE_SHIFT` away.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    radius = int(rng.integers(-EDGE_SHIFT, EDGE_SHIFT + 1))
    if not rows.size:
        return mask.copy()
    # Only pixels within the shift of the person can change; one more pixel includes the background around it.
    margin = EDGE_SHIFT + 1
    window = (
        slice(max(rows[0] - margin, 0), rows[-1] + margin + 1),
        slice(max(columns[0] - margin, 0), columns[-1] + margin + 1),
    )
    near = mask[window]
    coarse = rng.uniform(-1, 1, [n // _RAG_LENGTH + 2 for n in near.shape])
    ragged = cv2.resize(coarse, near.shape[::-1], interpolation=cv2.INTER_LINEAR)
    shift = np.clip(np.rint(radius + ragged), -EDGE_SHIFT, EDGE_SHIFT)
    # In a window with pixels of one kind only, the other kind counts as far away.
    to_other = np.where(near, _distance_to_zero(near), _distance_to_zero(~near))
    moved = to_other <= np.abs(shift) + 1e-3
    result = mask.copy()
    result[window] = np.where(moved & (near == (shift < 0)), ~near, near)
    return result


def _distance_to_zero(mask: np.ndarray) -> np.ndarray:
    return cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def holes_and_blobs(mask: Bool[np.ndarray, "h w"], rng: np.random.Generator) -> Bool[np.ndarray, "h w"]:
    """Cut out or add `DISCS` discs of `DISC_RADIUS`, hole or blob at random.

    A hole is centred on the person, a blob at most `_BLOB_REACH` away from a point of the person in u and in v.
    Without a person there is neither.
    """
    result = mask.copy()
    person = np.argwhere(mask)
    for _ in range(DISCS if len(person) else 0):
        hole = bool(rng.integers(2))
        v, u = person[rng.integers(len(person))]
        if not hole:
            v, u = (v, u) + rng.integers(-_BLOB_REACH, _BLOB_REACH + 1, 2)
        rows, columns = np.ogrid[: mask.shape[0], : mask.shape[1]]
        result[(rows - v) ** 2 + (columns - u) ** 2 <= DISC_RADIUS**2] = not hole
    return result


def with_wrong_bones(recording: Recording, share: float, seed: int) -> Recording:
    """The recording with a template whose bones are each too long or too short by a share, at random.

    Left and right get the same factor. A tip gets the factor of the bone that ends in its joint: with a longer forearm,
    the hand is longer.

    Args:
        recording: With the subject's dimensions.
        share: Error of each length, as a share of it: 0.05 gives factors of 0.95 and 1.05.
        seed: Seed of the random choices.
    """
    if recording.skeleton is None:
        raise ValueError(f"{recording.name}: key 'rest_joints': there are no known bone lengths to disturb")
    if not 0 <= share < 1:
        raise ValueError(f"share {share}: give a number from 0 to below 1, as 0.05 for 5 %")
    rng = _generator(seed, recording.name)
    factors = 1 + share * rng.choice([-1.0, 1.0], len(JOINT_NAMES))
    factors = factors[np.minimum(np.arange(len(JOINT_NAMES)), MIRROR_JOINTS)]
    rest, tips = np.asarray(recording.skeleton.rest_joints), np.asarray(recording.skeleton.rest_tips)
    joints = rest.copy()
    for joint, parent in enumerate(JOINT_PARENTS):
        if parent >= 0:
            joints[joint] = joints[parent] + factors[joint] * (rest[joint] - rest[parent])
    ends = list(TIP_PARENTS)
    wrong = make_skeleton(joints, joints[ends] + factors[ends, None] * (tips - rest[ends]))
    return eqx.tree_at(lambda r: r.skeleton, recording, wrong)


def _generator(seed: int, name: str, *more: int) -> np.random.Generator:
    # Seeds are never negative, and frame numbers need not be positive.
    return np.random.default_rng([seed, zlib.crc32(name.encode()), *(number % 2**63 for number in more)])
