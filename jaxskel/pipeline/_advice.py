"""Advice when no frame has a pose."""

import numpy as np

from ..poses import WITH_POSE, Poses, Status
from ..recording import Recording, silhouette_areas


def advice(poses: Poses, recording: Recording) -> str | None:
    """The likely cause if no frame has a pose; None otherwise."""
    worst = _commonest(poses)
    if worst is None:
        return None
    share = silhouette_areas(recording.silhouettes)[::8] / recording.cameras.size.prod(1)
    if np.median(share) > 0.5:
        return "no pose in any frame: most of every image is person, so the masks seem to be inverted; 1 = person"
    hints = {
        Status.EMPTY: "no view shows a person: are the masks inverted or black?",
        Status.TOO_FEW_VIEWS: "fewer than three views show a person",
        Status.NO_HULL: "the silhouettes have no common volume: is the calibration for these views, and in metres?",
        Status.SEVERAL_PEOPLE: "more than one person is in view; tell them apart by --people all",
        Status.PARTLY_OUTSIDE: "the person extends beyond what the cameras see",
        Status.NO_MATCH: "the hull is not that of a person with these dimensions: is the up axis right?",
        Status.FAILED: "the refinement failed",
    }
    return f"no pose in any frame: {hints[worst]} (jaxskel check draws it)"


def advice_for_volumes(poses: Poses) -> str | None:
    """The likely cause if no frame of some volumes has a pose; None otherwise."""
    worst = _commonest(poses)
    if worst is None:
        return None
    hints = {
        Status.EMPTY: "no voxel is occupied",
        Status.NO_HULL: "no connected body is as large as a person, 8 litres: is the spacing right, and in metres?",
        Status.SEVERAL_PEOPLE: "there is more than one body of a person's size",
        Status.PARTLY_OUTSIDE: "the person reaches the edge of the volume; if nothing is cut off, pad it by one empty "
        "voxel on each side",
        Status.NO_MATCH: f"the body is not that of a person with these dimensions: is up {poses.up}?",
        Status.FAILED: "the refinement failed",
    }
    return f"no pose in any frame: {hints[worst]}"


def _commonest(poses: Poses) -> Status | None:
    """The commonest status if no frame has a pose; None otherwise."""
    if poses.has_pose.any():
        return None
    worst = Status(max(set(poses.status.tolist()), key=poses.status.tolist().count))
    assert worst not in WITH_POSE
    return worst
