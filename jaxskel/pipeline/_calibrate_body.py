"""Estimates the bone lengths and radii of an unmeasured subject from a recording."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import numpy as np

from ..body import (
    JOINT_NAMES,
    LENGTH_NAMES,
    SEGMENT_NAMES,
    SEGMENT_PARENTS,
    Body,
    Pose,
    Skeleton,
    lengths_of,
    people_prior,
)
from ..graph import SkeletalGraph
from ..hull import FRAMES_PER_WORD
from ..matching import estimate_stature
from ..recording import Recording
from ._observe_batch import Observation, label_graphs, look_at_outlines, observe_batch
from ._prepare import check_given, prepare
from ._prepared import Costs
from ._settings import Settings
from ._settle_subject import STAGES as SUBJECT_STAGES
from ._subject import find_subject, other_sizes
from ._subject_frames import Sight, sight_of

FRAMES = 60
STAGES = ("looking", *SUBJECT_STAGES)
"""Steps of `calibrate_body`, in order."""
# With fewer frames than this, lengths and flesh cannot be told apart.
_LEAST_FRAMES = 8
# A joint's position is observable if its segment takes directions this far apart (rad): 20 degrees. For smaller angles,
# a shift of the joint along the segment looks like a shift of the flesh around it.
_TURNED = 0.35
_PAIRS = 0.9  # quantile over pairs of frames
# For each length, the bones whose rotation makes its ends observable. Palms and tips are seen by their flesh only.
_SEEN_BY = {
    "trunk": ("trunk", "neck"), "neck": ("neck",), "shoulder": ("upper_arm",), "upper_arm": ("upper_arm", "forearm"),
    "forearm": ("forearm",), "hip": ("thigh",), "thigh": ("thigh", "shank"), "shank": ("shank",),
}  # fmt: skip
# Of each of these bones: name of the joint that it rotates about, its segments, and the joints at its two ends.
_TURNING = {
    "trunk": ("waist", ("chest",), "pelvis", "neck"), "neck": ("neck", ("head",), "neck", "head"),
    "upper_arm": ("shoulder", ("l_upper_arm", "r_upper_arm"), "l_shoulder", "l_elbow"),
    "forearm": ("elbow", ("l_forearm", "r_forearm"), "l_elbow", "l_hand"),
    "thigh": ("hip", ("l_thigh", "r_thigh"), "l_hip", "l_knee"),
    "shank": ("knee", ("l_shank", "r_shank"), "l_knee", "l_foot"),
}  # fmt: skip


@dataclass(frozen=True)
class MeasuredLength:
    """A length of a subject, the same for both sides.

    Attributes:
        length: From joint centre to joint centre (m).
        deviation: Posterior standard deviation (m), with the variation between people as the prior.
        still: Joints at its ends that hardly turn in these frames: only the flesh around them shows where they are.
    """

    length: float
    deviation: float
    still: tuple[str, ...]


@dataclass(frozen=True)
class CalibratedBody:
    """A subject's dimensions and flesh. Give the skeleton to a recording, the body to `Settings(body=...)`.

    Attributes:
        lengths: Keys are the names in the subject's file, see [`read_subject`][jaxskel.io.subjects.read_subject].
        costs: Final cost of the frames, in the units of `volume_objective`.
        frames: Number of frames used.
    """

    skeleton: Skeleton
    body: Body
    lengths: dict[str, MeasuredLength]
    costs: Costs
    frames: int


def calibrate_body(
    recording: Recording,
    settings: Settings | None = None,
    skeleton: Skeleton | None = None,
    frames: int = FRAMES,
    on_stage: Callable[[str], None] = lambda _: None,
) -> CalibratedBody:
    """Find a subject's bone lengths and radii, without known dimensions, from the silhouettes of some frames.

    Poses are searched for with an average body. Then lengths, flesh and the poses of all frames are adjusted at once.
    Both steps are done twice. What the silhouettes do not show follows from how people vary: the flesh around a joint
    tells where the joint is, because a table has their correlation (see [`Population`][jaxskel.body.Population]).
    Left and right are assumed to be alike, and hands to be half closed. A joint is found best where it turns: a few
    frames in which shoulders, elbows, hips and knees bend are worth more than many others.

    Args:
        recording: Silhouettes and cameras; its ``skeleton`` is ignored.
        settings: How hulls are made and poses searched for; a body in it is ignored.
        skeleton: Template to start from instead of the default adult, if the subject's proportions are known to
            differ from it. It is scaled to the size of the hulls.
        frames: Number of frames used, spread evenly.
        on_stage: Called with each of `STAGES` as it begins.

    Raises:
        ValueError: Fewer than 8 of the frames show one whole person, or the settings have no search.
    """
    settings = settings or Settings()
    check_given(recording, settings)
    if settings.search is None:
        raise ValueError("calibrate_body: the settings have no search for poses; give Settings(search=Search())")
    on_stage(STAGES[0])
    template, sight = _look(recording, settings, skeleton, frames)
    subject = find_subject(
        template, partial(people_prior, template), sight, settings.search, other_sizes(template.stature), on_stage
    )
    poses, body = subject.poses, subject.body
    deviations = np.sqrt(np.diagonal(subject.covariance))
    still = {bone for bone in _TURNING if _turning(poses, body.skeleton, bone) < _TURNED}
    lengths = {
        name: MeasuredLength(
            float(length),
            float(length * deviation),
            tuple(_TURNING[bone][0] for bone in _SEEN_BY.get(name, ()) if bone in still),
        )
        for name, length, deviation in zip(LENGTH_NAMES, lengths_of(body.skeleton), deviations, strict=True)
    }
    return CalibratedBody(body.skeleton, body, lengths, subject.costs, int(subject.used.sum()))


def _look(recording: Recording, settings: Settings, template: Skeleton | None, frames: int) -> tuple[Skeleton, Sight]:
    """The template scaled to the subject, and the observations in some frames, made batch by batch."""
    unknown = eqx.tree_at(lambda r: r.skeleton, recording, template, is_leaf=lambda leaf: leaf is None)
    prepared = prepare(unknown, settings, calibrate=False)
    chosen = np.unique(np.linspace(0, len(recording) - 1, frames).astype(int))
    batches: list[tuple[Observation, list[SkeletalGraph]]] = []
    for batch in np.array_split(chosen, -(-len(chosen) // FRAMES_PER_WORD)):
        found = observe_batch(recording[batch], prepared, settings, outlines=False)
        if found.labelled is not None:
            batches.append((found, found.labelled.graphs))
    count = sum(len(found.seen.frames) for found, _ in batches)
    if count < _LEAST_FRAMES:
        raise ValueError(
            f"{recording.name}: {count} of {len(chosen)} frames show one whole person, too few to tell a body's "
            f"dimensions; give {_LEAST_FRAMES} or more, in different poses (jaxskel check {recording.name}.npz)"
        )
    # A template with too long legs would be fitted with bent knees, even backwards, with left and right exchanged.
    skeleton = prepared.skeleton
    stature = estimate_stature([graph for _, graphs in batches for graph in graphs], skeleton)
    if stature is not None:
        skeleton = skeleton.scaled(stature / skeleton.stature)
    parts: list[Sight] = []
    for found, graphs in batches:
        labelled = label_graphs(graphs, skeleton, settings)
        outlines = look_at_outlines(found._replace(labelled=labelled), prepared).outlines
        assert outlines is not None
        parts.append(sight_of(outlines, labelled))
    return skeleton, jax.tree.map(lambda *some: np.concatenate(some), *parts)


def _turning(poses: Pose, skeleton: Skeleton, bone: str) -> float:
    """Angle (rad) between the extreme directions of a bone relative to its parent segment, without a few outliers.

    Of left and right, the larger angle. Twists about the bone do not count: they do not show where its joint is.
    """
    _, segments, start, end = _TURNING[bone]
    joints, rotations = np.asarray(skeleton.rest_joints), np.asarray(poses.rotations, np.float64)
    along = joints[JOINT_NAMES.index(end)] - joints[JOINT_NAMES.index(start)]
    angles = []
    for name in segments:
        segment = SEGMENT_NAMES.index(name)
        own = along * ([1, -1, 1] if name.startswith("r_") else [1, 1, 1]) / np.linalg.norm(along)
        seen = np.einsum("fji,fjk,k->fi", rotations[:, SEGMENT_PARENTS[segment]], rotations[:, segment], own)
        angles.append(np.quantile(np.arccos(np.clip(seen @ seen.T, -1, 1)), _PAIRS))
    return float(max(angles))
