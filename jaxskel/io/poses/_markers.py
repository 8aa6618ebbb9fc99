"""Points over time, the content of marker files: named trajectories, a frame rate, and an up axis."""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from ...body import KeypointSet
from ...poses import Poses
from ...recording import rotation_to_z_up


class Markers(eqx.Module):
    """Named points over time.

    Attributes:
        positions: Positions in the world of the file (m); NaN if a marker was not seen.
        fps: Frames per second.
        up: World axis that points up: one of `jaxskel.recording.UP_AXES`.
        frame_index: Number of each frame.
    """

    names: tuple[str, ...] = eqx.field(static=True)
    positions: Float[np.ndarray, "frames markers 3"]
    fps: float
    up: str
    frame_index: Int[np.ndarray, " frames"]

    def __len__(self) -> int:
        return len(self.positions)


def to_markers(poses: Poses, keypoint_set: KeypointSet | None = None) -> Markers:
    """Joints and then tips as markers; or the keypoints of a set, but for those that the skeleton has no point for.

    Raises:
        ValueError: There are no frames, or the poses have no keypoints.
    """
    if len(poses) == 0:
        raise ValueError("the poses hold no frame: there is nothing to export")
    if keypoint_set is None:
        names, positions = poses.template.point_names, np.concatenate([poses.joints, poses.tips], 1).astype(np.float64)
    else:
        meant = [number for number, points in enumerate(keypoint_set.points) if points]
        names = tuple(keypoint_set.names[number] for number in meant)
        positions = poses.keypoints(keypoint_set)[:, meant]
    return Markers(names, positions, poses.fps, poses.up, np.asarray(poses.frame_index))


def with_up(poses: Poses, up: str) -> Poses:
    """The poses in a world rotated so that the axis `up` points up: from +Z to +Y, (x, y, z) becomes (y, z, x).

    Axes are permuted cyclically, and two signs flipped if one of the two worlds has a negative axis, so this is exact.

    Raises:
        ValueError: `up` is not one of `jaxskel.recording.UP_AXES`.
    """
    turn = turn_up(poses.up, up).astype(np.float32)
    rotations = None if poses.rotations is None else turn @ poses.rotations
    covariance = None if poses.covariance is None else turn @ poses.covariance @ turn.T
    return eqx.tree_at(
        lambda p: (p.joints, p.tips, p.rotations, p.covariance, p.up), poses,
        (poses.joints @ turn.T, poses.tips @ turn.T, rotations, covariance, up), is_leaf=lambda leaf: leaf is None,
    )  # fmt: skip


def turn_up(before: str, after: str) -> Float[np.ndarray, "3 3"]:
    """Rotation from a world whose up axis is `before` to one where it is `after`; see `with_up`."""
    return rotation_to_z_up(after).T @ rotation_to_z_up(before)
