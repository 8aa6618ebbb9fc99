"""Results of presets on sequence files, stored on disk, so that an interrupted benchmark can be resumed."""

import hashlib
import json
import time
import zipfile
from pathlib import Path

import equinox as eqx
import numpy as np
from _condition import Condition
from jaxtyping import Bool, Float, Int

from jaxskel import Recording, Settings, join_poses, prepare, reconstruct_batches
from jaxskel._runtime.atomic_files import written_whole
from jaxskel._runtime.compile_cache import digest_of_code
from jaxskel.io.files import read_arrays
from jaxskel.poses import Score, score

_NEWS_EVERY = 30.0
"""Seconds between two lines of progress: short runs print none, and the log of a whole night stays readable."""


CODE = digest_of_code()[:12]
"""Digest of the package's source, computed at the start, because it may be edited while a benchmark runs."""


class Run(eqx.Module):
    """The poses of one sequence file by one preset beside the truth, in the recording's world."""

    joints: Float[np.ndarray, "frames joints=15 3"]
    """Estimated joints (m); NaN in a frame without a pose."""
    truth: Float[np.ndarray, "frames joints=15 3"]
    """True joints (m); NaN where they are not known."""
    has_pose: Bool[np.ndarray, " frames"]
    frame_index: Int[np.ndarray, " frames"]
    """Number of each frame in the material."""
    code: str
    """The `CODE` of the version that reconstructed it."""


def reconstruct_run(recording: Recording, settings: Settings, label: str) -> Run:
    """Reconstruct a recording with a truth, printing progress at intervals."""
    if recording.truth is None:
        raise ValueError(f"{recording.name}: key 'joints': there is no ground truth to score against")
    prepared = prepare(recording, settings)
    parts, done = [], 0
    start = first = told = time.perf_counter()
    for part in reconstruct_batches(recording, settings, prepared):
        parts.append(part)
        done += len(part)
        now = time.perf_counter()
        if len(parts) == 1:
            first = told = now  # the first batch compiles, so it does not show the speed of the others
        elif now - told > _NEWS_EVERY:
            told, rate = now, (done - len(parts[0])) / (now - first)
            left = (len(recording) - done) / rate / 60
            print(f"  {label}: {done} of {len(recording)} frames, {rate:.1f} frames/s, {left:.1f} min left", flush=True)
    poses, seconds = join_poses(parts), time.perf_counter() - start
    print(f"{label}: {len(poses)} frames in {seconds:.0f} s", flush=True)
    return Run(poses.joints, recording.truth.joints, poses.has_pose, poses.frame_index, CODE)


def score_run(run: Run) -> Score:
    """Score a run against its truth."""
    return score(run.joints.astype(np.float64), run.truth.astype(np.float64), run.has_pose)


def made_from(sequence: Path, condition: Condition, settings: Settings) -> dict[str, str]:
    """Everything a run is made from. Runs of one file name that differ in it must not be mixed in a table."""
    try:
        with zipfile.ZipFile(sequence) as archive:  # checksums of the arrays, without reading them
            arrays = sorted((info.filename, info.file_size, info.CRC) for info in archive.infolist())
    except (OSError, zipfile.BadZipFile) as error:
        raise ValueError(f"{sequence}: cannot be read ({error}); give a sequence file (.npz)") from None
    return {
        "sequence": hashlib.sha256(repr(arrays).encode()).hexdigest(),
        "condition": str(condition),
        "settings": eqx.tree_pformat(settings, short_arrays=False),
    }


def write_run(path: Path, run: Run, source: dict[str, str]) -> None:
    """Store a run and what it was `made_from`; an interrupted write leaves no file behind."""
    with written_whole(path) as file:
        np.savez_compressed(
            file, joints=run.joints, truth=run.truth, has_pose=run.has_pose, frame_index=run.frame_index,
            code=run.code, made_from=json.dumps(source),
        )  # fmt: skip


def read_run(path: Path, source: dict[str, str]) -> Run:
    """Read a run back.

    Raises:
        ValueError: It was not made from `source`, or the file is damaged.
    """
    arrays = read_arrays(path, ("joints", "truth", "has_pose", "frame_index", "code", "made_from"), ())
    kept = json.loads(str(arrays["made_from"]))
    other = [key for key in source if kept.get(key) != source[key]]
    if other:
        raise ValueError(f"{path}: was made with another {' and '.join(other)}; delete it or give another --output")
    return Run(
        arrays["joints"], arrays["truth"], arrays["has_pose"], arrays["frame_index"].astype(np.int64),
        str(arrays["code"]),
    )  # fmt: skip
