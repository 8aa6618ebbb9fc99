"""Left and right, by the direction in which feet and knees point, and over a film by where limbs were before.

The paper decides sides "in a post processing step" (Sect. 3.2.2) that it does not describe. Feet are longer in front of
the ankle and knees bend to the front, so both give the facing direction; up x facing then points to the left.
"""

import numpy as np
from jaxtyping import Float

from ..body import Skeleton
from ._followed_sides import follow_sides
from ._limbs import L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs

# Positions of ankle, knee, upper thigh and upper arm, in fractions of the limb's length from its tip.
_ANKLE, _KNEE, _THIGH, _UPPER_ARM = 0.20, 0.52, 0.85, 0.80
_FEET, _HANDS = np.array([L_FOOT, R_FOOT]), np.array([L_HAND, R_HAND])
# Lengths (m) at which evidence saturates: of the facing vector, and of the distance between the two limbs.
_FACING_SCALE, _APART_SCALE = 0.10, 0.08


def tell_sides(
    limbs: Limbs, skeleton: Skeleton
) -> tuple[Limbs, Float[np.ndarray, "frames 3"], Float[np.ndarray, " frames"]]:
    """Assign left and right to the two hands and the two feet.

    Args:
        limbs: Limbs of successive frames in a world with z up, the two of a pair in any order.
        skeleton: Template, for the lengths of arms and legs.

    Returns:
        The limbs with the correct sides, the facing direction (unit, horizontal; zero if unknown), and a confidence
        from 0.5 (a guess, or neighbouring frames say otherwise than the frame) to 1.
    """
    lengths = skeleton.bone_lengths
    arm = float(lengths[3] + lengths[4] + skeleton.tip_lengths[1])
    leg = float(lengths[9] + lengths[10] + skeleton.tip_lengths[3])
    on_legs = limbs.at(np.repeat(_FEET, 3), leg * np.array(2 * [_ANKLE, _KNEE, _THIGH]))
    ankles, knees, thighs = np.moveaxis(on_legs.reshape(-1, 2, 3, 3), 2, 0)
    upper_arms = limbs.at(_HANDS, np.full(2, _UPPER_ARM * arm))
    ahead = (limbs.ends[:, _FEET] - ankles) + (knees - (ankles + thighs) / 2)
    facing = np.where(limbs.found[:, _FEET, None], ahead, 0.0).sum(1)
    facing[:, 2] = 0.0
    strength = np.linalg.norm(facing, axis=1)
    facing /= np.maximum(strength, 1e-9)[:, None]
    left = np.stack([-facing[:, 1], facing[:, 0], np.zeros(len(facing))], 1)  # up x facing

    # If limbs cross, their upper parts are still on their own sides.
    hands, feet = (((pair[:, 0] - pair[:, 1]) * left).sum(1) for pair in (upper_arms, thighs))
    clear_feet, clear_hands = np.tanh(np.abs(feet) / _APART_SCALE), np.tanh(np.abs(hands) / _APART_SCALE)
    evidence = np.tanh(strength / _FACING_SCALE) * clear_feet
    limbs = limbs.exchanged(hands < 0, feet < 0)
    turned_hands, turned_feet = follow_sides(limbs, arm, leg, evidence, clear_hands * clear_feet)
    facing = np.where(turned_feet[:, None], -facing, facing)
    return limbs.exchanged(turned_hands, turned_feet), facing, 0.5 + 0.5 * np.where(turned_feet, 0.0, evidence)
