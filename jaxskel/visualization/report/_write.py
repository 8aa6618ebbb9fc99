"""The page as a file: numbers, tables, scripts and style in one, within a limit of bytes."""

import base64
import hashlib
import json
from collections.abc import Callable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..._runtime.atomic_files import written_whole
from ..._runtime.plain_text import plain
from ...poses import Poses, Score, score
from ...recording import Recording, Truth, recording_rows
from ._numbers import body_points, page_numbers
from ._overlays import Overlays, make_overlays
from ._tables import bone_lengths, facts, score_tables

LIMIT = 15_000_000
"""Greatest size of a page (bytes): it still goes by mail."""

# In the order in which they need each other.
_SCRIPTS = ("data.js", "orbit.js", "scene.js", "views.js", "charts.js", "player.js")


def write_report(
    path: str | Path,
    recording: Recording,
    poses: Poses,
    limit: int = LIMIT,
    on_frame: Callable[[int], None] | None = None,
) -> int:
    """Write one HTML page that shows poses in 3D, over the silhouettes, and their confidence over time.

    The page asks for nothing outside itself. Silhouettes are read a frame at a time. Where all frames would make
    the page larger than the limit, the views show every second, fourth, ... frame only, and the page says so.

    Args:
        path: The file.
        recording: What the poses were made from. With a ground truth, the page has a score.
        poses: Poses of all its frames, or of some.
        limit: Greatest size of the page (bytes).
        on_frame: Called with the number of frames whose silhouettes are done.

    Returns:
        The size of the page (bytes).

    Raises:
        ValueError: Poses of another recording, or poses that do not fit into the limit even without silhouettes.
    """
    rows = recording_rows(recording, poses)
    truth = None
    if recording.truth is not None and np.isfinite(recording.truth.joints[rows]).all(axis=(1, 2)).any():
        tips = recording.truth.tips
        truth = Truth(recording.truth.joints[rows], None if tips is None else tips[rows])
    scored = None if truth is None else score(poses.joints.astype(np.float64), truth.joints, poses.has_pose)

    def page(overlays: Overlays) -> bytes:
        numbers = page_numbers(recording, poses, truth, overlays)
        return make_page(numbers, recording, poses, scored).encode()

    points = body_points(poses.joints, poses.tips)
    without = len(page(make_overlays(recording, rows[:0], points[:0], 0)))
    if without > limit:
        raise ValueError(
            f"report: {len(poses)} frames take {without / 1e6:.2g} MB without any silhouette, more than the limit of "
            f"{limit / 1e6:g} MB; raise the limit, or give poses of fewer frames"
        )
    # The numbers of frames shown and their stride have some digits.
    content = page(make_overlays(recording, rows, points, limit - without - 64, on_frame))
    with written_whole(Path(path)) as file:
        file.write(content)
    return len(content)


def make_page(numbers: dict[str, Any], recording: Recording, poses: Poses, scored: Score | None) -> str:
    """The page as text. Its policy allows its own script and style by their hashes, and nothing else."""
    parts = files("jaxskel.visualization.report")
    script = "\n".join(parts.joinpath(name).read_text("utf-8") for name in _SCRIPTS)
    style = parts.joinpath("style.css").read_text("utf-8")
    # In JSON, "<" stands in texts only; escaped, no name can end the script that holds it.
    data = json.dumps(numbers, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return Template(parts.joinpath("page.html").read_text("utf-8")).substitute(
        title=escape(plain(recording.name)), script=script, style=style, data=data,
        script_hash=_hash(script), style_hash=_hash(style),
        facts=facts(recording, poses), bones=bone_lengths(poses, recording.skeleton), score=score_tables(scored),
    )  # fmt: skip


def _hash(text: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii") + "'"
