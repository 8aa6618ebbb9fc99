"""Measures how the time per frame grows with cameras, voxels, image size and frames: a picture, and the numbers.

    taskset -c 0 python benchmarks/growth.py -o growth.png [--quick]

The package films its own person in a ring of cameras; `--preset paper` reconstructs the film, after start-up.
"""

import argparse
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from _stage_times import stage_times
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxskel import HullSettings, Recording, paper_settings, prepare
from jaxskel.synthetic import camera_ring, make_scene

FRAMES, CAMERAS, WIDTH, SPACING = 64, 8, 640, 0.015
_STAGES = ("carve", "graph", "match", "refine")


def film(frames: int = FRAMES, cameras: int = CAMERAS, width: int = WIDTH) -> Recording:
    """A scene; the motion is always the same, but more frames sample it more finely."""
    size = (width, width * 3 // 4)
    return make_scene(frames, 5.0 * frames / FRAMES, camera_ring(cameras, size=size))


def times(recording: Recording, spacing: float = SPACING, repeat: int = 3) -> dict[str, float]:
    """Milliseconds a frame by stage, medians over repetitions, and all together."""
    settings = replace(paper_settings(), hull=HullSettings(spacing=spacing, max_misses=0))
    return stage_times(recording, settings, prepare(recording, settings), repeat)


def series(quick: bool) -> Iterable[tuple[str, list[float], list[dict[str, float]]]]:
    """The growing quantity, its values, and the times at each value."""
    every = slice(None, None, 3 if quick else 1)
    scene = film()
    cameras = [4, 6, 8, 12, 16][every]
    yield "cameras", list(cameras), [times(film(cameras=count)) for count in cameras]
    voxels = [30.0, 20.0, 15.0, 12.0, 10.0][every]
    yield "voxel (mm)", list(voxels), [times(scene, 1e-3 * edge) for edge in voxels]
    widths = [320, 640, 960, 1280][every]
    yield "image width (px)", list(widths), [times(film(width=width)) for width in widths]
    frames = [32, 64, 128, 256][every]
    yield "frames", list(frames), [times(film(frames=count)) for count in frames]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", "-o", type=Path, required=True, help="picture (.png)")
    parser.add_argument("--quick", action="store_true", help="fewer values")
    arguments = parser.parse_args()
    figure = Figure((10, 2.8), layout="constrained")
    FigureCanvasAgg(figure)
    print(f"others: {CAMERAS} cameras of {WIDTH} px, {1e3 * SPACING:g} mm, {FRAMES} frames\n")
    print(f"| | | {' | '.join(_STAGES)} | all (ms/frame) |\n|{'---|' * (len(_STAGES) + 3)}")
    all_axes = figure.subplots(1, 4, sharey=True)
    for axes, (what, values, found) in zip(all_axes, series(arguments.quick), strict=True):
        for value, row in zip(values, found, strict=True):
            print(f"| {what} | {value:g} | {' | '.join(f'{row[s]:.2f}' for s in (*_STAGES, 'all'))} |", flush=True)
        for stage in (*_STAGES, "all"):
            axes.loglog(values, [row[stage] for row in found], "o-", label=stage, markersize=3, linewidth=1)
        axes.set_xlabel(what)
        axes.set_xticks(values, [f"{value:g}" for value in values])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    all_axes[0].set_ylabel("ms a frame, one core")
    figure.legend(*all_axes[0].get_legend_handles_labels(), loc="outside right center", fontsize=7)
    figure.savefig(arguments.output, dpi=150)
    print(f"\nwritten: {arguments.output}")


if __name__ == "__main__":
    main()
