"""Luggage: what the silhouettes show at the same place of the chest in most frames, and no part of the body explains.

A search that does not know of a backpack explains it by an arm that reaches into it. An arm moves relative to the
chest, and what is carried on it does not.
"""

from concurrent.futures import Executor

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import padded, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import SEGMENT_NAMES, Body, Pose, all_distances, capsule_ends, limb_capsules
from ..refinement.terms import Observed, place
from ._additions import Addition, luggage

_CHEST = SEGMENT_NAMES.index("chest")
# Points about the turning centre of the chest (m): farthest to the front, back, sides, down and up, and their spacing.
_FRONT, _SIDE, _DOWN, _UP, _SPACING = 0.5, 0.45, 0.15, 0.75, 0.03
# A point is carried if the silhouettes show it in this share of the frames, at least this far (m) from trunk, head and
# legs, and if arms do not explain it in most frames.
_SEEN, _APART, _NO_ARM = 0.75, 0.02, 0.4
# Largest number of frames that are looked at.
_FRAMES = 32
# Volume from which on it is luggage (l). Backpacks of 12 to 25 l give 10 to 23 l, coats and hair below 1 l.
_LITRES = 3.0


def find_luggage(body: Body, poses: Pose, observed: Observed, frames: Int[np.ndarray, " used"]) -> Addition | None:
    """Find what a subject carries on the chest, or None.

    Args:
        body: The subject as found so far.
        poses: Its poses (m, in the world), with the axis ``used``.
        observed: What frames show, on the device.
        frames: Index of each pose's frame in `observed`.
    """
    some = np.unique(np.linspace(0, len(frames) - 1, _FRAMES).astype(int))
    poses, frames = padded((take(poses, some), frames[some].astype(np.int32)), _FRAMES)
    used, points = np.arange(_FRAMES) < len(some), _points()
    shown, armed = (np.asarray(a) for a in _carried(single_precision(body), poses, frames, used, observed, points))
    carried = points[(shown >= _SEEN) & (armed >= _NO_ARM)]
    behind = carried[:, 0] < 0
    carried = carried[behind == (2 * behind.sum() >= len(carried))]
    if 1000 * len(carried) * _SPACING**3 < _LITRES:
        return None
    middle = carried.mean(0)
    # Half the extent of a box with these deviations.
    thick, wide, tall = np.sqrt(3) * carried.std(0)
    radius = thick + _APART / 2
    aside, up = max(wide - radius, 0.0), max(tall - radius, 0.0)
    ends = np.array([[middle[0], aside, middle[2] + up], [middle[0], aside, middle[2] - up]])
    return luggage(ends, float(radius))


def luggage_ahead(threads: Executor, body: Body, pose: Pose, observed: Observed) -> None:
    """Begin to compile what `find_luggage` needs for arguments like these; `pose` has an axis for one frame."""
    frames, used = np.zeros(_FRAMES, np.int32), np.ones(_FRAMES, bool)
    _carried.ahead(threads, single_precision(body), padded(pose, _FRAMES), frames, used, observed, _points())


def _points() -> Float[np.ndarray, "points 3"]:
    """Points about the turning centre of the chest (m), relative to it."""
    size = [np.arange(-low, high, _SPACING) for low, high in ((_FRONT, _FRONT), (_SIDE, _SIDE), (_DOWN, _UP))]
    return np.stack(np.meshgrid(*size, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)


@cached_jit
def _carried(
    body: Body,
    poses: Pose,
    frames: Int[Array | np.ndarray, " frames"],
    used: Bool[Array | np.ndarray, " frames"],
    observed: Observed,
    points: Float[Array | np.ndarray, "points 3"],
) -> tuple[Float[Array, " points"], Float[Array, " points"]]:
    """Shares of the used frames where points (m, relative to the chest) are inside all silhouettes, outside the body.

    Once outside of trunk, head and legs, and once outside of the arms, too.
    """
    silhouettes = observed.silhouettes
    assert silhouettes is not None
    radii, armless = jnp.asarray(body.radii)[body.links], ~limb_capsules("l_arm", "r_arm")

    def seen_in(pose: Pose, frame: Int[Array, ""]) -> tuple[Bool[Array, " points"], Bool[Array, " points"]]:
        placed = place(body.skeleton, pose)
        here = placed.origins[_CHEST][None] + points @ placed.rotations[_CHEST].T
        view = silhouettes.of(frame)
        shown = (view.near(here) > 0).sum(0) <= view.misses
        away = all_distances(here, jnp.asarray(capsule_ends(body, placed.origins, placed.rotations)), radii)
        return shown & (away[:, armless].min(1) > _APART), shown & (away.min(1) > _APART)

    def one(given: tuple[Pose, Array, Array]) -> tuple[Bool[Array, " points"], Bool[Array, " points"]]:
        pose, frame, wanted = given
        nowhere = jnp.zeros(len(points), bool)
        return jax.lax.cond(wanted, lambda: seen_in(pose, frame), lambda: (nowhere, nowhere))

    both = jax.lax.map(one, (poses, frames, used))
    return both[0].sum(0) / used.sum(), both[1].sum(0) / used.sum()
