"""Writes poses as BVH (Biovision), the text format of animation programs: a skeleton and its rotations over time."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..._math.euler import to_zxy
from ..._runtime.atomic_files import written_whole
from ...body import HUMAN_15, JOINT_NAMES, Pose, SkeletonTemplate
from ...poses import Poses
from ._markers import turn_up, with_up
from ._rig import RIG, Rig, placed, rig_of

# How far (m) the root of the file is below the pelvis. With the root at the pelvis, the middle of its children would be
# the root itself, and Blender ends a bone in the middle of its children: the bone would have no length. Programs that
# scale a path by the height of the root are off by a fiftieth.
_ROOT_BELOW = 0.02

# If several joints share a point, take the first: no joint before it rotates by itself.
BVH_NAMES = {point: name for name, parent, point, _ in reversed(RIG) if parent and point in JOINT_NAMES}
"""Name in a BVH of each joint of the paper's human; those of any other template have their own.

The tips are the end sites; the root, Hips, is 2 cm below the pelvis.
"""


@dataclass(frozen=True)
class Animation:
    """How well a written animation reproduces the poses.

    Attributes:
        held: Number of frames without a pose, in which the animation repeats another pose.
        deviation: Largest distance between a joint or tip and its place in the poses (m), nonzero where bones are
            longer or shorter than the template's.
        farthest: Joint or tip with the largest distance.
    """

    path: Path
    held: int
    deviation: float
    farthest: str


def write_bvh(path: str | Path, poses: Poses, *, up: str = "+Y", scale: float = 0.01) -> Animation:
    """Write an animation for Blender and other animation programs.

    Bones have the lengths of the template, `poses.skeleton`, and the joints the rotations of the poses. The bones of
    poses from elbow to palm and from knee to ball of the foot are two here, with wrist and ankle in between. At rest
    the person stands in a T-pose and faces +Z if +Y is up. Joints have the usual names of animation programs: see
    `BVH_NAMES`. The root, Hips, turns with the pelvis and is 2 cm below it, so that no bone has length zero.

    So it is for the paper's human. Any other template has its own names, and is at rest as its skeleton is; where
    several segments turn about a joint, each but its own has one more joint there, named after both.

    The format has no gaps. A frame without a pose repeats the previous pose; frames before the first pose show that
    one.

    Args:
        path: The file; its folder is created if missing.
        poses: Frames at `poses.fps`.
        up: World axis that points up in the file, which cannot state it. Blender's importer expects +Y.
        scale: Metres per unit of the file, which cannot state it either: 0.01 for the usual centimetres.

    Returns:
        How well the animation agrees with the poses, and the number of frames that repeat another pose.

    Raises:
        ValueError: There is no pose, the rotations are not known, `up` is not one of `jaxskel.recording.UP_AXES`, or
            `scale` is not a length.
    """
    path = Path(path)
    if not 0.0 < scale < 1e6:
        raise ValueError(f"scale = {scale}: give metres per unit of the file, such as 0.01 for centimetres")
    known = poses.has_pose
    if not known.any():
        raise ValueError(f"{path}: no frame has a pose: there is nothing to animate")
    if poses.rotations is None or poses.skeleton is None:
        raise ValueError(f"{path}: the poses hold no rotations, because an older version wrote them; reconstruct again")
    turn, standing = turn_up("+Z", up), with_up(poses, "+Z")
    joints, tips = (points[known].astype(np.float64) for points in (standing.joints, standing.tips))
    rig = rig_of(poses.skeleton, Pose(joints[:, 0], standing.pose.rotations[known]))
    # Number of poses up to each frame; frames before the first pose show the first one.
    shown = np.maximum(np.cumsum(known) - 1, 0)
    written = _with_lower_root(rig) if poses.template == HUMAN_15 else rig
    rows = _channels(written, turn, scale)[shown]
    lines = [*_hierarchy(written, turn, scale), "MOTION", f"Frames: {len(rows)}", f"Frame Time: {1 / poses.fps:.10f}"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rows]
    with written_whole(path) as file:
        file.write("\n".join([*lines, ""]).encode())
    return Animation(path, int((~known).sum()), *_deviation(rig, poses.template, joints, tips))


def _with_lower_root(rig: Rig) -> Rig:
    """The same joints, but for the first one, which goes down the trunk."""
    root, below = rig.rows[0][0], np.array([0.0, 0.0, -_ROOT_BELOW])
    children = np.array([parent == root for _, parent, *_ in rig.rows])
    return Rig(rig.rows, rig.offsets - children[:, None] * below, rig.root + rig.rotations[:, 0] @ below, rig.rotations)


def _hierarchy(rig: Rig, turn: Float[np.ndarray, "3 3"], scale: float) -> list[str]:
    lines, depth, ends = ["HIERARCHY"], {"": 0}, _ends(rig)
    open_braces: list[str] = []

    def close(until: int) -> None:
        while len(open_braces) > until:
            open_braces.pop()
            lines.append("\t" * len(open_braces) + "}")

    for (name, parent, *_), offset in zip(rig.rows, rig.offsets @ turn.T / scale, strict=True):
        close(depth[parent])
        indent = "\t" * depth[parent]
        kind = "End Site" if name in ends else f"JOINT {name}" if parent else f"ROOT {name}"
        lines += [indent + kind, indent + "{", f"{indent}\tOFFSET {_numbers(offset)}"]
        if name not in ends:
            position = "" if parent else "Xposition Yposition Zposition "
            count = 3 if parent else 6
            lines.append(f"{indent}\tCHANNELS {count} {position}Zrotation Xrotation Yrotation")
        open_braces.append(name)
        depth[name] = len(open_braces)
    close(0)
    return lines


def _channels(rig: Rig, turn: Float[np.ndarray, "3 3"], scale: float) -> Float[np.ndarray, "frames channels"]:
    """Position of the root (units of the file), and the angles of each joint relative to its parent (degrees)."""
    names, ends = [name for name, *_ in rig.rows], _ends(rig)
    turning = [i for i, name in enumerate(names) if name not in ends]
    parents = [names.index(rig.rows[i][1]) for i in turning[1:]]
    whole = turn @ rig.rotations @ turn.T
    local = np.concatenate(
        [whole[:, :1], whole[:, parents].swapaxes(-1, -2) @ whole[:, turning[1:]]], axis=1
    )  # fmt: skip
    angles = np.rad2deg(to_zxy(local))
    return np.concatenate([rig.root @ turn.T / scale, angles.reshape(len(angles), -1)], 1)


def _ends(rig: Rig) -> set[str]:
    """Joints that nothing hangs on: end sites, which do not turn."""
    return {name for name, *_ in rig.rows} - {parent for _, parent, *_ in rig.rows}


def _deviation(rig: Rig, template: SkeletonTemplate, joints: np.ndarray, tips: np.ndarray) -> tuple[float, str]:
    names, goals = template.point_names, np.concatenate([joints, tips], 1)
    points = placed(rig)
    distances = {
        point: float(np.linalg.norm(points[:, j] - goals[:, names.index(point)], axis=-1).max())
        for j, (_, _, point, _) in enumerate(rig.rows)
        if point in names
    }
    farthest = max(distances, key=lambda point: distances[point])
    return distances[farthest], farthest


def _numbers(vector: np.ndarray) -> str:
    return " ".join(f"{value:.6f}" for value in vector)
