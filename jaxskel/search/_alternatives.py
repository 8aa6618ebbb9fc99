"""Other poses than a track's that the latest search found: its rivals, until the next search, for doubt that is honest.

A track follows one pose. Without what its searches found besides, a hand that a sleeve or long hair may explain is
given as sure once the track has taken it.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, Int

from .._runtime.batching import take
from ..body import SEGMENT_NAMES, Pose
from ._facing import turned_rivals
from ._hypotheses import Hypotheses

# Cost that is added to what an alternative cost more in the frame of its search: the frames before it spoke for the
# track. With 0, 1, 1.5 and 2, the log-likelihood of 1,943 hands of 15 naked films being within 100 mm is -0.144,
# -0.138, -0.137 and -0.137; of 4,068 in clothes -0.335, -0.327, -0.326 and -0.327, and -0.140 and -0.449 without
# alternatives.
_FOLLOWED = 1.5
_ROOT = SEGMENT_NAMES.index("pelvis")


class Alternatives(eqx.Module):
    """What the latest search found, in one frame or several.

    Attributes:
        poses: Axes ``*frames alternatives``.
        excess: How much more each costs than the track's pose in the frame of the search; infinite where there is none.
        pose: The pose of the track in the frame that `poses` are of, with axes ``*frames``.
    """

    poses: Pose
    excess: Float[np.ndarray, "*frames alternatives"]
    pose: Pose

    def taken(self) -> "Alternatives":
        """The same, of one frame, after the track has taken the first of them."""
        first = jax.tree.map(lambda a: a[0], self.poses)
        return Alternatives(self.poses, self.excess - self.excess[0], first)


def no_alternatives(pose: Pose, count: int) -> Alternatives:
    """Alternatives of which there is none."""
    poses = jax.tree.map(lambda a: np.repeat(np.asarray(a)[None], count, 0), pose)
    return Alternatives(poses, np.full(count, np.inf, np.float32), pose)


def carried(poses: Pose, then: Pose, now: Pose) -> Pose:
    """Poses of one frame, carried to another: each segment is moved as a track's has moved between the two.

    Args:
        poses: Axes ``*frames alternatives``.
        then: The track in the frames that they are of, with axes ``*frames``.
        now: The track in the frames that they are carried to, with the same axes.
    """
    moved = (np.asarray(now.rotations) @ np.asarray(then.rotations).swapaxes(-1, -2))[..., None, :, :, :]
    away = poses.root - np.asarray(then.root)[..., None, :]
    roots = np.asarray(now.root)[..., None, :] + (moved[..., _ROOT, :, :] @ away[..., None])[..., 0]
    return Pose(roots.astype(np.float32), (moved @ poses.rotations).astype(np.float32))


class Known(NamedTuple):
    """What searches found in consecutive frames.

    Attributes:
        found: Axes ``searches alternatives``.
        frames: The frames that were searched in, in order.
        before: What was known before the first frame.
    """

    found: Hypotheses
    frames: Int[np.ndarray, " searches"]
    before: Alternatives


def latest(track: Hypotheses, known: Known) -> Alternatives:
    """What the latest search found, in each frame of a track (axis ``frames``), its hypothesis first."""
    excess = known.found.cost - track.cost[known.frames, :1]
    each = Alternatives(known.found.poses, excess, take(track.best, known.frames))
    each = jax.tree.map(lambda a, b: np.concatenate([np.asarray(a)[None], b]), known.before, each)
    return take(each, np.searchsorted(known.frames, np.arange(len(track.cost)), "right"))


def told(found: Hypotheses, known: Alternatives) -> Hypotheses:
    """Add to the hypotheses of each frame the alternatives known in it (axes ``frames alternatives``)."""
    poses = carried(known.poses, known.pose, found.best)
    cost = found.cost[:, :1] + np.maximum(known.excess, 0.0) + _FOLLOWED
    return found.joined(Hypotheses(poses, cost))


def facing_alike(found: Hypotheses) -> Hypotheses:
    """The same, but hypotheses that face another way than the first of their frame cost too much to count."""
    return Hypotheses(found.poses, np.where(turned_rivals(found), np.float32(np.inf), found.cost))
