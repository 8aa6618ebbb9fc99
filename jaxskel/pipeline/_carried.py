"""Poses of another template whose points lie on the human body that was found."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..body import HUMAN_15, JOINT_OF_PIVOT, SkeletonTemplate, carriers_of, human_points, make_skeleton, shares_of
from ..poses import Poses


def carried(poses: Poses, template: SkeletonTemplate) -> Poses:
    """The same poses with the points of a template that is on the human body.

    Positions are those of the template's points. Covariances and confidences of a point between others are those of
    what it is a mean of: the covariance as if their errors were one, the confidence as their mean. A tip's, a wrist's
    and an ankle's are those of the joint beside it.

    Args:
        poses: Of the human template (m).
        template: One whose points all have a meaning.
    """
    assert poses.skeleton is not None
    assert poses.rotations is not None
    assert poses.covariance is not None
    joints = len(template.joint_names)
    shares = shares_of(template.meanings).astype(np.float32)
    points = shares @ np.concatenate([poses.joints, poses.tips, _pivots(poses)], 1)
    at_rest = human_points(poses.skeleton, template.meanings)
    # What is known of tips, wrists and ankles is what is known of the joints beside them.
    beside = np.concatenate([np.arange(len(HUMAN_15.joint_names)), HUMAN_15.tip_parents, JOINT_OF_PIVOT]).astype(int)
    return replace(
        poses,
        template=template,
        joints=points[:, :joints],
        tips=points[:, joints:],
        rotations=poses.rotations[:, carriers_of(template)],
        skeleton=make_skeleton(at_rest[:joints], at_rest[joints:], template),
        confidence=poses.confidence[:, beside] @ shares[:joints].T,
        covariance=np.einsum("jp,fpab->fjab", shares[:joints], poses.covariance[:, beside]),
    )


def _pivots(poses: Poses) -> Float[np.ndarray, "frames pivots 3"]:
    """Wrists and ankles of the human body (m)."""
    assert poses.skeleton is not None
    assert poses.rotations is not None
    starts = HUMAN_15.point_parents[list(JOINT_OF_PIVOT)]
    segments = np.array(HUMAN_15.segment_of_joint)[list(JOINT_OF_PIVOT)]
    bones = np.asarray(poses.skeleton.pivots - poses.skeleton.rest_joints[starts], np.float32)
    return poses.joints[:, starts] + np.einsum("fpij,pj->fpi", poses.rotations[:, segments], bones)
