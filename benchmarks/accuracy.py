"""Accuracy over sequence files with ground truth: one row a file, as in the paper's Table 1, and speed.

    python benchmarks/accuracy.py SEQUENCE.npz ... [--output accuracy.json]
    python benchmarks/accuracy.py SEQUENCE.npz ... --cameras 0,2,3,5,7,8      with fewer cameras
    python benchmarks/accuracy.py SEQUENCE.npz ... --dirty 1                  with dirty masks
    python benchmarks/accuracy.py SEQUENCE.npz ... --bones 0.05 --seed 1      with a mismeasured subject

Prints the Markdown table of the README. Every file is reconstructed by the defaults of `jaxskel run`. Errors are
given with sides counted / with swaps forgiven; frames per second leave out the preparation of a file and compilation.
Pin the process to one core (`taskset -c 0`) to measure what one core does.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from _condition import Condition, add_options, condition_of, disturbed

from jaxskel import (
    Poses,
    Prepared,
    Recording,
    Settings,
    join_poses,
    paper_settings,
    prepare,
    read_recording,
    reconstruct_batches,
)
from jaxskel.metrics import Score, join_scores, score

HEADER = (
    "| sequence | frames | no pose | hands wrong | feet wrong | head wrong | all 15 right | median | frames/s |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def reconstruct_timed(recording: Recording, prepared: Prepared, settings: Settings) -> tuple[Poses, float]:
    """Reconstruct a recording; also the seconds it took."""
    start = time.perf_counter()
    poses = join_poses(reconstruct_batches(recording, settings, prepared))
    return poses, time.perf_counter() - start


def score_against_truth(poses: Poses, recording: Recording) -> Score:
    """Score the poses of a recording against its truth."""
    if recording.truth is None:
        raise ValueError(f"{recording.name}: key 'joints': there is no ground truth to score against")
    return score(poses.joints.astype(np.float64), recording.truth.joints, poses.has_pose)


def row(name: str, result: Score, frames_per_second: float) -> str:
    """A row of the table: percent with sides counted, then with swaps forgiven."""
    frames = len(result)

    def percent(*limbs: str) -> str:
        shares = [
            100 * sum(result.wrong(limb, forgive) for limb in limbs) / (frames * len(limbs))
            for forgive in (False, True)
        ]
        return f"{shares[0]:.1f} / {shares[1]:.1f} %"

    right = f"{100 * result.all_correct():.1f} / {100 * result.all_correct(True):.1f} %"
    medians = [f"{1e3 * result.percentile(50, None, forgive):.0f}" for forgive in (False, True)]
    cells = [
        name, str(frames), str(int((~result.has_pose).sum())), percent("l_hand", "r_hand"),
        percent("l_foot", "r_foot"), percent("head"), right, f"{medians[0]} / {medians[1]} mm",
        f"{frames_per_second:.0f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def score_files(paths: list[Path], condition: Condition, settings: Settings) -> tuple[dict[str, Score], Score]:
    """Reconstruct and score files under a condition, and print a row for each and one for all.

    Returns:
        The score of each file by its name, and of all taken as one.
    """
    results: dict[str, Score] = {}
    frames, seconds = 0, 0.0
    suffix = f", {condition}" if str(condition) else ""
    print(HEADER)
    for path in sorted(paths):
        if path.stem in results:
            raise ValueError(f"{path}: another file is called {path.stem} too; give each a name of its own")
        recording = disturbed(read_recording(path), condition)
        prepared = prepare(recording, settings)
        if not results:  # compiles
            next(reconstruct_batches(recording, settings, prepared))
        poses, taken = reconstruct_timed(recording, prepared, settings)
        results[path.stem] = score_against_truth(poses, recording)
        frames, seconds = frames + len(recording), seconds + taken
        print(row(path.stem + suffix, results[path.stem], len(recording) / taken), flush=True)
    total = join_scores(results.values())
    print(row(f"**all**{suffix}", total, frames / seconds), flush=True)
    return results, total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, help="also write every figure as JSON")
    add_options(parser)
    parser.add_argument("--preset", choices=("default", "paper"), default="default", help="as in `jaxskel run`")
    arguments = parser.parse_args()
    settings = paper_settings() if arguments.preset == "paper" else Settings()
    condition = condition_of(arguments)
    results, total = score_files(arguments.sequences, condition, settings)
    if arguments.output:
        figures = {name: result.to_dict() for name, result in results.items()} | {"all": total.to_dict()}
        report = {"preset": arguments.preset, "condition": str(condition), "accuracy": figures}
        arguments.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
