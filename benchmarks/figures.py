r"""The paper's figures of accuracy, Figure 3 and Figure 4(a), over sequence files with ground truth.

    python benchmarks/figures.py SEQUENCE.npz ... -o FOLDER
    python benchmarks/figures.py SEQUENCE.npz ... -o FOLDER --hand 13_18_male.npz \
        --poses "paper=out/poses.npz" --poses "tracked=tracked/poses.npz" --interval 300:700

Writes `figure3.png`: how far each joint is from the truth over all files together, reconstructed by the defaults of
`jaxskel run`. With `--hand` also `figure4a.png`: the distance of the left hand from its true position over the frames
of one sequence, one panel for each `poses.npz` that `jaxskel run` has written of it.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from _condition import add_options, condition_of, disturbed
from accuracy import score_files
from jaxtyping import Float, Int
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxskel import JOINT_NAMES, Poses, Recording, Settings, read_recording, reconstruct
from jaxskel.io import read_poses
from jaxskel.plots import plot_score

_WRONG_MM = 100
"""Table 1 counts a hand farther off than this as wrong (mm)."""


def joint_distance(
    poses: Poses, recording: Recording, joint: str = "l_hand"
) -> tuple[Int[np.ndarray, " common"], Float[np.ndarray, " common"]]:
    """How far a joint is from the truth over the frames that both have.

    Returns:
        The number of each frame in the material, and the distances (m), NaN without a pose or a truth.
    """
    if recording.truth is None:
        raise ValueError(f"{recording.name}: key 'joints': there is no ground truth to measure from")
    if poses.up != recording.up:
        raise ValueError(f"{recording.name}: up is {recording.up} but the poses have {poses.up}; give the same world")
    numbers, a, b = np.intersect1d(poses.frame_index, recording.frame_index, return_indices=True)
    if not len(numbers):
        raise ValueError(f"{recording.name}: key 'frame_index': no frame in common with the poses")
    index = JOINT_NAMES.index(joint)
    offsets = poses.joints[a, index].astype(np.float64) - recording.truth.joints[b, index]
    return numbers, np.linalg.norm(offsets, axis=-1)


def plot_joint_distance(
    poses: Mapping[str, Poses], recording: Recording, path: Path, interval: tuple[int, int] | None = None
) -> None:
    """Draw the left hand's distance from the truth as Figure 4(a) of Straka et al. (BMVC 2011) does.

    Args:
        poses: Reconstructions of the recording by their labels, a panel each.
        recording: With the truth.
        path: The picture; its ending tells the format (.png, .pdf, .svg).
        interval: First frame and the frame after the last, by their numbers in the material; all by default.
    """
    figure = Figure(figsize=(10, 1 + 2 * len(poses)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(poses), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (label, estimated) in zip(panels, poses.items(), strict=True):
        numbers, distances = joint_distance(estimated, recording)
        first, end = interval or (int(numbers[0]), int(numbers[-1]) + 1)
        shown = (numbers >= first) & (numbers < end)
        if not shown.any():
            raise ValueError(f"{label}: no frame from {first} to {end - 1}; its frames are {numbers[0]}..{numbers[-1]}")
        numbers, mm = numbers[shown], 1e3 * distances[shown]
        lost = np.isnan(mm)
        # Frames that the recording itself skips are joined; a frame without a pose leaves a gap and a mark.
        axes.plot(numbers, mm, ".-", markersize=3, linewidth=1)
        if lost.any():  # nothing to draw would be laid out as a point at the origin
            axes.plot(numbers[lost], np.zeros(lost.sum()), "x", color="tab:red", clip_on=False)
        axes.axhline(_WRONG_MM, color="grey", linestyle=":")
        wrong = 100 * (lost | (mm > _WRONG_MM)).mean()
        axes.set_title(f"{label}: wrong in {wrong:.1f} % of {len(mm)} frames, {lost.sum()} without a pose", loc="left")
        axes.set_ylabel("left hand (mm)")
        axes.grid(alpha=0.3)
    panels[0].set_ylim(bottom=0)
    panels[-1].set_xlabel(f"frame of {recording.name}")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def labelled(text: str) -> tuple[str, Path]:
    """Split LABEL=PATH."""
    label, found, path = text.partition("=")
    if not (label and found and path):
        raise argparse.ArgumentTypeError(f"{text!r}: give LABEL=POSES.npz")
    return label, Path(path)


def span(text: str) -> tuple[int, int]:
    """Split FIRST:END, the frame after the last."""
    first, found, end = text.partition(":")
    if not (found and first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise argparse.ArgumentTypeError(f"{text!r}: give FIRST:END, as 300:700")
    return int(first), int(end)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="*", type=Path, help="for Figure 3")
    parser.add_argument("--output", "-o", type=Path, required=True, help="folder of the pictures")
    parser.add_argument("--hand", type=Path, metavar="SEQUENCE", help="the sequence of Figure 4(a)")
    parser.add_argument(
        "--poses", type=labelled, action="append", default=[], metavar="LABEL=POSES",
        help="a panel of Figure 4(a); by default the sequence is reconstructed",
    )  # fmt: skip
    parser.add_argument("--interval", type=span, metavar="FIRST:END", help="frame numbers of Figure 4(a)")
    add_options(parser)
    arguments = parser.parse_args()
    if not (arguments.sequences or arguments.hand):
        parser.error("give sequences for Figure 3, or --hand for Figure 4(a)")
    if (arguments.poses or arguments.interval) and not arguments.hand:
        parser.error("--poses and --interval are of Figure 4(a): give its sequence by --hand")
    condition, settings = condition_of(arguments), Settings()
    if arguments.sequences:
        _, total = score_files(arguments.sequences, condition, settings)
        plot_score(total, arguments.output / "figure3.png")
    if arguments.hand:
        recording = read_recording(arguments.hand)
        poses = {label: read_poses(path) for label, path in arguments.poses}
        if not poses:
            poses = {str(condition) or "default": reconstruct(disturbed(recording, condition), settings)}
        plot_joint_distance(poses, recording, arguments.output / "figure4a.png", arguments.interval)


if __name__ == "__main__":
    main()
