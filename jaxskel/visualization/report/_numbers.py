"""The data that the page animates and plots: points, their uncertainty and status of every frame as small integers."""

from typing import Any

import numpy as np
from jaxtyping import Float, Int16

from ..._runtime.plain_text import plain
from ...body import SkeletonTemplate
from ...poses import STATUS_NAMES, WITH_POSE, Poses
from ...recording import Recording, Truth, rotation_to_z_up
from .. import thickness
from ._outlines import LONG_SIDE, UNITS, UNSEEN, display_scale
from ._overlays import Overlays
from ._packed import packed

# Resolution (m): with 16 bits a tenth of a millimetre covers 6.5 m. For larger scenes the steps are coarser. What is
# uncertain by more than 3 m is shown as uncertain by 3 m.
_STEP = 1e-4
_LARGEST = 32767
# Width at which a human's bone is drawn (m).
_BONE = 0.045


def page_numbers(recording: Recording, poses: Poses, truth: Truth | None, overlays: Overlays) -> dict[str, Any]:
    """All data that the page's scripts read, ready for JSON.

    Points are in a world rotated to z up (m). Arrays are base64, see `packed`.

    Args:
        recording: Provides cameras, name and up axis.
        poses: The poses to show.
        truth: Ground truth of the same frames, perhaps of another template.
        overlays: Outlines and projected skeletons.
    """
    turn = rotation_to_z_up(poses.up)
    shown = body_points(poses) @ turn.T
    true = None if truth is None else _by_name(truth, poses.template) @ turn.T
    origin, step = steps_of([shown] if true is None else [shown, true])
    scene = scene_numbers(recording, poses.template, shown, origin, step)
    return scene | pose_numbers(poses, origin, step) | time_numbers(poses) | {
        "truth_joints": [] if truth is None else [
            i for i, name in enumerate(poses.template.joint_names) if name in truth.template.joint_names
        ],
        "truth": None if true is None else packed(_in_steps(true, origin, step), "<i2"),
        "side_confidence": packed_sides(poses),
    } | view_numbers(recording, overlays) | {"skeletons": packed(overlays.skeletons[0], "<i2")}  # fmt: skip


def time_numbers(poses: Poses) -> dict[str, Any]:
    """What the frames are."""
    return {"frames": len(poses), "fps": poses.fps, "frame_index": packed(poses.frame_index, "<f8")}


def view_numbers(recording: Recording, overlays: Overlays) -> dict[str, Any]:
    """The views and the silhouettes in them."""
    cameras = recording.cameras
    # An outline is stored as its first point and the differences between consecutive points.
    first = np.cumsum(overlays.lengths) - overlays.lengths
    steps = np.delete(np.diff(overlays.points, axis=0, prepend=np.int16(0)), first, axis=0)
    return {
        "views": [
            {"name": plain(name), "size": size.tolist(), "scale": UNITS * display_scale(size)}
            for name, size in zip(cameras.names, cameras.size, strict=True)
        ],
        "long_side": LONG_SIDE,
        "stride": overlays.stride, "shown": len(overlays),
        "counts": packed(overlays.counts, "<u4"), "lengths": packed(overlays.lengths, "<u4"),
        "starts": packed(overlays.points[first], "<i2"), "steps": packed(steps, "i1"),
    }  # fmt: skip


def scene_numbers(
    recording: Recording,
    template: SkeletonTemplate,
    points: Float[np.ndarray, "frames points 3"],
    origin: Float[np.ndarray, "3"],
    step: float,
) -> dict[str, Any]:
    """What the scene shows in all frames, and how points are stored: ``origin + step * number`` (m, z up).

    Args:
        recording: Provides cameras, name and up axis.
        template: What the skeleton consists of.
        points: Some joints and tips of it, which tell how large it is (m).
        origin: See above.
        step: See above.
    """
    turn, cameras = rotation_to_z_up(recording.up), recording.cameras
    return {
        "name": plain(recording.name), "up": recording.up,
        "joints": [plain(name) for name in template.joint_names], "tips": [plain(name) for name in template.tip_names],
        "parents": template.point_parents.tolist(), "bone": round(_BONE * thickness(template, points), 5),
        "statuses": STATUS_NAMES, "with_pose": [int(status) for status in WITH_POSE],
        "origin": origin.tolist(), "step": step, "spread_step": _STEP, "unseen": UNSEEN,
        "cameras": (cameras.centres @ turn.T).round(4).tolist(),
        "axes": (np.asarray(cameras.R) @ turn.T).round(5).tolist(),
    }  # fmt: skip


def pose_numbers(poses: Poses, origin: Float[np.ndarray, "3"], step: float) -> dict[str, Any]:
    """Points, confidence, uncertainty and status of every frame."""
    turn = rotation_to_z_up(poses.up)
    shown = body_points(poses) @ turn.T
    return {
        "points": packed(_in_steps(shown, origin, step), "<i2"),
        "confidence": packed(np.round(255 * poses.confidence), "u1"),
        "spread": None if poses.covariance is None else packed(_spread(poses.covariance, turn), "<i2"),
        "status": packed(poses.status, "u1"),
    }


def packed_sides(poses: Poses) -> str:
    """How surely left and right are told apart in every frame."""
    return packed(np.round(255 * poses.side_confidence), "u1")


def body_points(poses: Poses) -> Float[np.ndarray, "frames points 3"]:
    """Joints followed by tips (m)."""
    return np.concatenate([poses.joints, poses.tips], axis=1).astype(np.float64)


def _by_name(truth: Truth, template: SkeletonTemplate) -> Float[np.ndarray, "frames points 3"]:
    """The true joints and tips (m) in the order of a template; NaN where the truth has no point of the name."""
    found = np.full((len(truth.joints), len(template.point_names), 3), np.nan)
    for names, points in ((truth.template.joint_names, truth.joints), (truth.template.tip_names, truth.tips)):
        for place, name in enumerate(names):
            if points is not None and name in template.point_names:
                found[:, template.point_names.index(name)] = points[:, place]
    return found


def _spread(
    covariance: Float[np.ndarray, "frames joints 3 3"], turn: Float[np.ndarray, "3 3"]
) -> Int16[np.ndarray, "frames joints 6"]:
    """Lower triangles of the Cholesky factors of the covariances, row by row, in steps; zeros where unknown."""
    known = np.isfinite(covariance).all((-2, -1))
    factors = np.zeros(covariance.shape)
    factors[known] = np.linalg.cholesky(turn @ covariance[known].astype(np.float64) @ turn.T)
    rows, columns = np.tril_indices(3)
    return np.round(factors[..., rows, columns] / _STEP).clip(-_LARGEST, _LARGEST).astype(np.int16)


def steps_of(clouds: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """The centre of all points (m), and the size of a quantisation step (m)."""
    points = np.concatenate([cloud.reshape(-1, 3) for cloud in clouds])
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return np.zeros(3), _STEP
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, max(_STEP, float((high - low).max()) / 2 / _LARGEST)


def _in_steps(points: np.ndarray, origin: np.ndarray, step: float) -> Int16[np.ndarray, "frames points 3"]:
    steps = np.round((points - origin) / step)
    return np.where(np.isfinite(steps), steps.clip(-_LARGEST, _LARGEST), UNSEEN).astype(np.int16)
