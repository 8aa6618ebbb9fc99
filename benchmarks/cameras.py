"""Extrinsics from silhouettes alone: are wrong cameras corrected?

    python benchmarks/cameras.py SEQUENCE.npz ... [--seeds 3]
    python benchmarks/cameras.py FOLDER

A sequence file's calibration is the truth. For each seed every camera is rotated by half a degree about a random axis
and moved by 10 mm in a random direction. Prints the angle of each camera to its truth before and after refinement,
with the rigs aligned by the best similarity.

A folder holds `calibration.npz` (K, R, t; `R_refined`, `t_refined` if there are better ones to compare with) and one or
more `masks_*.npz` (for each camera NAME its packed masks and NAME_shape: frames, height, width). Cameras are refined on
frames of the first of these. Prints how well hull and silhouettes agree in frames that were not used: see
`drawn_agreement`.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Int

from jaxskel import Cameras, Recording, make_cameras, read_recording, refine_cameras, unpack_silhouettes
from jaxskel.cameras import compare_rigs, project
from jaxskel.hull import carve, place_grid, projection_table
from jaxskel.recording import find_empty_views, silhouette_areas

TURN, SHIFT = np.radians(0.5), 0.010  # rad, m
_SPACING = 0.017
"""Edge of a voxel (m) for `drawn_agreement`."""
_HELD_OUT = 12
"""Number of frames compared, spread over those that were not used."""


def perturbed(cameras: Cameras, seed: int, turn: float = TURN, shift: float = SHIFT) -> Cameras:
    """Every camera turned about a random axis (rad) and moved in a random direction (m)."""
    rng = np.random.default_rng(seed)
    axes, ways = rng.normal(size=(2, len(cameras), 3))
    axes, ways = (a / np.linalg.norm(a, axis=1, keepdims=True) for a in (axes, ways))
    turns = np.stack([cv2.Rodrigues(turn * axis)[0] for axis in axes])
    R = turns @ np.asarray(cameras.R)
    t = -np.einsum("cij,cj->ci", R, cameras.centres + shift * ways)
    return make_cameras(cameras.K, R, t, cameras.size, cameras.dist, cameras.names, cameras.are_fisheye)


def drawn_agreement(recording: Recording, frames: Int[np.ndarray, " some"]) -> float:
    """Agreement of hulls and silhouettes: intersection over union, the mean over frames and views.

    The hull is carved from all views in voxels of 17 mm. The centres of its voxels are drawn into each view, and gaps
    are closed by a square of twice a voxel's size in that view. The drawing lacks half a voxel all around, so that even
    a perfect rig stays below 1.
    """
    cameras, silhouettes = recording.cameras, np.asarray(recording.silhouettes[frames])
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    grid = place_grid(cameras, silhouettes, empty_views, _SPACING, 3)
    if grid is None:
        return 0.0
    height, width = silhouettes.shape[2], 8 * silhouettes.shape[3]
    hulls = carve(silhouettes, projection_table(cameras, grid, height, width, 3), empty_views)
    found = []
    for frame, view in zip(*np.nonzero(~empty_views), strict=True):
        mask = unpack_silhouettes(silhouettes[frame, view], width)
        u, v, depth = (a[0] for a in project(cameras[[int(view)]], hulls.centres[hulls.inside[frame]]))
        drawn = np.zeros((height, width), np.uint8)
        # NaN, behind a camera, compares false.
        seen = (u > -0.5) & (v > -0.5) & (u < width - 0.5) & (v < height - 0.5)
        drawn[np.floor(v[seen] + 0.5).astype(int), np.floor(u[seen] + 0.5).astype(int)] = 1
        side = int(np.ceil(2 * cameras.K[view, 0, 0] * _SPACING / np.median(depth))) | 1
        hull = cv2.morphologyEx(drawn, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8)).view(bool)
        found.append((hull & mask).sum() / (hull | mask).sum())
    return float(np.mean(found))


def read_folder(folder: Path) -> tuple[dict[str, Recording], Cameras | None]:
    """The recordings of a folder by name, and its refined cameras, if it has any."""
    calibration = np.load(folder / "calibration.npz")
    recordings, better = {}, None
    for path in sorted(folder.glob("masks_*.npz")):
        masks = np.load(path)
        names = sorted(name for name in masks.files if not name.endswith("_shape"))
        sizes = np.array([masks[f"{name}_shape"][[2, 1]] for name in names])
        frames, (width, height) = len(masks[names[0]]), sizes.max(0)
        silhouettes = np.zeros((frames, len(names), height, -(-width // 8)), np.uint8)
        for view, name in enumerate(names):
            packed = masks[name]
            silhouettes[:, view, : packed.shape[1], : packed.shape[2]] = packed
        cameras = make_cameras(calibration["K"], calibration["R"], calibration["t"], sizes, names=names)
        name = path.stem.removeprefix("masks_")
        recordings[name] = Recording(cameras, silhouettes, 60.0, "+Z", np.arange(frames), name=name)
        if "R_refined" in calibration.files:
            R, t = calibration["R_refined"], calibration["t_refined"]
            better = make_cameras(calibration["K"], R, t, sizes, names=names)
    if not recordings:
        raise ValueError(f"{folder}: there is no masks_*.npz; give a folder with calibration.npz and masks")
    return recordings, better


def print_folder(folder: Path) -> None:
    recordings, better = read_folder(folder)
    first = next(iter(recordings.values()))
    refined = refine_cameras(first)
    rigs = {"given": first.cameras, "refined": refined.cameras}
    if better is not None:
        rigs["R_refined"] = better
    turned = " ".join(f"{angle:.2f}" for angle in np.degrees(np.linalg.norm(refined.rotation, axis=1)))
    moved = " ".join(f"{1e3 * way:.0f}" for way in np.linalg.norm(refined.shift, axis=1))
    print(f"{folder.name}: turned by {turned} degrees, moved by {moved} mm; converged: {refined.converged}")
    for label, recording in recordings.items():
        held = np.arange(len(recording))
        if recording is first:
            held = np.setdiff1d(held, refined.frames)
        held = held[np.unique(np.linspace(0, len(held) - 1, _HELD_OUT).astype(int))]
        # Images of another take may be wider.
        agreements = {
            name: drawn_agreement(replace(recording, cameras=replace(rig, size=recording.cameras.size)), held)
            for name, rig in rigs.items()
        }
        shown = ", ".join(f"{name} {value:.3f}" for name, value in agreements.items())
        print(f"  {label}, {len(held)} frames that were not used: {shown}", flush=True)


def print_sequence(path: Path, seeds: int) -> None:
    recording = read_recording(path)
    for seed in range(seeds):
        wrong = perturbed(recording.cameras, seed)
        refined = refine_cameras(replace(recording, cameras=wrong))
        cells = [path.stem, str(seed)]
        for rig in (wrong, refined.cameras):
            apart = compare_rigs(rig, recording.cameras)
            angles = np.degrees(apart.angles)
            cells += [f"{angles.mean():.3f}", f"{angles.max():.3f}", f"{1e3 * apart.distances.mean():.1f}"]
        cells += [f"{np.nanmean(refined.before):.2f}", f"{np.nanmean(refined.after):.2f}", str(refined.converged)]
        print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, metavar="SEQUENCE.npz|FOLDER")
    parser.add_argument("--seeds", type=int, default=3, help="how often a sequence file's cameras are put wrong")
    arguments = parser.parse_args()
    folders = [path for path in arguments.recordings if path.is_dir()]
    sequences = [path for path in arguments.recordings if not path.is_dir()]
    for folder in folders:
        print_folder(folder)
    if sequences:
        heads = ["sequence", "seed"]
        heads += [f"{when}: {what}" for when in ("before", "after") for what in ("mean °", "largest °", "centres mm")]
        heads += ["missed px", "after", "converged"]
        print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for path in sequences:
        print_sequence(path, arguments.seeds)


if __name__ == "__main__":
    main()
