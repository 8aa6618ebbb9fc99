"""Scores of poses against markers of another program, such as keypoints that Pose2Sim has triangulated."""

import numpy as np
from jaxtyping import Float

from .._runtime.kinds import check_kind
from ..body import KeypointSet
from ._poses import Poses
from .metrics import LimbPairs, Score, limb_pairs, scored

# Points of one arm and of one leg, the ends last; where left and right may be exchanged, they are exchanged together.
_LIMBS = (("shoulder", "elbow", "wrist", "hand", "fingertip"), ("hip", "knee", "ankle", "foot", "toetip"))
_INNER = ("shoulder", "elbow", "hip", "knee")


def score_markers(
    poses: Poses,
    positions: Float[np.ndarray, "truth_frames markers 3"],
    names: tuple[str, ...],
    keypoint_set: KeypointSet | None = None,
    threshold: float = 0.1,
) -> Score:
    """Score poses against markers of the same frames in the same world, by the names that both have.

    Args:
        poses: The poses.
        positions: True places of the markers (m); a frame in which one that both have is NaN is left out.
        names: Of the markers.
        keypoint_set: What the names mean, such as `jaxskel.body.BODY_25`; by default they are those of joints.
        threshold: A point farther than this from the truth is wrong (m).

    Raises:
        ValueError: The numbers of frames differ, no frame is left, no name is in both, or the poses have no keypoints.
    """
    check_kind("keypoint_set", keypoint_set, KeypointSet | None, "a KeypointSet, such as jaxskel.body.BODY_25, or None")
    if keypoint_set is None:
        ours, points = poses.template.joint_names, poses.joints
    else:
        has_point = [number for number, shares in enumerate(keypoint_set.points) if shares]
        ours = tuple(keypoint_set.names[number] for number in has_point)
        points = poses.keypoints(keypoint_set)[:, has_point]
    common = tuple(name for name in ours if name in names)
    if not common:
        raise ValueError(
            f"score: no marker ({', '.join(names)}) has the name of one of {', '.join(ours)}; give the set that the "
            "markers are of"
        )
    pairs = limb_pairs(poses.template, common) if keypoint_set is None else _pairs(keypoint_set, common)
    return scored(
        points[:, [ours.index(name) for name in common]],
        positions[:, [names.index(name) for name in common]],
        poses.has_pose,
        threshold,
        pairs,
        common,
        tuple(name for name in (*ours, *names) if name not in common),
    )


def _pairs(keypoint_set: KeypointSet, names: tuple[str, ...]) -> LimbPairs:
    """For arms and legs: their keypoints, those on the other side, and whether they are ends."""
    place_of = {
        frozenset(keypoint_set.points[keypoint_set.names.index(name)]): place for place, name in enumerate(names)
    }
    found = []
    for limb in _LIMBS:
        both = []
        for left, place in place_of.items():
            right = frozenset(f"r_{point[2:]}" for point in left)
            if left and left <= {f"l_{part}" for part in limb} and right in place_of:
                both.append((place, place_of[right], not any(point[2:] in _INNER for point in left)))
        lefts, rights, ends = (list(each) for each in zip(*both, strict=True)) if both else ([], [], [])
        if any(ends):
            found.append((lefts + rights, rights + lefts, ends + ends))
    return found
