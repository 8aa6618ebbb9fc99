"""Skeletons other than the paper's human: a hand with three fingers, and an animal with four legs."""

import numpy as np
from scipy.spatial.transform import Rotation

from jaxskel import Pose, Poses, Skeleton, make_skeleton
from jaxskel.body import FREE, HINGE, Hinge, Pivot, SkeletonTemplate
from support.poses import placed

_UP, _DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)

# Every joint turns what hangs on it; no joint has a left and a right.
HAND = SkeletonTemplate(
    name="three-fingered hand",
    joint_names=("wrist", "thumb", "index", "index_middle", "little", "little_middle"),
    joint_parents=(-1, 0, 0, 2, 0, 4),
    tip_names=("index_tip", "thumb_tip", "little_tip"),
    tip_parents=(3, 1, 5),
    segment_names=("palm", "thumb", "index", "index_end", "little", "little_end"),
    segment_parents=(-1, 0, 0, 2, 0, 4),
    segment_of_joint=(0, 0, 0, 2, 0, 4),
    segment_of_tip=(3, 1, 5),
    freedoms=(FREE, FREE, FREE, HINGE, FREE, HINGE),
    inner=(0,),
    described_by=(0, 1, 2),
    attracted=(),
    firmness=(0.1,) * 5,
    hinges=(Hinge(3, 3, 6, _DOWN, 0.0, 1.8), Hinge(5, 5, 8, _DOWN, 0.0, 1.8)),
)

# Several segments turn about the pelvis and about the chest, and the head turns inside its bone.
ANIMAL = SkeletonTemplate(
    name="animal",
    joint_names=("pelvis", "chest", "head", "l_elbow", "r_elbow", "l_hip", "l_knee", "r_hip", "r_knee"),
    joint_parents=(-1, 0, 1, 1, 1, 0, 5, 0, 7),
    tip_names=("nose", "l_forepaw", "r_forepaw", "l_hindpaw", "r_hindpaw"),
    tip_parents=(2, 3, 4, 6, 8),
    segment_names=(
        "pelvis", "trunk", "neck", "head", "l_foreleg", "l_forepaw", "r_foreleg", "r_forepaw", "l_thigh", "l_shank",
        "r_thigh", "r_shank",
    ),
    segment_parents=(-1, 0, 1, 2, 1, 4, 1, 6, 0, 8, 0, 10),
    segment_of_joint=(0, 1, 2, 4, 6, 0, 8, 0, 10),
    segment_of_tip=(3, 5, 7, 9, 11),
    freedoms=(FREE,) * 12,
    inner=(0, 1),
    described_by=(0, 1, 2, 3, 4),
    attracted=(),
    firmness=(0.1,) * 11,
    pivots=(Pivot("atlas", 2, (0.4, 0.4, 0.4), (0.0, 0.0, 0.0)),),
    segment_of_pivot=(3,),
)  # fmt: skip


def hand() -> Skeleton:
    """A flat hand that points ahead (m)."""
    joints = [[0, 0, 0], [0.05, 0.05, 0], [0.09, 0.02, 0], [0.13, 0.02, 0], [0.08, -0.03, 0], [0.11, -0.03, 0]]
    tips = [[0.18, 0.02, 0.001], [0.09, 0.08, 0], [0.14, -0.03, 0.001]]
    return make_skeleton(joints, tips, HAND)


def animal() -> Skeleton:
    """An animal that stands on four legs and looks ahead (m)."""
    side = np.array([1, -1, 1])
    elbow, hip, knee = np.array([0.5, 0.1, -0.25]), np.array([0, 0.1, 0]), np.array([0.05, 0.1, -0.25])
    joints = [[0, 0, 0], [0.5, 0, 0], [0.7, 0, 0.2], elbow, side * elbow, hip, knee, side * hip, side * knee]
    fore, hind = np.array([0.5, 0.1, -0.5]), np.array([0, 0.1, -0.5])
    return make_skeleton(joints, [[0.8, 0, 0.2], fore, side * fore, hind, side * hind], ANIMAL)


def acting(skeleton: Skeleton, frames: int = 24, up: str = "+Z", without: tuple[int, ...] = ()) -> Poses:
    """Poses in which every segment turns to and fro in its own way."""
    template, noise = skeleton.template, np.random.default_rng(5)
    swings = noise.normal(0.0, 0.3, (len(template.segment_names), 3))
    waves = np.sin(0.3 * np.arange(frames)[:, None] + np.arange(len(swings)))
    local = Rotation.from_rotvec((waves[..., None] * swings).reshape(-1, 3)).as_matrix().reshape(frames, -1, 3, 3)
    turns = [local[:, 0]]
    for segment, parent in enumerate(template.segment_parents[1:], 1):
        turns.append(turns[parent] @ local[:, segment])
    root = np.array([0.3, -0.2, 1.0]) + 0.01 * np.arange(frames)[:, None]
    return placed(skeleton, Pose(root, np.stack(turns, 1)), 30.0, up, without)
