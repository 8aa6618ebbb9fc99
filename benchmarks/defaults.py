"""Which values the defaults were chosen from: one setting is changed at a time, the others stay.

    python benchmarks/defaults.py SEQUENCE.npz ... [--only min_branch]

For each value a row: hands, feet and head wrong (more than 100 mm off, left and right counted apart), median error and
milliseconds a frame. The graph's settings are those of the paper's preset with the default's root, in which the graph
alone gives the pose; the others are those of the default.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from accuracy import score_against_truth

from jaxskel import GraphSettings, Settings, join_poses, paper_settings, prepare, read_recording, reconstruct_batches
from jaxskel.graph import GeodesicShells, HeadBall, HighestVoxel, ThinnestPaths, VoxelScooping
from jaxskel.matching import HANDLESS_DESCRIPTOR, PAPER_DESCRIPTOR
from jaxskel.poses.metrics import join_scores


def changes() -> dict[str, list[tuple[str, Settings]]]:
    """Of each setting, its values and settings that differ in it alone."""
    full, paper = Settings(), paper_settings()
    graph = replace(paper, graph=GraphSettings(root_finder=HeadBall()))
    return {
        "min_branch": [
            (f"{length:.2f} m", replace(graph, graph=replace(graph.graph, min_branch=length)))
            for length in (0.12, 0.16, 0.20, 0.24, 0.28, 0.32, 0.40)
        ],
        "skeletoniser": [
            (type(one).__name__, replace(graph, graph=replace(graph.graph, skeletoniser=one)))
            for one in (GeodesicShells(), VoxelScooping(), ThinnestPaths())
        ],
        "root_finder": [
            (type(finder).__name__, replace(graph, graph=replace(graph.graph, root_finder=finder)))
            for finder in (HeadBall(), HighestVoxel())
        ],
        "descriptor": [
            (name, replace(graph, matching=replace(graph.matching, descriptor=descriptor)))
            for name, descriptor in (("without hands", HANDLESS_DESCRIPTOR), ("the paper's", PAPER_DESCRIPTOR))
        ],
        "spacing": [
            (f"{1e3 * spacing:g} mm", replace(full, hull=replace(full.hull, spacing=spacing)))
            for spacing in (0.010, 0.015, 0.020, 0.030)
        ],
        "rounds": [
            (f"{rounds}", replace(full, refinement=replace(full.refinement, rounds=rounds))) for rounds in (1, 2, 3)
        ],
        "max_steps": [
            (f"{steps}", replace(full, refinement=replace(full.refinement, max_steps=steps))) for steps in (4, 8, 16)
        ],
    }


def rows(files: list[Path], values: list[tuple[str, Settings]]) -> Iterator[str]:
    """A row of the table for each value."""
    for value, settings in values:
        scores, frames, seconds = [], 0, 0.0
        for path in files:
            recording = read_recording(path)
            prepared = prepare(recording, settings)
            if not scores:  # compiles
                next(reconstruct_batches(recording, settings, prepared))
            start = time.perf_counter()
            poses = join_poses(reconstruct_batches(recording, settings, prepared))
            seconds, frames = seconds + time.perf_counter() - start, frames + len(recording)
            scores.append(score_against_truth(poses, recording))
        total = join_scores(scores)
        wrong = [
            100 * sum(total.wrong(limb, False) for limb in limbs) / (len(total) * len(limbs))
            for limbs in (("l_hand", "r_hand"), ("l_foot", "r_foot"), ("head",))
        ]
        cells = [*(f"{share:.2f} %" for share in wrong), f"{1e3 * total.percentile(50, None, False):.1f} mm"]
        yield f"| {value} | {' | '.join(cells)} | {1e3 * seconds / frames:.1f} |"


def main() -> None:
    """Print a table for each setting."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--only", choices=list(changes()), action="append", help="only these settings")
    given = parser.parse_args()
    for name, values in changes().items():
        if given.only and name not in given.only:
            continue
        print(f"\n| {name} | hands wrong | feet wrong | head wrong | median | ms a frame |\n|---|---|---|---|---|---|")
        for row in rows(sorted(given.sequences), values):
            print(row, flush=True)


if __name__ == "__main__":
    main()
