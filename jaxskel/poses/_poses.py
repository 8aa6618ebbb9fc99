"""The result of a reconstruction: poses with a status and a confidence for every frame."""

from collections.abc import Iterable
from enum import IntEnum
from typing import TYPE_CHECKING

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from .._runtime.kinds import check_kind
from ..body import HUMAN_15, KeypointSet, Pose, Skeleton, SkeletonTemplate
from ._dataset import poses_dataset
from ._quaternions import to_quaternions

if TYPE_CHECKING:
    import xarray


class Status(IntEnum):
    """What became of a frame. A frame has a pose in the first three cases only."""

    OK = 0
    VIEW_LOST = 1
    """A pose from fewer views: at least one silhouette is empty while the others show a person."""
    NOT_CONVERGED = 2
    """A pose, but the refinement used up its steps while it still improved."""
    EMPTY = 3
    """No person in any view."""
    TOO_FEW_VIEWS = 4
    """A person in too few views for a visual hull."""
    NO_HULL = 5
    """The silhouettes have no common volume of a person's size: they contradict each other or the calibration."""
    SEVERAL_PEOPLE = 6
    """More than one body in the hull."""
    PARTLY_OUTSIDE = 7
    """The body reaches over the edge of the volume that enough cameras see, or of the voxel grid."""
    NO_MATCH = 8
    """The skeletal graph has no head, hands and feet of a person with these dimensions."""
    FAILED = 9
    """The refinement broke down (not a finite pose)."""


STATUS_NAMES = tuple(status.name.lower() for status in Status)
WITH_POSE = (Status.OK, Status.VIEW_LOST, Status.NOT_CONVERGED)


class Poses(eqx.Module):
    """Poses of a recording, frame by frame, in the recording's world.

    Attributes:
        joints: Joints (m); NaN in a frame without a pose.
        tips: Limb tips (m); NaN in a frame without a pose.
        rotations: Rotation of each segment from the body frame at rest to the world; NaN in a frame without a pose.
            None where an older version wrote the poses.
        skeleton: Its dimensions (m), given or found by the run, to whose rest pose the rotations refer. None where
            they are.
        confidence: Probability that each joint is within 100 mm of the truth; 0 in a frame without a pose.
        side_confidence: 0..1: how surely left and right are told apart in this frame; 0.5 means not at all.
        status: A `Status` for each frame.
        covariance: How far each joint may be off: covariance about where it is given (m^2); NaN in a frame without a
            pose. None where an older version wrote the poses.
        stature_deviation: Standard deviation of the skeleton's stature (m), if the run found it; None if it was given.
        template: What the skeleton consists of: names and tree of joints, tips and segments.

    Raises:
        ValueError: The template is not that of the skeleton, or has another number of joints or tips.
    """

    joints: Float[np.ndarray, "frames joints 3"]
    tips: Float[np.ndarray, "frames tips 3"]
    rotations: Float[np.ndarray, "frames segments 3 3"] | None
    skeleton: Skeleton | None
    confidence: Float[np.ndarray, "frames joints"]
    side_confidence: Float[np.ndarray, " frames"]
    status: Int[np.ndarray, " frames"]
    fps: float
    up: str
    frame_index: Int[np.ndarray, " frames"]
    covariance: Float[np.ndarray, "frames joints 3 3"] | None = None
    stature_deviation: float | None = None
    template: SkeletonTemplate = eqx.field(static=True, default=HUMAN_15)

    def __check_init__(self):
        """Reject a template that is not that of the skeleton and the points."""
        if self.skeleton is not None and self.skeleton.template != self.template:
            raise ValueError(
                f"template: is {self.template.name}, but that of the skeleton is {self.skeleton.template.name}; give "
                "template=skeleton.template"
            )
        wanted = len(self.template.joint_names), len(self.template.tip_names)
        if (self.joints.shape[1], self.tips.shape[1]) != wanted:
            raise ValueError(
                f"joints and tips: are {self.joints.shape[1]} and {self.tips.shape[1]}, but the template "
                f"{self.template.name} has {wanted[0]} and {wanted[1]}; give the template that they are of"
            )

    def __len__(self) -> int:
        return len(self.joints)

    @property
    def has_pose(self) -> Bool[np.ndarray, " frames"]:
        """Which frames have a pose."""
        return np.isin(self.status, WITH_POSE)

    @property
    def pose(self) -> Pose:
        """Root joint (m) and rotations, for `skeleton`; bones of the joints may be longer or shorter than its own.

        Raises:
            ValueError: The rotations are not known.
        """
        return Pose(self.joints[:, 0], self._known_rotations())

    @property
    def local_rotations(self) -> Float[np.ndarray, "frames segments 3 3"]:
        """Rotation of each segment relative to its parent in the template, from rest; the first one to the world.

        Raises:
            ValueError: The rotations are not known.
        """
        rotations = self._known_rotations()
        parents = rotations[:, list(self.template.segment_parents[1:])].swapaxes(-1, -2)
        return np.concatenate([rotations[:, :1], parents @ rotations[:, 1:]], axis=1)

    @property
    def quaternions(self) -> Float[np.ndarray, "frames segments 4"]:
        """`rotations` as unit quaternions, w first, whose signs do not flip over the film; NaN without a pose.

        Raises:
            ValueError: The rotations are not known.
        """
        return to_quaternions(self._known_rotations())

    @property
    def local_quaternions(self) -> Float[np.ndarray, "frames segments 4"]:
        """`local_rotations` as unit quaternions, w first, whose signs do not flip over the film; NaN without a pose.

        Raises:
            ValueError: The rotations are not known.
        """
        return to_quaternions(self.local_rotations)

    def _known_rotations(self) -> Float[np.ndarray, "frames segments 3 3"]:
        if self.rotations is None:
            raise ValueError("the poses hold no rotations, because an older version wrote them; reconstruct again")
        return self.rotations

    @property
    def deviations(self) -> Float[np.ndarray, "frames joints"] | None:
        """Standard deviation of each joint along an axis, the root mean square over all directions (m)."""
        return None if self.covariance is None else np.sqrt(np.trace(self.covariance, axis1=-2, axis2=-1) / 3)

    @property
    def typical_confidence(self) -> float:
        """Median over the frames with a pose of their joints' mean confidence; NaN where no frame has one."""
        return float(np.median(self.confidence[self.has_pose].mean(1))) if self.has_pose.any() else float("nan")

    def keypoints(self, keypoint_set: KeypointSet) -> Float[np.ndarray, "frames keypoints 3"]:
        """Where the keypoints of a detector are (m, world), such as those of `jaxskel.body.BODY_25`.

        NaN in a frame without a pose, and of keypoints that the skeleton has no point for, such as eyes.

        Args:
            keypoint_set: The keypoints, and what they mean.

        Raises:
            ValueError: The template is not the paper's human, or the rotations, which place wrists and ankles, are not
                known.
        """
        check_kind("keypoint_set", keypoint_set, KeypointSet, "a KeypointSet, such as jaxskel.body.BODY_25")
        template = self.template
        if template != HUMAN_15:
            raise ValueError(
                f"template: {template.name} has no keypoints, which are points of {HUMAN_15.name}; use its joints"
            )
        rotations = self._known_rotations()
        assert self.skeleton is not None  # rotations refer to it
        ends = np.array([pivot.joint for pivot in template.pivots])
        starts, segments = template.point_parents[ends], np.array(template.segment_of_joint)[ends]
        offsets = np.asarray(self.skeleton.pivots) - np.asarray(self.skeleton.rest_joints)[starts]
        pivots = self.joints[:, starts] + np.einsum("fpij,pj->fpi", rotations[:, segments], offsets)
        shares = keypoint_set.shares
        found = shares @ np.concatenate([self.joints, self.tips, pivots], 1).astype(np.float64)
        found[:, ~shares.any(1)] = np.nan
        return found

    def counts(self) -> dict[str, int]:
        """Number of frames of each status that occurs, by name."""
        return {name: int((self.status == i).sum()) for i, name in enumerate(STATUS_NAMES) if (self.status == i).any()}

    def to_xarray(self) -> "xarray.Dataset":
        """Joints and tips as a dataset in the layout of the package `movement`.

        Dimensions are time (s, from the first frame), space (x, y, z of the world, m), keypoints (joints, then tips of
        the template) and individuals (one, ``person``). Tips have no confidence of their own: NaN.

        Raises:
            ImportError: xarray is not installed.
        """
        return poses_dataset(
            self.template.point_names, np.concatenate([self.joints, self.tips], 1),
            np.concatenate([self.confidence, np.full(self.tips.shape[:2], np.nan, self.confidence.dtype)], 1),
            self.frame_index, [STATUS_NAMES[status] for status in self.status], self.fps, self.up,
        )  # fmt: skip


def join_poses(parts: Iterable[Poses]) -> Poses:
    """Put consecutive parts of one recording together; the skeleton is that of the first one.

    Raises:
        ValueError: There are no parts, or they are of different templates.
    """
    parts = [parts] if isinstance(parts, Poses) else list(parts)
    for part in parts:
        check_kind("parts", part, Poses, "the Poses of consecutive parts")
    if not parts:
        raise ValueError("join_poses: no parts given")
    for part in parts:
        if part.template != parts[0].template:
            raise ValueError(
                f"join_poses: the templates {parts[0].template.name} and {part.template.name} differ; join parts of "
                "one recording"
            )

    def joined(field: str) -> np.ndarray:
        return np.concatenate([getattr(part, field) for part in parts])

    whole = all(part.rotations is not None for part in parts)
    sure = all(part.covariance is not None for part in parts)
    return Poses(
        joints=joined("joints"), tips=joined("tips"), rotations=joined("rotations") if whole else None,
        skeleton=parts[0].skeleton if whole else None, confidence=joined("confidence"),
        side_confidence=joined("side_confidence"), status=joined("status"), fps=parts[0].fps, up=parts[0].up,
        frame_index=joined("frame_index"), covariance=joined("covariance") if sure else None,
        stature_deviation=parts[0].stature_deviation, template=parts[0].template,
    )  # fmt: skip
