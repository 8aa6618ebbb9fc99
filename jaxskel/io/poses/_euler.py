"""Converts rotations to the three angles of a BVH joint, continuous over time."""

import numpy as np
from jaxtyping import Float


def to_zxy(rotations: Float[np.ndarray, "frames joints 3 3"]) -> Float[np.ndarray, "frames joints 3"]:
    """Angles (rad) about z, x and y, the first outermost, that continue those of the previous frame.

    Many triples of angles give the same rotation; the nearest triple is used, so that interpolation between frames
    never takes the long way round. Angles exceed half a turn if a joint rotates that far.
    """
    z = np.arctan2(-rotations[..., 0, 1], rotations[..., 1, 1])
    cosine, sine = np.cos(z), np.sin(z)
    # Remove the rotation about z, so that x and y are exact even at 90 degrees about x, where z and y are ambiguous.
    first = cosine[..., None] * rotations[..., 0, :] + sine[..., None] * rotations[..., 1, :]
    second = cosine * rotations[..., 1, 1] - sine * rotations[..., 0, 1]
    x, y = np.arctan2(rotations[..., 2, 1], second), np.arctan2(first[..., 2], first[..., 0])
    angles = np.stack([z, x, y], -1)
    twins = np.stack([z + np.pi, np.pi - x, y + np.pi], -1)
    last = np.zeros(angles.shape[1:])
    for frame, pair in enumerate(np.stack([angles, twins], 1)):
        near = pair + 2 * np.pi * np.round((last - pair) / (2 * np.pi))
        far = np.abs(near - last).sum(-1)
        last = np.where((far[1] < far[0])[:, None], near[1], near[0])
        angles[frame] = last
    return angles
