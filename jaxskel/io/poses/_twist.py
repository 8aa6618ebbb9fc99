"""How bones are turned about themselves: by the plane in which a limb bends, carried on where it is straight."""

import numpy as np
from jaxtyping import Float

from ..._math.rotations import aligning

# Sine of the bend from which on a plane is trusted wholly. Joints are right to a centimetre or two, bones some 25 cm
# long: below, the plane of a limb that is nearly straight is that of its errors.
_SURE_BEND = 0.4


def swung(
    parents: Float[np.ndarray, "frames 3 3"], rest: Float[np.ndarray, "3"], bones: Float[np.ndarray, "frames 3"]
) -> Float[np.ndarray, "frames 3 3"]:
    """Rotations that follow those of the parent, and turn on by the least angle to bring `rest` into each bone.

    Args:
        parents: Rotations of the parent from rest to the world.
        rest: Unit vector along the bone at rest.
        bones: Unit vectors along the bone in the world.
    """
    turned = aligning(parents @ rest, bones) @ parents
    # Once more, because vectors that are opposite to a milliradian are taken for opposite.
    return aligning(turned @ rest, bones) @ turned


def hinged(
    rest: Float[np.ndarray, "3"],
    hinge: Float[np.ndarray, "3"],
    bones: Float[np.ndarray, "frames 3"],
    hinges: Float[np.ndarray, "frames 3"],
) -> Float[np.ndarray, "frames 3 3"]:
    """Rotations that bring a bone and the hinge across it from rest into those of each frame (unit vectors)."""
    at_rest = np.stack([rest, hinge, np.cross(rest, hinge)], -1)
    return np.stack([bones, hinges, np.cross(bones, hinges)], -1) @ at_rest.T


def hinge_across(
    bones: Float[np.ndarray, "frames 3"],
    bends: Float[np.ndarray, "frames 3"],
    parents: Float[np.ndarray, "frames 3 3"],
    rest: Float[np.ndarray, "3"],
    hinge: Float[np.ndarray, "3"],
    one_way: bool,
) -> Float[np.ndarray, "frames 3"]:
    """Unit vectors across a bone about which its limb bends, steady from frame to frame.

    The more a limb bends the more its plane is followed. What is left of the twist stays as it was in the frame before,
    relative to the parent, while the bone swings by the least angles.

    Args:
        bones: Unit vectors along the bone.
        bends: Across each bone, of the length of the sine of the bend: bone times the one that comes after it.
        parents: Rotations of the parent from rest to the world.
        rest: Unit vector along the bone at rest.
        hinge: Unit vector across it about which the limb bends at rest.
        one_way: Whether the limb bends to one side only, as a knee does: a bend to the other is an error.
    """
    turn_back = parents.swapaxes(-1, -2)
    along, bent = np.einsum("fij,fj->fi", turn_back, bones), np.einsum("fij,fj->fi", turn_back, bends)
    size = np.linalg.norm(bent, axis=-1)
    if one_way:
        by_parent = aligning(np.broadcast_to(rest, along.shape), along) @ hinge
        size = np.maximum((bent * by_parent).sum(-1), 0.0)
    sure = np.minimum(size / _SURE_BEND, 1.0) ** 2
    # Carried without any twist; the twist is then an angle from there.
    swings = aligning(np.concatenate([rest[None], along[:-1]]), along)
    carried = np.empty_like(along)
    last = hinge
    for frame, swing in enumerate(swings):
        last = swing @ last
        # Across the bone again, lest rounding add up over a long recording.
        last = last - along[frame] * (along[frame] @ last)
        last = last / np.linalg.norm(last)
        carried[frame] = last
    beside = np.cross(along, carried)
    seen = np.arctan2((bent * beside).sum(-1), (bent * carried).sum(-1))
    twists = np.empty(len(along))
    twist = 0.0
    for frame, (angle, weight) in enumerate(zip(seen, sure, strict=True)):
        twist += weight * ((angle - twist + np.pi) % (2 * np.pi) - np.pi)
        twists[frame] = twist
    found = np.cos(twists)[:, None] * carried + np.sin(twists)[:, None] * beside
    return np.einsum("fij,fj->fi", parents, found)
