r"""The paper's Table 1, Figure 3 and Figure 4(a) over sequence files with ground truth, our presets side by side.

    python benchmarks/figures.py full/*.npz sparse/*.npz --output FOLDER
    python benchmarks/figures.py full/*.npz --output FOLDER --presets paper --interval 300:700

The sequences of one folder are one set: a section of the table, a row of the figures. A file stem such as 13_18_male
gives the clip, hence the paper's numbers for it, and the body. Writes `table1.md`, `table1.json`, `boxplots.png`
(Figure 3a), `threshold.png` (Figure 3b), and, if clip 13_18 is given, `hand_distance.png` (Figure 4a, from its longest
file). The poses of every finished file are kept in FOLDER/runs, so that an interrupted benchmark can be resumed.

Files are read one at a time, but each as a whole, because the grid is laid around all of its frames.
"""

import argparse
import json
from pathlib import Path

from _condition import Condition, add_options, condition_of, disturbed
from _drawings import WRONG_MM, draw_boxplots, draw_joint_distance, draw_thresholds, joint_distance, jumpy_interval
from _presets import PRESETS, Preset
from _runs import Run, made_from, read_run, reconstruct_run, score_run, write_run
from _table import clip_and_body, paper_dict, table_dict, table_markdown

from jaxskel import read_recording
from jaxskel.poses.metrics import join_scores

_HAND_CLIP = "13_18"
"""The sequence of Figure 4(a)."""
_HAND_FRAMES = 400
"""Length of the interval (frames), which the paper does not give: each frame is visible in a picture of 1500 px."""

Runs = dict[str, dict[str, dict[str, Run]]]
"""Runs by set, preset and file stem."""


def sets_of(paths: list[Path]) -> dict[str, dict[str, Path]]:
    """The sequence files by folder and stem."""
    sets: dict[str, dict[str, Path]] = {}
    for path in sorted(paths):
        files = sets.setdefault(path.resolve().parent.name, {})
        if path.stem in files:
            raise ValueError(f"{path}: {files[path.stem]} has the same name and folder name; rename one of them")
        files[path.stem] = path
    return sets


def run_all(sets: dict[str, dict[str, Path]], presets: list[Preset], condition: Condition, folder: Path) -> Runs:
    """Reconstruct files whose poses are not yet stored in the folder, and read the others.

    Raises:
        ValueError: Stored poses were made from other files, under another condition or with other settings.
    """
    runs: Runs = {name: {preset.name: {} for preset in presets} for name in sets}
    missing: dict[tuple[str, str], list[tuple[Preset, dict[str, str], Path]]] = {}
    # Stored poses are read first, so that a fault is reported before hours of work.
    for name, files in sets.items():
        for stem, path in files.items():
            for preset in presets:
                source = made_from(path, condition, preset.settings())
                kept = folder / name / f"{stem}.{preset.name}.npz"
                if kept.exists():
                    runs[name][preset.name][stem] = read_run(kept, source)
                else:
                    missing.setdefault((name, stem), []).append((preset, source, kept))
    for number, ((name, stem), todo) in enumerate(missing.items(), 1):
        recording = disturbed(read_recording(sets[name][stem]), condition)
        for preset, source, kept in todo:
            label = f"[{number}/{len(missing)}] {name}/{stem}, {preset.name}"
            run = reconstruct_run(recording, preset.settings(), label)
            write_run(kept, run, source)
            runs[name][preset.name][stem] = run
    return runs


def write_table(runs: Runs, presets: list[Preset], condition: Condition, folder: Path) -> None:
    """Write `table1.md` and `table1.json`."""
    scores = {
        name: {preset: {stem: score_run(run) for stem, run in by_stem.items()} for preset, by_stem in by_preset.items()}
        for name, by_preset in runs.items()
    }
    lines = ["# Table 1", ""]
    if str(condition):
        lines += [f"Under the condition: {condition}.", ""]
    versions = sorted({run.code for by in runs.values() for by_stem in by.values() for run in by_stem.values()})
    if len(versions) > 1:
        lines += [f"Made by {len(versions)} versions of the code ({', '.join(versions)}): not comparable.", ""]
    lines += [table_markdown(name, by_preset, presets) for name, by_preset in scores.items()]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "table1.md").write_text("\n".join(lines), encoding="utf-8")
    report = {
        "condition": str(condition), "code": versions, "paper": paper_dict(),
        "sets": {name: table_dict(by_preset) for name, by_preset in scores.items()},
    }  # fmt: skip
    (folder / "table1.json").write_text(json.dumps(report, indent=1) + "\n")


def draw_hand(runs: Runs, interval: tuple[int, int] | None, path: Path) -> None:
    """Draw Figure 4(a) of its clip's longest file, by default where the first preset jumps most."""
    presets = list(next(iter(runs.values())))
    files = [
        (len(run.frame_index), name, stem)
        for name, by_preset in runs.items()
        for stem, run in by_preset[presets[0]].items()
        if clip_and_body(stem)[0] == _HAND_CLIP
    ]
    if not files:
        print(f"no {path.name}: no sequence of clip {_HAND_CLIP} is given")
        return
    _, name, stem = max(files, key=lambda file: file[0])
    shown = {preset: runs[name][preset][stem] for preset in presets}
    if interval is None:
        # The paper chose "a time interval with many errors that cause a jump of the hand position" (Sect. 4.2).
        numbers, distances = joint_distance(shown[presets[0]])
        chosen = numbers[jumpy_interval(~(1e3 * distances <= WRONG_MM), _HAND_FRAMES)]
        interval = int(chosen[0]), int(chosen[-1]) + 1
    draw_joint_distance(shown, f"{name}/{stem}", path, interval)


def span(text: str) -> tuple[int, int]:
    """Split FIRST:END, the frame after the last."""
    first, found, end = text.partition(":")
    if not (found and first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise argparse.ArgumentTypeError(f"{text!r}: give FIRST:END, as 300:700")
    return int(first), int(end)


def presets_of(text: str) -> list[Preset]:
    """The presets of a list with commas, in the order of `PRESETS`."""
    names, known = text.split(","), list(PRESETS)
    if not set(names) <= set(known):
        raise argparse.ArgumentTypeError(f"{text!r}: give some of {','.join(known)}")
    return [preset for name, preset in PRESETS.items() if name in names]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--output", "-o", type=Path, required=True, metavar="FOLDER")
    parser.add_argument(
        "--presets", type=presets_of, default=list(PRESETS.values()), metavar="A,B",
        help=f"the columns, by default {','.join(PRESETS)}",
    )  # fmt: skip
    parser.add_argument("--interval", type=span, metavar="FIRST:END", help="frame numbers of Figure 4(a)")
    add_options(parser)
    arguments = parser.parse_args()
    condition, folder = condition_of(arguments), arguments.output
    runs = run_all(sets_of(arguments.sequences), arguments.presets, condition, folder / "runs")
    write_table(runs, arguments.presets, condition, folder)
    totals = {
        name: {preset: join_scores(map(score_run, by_stem.values())) for preset, by_stem in by_preset.items()}
        for name, by_preset in runs.items()
    }
    draw_boxplots(totals, folder / "boxplots.png")
    draw_thresholds(totals, folder / "threshold.png")
    draw_hand(runs, arguments.interval, folder / "hand_distance.png")
    print((folder / "table1.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
