"""Figures 3 and 4(a) of Straka et al. (BMVC 2011), our presets side by side.

A set is all sequences of one folder, pooled; figures have a row of panels for each set.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from _runs import Run
from jaxtyping import Bool, Float, Int
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxskel import JOINT_NAMES
from jaxskel.poses import CURVE_THRESHOLDS_MM, Score

WRONG_MM = 100
"""Table 1 counts a limb farther off than this as wrong (mm)."""

_PAPER_MEDIAN_MM = 80
"""Sect. 4.2 on Figure 3(a): the median stays below this for all joints."""
_PAPER_CURVE = ((50, 50), (100, 95))
"""Sect. 4.2 on Figure 3(b): within 50 mm in more than half, within 100 mm in more than 95 % of all frames."""


def draw_boxplots(totals: Mapping[str, Mapping[str, Score]], path: Path) -> None:
    """Figure 3(a): the distances of each joint from the truth over frames with a pose.

    Args:
        totals: The score of each set by each preset.
        path: The picture; its ending tells the format.
    """
    figure = Figure(figsize=(12, 1 + 4 * len(totals)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(totals), 1, sharey=True, squeeze=False)[:, 0]
    for axes, (name, by_preset) in zip(panels, totals.items(), strict=True):
        width = 0.8 / len(by_preset)
        for i, (preset, score) in enumerate(by_preset.items()):
            distances = 1e3 * score.distances[score.has_pose]
            # A missing joint has an infinite distance, which a box cannot show.
            shown = [column[np.isfinite(column)] for column in distances.T]
            places = np.arange(len(JOINT_NAMES)) + (i - (len(by_preset) - 1) / 2) * width
            lost = int((~score.has_pose).sum())
            axes.boxplot(
                shown, positions=places, widths=0.85 * width, whis=(5, 95), showfliers=False, manage_ticks=False,
                patch_artist=True, boxprops={"facecolor": f"C{i}", "alpha": 0.6}, medianprops={"color": "black"},
                label=f"{preset}: {len(score)} frames, {lost} without a pose",
            )  # fmt: skip
        axes.axhline(WRONG_MM, color="grey", linestyle=":", label="wrong in Table 1")
        axes.axhline(_PAPER_MEDIAN_MM, color="tab:red", linestyle="--", linewidth=1, label="the paper: medians below")
        axes.set_xticks(range(len(JOINT_NAMES)), JOINT_NAMES, rotation=45)
        axes.set_xlim(-0.6, len(JOINT_NAMES) - 0.4)
        axes.set_ylabel("distance from the truth (mm)")
        axes.set_title(f"{name}: median, quartiles, 5 % to 95 %", loc="left")
        axes.grid(axis="y", alpha=0.3)
        axes.legend(loc="upper left", fontsize=8)
    panels[0].set_ylim(bottom=0)
    _save(figure, path)


def draw_thresholds(totals: Mapping[str, Mapping[str, Score]], path: Path) -> None:
    """Figure 3(b): the share of frames in which joints are within a threshold, a panel for each set and preset.

    Args:
        totals: The score of each set by each preset; a frame without a pose counts against every joint.
        path: The picture.
    """
    across = max(len(by_preset) for by_preset in totals.values())
    figure = Figure(figsize=(1 + 5 * across, 1 + 4 * len(totals)), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(len(totals), across, sharex=True, sharey=True, squeeze=False)
    for row, (name, by_preset) in zip(rows, totals.items(), strict=True):
        for axes, (preset, score) in zip(row, by_preset.items(), strict=True):
            _draw_curves(axes, score)
            axes.set_title(f"{name}, {preset}", loc="left")
        row[0].set_ylabel("frames (%)")
    for axes in rows[-1]:
        axes.set_xlabel("threshold (mm)")
    # All panels use the same colours.
    handles, labels = rows[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8, title="left solid,\nright dashed")
    _save(figure, path)


def _draw_curves(axes: Axes, score: Score) -> None:
    curve = 100 * score.curve()
    kinds = list(dict.fromkeys(name.removeprefix("l_").removeprefix("r_") for name in JOINT_NAMES))
    for joint, share in zip(JOINT_NAMES, curve.T, strict=True):
        kind, right = joint.removeprefix("l_").removeprefix("r_"), joint.startswith("r_")
        label = f"_{joint}" if right else kind
        axes.plot(
            CURVE_THRESHOLDS_MM, share, "--" if right else "-", color=f"C{kinds.index(kind)}", linewidth=1, label=label
        )
    every = [100 * (1e3 * score.distances <= threshold).all(1).mean() for threshold in CURVE_THRESHOLDS_MM]
    axes.plot(CURVE_THRESHOLDS_MM, curve.mean(1), color="black", linewidth=2.5, label="mean of joints")
    axes.plot(CURVE_THRESHOLDS_MM, every, color="black", linewidth=1.5, linestyle="-.", label="all 15 at once")
    axes.plot(*zip(*_PAPER_CURVE, strict=True), "r^", label="the paper: above")
    axes.axvline(WRONG_MM, color="grey", linestyle=":")
    axes.set_xlim(CURVE_THRESHOLDS_MM[0], CURVE_THRESHOLDS_MM[-1])
    axes.set_ylim(0, 100)
    axes.grid(alpha=0.3)


def joint_distance(run: Run, joint: str = "l_hand") -> tuple[Int[np.ndarray, " known"], Float[np.ndarray, " known"]]:
    """Distance of a joint from the truth in the frames whose truth is known.

    Returns:
        The number of each frame in the material, and the distances (m), NaN without a pose.
    """
    index = JOINT_NAMES.index(joint)
    known = np.isfinite(run.truth[:, index]).all(-1)
    offsets = run.joints[known, index].astype(np.float64) - run.truth[known, index]
    return run.frame_index[known], np.where(run.has_pose[known], np.linalg.norm(offsets, axis=-1), np.nan)


def jumpy_interval(wrong: Bool[np.ndarray, " frames"], length: int) -> slice:
    """The first stretch of `length` frames with the most changes between right and wrong; all frames if fewer."""
    length = min(length, len(wrong))
    before = np.concatenate([[0], np.cumsum(wrong[1:] != wrong[:-1])])  # jumps up to each frame
    start = int(np.argmax(before[length - 1 :] - before[: len(before) - length + 1]))
    return slice(start, start + length)


def draw_joint_distance(
    runs: Mapping[str, Run], name: str, path: Path, interval: tuple[int, int], joint: str = "l_hand"
) -> None:
    """Figure 4(a): the distance of a joint from the truth in an interval of one sequence, a panel for each preset.

    Args:
        runs: The sequence by each preset.
        name: The sequence's name.
        path: The picture.
        interval: First frame and the frame after the last, by their numbers in the material.
        joint: The paper shows the left hand.
    """
    figure = Figure(figsize=(10, 1 + 2 * len(runs)), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(len(runs), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, (preset, run) in zip(panels, runs.items(), strict=True):
        numbers, distances = joint_distance(run, joint)
        first, end = interval
        shown = (numbers >= first) & (numbers < end)
        if not shown.any():
            raise ValueError(f"{name}: no frame from {first} to {end - 1}; its frames are {numbers[0]}..{numbers[-1]}")
        numbers, mm = numbers[shown], 1e3 * distances[shown]
        lost = np.isnan(mm)
        # Frames that the recording itself skips are joined; a frame without a pose leaves a gap and a mark.
        axes.plot(numbers, mm, ".-", markersize=3, linewidth=1)
        if lost.any():  # nothing to draw would be laid out as a point at the origin
            axes.plot(numbers[lost], np.zeros(lost.sum()), "x", color="tab:red", clip_on=False)
        axes.axhline(WRONG_MM, color="grey", linestyle=":")
        wrong = 100 * (lost | (mm > WRONG_MM)).mean()
        axes.set_title(f"{preset}: wrong in {wrong:.1f} % of {len(mm)} frames, {lost.sum()} without a pose", loc="left")
        axes.set_ylabel(f"{joint} (mm)")
        axes.grid(alpha=0.3)
    panels[0].set_ylim(bottom=0)
    panels[-1].set_xlabel(f"frame of {name}")
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
