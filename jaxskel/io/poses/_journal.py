"""Poses while they are made: a file that grows by one record a frame.

`poses.live` has a line that says what it is, a line of JSON with ``fps``, ``up`` and, if it is not the paper's human,
``template``, and then records of one size, see `_record`. Each frame's record is handed to the system at once, so a
killed process loses no more than the frame that it was writing. A record that was cut off at the end is left out.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...body import HUMAN_15, SkeletonTemplate
from ...poses import STATUS_NAMES, WITH_POSE, Poses, Status
from ..files import fault, open_regular
from ..recordings import template_arrays, template_of

JOURNAL_FILE = "poses.live"
"""Name of the journal in a folder of results."""

_FIRST_LINE = b"jaxskel journal of poses 1\n"
_MOST_HEADER = 1_000_000  # bytes
# Largest number of frames between the records, for each record and in all: an hour at 60 frames per second.
_MOST_MISSING = 20, 216_000
# Confidence of the sides where nothing was seen.
_NO_SIDES = 0.5


class PosesJournal:
    """A new journal, to which frames are added as they come.

    Args:
        path: The file, which must not exist yet.
        fps: Frames per second of the numbers in `frame_index`.
        up: World axis that points up.
        template: What the skeleton of all frames consists of.

    Raises:
        OSError: The file exists, or cannot be written.
    """

    def __init__(self, path: Path, fps: float, up: str, template: SkeletonTemplate = HUMAN_15):
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._file = open(path, "xb", buffering=0)
        self._record = _record(template)
        header = {"fps": fps, "up": up, **template_arrays(template)}
        self._write(_FIRST_LINE + json.dumps(header).encode() + b"\n")

    def append(self, poses: Poses) -> None:
        """Add frames; each number in `frame_index` must be greater than the one before.

        Raises:
            OSError: The disk is full, for instance.
        """
        records = np.zeros(len(poses), self._record)
        for key in ("rotations", "sigma", "rest_joints", "rest_tips", "stature_sigma"):
            records[key] = np.nan
        for field, values in (
            ("frame_index", poses.frame_index), ("status", poses.status), ("confidence", poses.confidence),
            ("side_confidence", poses.side_confidence), ("joints", poses.joints), ("tips", poses.tips),
            ("rotations", poses.rotations), ("sigma", poses.covariance), ("stature_sigma", poses.stature_deviation),
        ):  # fmt: skip
            if values is not None:
                records[field] = values
        if poses.skeleton is not None:
            records["rest_joints"], records["rest_tips"] = poses.skeleton.rest_joints, poses.skeleton.rest_tips
        self._write(records.tobytes())

    def close(self) -> None:
        """Close the file, which stays."""
        self._file.close()

    def _write(self, record: bytes) -> None:
        left = memoryview(record)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise OSError(error.errno, f"cannot be written ({error.strerror})", str(self.path)) from error


def journal_arrays(path: Path) -> dict[str, Any]:
    """The arrays that `poses.npz` has, from a journal. A number without a record is a frame without images: EMPTY.

    The template is the last one: a live recording finds better and better dimensions of an unknown subject.

    Raises:
        ValueError: One line that names the file, if it is no journal, is damaged, or holds no frame.
    """
    with open_regular(path) as file:
        first, header = file.readline(len(_FIRST_LINE)), file.readline(_MOST_HEADER)
        if first != _FIRST_LINE:
            raise fault(path, None, "is no journal of poses that this version can read")
        content = file.read()
    fps, up, template = _read_header(path, header)
    record = _record(template)
    records = np.frombuffer(content, record, len(content) // record.itemsize)
    if not len(records):
        raise fault(path, None, "holds no frame: `jaxskel live` was ended before the first one")
    rows = records["frame_index"] - records["frame_index"][0]
    per_record, in_all = _MOST_MISSING
    if (np.diff(rows) <= 0).any() or not rows[-1] < per_record * len(rows) + in_all:
        raise fault(path, "frame_index", "does not ascend from record to record; the file is damaged")
    arrays: dict[str, Any] = {
        "fps": np.array(fps), "up": np.array(up), "frame_index": records["frame_index"][0] + np.arange(rows[-1] + 1)
    }  # fmt: skip
    arrays |= {key: np.array(text) for key, text in template_arrays(template).items()}
    status = records["status"]
    posed = (status >= 0) & (status < len(STATUS_NAMES)) & np.isin(status, WITH_POSE)
    known = records[posed] if posed.any() else records
    for key, missing in (
        ("status", Status.EMPTY), ("side_confidence", _NO_SIDES), ("confidence", 0.0), ("joints", np.nan),
        ("tips", np.nan), ("rotations", np.nan), ("sigma", np.nan),
    ):  # fmt: skip
        # Not all settings give rotations and covariances.
        if key in ("rotations", "sigma") and np.isnan(known[key]).any():
            continue
        values = np.full((len(arrays["frame_index"]), *records[key].shape[1:]), missing, records[key].dtype)
        values[rows] = records[key]
        arrays[key] = values
    last = known[-1]
    if "rotations" in arrays:
        arrays |= {key: last[key] for key in ("rest_joints", "rest_tips")}
    if math.isfinite(last["stature_sigma"]):
        arrays["stature_sigma"] = np.array(last["stature_sigma"])
    return arrays


def _record(template: SkeletonTemplate) -> np.dtype:
    """What is written of each frame."""
    joints, tips, segments = len(template.joint_names), len(template.tip_names), len(template.segment_names)
    return np.dtype(
        [
            ("frame_index", "<i8"), ("status", "<i8"), ("side_confidence", "<f4"), ("confidence", "<f4", (joints,)),
            ("joints", "<f4", (joints, 3)), ("tips", "<f4", (tips, 3)), ("rotations", "<f4", (segments, 3, 3)),
            ("sigma", "<f4", (joints, 3, 3)), ("rest_joints", "<f8", (joints, 3)), ("rest_tips", "<f8", (tips, 3)),
            ("stature_sigma", "<f4"),
        ]
    )  # fmt: skip


def _read_header(path: Path, line: bytes) -> tuple[float, str, SkeletonTemplate]:
    try:
        header = json.loads(line)
        fps, up = float(header["fps"]), str(header["up"])
        named = {"template": np.array(str(header["template"]))} if "template" in header else {}
    except (ValueError, KeyError, TypeError):
        raise fault(path, None, "has a damaged header; its frame rate is lost") from None
    return fps, up, template_of(path, named)
