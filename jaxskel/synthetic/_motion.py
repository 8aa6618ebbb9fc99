"""The built-in motion: twelve seconds of everyday and difficult poses, defined by smooth joint angles.

All angles are zero when the person stands upright with the arms hanging. Angles are interpolated between keys without
overshoot (PCHIP), so knees and elbows never bend the wrong way between two keys.
"""

import numpy as np
from jaxtyping import Float

from ..body import JOINT_NAMES, SEGMENT_NAMES, TIP_NAMES, Pose, Skeleton, place_body, place_joints
from ..io.mocap import turn
from ._anatomy import detailed_body

DURATION = 12.0
"""Length of the motion (s), after which it repeats."""

Keys = tuple[tuple[float, int], ...]

# Keys (s, degrees) of each angle, constant before the first and after the last. The poses, with times in s:
# 0 A-pose, 1 walking on the spot, 3 waving, 4.6 arms sideways, 6 a turn with steps, 8 crane stand, 9.3
# crouch, 10.7 hands on hips, 12 A-pose again.
_KEYS: dict[str, Keys] = {
    "turn": ((6.0, 0), (7.9, 360)),
    "lean": ((1.0, 0), (1.5, 3), (2.8, 3), (3.2, 0), (9.2, 0), (9.9, 30), (10.1, 30), (10.7, 0)),
    "tilt": ((7.9, 0), (8.4, -4), (9.0, -4), (9.3, 0)),
    "chest_bend": ((9.2, 0), (9.9, 12), (10.1, 12), (10.7, 0), (10.9, -3), (11.4, -3), (11.8, 0)),
    "chest_twist": (
        (1.0, 0), (1.3, 8), (1.8, -8), (2.3, 8), (2.8, -8), (3.1, 0), (11.0, 0), (11.3, 14), (11.7, 0),
    ),
    "head_bend": ((9.2, 0), (9.9, -22), (10.1, -22), (10.7, 0)),
    "head_twist": ((0.0, 0), (3.3, 0), (3.7, -20), (4.3, -20), (4.7, 0), (5.2, 25), (5.8, 0)),
    "l_abduct": (
        (0.0, 30), (0.9, 10), (4.4, 9), (4.9, 90), (5.7, 90), (6.2, 28), (7.9, 28), (8.4, 105), (9.0, 105),
        (9.6, 12), (10.2, 12), (10.8, 46), (11.4, 46), (12.0, 30),
    ),
    "r_abduct": (
        (0.0, 30), (0.9, 10), (2.9, 10), (3.4, 105), (4.2, 105), (4.9, 90), (5.7, 90), (6.2, 28), (7.9, 28),
        (8.4, 105), (9.0, 105), (9.6, 12), (10.2, 12), (10.8, 46), (11.4, 46), (12.0, 30),
    ),
    "l_raise": (
        (1.0, 0), (1.3, -22), (1.8, 26), (2.3, -22), (2.8, 26), (3.2, 0), (9.2, 0), (9.8, 96), (10.1, 96),
        (10.8, -16), (11.4, -16), (12.0, 0),
    ),
    "r_raise": (
        (1.0, 0), (1.3, 26), (1.8, -22), (2.3, 26), (2.8, -22), (3.2, 0), (9.2, 0), (9.8, 96), (10.1, 96),
        (10.8, -16), (11.4, -16), (12.0, 0),
    ),
    "l_twist": ((10.2, 0), (10.8, 62), (11.4, 62), (12.0, 0)),
    "r_twist": ((2.9, 0), (3.4, -80), (4.2, -80), (4.8, 0), (10.2, 0), (10.8, 62), (11.4, 62), (12.0, 0)),
    "l_elbow": (
        (0.0, 6), (1.0, 10), (1.3, 22), (2.8, 40), (3.2, 12), (4.8, 4), (5.7, 4), (6.3, 15), (7.9, 15),
        (8.4, 28), (9.0, 28), (9.7, 10), (10.2, 14), (10.8, 98), (11.4, 98), (12.0, 6),
    ),
    "r_elbow": (
        (0.0, 6), (1.0, 10), (1.3, 40), (2.8, 22), (3.4, 75), (3.6, 48), (3.8, 85), (4.0, 48), (4.2, 75),
        (4.8, 4), (5.7, 4), (6.3, 15), (7.9, 15), (8.4, 28), (9.0, 28), (9.7, 10), (10.2, 14), (10.8, 98),
        (11.4, 98), (12.0, 6),
    ),
    "l_hip": (
        (1.0, 0), (1.3, 48), (1.6, 0), (2.0, 0), (2.3, 48), (2.6, 0), (6.2, 0), (6.5, 24), (6.8, 0),
        (7.2, 0), (7.5, 24), (7.8, 0), (7.9, 0), (8.4, 88), (8.9, 88), (9.3, 0), (9.4, 0), (9.9, 118),
        (10.1, 118), (10.7, 0),
    ),
    "r_hip": (
        (1.5, 0), (1.8, 48), (2.1, 0), (2.5, 0), (2.8, 48), (3.1, 0), (6.6, 0), (7.0, 24), (7.3, 0),
        (9.4, 0), (9.9, 118), (10.1, 118), (10.7, 0),
    ),
    "l_knee": (
        (1.0, 3), (1.3, 62), (1.6, 3), (2.0, 3), (2.3, 62), (2.6, 3), (6.2, 3), (6.5, 40), (6.8, 3),
        (7.2, 3), (7.5, 40), (7.8, 3), (7.9, 3), (8.4, 84), (8.9, 84), (9.3, 3), (9.4, 3), (9.9, 126),
        (10.1, 126), (10.7, 3),
    ),
    "r_knee": (
        (1.5, 3), (1.8, 62), (2.1, 3), (2.5, 3), (2.8, 62), (3.1, 3), (6.6, 3), (7.0, 40), (7.3, 3),
        (9.4, 3), (9.9, 126), (10.1, 126), (10.7, 3),
    ),
    "spread": ((9.2, 0), (9.9, 16), (10.1, 16), (10.7, 0)),
}  # fmt: skip
# Above this abduction (rad), a raised arm turns its collar bone by this share of the excess.
_COLLAR_FROM, _COLLAR_SHARE = np.deg2rad(40.0), 0.25


def demo_motion(skeleton: Skeleton, frames: int = 60, fps: float = 5.0) -> Pose:
    """Make a motion: A-pose, walk, wave, arms sideways, a turn, a crane stand, a crouch, hands on hips.

    Args:
        skeleton: Template (m), in any rest pose.
        frames: Number of frames. 60 frames at 5 per second show the whole motion once.
        fps: Frames per second.

    Returns:
        A stack of poses (m). World: z up, the floor at z = 0, facing +x at the start. Feet that carry the body do not
        slide.

    Raises:
        ValueError: There is no frame, or the frame rate is not positive.
    """
    if frames < 1 or not fps > 0:
        raise ValueError(f"frames = {frames} and fps = {fps}: give at least one frame and a positive frame rate")
    seconds = (np.arange(frames) / fps) % DURATION
    from scipy.interpolate import PchipInterpolator  # takes a quarter of a second to import, and only scenes need it

    return poses_by_angles(skeleton, {name: PchipInterpolator(*_tails(keys))(seconds) for name, keys in _KEYS.items()})


def poses_by_angles(skeleton: Skeleton, degrees: dict[str, Float[np.ndarray, " frames"]]) -> Pose:
    """Poses of somebody who stands on the floor, from the angles of `_KEYS` (degrees); those left out are 0.

    Args:
        skeleton: Template (m), in any rest pose.
        degrees: Each angle in all frames; at least one.
    """
    none = np.zeros_like(next(iter(degrees.values())))
    angle = {name: np.deg2rad(degrees.get(name, none)) for name in _KEYS}
    rotations = _rotations(skeleton, angle)
    return Pose(_stand(skeleton, rotations, angle["turn"]), rotations)


def _tails(keys: Keys) -> tuple[np.ndarray, np.ndarray]:
    times, values = np.array(keys).T
    return np.concatenate([[-1.0], times, [DURATION + 1.0]]), np.concatenate([values[:1], values, values[-1:]])


def _rotations(skeleton: Skeleton, angle: dict[str, np.ndarray]) -> np.ndarray:
    """Segment rotations from joint angles (rad). Body frame: x front, y left, z up."""
    turned: dict[str, np.ndarray] = {}
    turned["pelvis"] = turn("z", angle["turn"]) @ turn("x", angle["tilt"]) @ turn("y", angle["lean"])
    turned["chest"] = turned["pelvis"] @ turn("y", angle["chest_bend"]) @ turn("z", angle["chest_twist"])
    turned["head"] = turned["chest"] @ turn("z", angle["head_twist"]) @ turn("y", angle["head_bend"])
    for side, sign in (("l_", 1.0), ("r_", -1.0)):
        abduct, raised = angle[side + "abduct"], angle[side + "raise"]
        collar = _COLLAR_SHARE * np.maximum(np.maximum(abduct, raised) - _COLLAR_FROM, 0.0)
        turned[side + "clavicle"] = turned["chest"] @ turn("x", sign * collar)
        shoulder = (
            turned["chest"] @ turn("x", sign * abduct) @ turn("y", -raised) @ turn("z", -sign * angle[side + "twist"])
        )
        turned[side + "upper_arm"] = shoulder @ _hanging(skeleton, side + "shoulder", side + "elbow")
        elbow = shoulder @ turn("y", -angle[side + "elbow"])
        turned[side + "forearm"] = elbow @ _hanging(skeleton, side + "elbow", side + "hand")
        hip = turned["pelvis"] @ turn("x", sign * angle["spread"]) @ turn("y", -angle[side + "hip"])
        turned[side + "thigh"] = hip
        turned[side + "shank"] = hip @ turn("y", angle[side + "knee"])
        turned[side + "hand"], turned[side + "foot"] = turned[side + "forearm"], turned[side + "shank"]
    return np.stack([turned[name] for name in SEGMENT_NAMES], 1)


def _hanging(skeleton: Skeleton, start: str, end: str) -> np.ndarray:
    """Rotation from rest to a hanging bone of the arm, whose front keeps facing the front."""
    joints = np.asarray(skeleton.rest_joints, np.float64)
    bone = joints[JOINT_NAMES.index(end)] - joints[JOINT_NAMES.index(start)]
    up = -bone / np.linalg.norm(bone)
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    # Rows: the rest directions that are mapped to x, y and z.
    return np.stack([np.cross(left, up), left, up])


def _stand(skeleton: Skeleton, rotations: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """Pelvis positions (m) that put the body's lowest point on the floor and keep the carrying feet in place."""
    ends, radii = place_body(detailed_body(skeleton), Pose(np.zeros((len(rotations), 3)), rotations))
    joints, tips = (
        np.asarray(x, np.float64) for x in place_joints(skeleton, Pose(np.zeros((len(rotations), 3)), rotations))
    )
    balls = joints[:, [JOINT_NAMES.index("l_foot"), JOINT_NAMES.index("r_foot")]]
    toes = tips[:, [TIP_NAMES.index("l_toetip"), TIP_NAMES.index("r_toetip")]]
    low = np.minimum(balls[..., 2], toes[..., 2])
    # A foot more than about 2 cm above the other carries no weight.
    weight = np.exp((low.min(1, keepdims=True) - low) / 0.02)
    weight /= weight.sum(1, keepdims=True)
    # Positions of the standing feet, rotating with the body on the spot.
    rest = np.asarray(skeleton.rest_joints)[[JOINT_NAMES.index("l_foot"), JOINT_NAMES.index("r_foot")]]
    places = np.einsum("fij,kj->fki", turn("z", facing), rest)
    root = np.einsum("fk,fki->fi", weight, places - balls)
    root[:, 2] = -(ends[..., 2] - radii).min((1, 2))
    return root
