"""A small model in OpenSim, scaled to a template: rigid segments, joints named as in OpenSim's full-body models.

Axes and origins are those of its documentation, not those of our code: X to the front, Y up, Z to the right, each joint
by rotations about Z, X and Y in this order; left ab- or adduction and rotation are about the mirrored axes.
"""

from typing import Any

import numpy as np

from jaxskel import JOINT_NAMES, TIP_NAMES, Pose, Skeleton
from jaxskel.body import PIVOT_NAMES, neutral_posture, place_segments

_LEG = (
    ("hip", "pelvis", "{}_thigh", "{}_hip", ("hip_flexion", "hip_adduction", "hip_rotation")),
    ("knee", "{}_thigh", "{}_shank", "{}_knee", ("knee_angle", "knee_adduction", "knee_rotation")),
    ("ankle", "{}_shank", "{}_foot", "{}_ankle", ("ankle_angle", "ankle_inversion", "ankle_rotation")),
)  # fmt: skip
_ARM = (
    ("clavicle", "chest", "{}_clavicle", "neck", ("clavicle_z", "clavicle_x", "clavicle_y")),
    ("shoulder", "{}_clavicle", "{}_upper_arm", "{}_shoulder", ("arm_flex", "arm_add", "arm_rot")),
    ("elbow", "{}_upper_arm", "{}_radius", "{}_elbow", ("elbow_flex", "elbow_add", "pro_sup")),
    ("wrist", "{}_radius", "{}_hand", "{}_wrist", ("wrist_flex", "wrist_dev", "wrist_rot")),
)  # fmt: skip
_TRUNK = (
    ("back", "pelvis", "chest", "pelvis", ("lumbar_extension", "lumbar_bending", "lumbar_rotation")),
    ("neck", "chest", "head", "neck", ("neck_extension", "neck_bending", "neck_rotation")),
)  # fmt: skip
# The body that carries each marker.
CARRIERS = {
    "pelvis": "pelvis", "neck": "chest", "head": "head", "head_top": "head",
    **{f"{side}_{point}": f"{side}_{body}" if body != "pelvis" else body for side in "lr" for point, body in (
        ("shoulder", "clavicle"), ("elbow", "upper_arm"), ("hand", "hand"), ("fingertip", "hand"), ("hip", "pelvis"),
        ("knee", "thigh"), ("foot", "foot"), ("toetip", "foot"),
    )},
}  # fmt: skip
# What markers on straight lines do not show, or no joint does.
UNSEEN = ("knee_adduction", "knee_rotation", "elbow_add", "pro_sup", "wrist_rot", "clavicle_z", "neck_rotation")


def neutral_points(skeleton: Skeleton) -> dict[str, np.ndarray]:
    """Joints, tips and pivots in the neutral posture (m), in OpenSim's axes."""
    pose = Pose(np.zeros(3), neutral_posture(skeleton))
    joints, tips, origins = (np.asarray(part, np.float64) for part in place_segments(skeleton, pose))
    points = np.concatenate([joints, tips, origins[-4:]]) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    return dict(zip(JOINT_NAMES + TIP_NAMES + PIVOT_NAMES, points, strict=True))


def scaled_model(opensim: Any, skeleton: Skeleton) -> Any:
    """A model with a marker at each joint and tip."""
    at = neutral_points(skeleton)
    model = opensim.Model()
    bodies, origins = {"ground": model.getGround()}, {"ground": np.zeros(3)}
    rows = [("ground_pelvis", "ground", "pelvis", "pelvis", ("pelvis_tilt", "pelvis_list", "pelvis_rotation"), "")]
    rows += [(*row, "") for row in _TRUNK]
    for limb in (_LEG, _ARM):
        rows += [
            (f"{name}_{side}", parent.format(side), child.format(side), point.format(side),
             tuple(f"{each}_{side}" for each in coordinates), side)
            for side in "rl" for name, parent, child, point, coordinates in limb
        ]  # fmt: skip

    def vector(values) -> Any:
        return opensim.Vec3(*(float(value) for value in values))

    for name, parent, child, point, coordinates, side in rows:
        bodies[child] = opensim.Body(child, 1.0, vector([0, 0, 0]), opensim.Inertia(1.0))
        origins[child] = at[point]
        model.addBody(bodies[child])
        transform = opensim.SpatialTransform()
        mirror = -1.0 if side == "l" else 1.0
        for i, (coordinate, axis) in enumerate(
            zip(coordinates, ((0, 0, 1), (mirror, 0, 0), (0, mirror, 0)), strict=True)
        ):
            _add_axis(opensim, transform, i, coordinate, vector(axis), -1.0 if coordinate[:10] == "knee_angle" else 1.0)
        if parent == "ground":
            for i, axis in enumerate(np.eye(3)):
                _add_axis(opensim, transform, 3 + i, f"pelvis_t{'xyz'[i]}", vector(axis), 1.0)
        location = vector([0, 0, 0] if parent == "ground" else origins[child] - origins[parent])
        zero = vector([0, 0, 0])
        model.addJoint(opensim.CustomJoint(name, bodies[parent], location, zero, bodies[child], zero, zero, transform))
    for point, carrier in CARRIERS.items():
        model.addMarker(opensim.Marker(point, bodies[carrier], vector(at[point] - origins[carrier])))
    model.finalizeConnections()
    return model


def _add_axis(opensim: Any, transform: Any, index: int, coordinate: str, axis: Any, slope: float) -> None:
    names = opensim.ArrayStr()
    names.append(coordinate)
    row = transform.updTransformAxis(index)
    row.setCoordinateNames(names)
    row.setAxis(axis)
    row.set_function(opensim.LinearFunction(slope, 0.0))


def marker_positions(model: Any, state: Any) -> np.ndarray:
    """Places of the markers in the world (m), in the order of joints, then tips."""
    model.realizePosition(state)
    found = []
    for name in JOINT_NAMES + TIP_NAMES:
        place = model.getMarkerSet().get(name).getLocationInGround(state)
        found.append([place.get(i) for i in range(3)])
    return np.array(found)
