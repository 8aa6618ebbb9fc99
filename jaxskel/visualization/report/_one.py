"""The page of one person."""

import numpy as np

from ...poses import Poses, score_poses
from ...recording import Recording, recording_rows
from ._content import Content
from ._filled import filled
from ._numbers import body_points, page_numbers
from ._overlays import Overlays
from ._tables import bone_lengths, facts, score_tables, varying_bones

SCRIPTS = ("data.js", "orbit.js", "scene.js", "options.js", "views.js", "charts.js", "player.js")
"""In order of their dependencies."""


def content_of_one(recording: Recording, poses: Poses) -> Content:
    """Poses in 3D and over the silhouettes, with a score if the recording has ground truth.

    Raises:
        ValueError: Poses of another recording.
    """
    rows = recording_rows(recording, poses)
    truth = None if recording.truth is None else recording.truth[rows]
    if truth is not None and not np.isfinite(truth.joints).all(axis=(1, 2)).any():
        truth = None
    scored = None
    # Truth of a template without any joint of the same name says nothing of these poses.
    if truth is not None and set(truth.template.joint_names) & set(poses.template.joint_names):
        scored = score_poses(poses, truth.joints, truth.template)

    def page(overlays: Overlays) -> str:
        numbers = page_numbers(recording, poses, truth, overlays)
        return filled(
            "page.html", (*SCRIPTS, "start.js"), recording.name, numbers,
            facts=facts(recording, poses), bones=bone_lengths(poses, recording.skeleton), varying=varying_bones(poses),
            score=score_tables(scored),
        )  # fmt: skip

    return Content(rows, body_points(poses)[None], page)
