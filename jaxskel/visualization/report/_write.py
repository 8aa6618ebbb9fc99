"""Writes the report as one HTML file of limited size: numbers, tables, scripts and style."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ...poses import Poses, Score, score_poses
from ...recording import Recording, recording_rows
from ._filled import filled
from ._numbers import body_points, page_numbers
from ._overlays import Overlays, make_overlays
from ._tables import bone_lengths, facts, score_tables, varying_bones

LIMIT = 15_000_000
"""Largest size of a page (bytes), so that it can still be sent by mail."""

# In order of their dependencies.
_SCRIPTS = ("data.js", "orbit.js", "scene.js", "options.js", "views.js", "charts.js", "player.js")


def write_report(
    path: str | Path,
    recording: Recording,
    poses: Poses,
    limit: int = LIMIT,
    on_frame: Callable[[int], None] | None = None,
) -> int:
    """Write one HTML page that shows poses in 3D, over the silhouettes, and their confidence over time.

    The page loads nothing else. Silhouettes are read one frame at a time. If all frames would make the page larger than
    the limit, the views show only every second, fourth, ... frame, and the page says so.

    Args:
        path: The file.
        recording: Recording that the poses were made from. If it has ground truth, the page shows a score.
        poses: Poses of all its frames, or of some.
        limit: Largest size of the page (bytes).
        on_frame: Called with the number of frames whose silhouettes are done.

    Returns:
        The size of the page (bytes).

    Raises:
        ValueError: Poses of another recording, or poses that exceed the limit even without silhouettes.
    """
    rows = recording_rows(recording, poses)
    truth = None if recording.truth is None else recording.truth[rows]
    if truth is not None and not np.isfinite(truth.joints).all(axis=(1, 2)).any():
        truth = None
    scored = None
    # Truth of a template without any joint of the same name says nothing of these poses.
    if truth is not None and set(truth.template.joint_names) & set(poses.template.joint_names):
        scored = score_poses(poses, truth.joints, truth.template)

    def page(overlays: Overlays) -> bytes:
        numbers = page_numbers(recording, poses, truth, overlays)
        return make_page(numbers, recording, poses, scored).encode()

    points = body_points(poses)
    without = len(page(make_overlays(recording, rows[:0], points[:0], 0)))
    if without > limit:
        raise ValueError(
            f"report: {len(poses)} frames take {without / 1e6:.2g} MB without any silhouette, more than the limit of "
            f"{limit / 1e6:g} MB; raise the limit, or give poses of fewer frames"
        )
    # Reserve some bytes for the digits of the stride and the number of frames.
    content = page(make_overlays(recording, rows, points, limit - without - 64, on_frame))
    with written_whole(Path(path)) as file:
        file.write(content)
    return len(content)


def make_page(numbers: dict[str, Any], recording: Recording, poses: Poses, scored: Score | None) -> str:
    """The page as text."""
    return filled(
        "page.html", _SCRIPTS, recording.name, numbers,
        facts=facts(recording, poses), bones=bone_lengths(poses, recording.skeleton), varying=varying_bones(poses),
        score=score_tables(scored),
    )  # fmt: skip
