"""Shows the view in a window, or saves it to a file."""

import os
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from ..._runtime.atomic_files import check_replaceable
from ..._runtime.plain_text import plain
from ...pipeline import Settings
from ...poses import Poses
from ...recording import Recording
from ._blueprint import blueprint
from ._log import check_shown, log_recording
from ._rerun import rr

_APPLICATION = "jaxskel"


def save_view(
    path: str | Path,
    recording: Recording,
    poses: Poses | Mapping[str, Poses] | None = None,
    settings: Settings | None = None,
    frames: slice = slice(None),
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Write the view to a file, for ``rerun FILE.rrd`` to open, without opening a window; see `log_recording`.

    Returns:
        The number of frames written.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
    """
    path = Path(path)
    check_shown(recording, poses, frames)
    check_replaceable(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # rerun opens its file by name and extends it frame by frame; the final file only appears once it is complete.
    with tempfile.TemporaryDirectory(prefix=f".{path.name[:40]}.", dir=path.parent) as folder:
        unfinished = Path(folder) / "view.rrd"
        stream = rr.RecordingStream(_APPLICATION)
        stream.save(unfinished, default_blueprint=blueprint(recording, poses is not None))
        stream.send_recording_name(plain(recording.name))
        try:
            count = log_recording(stream, recording, poses, settings, frames, on_frame)
        finally:
            stream.disconnect()  # flushes and closes the file
        os.replace(unfinished, path)
    return count


def show_view(
    recording: Recording,
    poses: Poses | Mapping[str, Poses] | None = None,
    settings: Settings | None = None,
    frames: slice = slice(None),
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Open the viewer, or use one that is already open, and show the view; see `log_recording`.

    The window stays open when Python ends.

    Returns:
        The number of frames shown.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
        OSError: There is no display.
    """
    check_shown(recording, poses, frames)
    if not has_display():
        raise OSError("there is no display to show the view on; save it, and open the file where there is one")
    stream = rr.RecordingStream(_APPLICATION)
    stream.spawn(default_blueprint=blueprint(recording, poses is not None))
    stream.send_recording_name(plain(recording.name))
    try:
        return log_recording(stream, recording, poses, settings, frames, on_frame)
    finally:
        stream.disconnect()


def has_display() -> bool:
    """Whether a window can be opened; only on Linux may there be no display."""
    return not sys.platform.startswith("linux") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
