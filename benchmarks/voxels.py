"""Poses from voxels alone: hulls are carved from the silhouettes of sequence files, and the silhouettes are put aside.

    python benchmarks/voxels.py SEQUENCE.npz ... [--cameras 8] [--step 4]

For each file a row for the graph of the voxels, for virtual cameras around them, and for the silhouettes themselves:
frames with a pose, median and 90th percentile of the joints' errors, hands and feet wrong (more than 100 mm off). The
subject's dimensions are not used.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import equinox as eqx
import numpy as np
from accuracy import score_against_truth

from jaxskel import Poses, Recording, paper_settings, prepare, read_recording, reconstruct, reconstruct_hulls
from jaxskel.hull import VoxelGrid, carve
from jaxskel.volumes import VIRTUAL_CAMERAS, virtual_recording


def carved(recording: Recording) -> tuple[np.ndarray, VoxelGrid]:
    """Hulls of all frames as dense voxels."""
    table = prepare(recording, paper_settings()).table
    if table is None:
        raise ValueError(f"{recording.name}: no frame has a hull")
    hulls = carve(recording.silhouettes[:], table)
    return np.stack([hulls.dense(frame) for frame in range(len(hulls))]), table.grid


def ways(recording: Recording, cameras: int) -> Iterator[tuple[str, Poses]]:
    """The poses of each way, by its name."""
    occupied, grid = carved(recording)
    yield "graph", reconstruct_hulls(occupied, grid.origin, grid.spacing)
    virtual = virtual_recording(occupied, grid.origin, grid.spacing, cameras)
    yield f"{cameras} virtual cameras", reconstruct(virtual)
    yield "silhouettes", reconstruct(recording)


def row(poses: Poses, recording: Recording) -> str:
    """The cells of a row."""
    score = score_against_truth(poses, recording)
    wrong = [100 * np.mean([score.wrong(f"{side}_{limb}") for side in "lr"]) / len(score) for limb in ("hand", "foot")]
    lengths = [f"{1e3 * score.percentile(q):.1f} mm" for q in (50, 90)]
    return " | ".join([f"{poses.has_pose.sum()} of {len(poses)}", *lengths, *(f"{share:.1f} %" for share in wrong)])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--cameras", type=int, default=VIRTUAL_CAMERAS, help="number of virtual cameras")
    parser.add_argument("--step", type=int, default=1, help="take every so many frames")
    given = parser.parse_args()
    print("| sequence | from | with a pose | median | 90 % | hands wrong | feet wrong |\n|---|---|---|---|---|---|---|")
    for path in sorted(given.sequences):
        recording = read_recording(path)[:: given.step]
        if recording.up != "+Z":
            raise ValueError(f"{path}: up is {recording.up}; give sequences with z up")
        recording = eqx.tree_at(lambda r: r.skeleton, recording, None, is_leaf=lambda leaf: leaf is None)
        for name, poses in ways(recording, given.cameras):
            print(f"| {path.stem} | {name} | {row(poses, recording)} |", flush=True)


if __name__ == "__main__":
    main()
