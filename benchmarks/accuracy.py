"""Accuracy over sequence files with ground truth: one row a file, as in the paper's Table 1, and speed.

    python benchmarks/accuracy.py SEQUENCE.npz ... [--output accuracy.json]
    python benchmarks/accuracy.py SEQUENCE.npz ... --cameras 0,2,3,5,7,8      with fewer cameras
    python benchmarks/accuracy.py SEQUENCE.npz ... --dirty 1                  with dirty masks
    python benchmarks/accuracy.py SEQUENCE.npz ... --unknown                  dimensions withheld
    python benchmarks/accuracy.py SEQUENCE.npz ... --unknown --clothes 1      the same in clothes
    python benchmarks/accuracy.py SEQUENCE.npz ... --unknown --alone          each frame as a recording of its own
    python benchmarks/accuracy.py SEQUENCE.npz ... --bones 0.05 --seed 1      with a mismeasured subject
    python benchmarks/accuracy.py SEQUENCE.npz ... --preset tracked           as with `jaxskel run --track`

Prints the table of notebooks/accuracy.md, and how reliable the confidence of joints is. Every file is reconstructed by
the defaults of `jaxskel run`. Errors are given with sides counted / with swaps forgiven; frames per second leave out
the preparation of a file and compilation.
Pin the process to one core (`taskset -c 0`) to measure what one core does.
"""

import argparse
import itertools
import json
import time
from pathlib import Path

import numpy as np
from _condition import Condition, add_options, condition_of, disturbed
from _presets import PRESETS
from jaxtyping import Bool, Float

from jaxskel import (
    JOINT_NAMES,
    Poses,
    Prepared,
    Recording,
    Settings,
    join_poses,
    prepare,
    read_recording,
    reconstruct_batches,
)
from jaxskel.poses import Score, score
from jaxskel.poses.metrics import join_scores

CONFIDENCES = (0.0, 0.5, 0.9, 1.0)
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


def errors(
    poses: Poses, recording: Recording
) -> tuple[Bool[np.ndarray, " frames"], Float[np.ndarray, "known joints 3"]]:
    """Which frames have a pose and a truth, and how far each joint is from it there (m)."""
    assert recording.truth is not None
    known = poses.has_pose & np.isfinite(recording.truth.joints).all((1, 2))
    return known, (poses.joints[known] - recording.truth.joints[known]).astype(np.float64)


def trust_and_truth(
    poses: Poses, recording: Recording
) -> tuple[Float[np.ndarray, " joints"], Bool[np.ndarray, " joints"]]:
    """Confidence of all joints of the frames with a pose and a truth, and whether they are within 100 mm of it."""
    known, away = errors(poses, recording)
    return poses.confidence[known].ravel(), np.linalg.norm(away, axis=-1).ravel() < 0.1


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


def reliability(confidence: Float[np.ndarray, " joints"], right: Bool[np.ndarray, " joints"]) -> str:
    """A table: for each range of confidence, the share of joints that are right."""
    lines = ["| confidence | share of the joints | within 100 mm |", "|---|---|---|"]
    for low, high in itertools.pairwise(CONFIDENCES):
        chosen = (confidence >= low) & ((confidence < high) | (high == CONFIDENCES[-1]))
        good = f"{100 * right[chosen].mean():.1f} %" if chosen.any() else "-"
        lines.append(f"| {low:g} to {high:g} | {100 * chosen.mean():.1f} % | {good} |")
    return "\n".join(lines)


def squared_deviations(poses: Poses, recording: Recording) -> Float[np.ndarray, "frames joints"]:
    """Squared Mahalanobis distances of the truth from the joints, of the frames with a pose and a truth."""
    assert poses.covariance is not None
    known, away = errors(poses, recording)
    solved = np.linalg.solve(poses.covariance[known].astype(np.float64), away[..., None])[..., 0]
    return (away * solved).sum(-1)


def coverage(squared: Float[np.ndarray, "frames joints"]) -> str:
    """A table: how many truths are within two and three standard deviations; of a true Gaussian, 73.9 and 97.1 %."""
    lines = ["| joints | within 2 sigma | within 3 sigma |", "|---|---|---|"]
    for name, joints in (("all", JOINT_NAMES), ("hands", ("l_hand", "r_hand")), ("feet", ("l_foot", "r_foot"))):
        chosen = squared[:, [JOINT_NAMES.index(joint) for joint in joints]]
        lines.append(f"| {name} | {100 * (chosen < 4).mean():.1f} % | {100 * (chosen < 9).mean():.1f} % |")
    return "\n".join(lines)


def statures(shares: list[float]) -> str:
    """A line: how far the statures found are from the true ones."""
    off = 100 * np.abs(np.array(shares) - 1)
    within = ", ".join(f"{100 * (off <= most).mean():.1f} % within {most:g} %" for most in (2.5, 5.0))
    return f"stature: {within}, at most {off.max():.1f} % off (of {len(off)})"


def score_files(
    paths: list[Path], condition: Condition, settings: Settings, alone: bool = False
) -> tuple[dict[str, Score], Score]:
    """Reconstruct and score files under a condition; print a row for each, one for all, and the reliability.

    Args:
        paths: Sequence files.
        condition: Changes made to them.
        settings: How to reconstruct.
        alone: Whether each frame is a recording of its own, so that nothing is known from the others.

    Returns:
        The score of each file by its name, and of all files pooled.
    """
    results: dict[str, Score] = {}
    frames, seconds = 0, 0.0
    trusted: list[tuple[np.ndarray, np.ndarray]] = []
    squared: list[np.ndarray] = []
    tall: list[float] = []
    suffix = "".join(f", {part}" for part in (str(condition), "each frame alone" if alone else "") if part)
    print(HEADER)
    for path in sorted(paths):
        if path.stem in results:
            raise ValueError(f"{path}: another file is called {path.stem} too; give each a name of its own")
        known = read_recording(path)
        recording = disturbed(known, condition)
        parts, taken = [], 0.0
        for part in [recording[i : i + 1] for i in range(len(recording))] if alone else [recording]:
            prepared = prepare(part, settings)
            if not results and not parts:  # compiles
                next(reconstruct_batches(part, settings, prepared))
            found, took = reconstruct_timed(part, prepared, settings)
            parts, taken = [*parts, found], taken + took
            if recording.skeleton is None and known.skeleton is not None:
                tall.append(prepared.skeleton.stature / known.skeleton.stature)
        poses = join_poses(parts)
        results[path.stem] = score_against_truth(poses, recording)
        frames, seconds = frames + len(recording), seconds + taken
        trusted.append(trust_and_truth(poses, recording))
        squared.append(squared_deviations(poses, recording))
        print(row(path.stem + suffix, results[path.stem], len(recording) / taken), flush=True)
    total = join_scores(results.values())
    print(row(f"**all**{suffix}", total, frames / seconds), flush=True)
    print("\n" + reliability(*(np.concatenate(part) for part in zip(*trusted, strict=True))))
    print("\n" + coverage(np.concatenate(squared)))
    if tall:
        print("\n" + statures(tall))
    return results, total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, help="also write every figure as JSON")
    add_options(parser)
    parser.add_argument("--alone", action="store_true", help="each frame is a recording of its own")
    parser.add_argument("--preset", choices=list(PRESETS), default="default", help="how to reconstruct")
    arguments = parser.parse_args()
    settings = PRESETS[arguments.preset].settings()
    condition = condition_of(arguments)
    results, total = score_files(arguments.sequences, condition, settings, arguments.alone)
    if arguments.output:
        figures = {name: result.to_dict() for name, result in results.items()} | {"all": total.to_dict()}
        report = {"preset": arguments.preset, "condition": str(condition), "accuracy": figures}
        arguments.output.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
