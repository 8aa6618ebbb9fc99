"""Start poses of the search: eight a frame from the graph, and others that need no graph."""

import jax
import numpy as np
from jaxtyping import Float

from .._math.rotations import aligning, frame, turn_about
from .._math.vectors import unit
from ..body import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, Pose, Skeleton, hinge_axes
from ..matching import L_FOOT, R_FOOT, Limbs

STARTS = 8
# A front is along the spine if less than this of it (sine) is across.
_ALONG = 0.3
# A crouch: lean of the trunk, flexion of hips and knees (rad), and the pelvis relative to the middle of the body
# (shares of the stature, in the frame of the body: behind and below).
_LEAN, _HIP, _KNEE = 0.3, 1.8, 2.1
_CROUCHED = np.array([-0.12, 0.0, -0.09])
_LEFT_OF_FRONT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # a quarter turn about z


def start_poses(limbs: Limbs, facing: Float[np.ndarray, "frames 3"], skeleton: Skeleton) -> Pose:
    """Eight poses a frame: four facing directions, each with the feet straight and crossed.

    The first has the facing direction given. Knees bend towards the front; arms are at rest.

    Args:
        limbs: Labelled limbs (m) in a world with z up; the labels of the hands are not used.
        facing: Estimated horizontal unit vector in which the body faces; the world's x axis where it is zero.
        skeleton: Template.

    Returns:
        Poses with axes ``frames starts``. Elbows and knees bend as hinges, see `HingedLimbs`.
    """
    known = np.linalg.norm(facing, axis=1, keepdims=True) > 0.5
    front = np.where(known, facing, [1.0, 0.0, 0.0])
    spine = limbs.neck - limbs.pelvis
    spine = np.where(np.linalg.norm(spine, axis=1, keepdims=True) > 0.05, spine, [0.0, 0.0, 1.0])
    feet = np.stack([limbs.ends[:, L_FOOT], limbs.ends[:, R_FOOT]], 1)
    missing = ~limbs.found[:, [L_FOOT, R_FOOT]]
    # A missing foot is put where the other one is; if both are missing, below the pelvis.
    below = limbs.pelvis - [0.0, 0.0, 0.5 * skeleton.stature]
    other = np.where(missing[:, ::-1, None], below[:, None], feet[:, ::-1])
    return _eight_ways(limbs.pelvis, spine, front, np.where(missing[..., None], other, feet), skeleton)


def other_ways(joints: Float[np.ndarray, "frames joints 3"], skeleton: Skeleton) -> Pose:
    """Eight poses a frame around a pose already found, facing four ways and with the feet exchanged or not.

    Args:
        joints: Joints of the pose found (m), in a world with z up.
        skeleton: Template.

    Returns:
        Poses like those of [`start_poses`][]; the first is the pose found, but with arms at rest.
    """
    pelvis, neck, left_hip, right_hip, *feet = (
        joints[:, JOINT_NAMES.index(name)] for name in ("pelvis", "neck", "l_hip", "r_hip", "l_foot", "r_foot")
    )
    front = np.cross(left_hip - right_hip, [0.0, 0.0, 1.0])
    front = np.where(np.linalg.norm(front, axis=1, keepdims=True) > 1e-3, front, [1.0, 0.0, 0.0])
    return _eight_ways(pelvis, neck - pelvis, unit(front), np.stack(feet, 1), skeleton)


def _eight_ways(
    pelvis: Float[np.ndarray, "frames 3"],
    spine: Float[np.ndarray, "frames 3"],
    front: Float[np.ndarray, "frames 3"],
    feet: Float[np.ndarray, "frames 2 3"],
    skeleton: Skeleton,
) -> Pose:
    # The body is turned about its own spine, which need not be upright.
    upwards = unit(spine)
    ahead = front - upwards * (front * upwards).sum(1, keepdims=True)
    # Whoever lies along the estimated front faces up or down.
    ahead = np.where(np.linalg.norm(ahead, axis=1, keepdims=True) > _ALONG, ahead, [0.0, 0.0, 1.0])
    first = unit(np.cross(upwards, ahead))
    second = np.cross(upwards, first)
    left = np.repeat(np.stack([first, -first, second, -second], 1), 2, 1)
    straight = ((feet[:, 0] - feet[:, 1])[:, None] * left).sum(-1) >= 0
    exchanged = (straight == np.tile([False, True], STARTS // 2))[..., None, None]
    ordered = np.where(exchanged, feet[:, None, ::-1], feet[:, None])

    def flat(a: np.ndarray) -> np.ndarray:
        return np.repeat(a[:, None], STARTS, 1).reshape(-1, 3)

    # Of a model, they are on the device, where these small operations would take a hundred times as long.
    skeleton = jax.tree.map(np.asarray, skeleton)
    rotations = _reaching(flat(pelvis), flat(spine), left.reshape(-1, 3), ordered.reshape(-1, 2, 3), skeleton)
    return Pose(np.repeat(pelvis[:, None], STARTS, 1), rotations.reshape(-1, STARTS, *rotations.shape[1:]))


def graphless_poses(middles: Float[np.ndarray, "frames 3"], skeleton: Skeleton) -> Pose:
    """Poses that need no graph, around the middle of the body: upright, crouched, upside down and lying.

    Each faces four ways; those who lie do so on the belly, on the back and on both sides. Without the crouches, these
    are the 24 rotations of a cube.

    Args:
        middles: Middle of the body (m), see `body_middles`, in a world with z up.
        skeleton: Template.

    Returns:
        Poses with axes ``frames starts=28``.
    """
    standing = np.repeat(np.eye(3)[None], len(SEGMENT_NAMES), 0)
    crouching, axes = np.repeat(_about_left(_LEAN)[None], len(SEGMENT_NAMES), 0), np.asarray(hinge_axes(skeleton))
    for number, side in enumerate(("l_", "r_")):
        thigh, shank, foot = (SEGMENT_NAMES.index(side + name) for name in ("thigh", "shank", "foot"))
        crouching[thigh] = _about_left(-_HIP)
        crouching[shank] = crouching[thigh] @ turn_about(axes[None, 2 + number], np.array([_KNEE]))[0]
        crouching[foot] = np.eye(3)
    poses = [(standing, np.zeros(3)), (crouching, skeleton.stature * _CROUCHED)]
    poses += [(_about_left(angle) @ standing, np.zeros(3)) for angle in (np.pi, np.pi / 2, -np.pi / 2)]
    poses += [(_about_front(angle) @ standing, np.zeros(3)) for angle in (np.pi / 2, -np.pi / 2)]
    turns = [np.linalg.matrix_power(_LEFT_OF_FRONT, quarter) for quarter in range(4)]
    roots = np.stack([turn @ offset for _, offset in poses for turn in turns])
    rotations = np.stack([turn @ pose for pose, _ in poses for turn in turns])
    return Pose(middles[:, None] + roots[None], np.repeat(rotations[None], len(middles), 0))


def _about_left(angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation about the y axis (left) by an angle (rad); a positive angle leans an upright body forwards."""
    return turn_about(np.array([[0.0, 1.0, 0.0]]), np.array([angle]))[0]


def _about_front(angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation about the x axis (front) by an angle (rad); a positive angle leans an upright body to its right."""
    return turn_about(np.array([[1.0, 0.0, 0.0]]), np.array([angle]))[0]


def _reaching(
    pelvis: Float[np.ndarray, "frames 3"],
    spine: Float[np.ndarray, "frames 3"],
    left: Float[np.ndarray, "frames 3"],
    feet: Float[np.ndarray, "frames 2 3"],
    skeleton: Skeleton,
) -> Float[np.ndarray, "frames segments 3 3"]:
    """Rotations of a body with this spine and left side, whose legs reach to the feet."""
    points = np.concatenate([skeleton.rest_joints, skeleton.pivots]).astype(np.float64)
    rest: dict[str, np.ndarray] = dict(zip(JOINT_NAMES + PIVOT_NAMES, points, strict=True))
    trunk = frame(spine, left) @ aligning(unit(rest["neck"]), np.array([0.0, 0.0, 1.0]))
    rotations = np.repeat(trunk[:, None], len(SEGMENT_NAMES), 1)
    axes = np.asarray(hinge_axes(skeleton), np.float64)
    for number, side in enumerate(("l_", "r_")):
        hip = pelvis + trunk @ rest[side + "hip"]
        ankle = feet[:, number] + [0.0, 0.0, 0.03 * skeleton.stature] - 0.045 * skeleton.stature * trunk[:, :, 0]
        thigh, shank, foot = (SEGMENT_NAMES.index(side + name) for name in ("thigh", "shank", "foot"))
        bones = (rest[side + "knee"] - rest[side + "hip"], rest[side + "ankle"] - rest[side + "knee"])
        rotations[:, thigh], rotations[:, shank] = _reach(ankle - hip, trunk[:, :, 0], bones, axes[2 + number])
        rotations[:, foot] = rotations[:, shank]
    return rotations


def _reach(
    goal: Float[np.ndarray, "frames 3"],
    front: Float[np.ndarray, "frames 3"],
    bones: tuple[np.ndarray, np.ndarray],
    axis: Float[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "frames 3 3"], Float[np.ndarray, "frames 3 3"]]:
    """Rotate two bones joined by a hinge, which opens to the front, so that they end at the goal or near it."""
    upper, lower = (float(np.linalg.norm(bone)) for bone in bones)
    bone = bones[0] / upper
    at_rest = np.arctan2(bones[1] @ np.cross(axis, bone), bones[1] @ bone)
    reach = np.linalg.norm(goal, axis=1)
    way = goal / np.maximum(reach, 1e-9)[:, None]
    reach = np.clip(reach, abs(upper - lower) + 0.05, upper + lower - 0.005)
    bend = np.pi - np.arccos(np.clip((upper**2 + lower**2 - reach**2) / (2 * upper * lower), -1, 1))
    ahead = np.arccos(np.clip((upper**2 + reach**2 - lower**2) / (2 * upper * reach), -1, 1))
    hinge = np.cross(way, -front)
    length = np.linalg.norm(hinge, axis=1, keepdims=True)
    hinge = np.where(length > 1e-3, hinge / np.maximum(length, 1e-9), np.cross(way, np.roll(way, 1, 1)))
    hinge = unit(hinge)
    first = way * np.cos(ahead)[:, None] - np.cross(hinge, way) * np.sin(ahead)[:, None]
    world = np.stack([first, hinge, np.cross(first, hinge)], -1)
    rest = np.stack([bone, axis, np.cross(bone, axis)], -1)
    thigh = world @ rest.T
    return thigh, thigh @ turn_about(np.broadcast_to(axis, goal.shape), bend - at_rest)
