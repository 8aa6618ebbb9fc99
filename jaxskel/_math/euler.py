"""Three angles of a rotation (Euler, Cardan), continuous over time."""

import numpy as np
from jaxtyping import Float


def to_zxy(
    rotations: Float[np.ndarray, "frames joints 3 3"], *, home: float = 0.0, most: float = np.inf
) -> Float[np.ndarray, "frames joints 3"]:
    """Angles (rad) about z, x and y, the first outermost, that continue those of the previous frame.

    Two triples of angles, and each of them with full turns added, give the same rotation. The one nearest to the
    previous frame's is used, so that interpolation between frames never takes the long way round. Angles exceed half a
    turn if a joint rotates that far.

    Args:
        rotations: Rotation matrices, none of them NaN.
        home: How many times as much as the way from the previous frame it counts how far the second and the third angle
            are from zero. At 0, a joint that once passed where z and y fall together (gimbal lock) may keep large
            angles for ever; with 2, it comes back to small ones within a frame or two.
        most: Angles beyond (rad) lose their full turns: no limb turns so far, but noise at a gimbal lock adds up.
    """
    z = np.arctan2(-rotations[..., 0, 1], rotations[..., 1, 1])
    cosine, sine = np.cos(z), np.sin(z)
    # Remove the rotation about z, so that x and y are exact even at 90 degrees about x, where z and y are ambiguous.
    first = cosine[..., None] * rotations[..., 0, :] + sine[..., None] * rotations[..., 1, :]
    second = cosine * rotations[..., 1, 1] - sine * rotations[..., 0, 1]
    x, y = np.arctan2(rotations[..., 2, 1], second), np.arctan2(first[..., 2], first[..., 0])
    angles = np.stack([z, x, y], -1)
    twins = np.stack([z + np.pi, np.pi - x, y + np.pi], -1)
    pairs = np.stack([angles, twins], 1)
    away = home * np.abs(pairs[..., 1:] - _full_turns(pairs[..., 1:])).sum(-1)
    last = np.zeros(angles.shape[1:])
    for frame, pair in enumerate(pairs):
        near = pair - _full_turns(pair - last)
        near = np.where(np.abs(near) > most, near - _full_turns(near), near)
        cost = np.abs(near - last).sum(-1) + away[frame]
        last = np.where((cost[1] < cost[0])[:, None], near[1], near[0])
        angles[frame] = last
    return angles


def _full_turns(angles: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch"]:
    """The full turns (rad) nearest to angles."""
    return 2 * np.pi * np.round(angles / (2 * np.pi))
