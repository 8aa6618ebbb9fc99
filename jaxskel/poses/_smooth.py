"""Low-pass filtering of finished poses over time."""

from collections.abc import Callable
from functools import partial

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from ..body import JOINT_PARENTS, TIP_PARENTS
from ._poses import Poses

_ORDER = 2  # run forwards and backwards: no delay, and the effect of order four
_SHORTEST = 15  # frames: the filter is started up on as many


def smooth(poses: Poses, cutoff: float) -> Poses:
    """Smooth joints and tips by a Butterworth filter without delay.

    Directions and lengths of the bones are smoothed apart, so that a bone whose length is constant keeps it. Frames
    without a pose are left alone and nothing is smoothed across them; nor are runs that are too short to filter.

    Args:
        poses: Consecutive frames.
        cutoff: Frequency (Hz) at which the amplitude falls to half.

    Raises:
        ValueError: The cutoff is not between 0 and half of the frame rate.
    """
    if not 0 < cutoff < poses.fps / 2:
        raise ValueError(f"cutoff {cutoff:g} Hz: give one between 0 and {poses.fps / 2:g} Hz, half of the frame rate")
    from scipy import signal  # takes a third of a second, and few smooth

    sections = np.asarray(signal.butter(_ORDER, cutoff, fs=poses.fps, output="sos"))
    low = partial(signal.sosfiltfilt, sections, axis=0)
    joints, tips = poses.joints.astype(np.float64), poses.tips.astype(np.float64)
    for start, stop in _runs(poses.has_pose):
        if stop - start > _SHORTEST:
            part = slice(start, stop)
            joints[part], tips[part] = _filtered(joints[part], tips[part], low)
    new = joints.astype(np.float32), tips.astype(np.float32)
    return eqx.tree_at(lambda p: (p.joints, p.tips), poses, new)


def _filtered(
    joints: Float[np.ndarray, "frames joints=15 3"],
    tips: Float[np.ndarray, "frames tips=5 3"],
    low: Callable[[np.ndarray], np.ndarray],
) -> tuple[Float[np.ndarray, "frames joints=15 3"], Float[np.ndarray, "frames tips=5 3"]]:
    def bone(start: np.ndarray, end: np.ndarray) -> np.ndarray:
        length = np.linalg.norm(end - start, axis=-1, keepdims=True)
        way = low((end - start) / np.maximum(length, 1e-9))
        return low(length) * way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)

    new = np.empty_like(joints)
    for joint, parent in enumerate(JOINT_PARENTS):
        new[:, joint] = (
            low(joints[:, joint]) if parent < 0 else new[:, parent] + bone(joints[:, parent], joints[:, joint])
        )
    ends = [new[:, joint] + bone(joints[:, joint], tips[:, tip]) for tip, joint in enumerate(TIP_PARENTS)]
    return new, np.stack(ends, 1)


def _runs(there: Bool[np.ndarray, " frames"]) -> list[tuple[int, int]]:
    """First frame, and frame after the last, of each run of frames that are there."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
