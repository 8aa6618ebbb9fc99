"""Body calibration without known dimensions: bone lengths and joint errors against those with known dimensions.

    python benchmarks/calibration.py SEQUENCE.npz ... [--off 0.08] [--frames 60]

Each file is calibrated twice, from a default adult that is too tall and one that is too short by a share. It is
reconstructed with each body found and, once, with the known dimensions, by the defaults of `jaxskel run`. Prints
Markdown tables with the errors of bone lengths, without the tips of head, fingers and toes, and the median distance of
all joints from the truth.
"""

import argparse
import time
from pathlib import Path

import equinox as eqx
import numpy as np
from accuracy import score_against_truth
from jaxtyping import Float

from jaxskel import Recording, Settings, Skeleton, calibrate_body, default_adult, read_recording, reconstruct
from jaxskel.pipeline import CalibratedBody
from jaxskel.poses import Score
from jaxskel.poses.metrics import join_scores

COLUMNS = ("sequence", "start", "worst bone", "second worst", "known dimensions", "calibrated", "seconds")
HEADER = f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|"
BONES = ("trunk", "neck", "shoulder", "upper_arm", "forearm", "hip", "thigh", "shank")
_ENDS = (0, 1, 2, 3, 4, 8, 9, 10)  # the left one of both sides


def reconstructed(recording: Recording, found: CalibratedBody) -> Score:
    """Score with a calibrated body."""
    known = eqx.tree_at(lambda r: r.skeleton, recording, found.skeleton)
    return score_against_truth(reconstruct(known, Settings(body=found.body)), recording)


def length_errors(found: Skeleton, true: Skeleton) -> Float[np.ndarray, "bones=8"]:
    """Share by which each bone is too long."""
    return (found.bone_lengths / true.bone_lengths - 1)[list(_ENDS)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--off", type=float, default=0.08, help="by which share the stature at the start is off")
    parser.add_argument("--frames", type=int, default=60, help="frames to calibrate on")
    arguments = parser.parse_args()
    known_scores, found_scores, errors = [], [], []
    print(HEADER)
    for path in sorted(arguments.sequences):
        recording = read_recording(path)
        true = recording.skeleton
        if true is None:
            raise ValueError(f"{path}: key 'rest_joints': there are no known dimensions to compare with")
        known = score_against_truth(reconstruct(recording), recording)
        for share in (arguments.off, -arguments.off):
            began = time.perf_counter()
            start = default_adult(true.stature * (1 + share))
            found = calibrate_body(recording, skeleton=start, frames=arguments.frames)
            seconds = time.perf_counter() - began
            score = reconstructed(recording, found)
            known_scores.append(known)
            found_scores.append(score)
            errors.append(length_errors(found.skeleton, true))
            worst = np.argsort(-np.abs(errors[-1]))[:2]
            cells = [
                path.stem, f"{100 * share:+g} %", *(f"{BONES[i]} {100 * errors[-1][i]:+.1f} %" for i in worst),
                *(f"{1e3 * each.percentile(50):.1f} mm" for each in (known, score)), f"{seconds:.0f}",
            ]  # fmt: skip
            print(f"| {' | '.join(cells)} |", flush=True)
    medians = [1e3 * join_scores(scores).percentile(50) for scores in (known_scores, found_scores)]
    print(f"| **all** | | | | {medians[0]:.1f} mm | {medians[1]:.1f} mm | |")
    print("\n| bone | root mean square error | mean error | within 5 % |\n|---|---|---|---|")
    for bone, error in zip(BONES, 100 * np.array(errors).T, strict=True):
        rms = np.sqrt((error**2).mean())
        print(f"| {bone} | {rms:.1f} % | {error.mean():+.1f} % | {100 * (np.abs(error) <= 5).mean():.0f} % |")


if __name__ == "__main__":
    main()
