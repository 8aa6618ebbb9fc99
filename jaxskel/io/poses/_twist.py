"""Twist of bones about their axes: from the plane in which a limb bends, carried on while the limb is straight."""

import numpy as np
from jaxtyping import Float

from ..._math.rotations import aligning

# Sine of the bend above which its plane is fully trusted. Joints err by a centimetre or two and bones are some 25 cm
# long, so the plane of a nearly straight limb is dominated by errors.
_SURE_BEND = 0.4


def swung(
    parents: Float[np.ndarray, "frames 3 3"], rest: Float[np.ndarray, "3"], bones: Float[np.ndarray, "frames 3"]
) -> Float[np.ndarray, "frames 3 3"]:
    """Rotations that follow those of the parent, plus the least rotation that aligns `rest` with each bone.

    Args:
        parents: Rotations of the parent from rest to the world.
        rest: Unit vector along the bone at rest.
        bones: Unit vectors along the bone in the world.
    """
    turned = aligning(parents @ rest, bones) @ parents
    # Repeat, because vectors that are opposite within a milliradian are treated as exactly opposite.
    return aligning(turned @ rest, bones) @ turned


def hinged(
    rest: Float[np.ndarray, "3"],
    hinge: Float[np.ndarray, "3"],
    bones: Float[np.ndarray, "frames 3"],
    hinges: Float[np.ndarray, "frames 3"],
) -> Float[np.ndarray, "frames 3 3"]:
    """Rotations that map a bone and its perpendicular hinge from rest to those of each frame (unit vectors)."""
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
    """Unit vectors perpendicular to a bone, about which its limb bends, continuous over time.

    The more a limb bends, the more its plane determines the twist. The rest of the twist stays as in the previous
    frame, relative to the parent, while the bone swings by the least angles.

    Args:
        bones: Unit vectors along the bone (world).
        bends: Cross product of each bone with the next one, whose length is the sine of the bend.
        parents: Rotations of the parent from rest to the world.
        rest: Unit vector along the bone at rest.
        hinge: Unit vector perpendicular to it, about which the limb bends at rest.
        one_way: Whether the limb only bends to one side, as a knee does; a bend to the other side is an error.
    """
    turn_back = parents.swapaxes(-1, -2)
    along, bent = np.einsum("fij,fj->fi", turn_back, bones), np.einsum("fij,fj->fi", turn_back, bends)
    size = np.linalg.norm(bent, axis=-1)
    if one_way:
        by_parent = aligning(np.broadcast_to(rest, along.shape), along) @ hinge
        size = np.maximum((bent * by_parent).sum(-1), 0.0)
    sure = np.minimum(size / _SURE_BEND, 1.0) ** 2
    # Hinges carried along without twist; the twist is then an angle relative to them.
    swings = aligning(np.concatenate([rest[None], along[:-1]]), along)
    carried = np.empty_like(along)
    last = hinge
    for frame, swing in enumerate(swings):
        last = swing @ last
        # Project onto the plane across the bone again, since rounding would accumulate over a long recording.
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
