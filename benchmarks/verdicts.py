"""Verdicts of `jaxskel check` on recordings as they are, and with faults added in many ways.

python benchmarks/verdicts.py FILES... [--spoilt]

Prints a line for each: misfit, severity, views and cause. Without `--spoilt` the recordings are assumed to be good: the
exit code is 1 if one of them is judged hopeless. With it, faults are added in turn to a view in the middle of the rig
(or to all views), and the script counts how many are found with the right view and cause.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import equinox as eqx
import numpy as np

from jaxskel import Recording, pack_silhouettes, unpack_silhouettes
from jaxskel.io.recordings import read_recording
from jaxskel.verdict import Verdict, judge

# Number of frames used of a film, because the script holds all of them in memory, unpacked.
_FRAMES = 40


def main() -> None:
    """Judge the files that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--spoilt", action="store_true", help="spoil each in turn")
    given = parser.parse_args()
    refused, found, spoilt = 0, 0, 0
    for path in given.files:
        recording = read_recording(path)
        if not given.spoilt:
            start = time.perf_counter()
            verdict = judge(recording, thorough=True)
            refused += verdict.is_hopeless
            print(f"{path.name:28} {told(verdict)} ({time.perf_counter() - start:.1f} s)", flush=True)
            continue
        start = max(0, (len(recording) - _FRAMES) // 2)
        recording = recording[start : start + _FRAMES]
        guilty = len(recording.cameras) // 2
        for kind, (spoil, word, names_view) in spoils(recording, guilty).items():
            verdict = judge(spoil(recording), thorough=True)
            right = any(
                word in finding.told and (not names_view or recording.cameras.names[guilty] in finding.views)
                for finding in verdict.findings
            )
            found, spoilt = found + right, spoilt + 1
            print(f"{path.name:28} {kind:18} {'found' if right else 'MISSED':7} {told(verdict)}", flush=True)
    if given.spoilt:
        print(f"{found} of {spoilt} found with their cause")
    else:
        print(f"{refused} of {len(given.files)} refused")
    sys.exit(1 if refused else 0)


def told(verdict: Verdict) -> str:
    """Misfit, and the first finding in short."""
    misfit = float("nan") if verdict.misfit is None else 1e3 * float(np.nanmean(verdict.misfit))
    if not verdict.findings:
        return f"{misfit:5.1f} mm good"
    worst = verdict.findings[0]
    return f"{misfit:5.1f} mm {worst.severity.name} {','.join(worst.views)}: {worst.told[:90]}"


Spoil = tuple[Callable[[Recording], Recording], str, bool]


def spoils(recording: Recording, guilty: int) -> dict[str, Spoil]:
    """The faults to add: a function, a word of the cause, and whether the guilty view must be named."""
    height = int(recording.cameras.size[guilty, 1])
    other = next(
        (c for c in range(len(recording.cameras))
         if c != guilty and (recording.cameras.size[c] == recording.cameras.size[guilty]).all()), None,
    )  # fmt: skip
    cameras = recording.cameras
    found: dict[str, Spoil] = {
        "turned": (lambda r: _view(r, guilty, lambda m: m[:, ::-1, ::-1]), "180", True),
        "mirrored": (lambda r: _view(r, guilty, lambda m: m[:, :, ::-1]), "mirrored", True),
        "inverted": (lambda r: _view(r, guilty, lambda m: ~m), "inverted", True),
        "out of step by 3": (lambda r: _late(r, guilty, 3), "3 frames too late", True),
        "resized to 3/4": (lambda r: _view(r, guilty, lambda m: _moved(m, 0, 0.75)), "resized", True),
        "cut at the top": (lambda r: _view(r, guilty, lambda m: _moved(m, -round(height / 18), 1)), "cut", True),
        "bumped by 3 down": (lambda r: _turned(r, guilty, (3.0, 0.0, 0.0)), "moved", True),
        "bumped by 3 across": (lambda r: _turned(r, guilty, (0.0, 3.0, 0.0)), "moved", True),
        "all turned": (lambda r: _all(r, lambda m: m[:, ::-1, ::-1]), "180", False),
        "all mirrored": (lambda r: _all(r, lambda m: m[:, :, ::-1]), "mirrored", False),
        "centimetres": (lambda r: replace(r, cameras=replace(cameras, t=100 * np.asarray(cameras.t))), "unit", False),
        "wrong up": (lambda r: replace(r, up=("-" if r.up[0] == "+" else "+") + r.up[1]), "up is", False),
    }
    if other is not None:
        found["exchanged"] = (lambda r: _exchanged(r, guilty, other), "exchanged", True)
    return found


def _masks(recording: Recording) -> np.ndarray:
    return np.array(unpack_silhouettes(np.asarray(recording.silhouettes[:]), 8 * recording.silhouettes.shape[3]))


def _with(recording: Recording, masks: np.ndarray) -> Recording:
    return eqx.tree_at(lambda r: r.silhouettes, recording, pack_silhouettes(masks))


def _view(recording: Recording, view: int, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    masks = _masks(recording)
    width, height = recording.cameras.size[view]
    masks[:, view, :height, :width] = change(masks[:, view, :height, :width].copy())
    return _with(recording, masks)


def _all(recording: Recording, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    for view in range(len(recording.cameras)):
        recording = _view(recording, view, change)
    return recording


def _late(recording: Recording, view: int, frames: int) -> Recording:
    masks = _masks(recording)
    masks[frames:, view] = masks[:-frames, view].copy()
    return _with(recording, masks)


def _exchanged(recording: Recording, one: int, two: int) -> Recording:
    masks = _masks(recording)
    masks[:, [one, two]] = masks[:, [two, one]]
    return _with(recording, masks)


def _moved(masks: np.ndarray, down: int, scale: float) -> np.ndarray:
    matrix = np.array([[scale, 0, 0], [0, scale, down]], float)
    size = masks.shape[2], masks.shape[1]
    return np.stack([cv2.warpAffine(mask.astype(np.uint8), matrix, size) > 0 for mask in masks])


def _turned(recording: Recording, view: int, degrees: tuple[float, float, float]) -> Recording:
    R, t = np.array(recording.cameras.R), np.array(recording.cameras.t)
    turn = cv2.Rodrigues(np.radians(degrees))[0]
    R[view], t[view] = turn @ R[view], turn @ t[view]
    return replace(recording, cameras=replace(recording.cameras, R=R, t=t))


if __name__ == "__main__":
    main()
