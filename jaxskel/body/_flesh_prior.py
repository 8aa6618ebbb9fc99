"""Flesh of someone whose skeleton is known, as the tables of people have it.

The tables hold flesh around `default_adult`, where it stands at rest: feet straight ahead, arms near the trunk. A known
skeleton rests as it was measured, say with legs apart. So each segment's flesh turns with its bone.
"""

import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning
from .._math.vectors import unit
from ._capsule_body import BAG_BALLS, BALL_NAMES, FREE_BALLS, HAIR_BALLS, make_body
from ._shape import FLESH_FROM, LENGTH_NAMES, NO_PLAY, Prior, Shape, lengths_of, people_prior, shaped_body
from ._skeleton import Skeleton, default_adult

# Balls that the tables lack: their place follows from the skeleton alone.
_NOT_IN_TABLES = ("palm", "finger", *BAG_BALLS, *HAIR_BALLS)
_FREE = list(FREE_BALLS)
_MOVED = np.array([not BALL_NAMES[ball].endswith(_NOT_IN_TABLES) for ball in _FREE])


def flesh_prior(skeleton: Skeleton) -> Prior:
    """Prior of the flesh of someone with a known skeleton, which is the template: lengths and fingers are fixed."""
    usual = default_adult(skeleton.stature)
    table, count = people_prior(usual, skeleton.stature), len(LENGTH_NAMES)
    lengths = np.log(lengths_of(skeleton) / lengths_of(usual))
    known, free = np.arange(FLESH_FROM), np.arange(FLESH_FROM, len(table.precision))
    off = np.zeros(FLESH_FROM)  # the table does not contain fingers
    off[:count] = lengths - table.mean.lengths
    precision = table.precision.copy()
    flesh = np.asarray(table.mean.vector[free])
    flesh -= np.linalg.solve(precision[np.ix_(free, free)], precision[np.ix_(free, known)] @ off)
    precision[known], precision[:, known] = 0.0, 0.0
    precision[known, known] = NO_PLAY**-2
    return _as_it_rests(skeleton, usual, Prior(Shape(lengths, np.zeros(2), flesh.reshape(-1, 4)), precision))


def _as_it_rests(skeleton: Skeleton, usual: Skeleton, prior: Prior) -> Prior:
    """A prior around `usual` with the lengths of a skeleton, as one around the skeleton itself."""
    naked, own = shaped_body(usual, prior.mean), make_body(skeleton)
    turns = np.where(_MOVED[:, None, None], _turns(naked.skeleton, skeleton)[own.segments[_FREE]], np.eye(3))
    centres = (turns @ naked.offsets[_FREE][:, :, None])[..., 0]
    balls = np.concatenate([centres - own.offsets[_FREE], (naked.radii - own.radii)[_FREE][:, None]], 1)
    balls[~_MOVED] = prior.mean.balls[~_MOVED]
    turn = np.eye(len(prior.precision))
    for number, of_ball in enumerate(turns):
        first = FLESH_FROM + 4 * number
        turn[first : first + 3, first : first + 3] = of_ball
    return Prior(Shape(np.zeros(len(LENGTH_NAMES)), np.zeros(2), balls), turn @ prior.precision @ turn.T)


def _turns(start: Skeleton, goal: Skeleton) -> Float[np.ndarray, "segments 3 3"]:
    """Rotation of each segment from one rest pose to that of another skeleton.

    A segment turns with its parent, and then by the smallest rotation that aligns its bone. The pelvis, which carries
    several bones, keeps its direction.
    """
    turns = np.tile(np.eye(3), (len(start.template.segment_names), 1, 1))
    ways = [_ends(each) for each in (start, goal)]
    for (_, _, segment), one, other in zip(start.template.parts, *ways, strict=True):
        if segment:
            parent = turns[start.template.segment_parents[segment]]
            turns[segment] = aligning(parent @ one, other) @ parent
    return turns


def _ends(skeleton: Skeleton) -> Float[np.ndarray, "parts 3"]:
    """Unit vectors along the rigid parts of a skeleton at rest."""
    points = np.concatenate([np.asarray(skeleton.rest_joints), np.asarray(skeleton.pivots)])
    starts, ends, _ = skeleton.template.parts.T
    return unit(points[ends] - points[starts])
