"""Writes the report as one HTML file of limited size: numbers, tables, scripts and style."""

from collections.abc import Callable, Mapping
from pathlib import Path

from ..._runtime.atomic_files import written_whole
from ...poses import Poses
from ...recording import Recording
from ._one import content_of_one
from ._overlays import Overlays, make_overlays
from ._people import content_of_people

LIMIT = 15_000_000
"""Largest size of a page (bytes), so that it can still be sent by mail."""


def write_report(
    path: str | Path,
    recording: Recording,
    poses: Poses | Mapping[str, Poses],
    limit: int = LIMIT,
    on_frame: Callable[[int], None] | None = None,
) -> int:
    """Write one HTML page that shows poses in 3D, over the silhouettes, and their confidence over time.

    The page loads nothing else. Silhouettes are read one frame at a time. If all frames would make the page larger than
    the limit, the views show only every second, fourth, ... frame, and the page says so.

    Args:
        path: The file.
        recording: Recording that the poses were made from. If it has ground truth, the page shows a score.
        poses: Poses of all its frames, or of some; of several people, poses by name, of the same frames. Of these the
            page shows no score.
        limit: Largest size of the page (bytes).
        on_frame: Called with the number of frames whose silhouettes are done.

    Returns:
        The size of the page (bytes).

    Raises:
        ValueError: Poses of another recording, or poses that exceed the limit even without silhouettes.
    """
    content = content_of_people(recording, poses) if isinstance(poses, Mapping) else content_of_one(recording, poses)
    rows, bodies = content.rows, content.bodies

    def page(overlays: Overlays) -> bytes:
        return content.page(overlays).encode()

    without = len(page(make_overlays(recording, rows[:0], bodies[:, :0], 0)))
    if without > limit:
        raise ValueError(
            f"report: {len(rows)} frames take {without / 1e6:.2g} MB without any silhouette, more than the limit of "
            f"{limit / 1e6:g} MB; raise the limit, or give poses of fewer frames"
        )
    # Reserve some bytes for the digits of the stride and the number of frames.
    written = page(make_overlays(recording, rows, bodies, limit - without - 64, on_frame))
    with written_whole(Path(path)) as file:
        file.write(written)
    return len(written)
