"""Several people in one room: joints, identities and time, with masks of each person and with one mask for all.

    python benchmarks/people.py [FILE...] [--masks each all] [--frames 60] [--seed 0] [--single]

Each FILE is a sequence file of several people with ground truth, as `write_people` writes it. Without files, people of
the package's own making walk past each other, stand shoulder to shoulder, shake hands and hug, and four walk past each
other, before eight cameras. Dimensions are not told. Frames are tracked unless ``--single``.
"""

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from jaxskel import Recording, Settings, Tracking, keep_compiled
from jaxskel.io.recordings import read_people
from jaxskel.people import everybody, hide_others, reconstruct_people, tell_people_apart
from jaxskel.poses import PeopleScore, join_scores, score_people
from jaxskel.synthetic import draw_adult, handshake, hug, make_people, stand_close, walk_by

_FPS = 30.0
_LIMBS = ("hand", "foot")
_MEETINGS = {"walk by": (walk_by, 2), "stand close": (stand_close, 2), "handshake": (handshake, 2), "hug": (hug, 2),
             "four walk by": (walk_by, 4)}  # fmt: skip


def own_scenes(frames: int, seed: int) -> Iterator[tuple[str, dict[str, Recording]]]:
    """Meetings of people drawn at random, by name."""
    for scene, (name, (meeting, count)) in enumerate(_MEETINGS.items()):
        skeletons = [draw_adult(1000 * seed + 10 * scene + place).skeleton for place in range(count)]
        motions = meeting(skeletons, frames, _FPS)
        names = (f"p{place + 1}" for place in range(count))
        yield name, make_people(dict(zip(names, zip(skeletons, motions, strict=True), strict=True)), _FPS)


def told_apart(people: Mapping[str, Recording], masks: str) -> dict[str, Recording]:
    """The recordings of people without their dimensions, by masks of ``each`` or one for ``all``."""
    unknown = {name: replace(recording, skeleton=None) for name, recording in people.items()}
    return hide_others(unknown) if masks == "each" else tell_people_apart(everybody(unknown))


def scored(people: Mapping[str, Recording], masks: str, settings: Settings) -> tuple[PeopleScore, int, float]:
    """Scores, the number of people found, and seconds for each person and frame."""
    start = time.perf_counter()
    poses = reconstruct_people(told_apart(people, masks), settings)
    seconds = time.perf_counter() - start
    truths = {name: recording.truth.joints for name, recording in people.items() if recording.truth is not None}
    frames = len(next(iter(people.values())))
    return score_people(poses, truths), len(poses), seconds / frames / len(people)


def main() -> None:
    """Print a row for each scene and kind of masks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--masks", nargs="+", choices=("each", "all"), default=("each", "all"))
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--single", action="store_true")
    given = parser.parse_args()
    keep_compiled()
    scenes = ((path.stem, read_people(path)) for path in given.files) if given.files else None
    settings = Settings() if given.single else Settings(tracking=Tracking())
    table = Table(title="several people")
    for column in ("scene", "masks", "found", "hands %", "feet %", "all right %", "median mm", "exchanged", "s/frame"):
        table.add_column(column, justify="left" if column in ("scene", "masks") else "right")
    for name, people in scenes or own_scenes(given.frames, given.seed):
        for masks in given.masks:
            score, found, seconds = scored(people, masks, settings)
            every = join_scores(score.scores.values())
            wrong = [100 * np.mean([every.wrong(f"{side}_{limb}") / len(every) for side in "lr"]) for limb in _LIMBS]
            right = 100 * (every.distances <= every.threshold).mean()
            row = (name, masks, f"{found} of {len(people)}", *(f"{share:.1f}" for share in wrong), f"{right:.1f}",
                   f"{1000 * every.percentile(50):.1f}", str(score.exchanged), f"{seconds:.2f}")  # fmt: skip
            table.add_row(*row)
            print("  ".join(row), flush=True)
    Console().print(table)


if __name__ == "__main__":
    main()
