"""Cameras that are running, described by a `recording.toml` as a recording is.

[views.cam01]
images = "rtsp://10.0.0.5/stream"   # an address, the number of a camera at this machine (0 is the first), or a device
plate = "empty01.png"               # or backdrop = true; or backdrop = [red, green, blue]

If one view is a camera, videos of other views are played at their own rate beside it. All views are colour images with
a background, which must be known before: a plate, or a backdrop.
"""

import reprlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...recording import Recording
from ..files import fault, named_path
from ..views import Camera, View, is_camera
from ._folders import RECORDING_FILE, described_rig, described_views, read_table
from ._view_table import text

# What a view of files may have, with the reason why one of a camera does not.
_REFUSED = {
    "masks": "a camera gives colour images: give images and a background",
    "median": 'is known only after the recording; film the empty room, plate = "empty.mp4"',
    "offset": "cameras are read as they run; leave it out",
    "fps": "cameras are read as they run; leave it out",
}


@dataclass(frozen=True)
class Rig:
    """Cameras that are open, and what is known about them.

    Attributes:
        facts: Calibration, up axis, frame rate and subject: a recording without frames.
        views: The cameras: the `frames` of each are a `Camera`.
    """

    facts: Recording
    views: tuple[View, ...]


def has_cameras(path: Path) -> bool:
    """Whether a recording's views are cameras, at least one of them. False if it cannot be read."""
    file = path / RECORDING_FILE if path.is_dir() else path
    if file.name != RECORDING_FILE or not file.is_file():
        return False
    try:
        views = read_table(file).get("views")
    except ValueError:
        return False
    tables = views.values() if isinstance(views, dict) else ()
    return any(isinstance(view, dict) and is_camera(view.get("images")) for view in tables)


def read_rig(path: Path) -> Rig:
    """Open the cameras of a `recording.toml`.

    Args:
        path: The file, or its folder.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    file = path / RECORDING_FILE if path.is_dir() else path
    table = read_table(file)
    if "frames" in table:
        raise fault(file, "frames", "cameras have no first and last frame; leave it out")
    for name, view in table["views"].items():
        for key in view:
            if key in _REFUSED:
                raise fault(file, f"views.{name}.{key}", _REFUSED[key])
    views = described_views(file, table, _open_camera)
    return Rig(described_rig(file, table, views), tuple(views))


def _open_camera(file: Path, key: str, value: Any) -> Camera:
    """A camera, or a video that is played beside cameras."""
    try:
        return Camera(value if is_camera(value) else named_path(file.parent, text(file, key, value)))
    except ValueError as error:
        raise fault(file, key, f"{reprlib.repr(value)} {error}" if is_camera(value) else str(error)) from None
