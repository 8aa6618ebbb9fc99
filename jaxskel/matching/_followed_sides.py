"""Left and right over a film: limbs stay near their places of the frame before, so clear frames decide unclear ones."""

import numpy as np
from jaxtyping import Bool, Float

from ._limbs import L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs

# Where the feet and the hands are exchanged, or not.
_STATES = np.array([[0, 0], [0, 1], [1, 0], [1, 1]], bool)
# A pair of limbs that moves less than `_NEAR` between two frames counts `_HOLD` times as much as the clearest single
# frame; one that moves farther counts less, so that single frames decide for themselves. On slim bodies in ten films
# of 30 frames per second (4968 frames), 60 frames have their feet exchanged without this and none with it; of every
# 8th frame (625) 6 and 1, of every 15th (334) 3 and 4, of every 30th (170) 3 and 2. `_NEAR` of 0.3 m is worse from
# every 15th frame on, 0.12 m at half the rate; `_HOLD` of 3 to 10 is alike.
_HOLD, _NEAR = 5.0, 0.2
# Gain in distance at which the other order of the two limbs is ruled out (m).
_STEP = 0.2


def follow_sides(
    limbs: Limbs, arm: float, leg: float, facing: Float[np.ndarray, " frames"], hands: Float[np.ndarray, " frames"]
) -> tuple[Bool[np.ndarray, " frames"], Bool[np.ndarray, " frames"]]:
    """Which frames' hands and feet must be exchanged for the least contradiction, by dynamic programming.

    Args:
        limbs: Limbs of successive frames, with the sides that each frame tells by itself.
        arm: Length of an arm to its tip (m).
        leg: Length of a leg to its tip (m).
        facing: Evidence of each frame for the sides of its feet (0 to 1).
        hands: Evidence of each frame that its hands have the sides that its feet have (0 to 1).

    Returns:
        Whether to exchange the hands, and the feet, of each frame.
    """
    if len(facing) == 1:  # as it tells by itself
        return np.zeros(1, bool), np.zeros(1, bool)
    by_feet, by_hands = _STATES.T
    own = facing[:, None] * by_feet + hands[:, None] * (by_feet != by_hands)
    feet_hold = _continuity(limbs, L_FOOT, R_FOOT, leg / 2)
    hands_hold = _continuity(limbs, L_HAND, R_HAND, arm / 2)
    turned_feet, turned_hands = by_feet[:, None] != by_feet, by_hands[:, None] != by_hands
    total, before = own[0], []
    for frame in range(1, len(own)):
        ways = total[:, None] + feet_hold[frame - 1] * turned_feet + hands_hold[frame - 1] * turned_hands
        before.append(ways.argmin(0))
        total = own[frame] + ways.min(0)
    path = [int(total.argmin())]
    for choices in reversed(before):
        path.append(int(choices[path[-1]]))
    states = _STATES[path[::-1]]
    return states[:, 1], states[:, 0]


def _continuity(limbs: Limbs, left: int, right: int, middle: float) -> Float[np.ndarray, " steps"]:
    """Cost of exchanging two limbs between a frame and the next; negative where they move less if exchanged.

    Limbs are compared at their ends and at `middle` (m) from them.
    """
    middles = limbs.at(np.array([left, right]), np.full(2, middle))
    one, other = (np.stack([limbs.ends[:, label], middles[:, i]], 1) for i, label in enumerate((left, right)))

    def moved(now: np.ndarray, last: np.ndarray) -> np.ndarray:
        return np.linalg.norm(now[1:] - last[:-1], axis=-1).mean(1)

    same = moved(one, one) + moved(other, other)
    crossed = moved(one, other) + moved(other, one)
    both = limbs.found[:, left] & limbs.found[:, right]
    weight = _HOLD * np.exp(-((np.minimum(same, crossed) / _NEAR) ** 2)) * (both[1:] & both[:-1])
    return weight * np.clip((crossed - same) / _STEP, -1, 1)
