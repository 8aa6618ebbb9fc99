"""Rotations over time as unit quaternions."""

import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Float


def to_quaternions(rotations: Float[np.ndarray, "frames segments 3 3"]) -> Float[np.ndarray, "frames segments 4"]:
    """Unit quaternions, w first, whose signs are continuous over time.

    A quaternion and its negative are the same rotation. The first one has w >= 0; each one after it has the sign that
    is nearer to the one before.

    Args:
        rotations: Rotation matrices; NaN in frames without a pose, which are skipped.

    Returns:
        The quaternions w, x, y, z; NaN in frames without a pose.
    """
    quaternions = np.full((*rotations.shape[:2], 4), np.nan)
    known = np.isfinite(rotations).all((1, 2, 3))
    if known.any():
        matrices = rotations[known].astype(np.float64)
        xyzw = scipy.spatial.transform.Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_quat(canonical=True)
        found = np.roll(xyzw.reshape(*matrices.shape[:2], 4), 1, axis=-1)
        turned_away = (found[1:] * found[:-1]).sum(-1) < 0
        found[1:] *= np.cumprod(np.where(turned_away, -1.0, 1.0), axis=0)[..., None]
        quaternions[known] = found
    return quaternions
