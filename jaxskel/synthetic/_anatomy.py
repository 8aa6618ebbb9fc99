"""A detailed body with plausible human volumes: tapered capsules around the bones and tips of a skeleton.

A tapered capsule is the convex hull of two balls. Each end is fixed to one rigid segment of the skeleton, so a capsule
with ends on different segments bridges the joint between them and stays closed when the joint bends.
"""

import numpy as np

from ..body import JOINT_NAMES, PIVOT_NAMES, SEGMENT_NAMES, TIP_NAMES, Body, Skeleton, rest_origins

# Cross sections of the trunk from seat to shoulders: segment, height as a fraction of the way from pelvis to neck,
# shift to the front, distance of the outer balls from the middle, their radius, radius of the middle ball. Lengths are
# fractions of the stature. Here and below they put the joints where the mean body of `adults` has them in its flesh.
_TRUNK = (
    ("pelvis", 0.00, 0.006, 0.036, 0.057, 0.060),
    ("pelvis", 0.16, 0.015, 0.036, 0.057, 0.060),
    ("chest", 0.40, 0.023, 0.029, 0.053, 0.056),
    ("chest", 0.62, 0.022, 0.034, 0.058, 0.062),
    ("chest", 0.80, 0.016, 0.041, 0.054, 0.058),
    ("chest", 0.94, 0.003, 0.034, 0.036, 0.040),
)
TOE_CLEARANCE = 0.010
"""Height of the toe tips above the sole, as a fraction of the stature."""

End = tuple[str, np.ndarray, float]


def detailed_body(skeleton: Skeleton) -> Body:
    """Make a body (m) for a skeleton of any proportions; radii are fractions of its stature."""
    rest: dict[str, np.ndarray] = dict(zip(JOINT_NAMES, np.asarray(skeleton.rest_joints, np.float64), strict=True))
    rest |= dict(zip(TIP_NAMES, np.asarray(skeleton.rest_tips, np.float64), strict=True))
    rest |= dict(zip(PIVOT_NAMES, np.asarray(skeleton.pivots, np.float64), strict=True))
    stature = skeleton.stature
    capsules = _trunk(rest, stature) + _head(rest, stature)
    for side in ("l_", "r_"):
        capsules += _arm(rest, stature, side) + _leg(rest, stature, side) + _foot(rest, stature, side)
    balls = [end for ends in capsules for end in ends]
    segments = np.array([SEGMENT_NAMES.index(segment) for segment, _, _ in balls], np.int32)
    points = np.array([point for _, point, _ in balls])
    radii = np.array([radius for _, _, radius in balls]) * stature
    origins = np.asarray(rest_origins(skeleton), np.float64)
    links = np.arange(len(balls), dtype=np.int32).reshape(-1, 2)
    return Body(skeleton, segments, points - origins[segments], radii, links)


def _chain(*ends: End) -> list[tuple[End, End]]:
    return list(zip(ends[:-1], ends[1:], strict=True))


def _side(side: str) -> float:
    return 1.0 if side == "l_" else -1.0


def _trunk(rest: dict[str, np.ndarray], stature: float) -> list[tuple[End, End]]:
    # Three columns of balls side by side, because a trunk is half as deep as it is wide.
    spine = rest["neck"] - rest["pelvis"]
    columns: list[tuple[End, End]] = []
    for side in (1.0, 0.0, -1.0):
        ends = [
            (
                segment,
                rest["pelvis"] + height * spine + np.array([x, side * y, 0.0]) * stature,
                outer if side else middle,
            )
            for segment, height, x, y, outer, middle in _TRUNK
        ]
        columns += _chain(*ends)
    return columns


def _head(rest: dict[str, np.ndarray], stature: float) -> list[tuple[End, End]]:
    # The skull is longer than wide, and its crown is the tip of the head.
    up = rest["head_top"] - rest["head"]
    radius = min(0.046, float(np.linalg.norm(up)) / stature)
    middle = rest["head_top"] - up / np.linalg.norm(up) * radius * stature

    def at(x: float, z: float) -> np.ndarray:
        return middle + np.array([x, 0.0, z]) * stature

    return [
        (("head", at(-0.012, -0.002), radius), ("head", at(0.008, 0.0), radius)),
        (("head", at(-0.002, -0.012), 0.043), ("head", at(0.020, -0.048), 0.026)),
        (
            ("chest", rest["neck"] + np.array([-0.004, 0, 0]) * stature, 0.035),
            ("head", at(-0.008, -0.035), 0.033),
        ),
    ]


def _arm(rest: dict[str, np.ndarray], stature: float, side: str) -> list[tuple[End, End]]:
    shoulder, elbow, hand, tip = (rest[side + name] for name in ("shoulder", "elbow", "hand", "fingertip"))
    upper, lower, spine = elbow - shoulder, hand - elbow, rest["neck"] - rest["pelvis"]
    fingers = (tip - hand) / np.linalg.norm(tip - hand)
    # Direction of the hand's front edge, where the thumb is. The palm lies on the inner side of the joint.
    across = np.array([1.0, 0, 0]) - fingers * fingers[0]
    across = across / max(float(np.linalg.norm(across)), 1e-6) * stature
    outward, front = np.array([0.0, _side(side), 0.0]) * stature, np.array([stature, 0.0, 0.0])
    wrist = rest[side + "wrist"]
    upper_arm, forearm, palm, clavicle = side + "upper_arm", side + "forearm", side + "hand", side + "clavicle"
    capsules = [
        # The slope of the neck, and the muscles of breast and back around the armpit.
        (("chest", rest["pelvis"] + 0.98 * spine + 0.012 * outward, 0.033), (clavicle, shoulder, 0.032)),
        (("chest", rest["pelvis"] + 0.78 * spine + 0.048 * outward, 0.042), (clavicle, shoulder, 0.033)),
    ]
    capsules += _chain(
        (upper_arm, shoulder - 0.003 * outward, 0.0345),
        (upper_arm, shoulder + 0.45 * upper - 0.003 * outward, 0.027),
        (upper_arm, elbow + 0.003 * front, 0.0225),
    )
    middle = hand - 0.006 * outward
    capsules += _chain(
        (forearm, elbow + 0.003 * front, 0.0225), (forearm, elbow + 0.22 * lower, 0.024),
        (forearm, wrist - 0.003 * front, 0.0165), (palm, middle - 0.006 * across, 0.016),
    )  # fmt: skip
    for shift, short in ((0.006, 0.012), (-0.010, 0.0)):
        end = tip - (short + 0.009) * stature * fingers + shift * 0.7 * across
        capsules.append(((palm, middle + shift * across, 0.015), (palm, end, 0.009)))
    thumb = wrist + 0.3 * (hand - wrist) + 0.004 * across
    capsules.append(((palm, thumb, 0.012), (palm, middle + 0.016 * across + 0.012 * stature * fingers, 0.008)))
    return capsules


def _leg(rest: dict[str, np.ndarray], stature: float, side: str) -> list[tuple[End, End]]:
    hip, knee = rest[side + "hip"], rest[side + "knee"]
    ankle = rest[side + "ankle"]
    thigh, shank = side + "thigh", side + "shank"
    outward = np.array([0.0, _side(side), 0.0]) * stature
    front = np.array([stature, 0.0, 0.0])
    along, down = knee - hip, ankle - knee
    calf = 0.005 * outward - 0.012 * front
    return [
        # The buttock and the outside of the hip bridge the joint.
        (
            ("pelvis", hip - 0.002 * front - 0.018 * outward, 0.058),
            (thigh, hip + 0.22 * along + 0.010 * front - 0.010 * outward, 0.054),
        ),
        *_chain(
            (thigh, hip + 0.006 * front - 0.010 * outward, 0.053),
            (thigh, hip + 0.45 * along + 0.008 * front - 0.007 * outward, 0.047),
            (thigh, knee, 0.0315),
        ),
        *_chain(
            (shank, knee, 0.0315), (shank, knee + 0.28 * down + calf, 0.034),
            (shank, knee + 0.65 * down + calf, 0.024), (shank, ankle + 0.5 * calf, 0.0195),
        ),
    ]  # fmt: skip


def _toes_to(rest: dict[str, np.ndarray], side: str) -> np.ndarray:
    """Horizontal direction of the foot at rest."""
    forward = (rest[side + "toetip"] - rest[side + "foot"]) * [1, 1, 0]
    length = np.linalg.norm(forward)
    return forward / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def _foot(rest: dict[str, np.ndarray], stature: float, side: str) -> list[tuple[End, End]]:
    ball, tip = rest[side + "foot"], rest[side + "toetip"]
    foot, ankle = side + "foot", rest[side + "ankle"]
    forward = _toes_to(rest, side)
    across = np.array([-forward[1], forward[0], 0.0]) * stature * _side(side)
    sole = tip[2] - TOE_CLEARANCE * stature

    def on_sole(point: np.ndarray, radius: float) -> End:
        return foot, np.array([point[0], point[1], sole + radius * stature]), radius

    heel = on_sole(ankle - 0.021 * stature * forward, 0.018)
    inner, outer = on_sole(ball - 0.010 * across, 0.0145), on_sole(ball + 0.001 * across, 0.0125)
    big_toe = on_sole(tip - 0.011 * stature * forward - 0.013 * across, 0.0105)
    small_toes = on_sole(tip - 0.020 * stature * forward + 0.003 * across, 0.009)
    return [
        ((foot, ankle, 0.0195), heel), ((foot, ankle, 0.0195), inner), (heel, inner), (heel, outer),
        (inner, big_toe), (outer, small_toes),
    ]  # fmt: skip
