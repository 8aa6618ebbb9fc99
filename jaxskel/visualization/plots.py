"""Plots of a score, without a display."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .._runtime.picture_files import write_figure
from ..poses import CURVE_THRESHOLDS_MM, Score


def plot_score(score: Score, path: str | Path) -> None:
    """Plot a score like Figure 3 of Straka et al. (BMVC 2011).

    Left: the distances of each joint from the ground truth (mm) over frames with a pose, as median, quartiles and
    whiskers at the 5th and 95th percentile. Right: the share of frames in which a joint is within a threshold (mm); a
    frame without a pose counts against every joint.

    Args:
        score: The score, with left and right told apart.
        path: The image file; its suffix decides the format (.png, .pdf, .svg).
    """
    figure = Figure(figsize=(12, 5), layout="constrained")
    FigureCanvasAgg(figure)
    boxes, curves = figure.subplots(1, 2)
    _draw_boxes(boxes, score)
    _draw_curves(curves, score)
    lost = int((~score.has_pose).sum())
    figure.suptitle(f"{len(score)} frames, {lost} without a pose")
    write_figure(path, figure, dpi=150)


def _draw_boxes(axes: Axes, score: Score) -> None:
    distances = 1000 * score.distances[score.has_pose]
    # A joint that is missing from a pose has an infinite distance, which a box plot cannot show.
    shown = [column[np.isfinite(column)] for column in distances.T]
    axes.boxplot(
        shown, tick_labels=list(score.joint_names), whis=(5, 95), showfliers=False,
        medianprops={"color": "tab:red"},
    )  # fmt: skip
    axes.axhline(1000 * score.threshold, color="grey", linestyle=":")
    axes.set_ylim(bottom=0)
    axes.tick_params(axis="x", rotation=60)
    axes.set_ylabel("distance from the truth (mm)")
    axes.set_title("median, quartiles, 5 % to 95 %")
    axes.grid(axis="y", alpha=0.3)


def _draw_curves(axes: Axes, score: Score) -> None:
    curve = 100 * score.curve()
    # One colour for both sides of a joint: left solid, right dashed.
    kinds = list(dict.fromkeys(name.removeprefix("l_").removeprefix("r_") for name in score.joint_names))
    for joint, share in zip(score.joint_names, curve.T, strict=True):
        kind = joint.removeprefix("l_").removeprefix("r_")
        style = "--" if joint.startswith("r_") else "-"
        axes.plot(
            CURVE_THRESHOLDS_MM, share, style, color=f"C{kinds.index(kind)}", linewidth=1.2,
            label=f"_{joint}" if joint.startswith("r_") else kind,
        )  # fmt: skip
    axes.plot(CURVE_THRESHOLDS_MM, curve.mean(axis=1), color="black", linewidth=2.5, label="all joints")
    axes.axvline(1000 * score.threshold, color="grey", linestyle=":")
    axes.set_xlim(CURVE_THRESHOLDS_MM[0], CURVE_THRESHOLDS_MM[-1])
    axes.set_ylim(0, 100)
    axes.set_xlabel("threshold (mm)")
    axes.set_ylabel("joints within the threshold (%)")
    axes.set_title("left solid, right dashed")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower right", fontsize=8)
