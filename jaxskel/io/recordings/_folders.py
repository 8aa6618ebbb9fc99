"""Recordings as folders: a calibration, a view for each camera, and a `recording.toml` that connects them.

fps = 60.0
calibration = "Calib_qualisys.toml"
up = "+Z"                        # if the calibration does not say it
unit = 0.001                     # metres per unit of the calibration, if it is not the usual one
frames = [0, 99]                 # first and last frame, if the views do not agree on them
subject = "subject.toml"

[views.cam01]
camera = "cam_01"                # its name in the calibration, if it is another one
turn = 90                        # if the images were turned after the calibration: degrees clockwise
crop = [0, 27]                   # if they were cut: where their first pixel lies in the calibrated image (px)
scale = 0.5                      # if they were scaled: image px for each calibrated px, or [across, down]
calibrated_size = [1088, 1920]   # size of the calibrated images (px), if these were cut at right or bottom only
masks = "masks/cam01"            # folder of images, video, or an archive of arrays, "masks.npz:cam01"
person = [2, 18]                 # values of the masks that are the person, if not all but 0; or colours, [[255, 0, 0]]
# images = "cam01.mp4"           # or, in colour, folder of images or video, with one of these backgrounds:
# plate = "empty01.mp4"          #   the empty scene: image, folder or video
# median = true                  #   what the images show most of the time
# backdrop = true                #   cloth of one colour, or that colour, [red, green, blue]
offset = 3                       # image that belongs to the recording's frame 0, if it is not image 0
fps = 30.0                       # images per second, if they are not those of the recording

[people.anna]                    # if there are several people: a table for each; `read_people` reads them
person = [1]                     # values of all masks, or colours, that are this person; or, where each person has
                                 # masks of their own, {person} stands for the name: masks = "masks/{person}/cam01"
subject = "anna.toml"

[cleaning]                       # of silhouettes in colour images; each is true if it is not here
shadows = true                   # shadows on a plate or median are background
smooth = true                    # single pixels go
largest = true                   # the largest connected part is the person
fill = true                      # slits and small holes are closed

Images are turned first, then cropped, then scaled. A point ``(u, v)`` of the calibrated image after the turn (px, an
integer is the centre of a pixel) lies at ``u' = s (u - x + 0.5) - 0.5``, ``v' = s (v - y + 0.5) - 0.5`` in the image,
with ``crop = [x, y]`` and ``scale = s``. Images that were padded at the left or at the top have a negative crop.
Intrinsics and extrinsics follow, see `ImageChange`. Without any of these keys the sizes must be equal.
``calibrated_size`` alone states that no pixel moved.

Every fault is a `ValueError` of one line that names the file, the key and how to mend it.
"""

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...cameras import Cameras, with_images_changed
from ...recording import UP_AXES, Recording
from ...segmentation import Cleaning
from ..calibrations import contents_of, not_posed, validated
from ..files import check_known, fault, named_path, read_toml
from ..subjects import read_subject
from ..views import Frames, View, ViewSilhouettes
from ._changed_images import calibrated_size, missing_sizes, read_change
from ._sequence_files import sequence_files
from ._view_table import number, rate, read_view, text

RECORDING_FILE = "recording.toml"
SUBJECT_FILE = "subject.toml"
PERSON_PLACE = "{person}"
"""Stands for the name of each of several people in the names of masks."""
# A day of video at 100 frames per second: a larger span of image numbers is a mistake.
_MOST_FRAMES = 10_000_000
KEYS = ("fps", "calibration", "up", "unit", "frames", "subject", "views", "cleaning", "people")


def read_folder(folder: Path, in_memory: int) -> Recording:
    """Read a recording that is a folder with a `recording.toml`.

    Silhouettes are made when they are needed. In a frame without an image of some camera, that view is empty (black).

    Args:
        folder: The folder.
        in_memory: See [`read_recording`][].

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = folder / RECORDING_FILE
    if not path.exists():
        files = sequence_files(folder)
        mend = f"give {files[0]}" if files else f"`jaxskel init {folder}` writes one"
        raise fault(folder, None, f"holds no {RECORDING_FILE}; {mend}")
    table = read_table(path)
    if "people" in table:
        raise fault(path, "people", "are several; read them with read_people, or take `jaxskel run`")
    return described_recording(path, table, described_views(path, table), in_memory)


def read_table(path: Path) -> dict[str, Any]:
    """The content of a `recording.toml`, with known keys only.

    Raises:
        ValueError: One line that names the file, and the key or line.
    """
    return read_toml(path, KEYS, "fps, calibration and views", 'calibration = "calibration.toml"')


def described_views(
    path: Path,
    table: dict[str, Any],
    open_images: Callable[[Path, str, Any], Frames] | None = None,
    may_lack: bool = False,
) -> list[View]:
    """The views that a `recording.toml` names; the file `path` itself need not exist yet.

    `open_images` opens what the key `images` names; masks may lack the values of the person if `may_lack`; see
    `read_view`.

    Raises:
        ValueError: As `read_folder` raises it.
    """
    fps = rate(path, "fps", table.get("fps"), "frames per second")
    cleaning, shadows = _cleaning(path, table)
    return [
        read_view(path, name, view, fps, cleaning, shadows, open_images, may_lack)
        for name, view in _views(path, table).items()
    ]


def described_recording(path: Path, table: dict[str, Any], views: list[View], in_memory: int) -> Recording:
    """The recording of these views, with all other settings of its `recording.toml`.

    Raises:
        ValueError: As `read_folder` raises it.
    """
    rig = described_rig(path, table, views)
    first, last = described_span(path, table, views)
    if last - first >= _MOST_FRAMES:
        raise fault(
            path, "frames", f"{first} to {last} are more than {_MOST_FRAMES} frames; check the numbers in the images' "
            "names and fps, or state fewer",
        )  # fmt: skip
    numbers = np.arange(first, last + 1)
    try:
        silhouettes = ViewSilhouettes(views, numbers, in_memory)
    except OSError as error:
        raise fault(
            path, "frames", f"their silhouettes do not fit on the disk ({error.strerror}); state fewer"
        ) from None
    return replace(rig, silhouettes=silhouettes, frame_index=numbers)


def described_rig(path: Path, table: dict[str, Any], views: list[View]) -> Recording:
    """What is known without looking at the frames of these views: a recording without frames.

    Raises:
        ValueError: As `read_folder` raises it.
    """
    cameras, up, turns = _calibrated(path, table, views)
    subject = table.get("subject", SUBJECT_FILE if (path.parent / SUBJECT_FILE).is_file() else None)
    width, height = cameras.size.max(0).tolist()
    return Recording(
        cameras=cameras,
        silhouettes=np.zeros((0, len(cameras), height, -(-width // 8)), np.uint8),
        fps=rate(path, "fps", table.get("fps"), "frames per second"),
        up=up,
        frame_index=np.arange(0),
        skeleton=None if subject is None else read_subject(_beside(path, "subject", subject)),
        name=path.parent.resolve().name,
        turns=turns,
    )


def _views(path: Path, table: dict[str, Any]) -> dict[str, Mapping[str, Any]]:
    views = table.get("views")
    if not isinstance(views, dict) or not all(isinstance(view, dict) for view in views.values()):
        raise fault(path, "views", 'is missing; give a table for each camera, [views.cam1] with masks = "cam1"')
    if len(views) < 2:
        raise fault(path, "views", f"{len(views)} view; a visual hull needs at least 2")
    return views


def _calibrated(path: Path, table: dict[str, Any], views: list[View]) -> tuple[Cameras, str, np.ndarray]:
    """Cameras with the names, order and image sizes of the views; the up axis; and the turns of the images."""
    source = _beside(path, "calibration", table.get("calibration"))
    unit = number(path, "unit", table["unit"], "metres per unit", 1e-9, 1e3) if "unit" in table else None
    tables = table["views"]
    names = [text(path, f"views.{v.name}.camera", tables[v.name].get("camera", v.name)) for v in views]
    if len(set(names)) < len(names):
        double = next(name for name in names if names.count(name) > 1)
        raise fault(path, "views", f"two views have the camera {double}; give each its own")
    contents = contents_of(source)
    if not contents.entries:
        validated(source, contents, unit, None)  # raises a message that says what is wrong
    entries = {entry.name: entry for entry in contents.entries}
    for name, view in zip(names, views, strict=True):
        if name in contents.unposed:
            raise fault(path, f"views.{view.name}", f"camera {name}: {not_posed(contents.format)}")
        if name not in entries:
            raise fault(
                path, f"views.{view.name}.camera",
                f"{name} is not in {source.name}, which has {', '.join(entries)}; give the one that it is",
            )  # fmt: skip
    wheres = [f"views.{view.name}." for view in views]
    changes = [read_change(path, where, tables[view.name]) for where, view in zip(wheres, views, strict=True)]
    sizes = [
        calibrated_size(path, where, tables[view.name], view.frames.size, entries[name].size, source.name)
        for where, view, name in zip(wheres, views, names, strict=True)
    ]
    calibration = validated(source, contents, unit, missing_sizes(contents, names, sizes))
    known = calibration.cameras.names
    cameras = with_images_changed(
        calibration.cameras[[known.index(name) for name in names]],
        changes,
        sizes,
        np.array([view.frames.size for view in views]),
    )
    cameras = replace(cameras, names=tuple(view.name for view in views))
    up = table.get("up", calibration.up)
    if up not in UP_AXES:
        told = f"{source.name} does not say which axis points up" if up is None else f"is {reprlib.repr(up)}"
        raise fault(path, "up", f"{told}; give one of {', '.join(UP_AXES)}")
    return cameras, up, np.array([change.turn for change in changes])


def described_span(path: Path, table: dict[str, Any], views: list[View]) -> tuple[int, int]:
    """Numbers of the first and the last frame.

    Raises:
        ValueError: As `read_folder` raises it.
    """
    spans = [view.span for view in views]
    common = max(first for first, _ in spans), min(last for _, last in spans)
    if "frames" in table:
        frames = table["frames"]
        if not (isinstance(frames, list) and len(frames) == 2 and all(type(n) is int for n in frames)):
            raise fault(path, "frames", f"is {reprlib.repr(frames)}; give the first and the last, [0, 99]")
        first, last = frames
        lowest, highest = min(first for first, _ in spans), max(last for _, last in spans)
        if not lowest <= first <= last <= highest:
            raise fault(path, "frames", f"is {frames}, but there are images of frames {lowest} to {highest} only")
        return first, last
    for view, span in zip(views, spans, strict=True):
        if span != spans[0]:
            advice = f"state frames = {list(common)}" if common[0] <= common[1] else "check their offsets"
            raise fault(
                path, "frames",
                f"view {views[0].name} has frames {spans[0][0]} to {spans[0][1]}, but {view.name} {span[0]} to "
                f"{span[1]}; {advice}",
            )  # fmt: skip
    return common


def _beside(path: Path, key: str, value: Any) -> Path:
    return named_path(path.parent, text(path, key, value))


def _cleaning(path: Path, table: dict[str, Any]) -> tuple[Cleaning, bool]:
    """How cut-out silhouettes are cleaned, and whether shadows are background."""
    given = table.get("cleaning", {})
    if not isinstance(given, dict):
        raise fault(path, "cleaning", "give a table: a line [cleaning], then lines such as shadows = false")
    for key, value in given.items():
        check_known(path, key, ("shadows", *(field.name for field in fields(Cleaning))), "cleaning.")
        if type(value) is not bool:
            raise fault(path, f"cleaning.{key}", f"is {reprlib.repr(value)}; give true or false")
    return Cleaning(**{k: v for k, v in given.items() if k != "shadows"}), given.get("shadows", True)
