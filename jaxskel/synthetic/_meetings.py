"""What two people or more do together: pass each other, stand close, shake hands, hug.

Each meeting is a pose for every person and frame, in a world with z up and the floor at z = 0, about the origin.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..body import JOINT_NAMES, Pose, Skeleton, place_joints
from ._motion import poses_by_angles

# Angles (degrees) of somebody who stands with the arms hanging, and changes of them; names as in the built-in motion.
_STANDING = {"l_abduct": 8, "r_abduct": 8, "l_elbow": 8, "r_elbow": 8, "l_knee": 3, "r_knee": 3}
_HAND_OUT = {"r_raise": 52, "r_abduct": 4, "r_elbow": 32}
_ARMS_AROUND = {"l_raise": 72, "r_raise": 72, "l_abduct": 22, "r_abduct": 22, "l_elbow": 58, "r_elbow": 58}
_STRIDE, _SWING = 24.0, 22.0  # of hips and shoulders (degrees)
_STEPS = 1.0  # pairs of steps per second
_SPEED = 1.2  # m/s
# Distance of the middles of two people who hug, and by how much they stand beside each other (m).
_HUG, _ASIDE = 0.36, 0.06


def walk_by(skeletons: Sequence[Skeleton], frames: int, fps: float, gap: float = 0.8) -> list[Pose]:
    """People walk past each other on parallel ways, every second one in the other direction.

    Args:
        skeletons: The people.
        frames: Number of frames.
        fps: Frames per second.
        gap: Distance between neighbouring ways (m).
    """
    seconds = (np.arange(frames) - (frames - 1) / 2) / fps
    found = []
    for place, skeleton in enumerate(skeletons):
        way = -1.0 if place % 2 else 1.0
        path = np.stack([way * _SPEED * seconds, np.full(frames, gap * (place - (len(skeletons) - 1) / 2))], 1)
        found.append(_placed(skeleton, _walking(seconds), path, 0.0 if way > 0 else np.pi))
    return found


def stand_close(skeletons: Sequence[Skeleton], frames: int, fps: float, gap: float = 0.6) -> list[Pose]:
    """People stand in a row, shoulder to shoulder if `gap` (m) is small, and swing their arms."""
    seconds = np.arange(frames) / fps
    found = []
    for place, skeleton in enumerate(skeletons):
        swing = 20 * np.sin(2 * np.pi * (0.4 * seconds + 0.3 * place))
        angles = _angles(frames, _STANDING) | {"l_raise": swing, "r_raise": -swing}
        path = np.tile([0.0, gap * (place - (len(skeletons) - 1) / 2)], (frames, 1))
        found.append(_placed(skeleton, angles, path, 0.0))
    return found


def handshake(skeletons: Sequence[Skeleton], frames: int, fps: float) -> list[Pose]:
    """Two people come near, shake hands in the middle of the film, and step back."""
    near = _nearness(frames)
    shaking = 6 * np.sin(2 * np.pi * 2.0 * np.arange(frames) / fps) * near
    angles = _blended(_STANDING, _HAND_OUT, near)
    angles["r_elbow"] = angles["r_elbow"] + shaking
    # Hands meet where each reaches.
    reach = np.sum([_hand(skeleton) for skeleton in skeletons[:2]], axis=0)
    return _face_to_face(skeletons, angles, near, float(reach[0]), float(reach[1]))


def hug(skeletons: Sequence[Skeleton], frames: int, fps: float) -> list[Pose]:
    """Two people come near, hug in the middle of the film, and step back."""
    near = _nearness(frames)
    return _face_to_face(skeletons, _blended(_STANDING, _ARMS_AROUND, near), near, _HUG, _ASIDE)


def _face_to_face(
    skeletons: Sequence[Skeleton], angles: dict[str, np.ndarray], near: np.ndarray, apart: float, aside: float
) -> list[Pose]:
    """Two people facing each other, `apart` and `aside` (m) where they are nearest, and 0.6 m farther before."""
    if len(skeletons) != 2:
        raise ValueError(f"{len(skeletons)} people: two shake hands, or hug; give two skeletons")
    half = 0.5 * np.stack([apart + 0.6 * (1 - near), np.full(len(near), aside)], 1)
    return [
        _placed(skeletons[0], angles, -half, 0.0),
        _placed(skeletons[1], angles, half, np.pi),
    ]


def _nearness(frames: int) -> Float[np.ndarray, " frames"]:
    """How near two people are, from 0 to 1: for the middle third of the film as near as they come."""
    share = np.clip((1 - np.abs(np.linspace(-1, 1, frames))) / (2 / 3), 0, 1)
    return share**2 * (3 - 2 * share)


def _blended(start: dict[str, int], end: dict[str, int], share: np.ndarray) -> dict[str, np.ndarray]:
    return {
        name: (1 - share) * start.get(name, 0) + share * end.get(name, start.get(name, 0)) for name in {*start, *end}
    }


def _walking(seconds: Float[np.ndarray, " frames"]) -> dict[str, np.ndarray]:
    phase = 2 * np.pi * _STEPS * seconds
    angles = _angles(len(seconds), _STANDING)
    for side, own in (("l_", phase), ("r_", phase + np.pi)):
        angles[f"{side}hip"] = _STRIDE * np.sin(own)
        angles[f"{side}knee"] = 5 + 45 * np.clip(np.cos(own), 0, 1)
        angles[f"{side}raise"] = -_SWING * np.sin(own)
        angles[f"{side}elbow"] = np.full(len(seconds), 18.0)
    return angles


def _angles(frames: int, given: dict[str, int]) -> dict[str, np.ndarray]:
    return {name: np.full(frames, float(value)) for name, value in given.items()}


def _placed(
    skeleton: Skeleton, angles: dict[str, np.ndarray], path: Float[np.ndarray, "frames 2"], facing: float
) -> Pose:
    """Poses with the pelvis over a path (m), facing a direction (rad)."""
    pose = poses_by_angles(skeleton, angles | {"turn": np.full(len(path), np.rad2deg(facing))})
    return Pose(np.concatenate([path, np.asarray(pose.root)[:, 2:]], 1), pose.rotations)


def _hand(skeleton: Skeleton) -> Float[np.ndarray, "2"]:
    """Where the right hand is held out, relative to the pelvis (m, x to the front, y to the left)."""
    pose = poses_by_angles(skeleton, _angles(1, _STANDING | _HAND_OUT))
    joints = np.asarray(place_joints(skeleton, pose)[0])
    return joints[0, JOINT_NAMES.index("r_hand"), :2] - joints[0, 0, :2]
