"""Tables of limb poses for the search: directions and twists of the upper bone, flexions of the hinge."""

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from .._math.rotations import aligning, turn_about
from ..body import JOINT_NAMES, PIVOT_NAMES, Skeleton, hinge_axes

_DOWN = np.array([0.0, 0.0, -1.0])
_HINGES = ("l_elbow", "r_elbow", "l_knee", "r_knee")
# Index of the upper bone's direction, its twist (rad), flexion of the hinge (rad).
_Row = tuple[int, float, float]


class LimbTable(eqx.Module):
    """Poses of one arm or leg, relative to the frame of the chest or the pelvis.

    Attributes:
        upper: Rotation of upper arm or thigh, from the body frame at rest to the frame of chest or pelvis.
        lower: Rotation of forearm or shank, in the same frames; hand or foot turns with it.
        direction: Index of the upper bone's direction, which many poses share.
        upper_points: Middle of the upper bone, and elbow or knee, relative to shoulder or hip (m).
        lower_points: Middle of the lower bone, wrist or ankle, and palm or ball of the foot, relative to shoulder or
            hip (m).
    """

    upper: Float[Array | np.ndarray, "poses 3 3"]
    lower: Float[Array | np.ndarray, "poses 3 3"]
    direction: Int[Array | np.ndarray, " poses"]
    upper_points: Float[Array | np.ndarray, "directions points=2 3"]
    lower_points: Float[Array | np.ndarray, "poses points=3 3"]


def arm_table(skeleton: Skeleton, side: str) -> LimbTable:
    """All directions that a shoulder reaches, about 15 degrees apart, with six flexions and seven twists each.

    Directions far across the chest, straight back, or up and back are left out.

    Args:
        skeleton: Template (m).
        side: ``l`` or ``r``.
    """
    directions = _sphere(140)
    x, y, z = directions.T
    directions = directions[(y > -0.65) & (x > -0.75) & ~((x < -0.3) & (z > 0.3))]
    rows: list[_Row] = []
    for number, direction in enumerate(directions):
        for flexion in (0.15, 0.6, 1.05, 1.5, 1.95, 2.35):
            twists = np.radians(np.arange(-60, 121, 30))
            if direction[2] > 0.6:  # a raised shoulder twists farther before the forearm meets the head
                twists = np.radians(np.arange(-150, 181, 40))
            rows += [(number, twist, flexion) for twist in (twists if flexion > 0.3 else [0.0])]
    return _table(skeleton, side, "arm", directions, rows)


def leg_table(skeleton: Skeleton, side: str) -> LimbTable:
    """All directions that a hip reaches, about 15 degrees apart, with five flexions and four twists each.

    Args:
        skeleton: Template (m).
        side: ``l`` or ``r``.
    """
    directions = _sphere(160)
    x, y, z = directions.T
    directions = directions[(y > -0.55) & (y < 0.95) & (x > -0.55) & (z < 0.55)]
    rows: list[_Row] = []
    for number in range(len(directions)):
        for flexion in (0.1, 0.6, 1.1, 1.6, 2.1):
            twists = np.radians([-45, -15, 15, 45]) if flexion > 0.3 else [0.0]
            rows += [(number, twist, flexion) for twist in twists]
    return _table(skeleton, side, "leg", directions, rows)


def _table(skeleton: Skeleton, side: str, kind: str, directions: np.ndarray, rows: list[_Row]) -> LimbTable:
    names = ("shoulder", "elbow", "wrist", "hand") if kind == "arm" else ("hip", "knee", "ankle", "foot")
    known: dict[str, np.ndarray] = dict(
        zip(JOINT_NAMES + PIVOT_NAMES, np.concatenate([skeleton.rest_joints, skeleton.pivots]), strict=True)
    )
    top, middle, pivot, end = (known[f"{side}_{name}"] for name in names)
    axis = np.asarray(hinge_axes(skeleton), np.float64)[_HINGES.index(f"{side}_{names[1]}")]
    bone = (middle - top) / np.linalg.norm(middle - top)
    at_rest = np.arctan2((end - middle) @ np.cross(axis, bone), (end - middle) @ bone)
    # Rotation from rest to a hanging limb, with the hinge axis in its usual direction (arms: to the right; legs: left).
    across = np.array([0.0, -1.0, 0.0]) if kind == "arm" else np.array([0.0, 1.0, 0.0])
    hanging = _basis(_DOWN, across) @ _basis(bone, axis).T

    mirror = np.array([1.0, 1.0 if side == "l" else -1.0, 1.0])
    directions = directions * mirror
    number = np.array([number for number, _, _ in rows], np.int32)
    twists = np.array([twist for _, twist, _ in rows]) * mirror[1]
    flexions = np.array([flexion for _, _, flexion in rows])
    swing = aligning(np.broadcast_to(_DOWN, directions.shape), directions)[number]
    upper = turn_about(directions[number], twists) @ swing @ hanging
    lower = upper @ turn_about(np.broadcast_to(axis, (len(rows), 3)), flexions - at_rest)
    hinge = upper @ (middle - top)
    offsets = (0.5 * (pivot - middle), pivot - middle, end - middle)
    points = np.stack([hinge + lower @ offset for offset in offsets], 1)
    # A twist about the upper bone does not move it.
    bones = np.linalg.norm(middle - top) * directions
    uppers = np.stack([0.5 * bones, bones], 1)
    single = (a.astype(np.float32) for a in (uppers, points))
    return LimbTable(upper.astype(np.float32), lower.astype(np.float32), number, *single)


def _sphere(count: int) -> Float[np.ndarray, "count 3"]:
    """Directions spread evenly over the sphere (Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    z, angle = 1 - 2 * index / count, np.pi * (1 + np.sqrt(5)) * index
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], 1)


def _basis(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.stack([first, second, np.cross(first, second)], 1)
