"""Accuracy over sequence files with ground truth: one row a file, as in the paper's Table 1, and speed.

    python benchmarks/accuracy.py SEQUENCE.npz ... [--output accuracy.json]

Prints the Markdown table of the README. Every file is reconstructed by the defaults of `jaxskel run`.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from jaxskel import Prepared, Recording, Settings, prepare, read_recording, reconstruct_batches
from jaxskel._poses import join_poses
from jaxskel.metrics import Score, join_scores, score

HEADER = (
    "| sequence | frames | no pose | hands wrong | feet wrong | head wrong | all 15 right | median |\n"
    "|---|---|---|---|---|---|---|---|"
)


def reconstruct_and_score(recording: Recording, prepared: Prepared, settings: Settings) -> tuple[Score, float]:
    """Score a recording against its truth; also the frames per second."""
    if recording.truth is None:
        raise ValueError(f"{recording.name}: key 'joints': there is no ground truth to score against")
    start = time.perf_counter()
    poses = join_poses(reconstruct_batches(recording, settings, prepared))
    seconds = time.perf_counter() - start
    return score(poses.joints.astype(np.float64), recording.truth.joints, poses.has_pose), len(recording) / seconds


def row(name: str, result: Score) -> str:
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
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, help="also write every figure as JSON")
    arguments = parser.parse_args()
    settings = Settings()
    results, rates = {}, {}
    print(HEADER)
    for path in sorted(arguments.sequences):
        recording = read_recording(path)
        results[path.stem], rates[path.stem] = reconstruct_and_score(recording, prepare(recording, settings), settings)
        print(row(path.stem, results[path.stem]), flush=True)
    total = join_scores(list(results.values()))
    print(row("**all**", total))
    # The first file pays for the compilation.
    later = list(rates.values())[1:] or list(rates.values())
    print(f"\n{np.median(later):.0f} frames per second (median over the files after the first)")
    if arguments.output:
        figures = {name: result.to_dict() for name, result in results.items()} | {"all": total.to_dict()}
        arguments.output.write_text(json.dumps({"accuracy": figures, "fps": rates}, indent=1) + "\n")


if __name__ == "__main__":
    main()
