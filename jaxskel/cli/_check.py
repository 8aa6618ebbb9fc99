"""`jaxskel check`: judges the input, and draws the voxel box and the hull into every view."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from .._runtime.picture_files import PICTURES, write_image
from ..hull import VisualHulls, VoxelGrid, agreement, carve, reproject
from ..io.recordings import read_recording
from ..pipeline import HullSettings, Prepared, prepare
from ..recording import Recording, find_empty_views, silhouette_areas, unpack_silhouettes
from ..verdict import Severity, Verdict, judge
from ..visualization import draw_box, draw_hull, draw_silhouette, tile
from ._outputs import chosen_file, files_of
from ._run import Box, MaxMisses, Preset, Recorded, Spacing, make_settings
from ._say import cell, say

_FRAMES = 8


def check(
    source: Recorded,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture to write.", show_default="check.png")
    ] = None,
    frame: Annotated[int | None, typer.Option(help="Frame to draw, counted from 0; the middle one by default.")] = None,
    spacing: Spacing = HullSettings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
) -> None:
    """Judge whether the views agree and name what is wrong; draw box and hull into every view.

    Exit code 0: good. 1: there are doubts. 2: no poses are possible, or the input is wrong.
    """
    settings = make_settings(Preset.DEFAULT, spacing, max_misses, box)
    output = chosen_file(output, "check.png", files_of(source), PICTURES)
    recording = read_recording(source)
    drawn = len(recording) // 2 if frame is None else frame
    if not 0 <= drawn < len(recording):
        raise ValueError(f"{source}: there is no frame {drawn}; give 0 to {len(recording) - 1}")
    verdict = judge(recording, thorough=True)
    # No pose is needed, so skip the calibration of the body.
    prepared = prepare(recording, settings, calibrate=False)
    place = f"{source}"
    if prepared.table is not None:
        _draw(recording, prepared, verdict, drawn, output)
        place = f"{output}: frame {drawn} of {recording.name}, silhouettes grey, hull yellow, voxel box violet"
    for finding in verdict.findings:
        say(f"{'wrong' if finding.severity is Severity.HOPELESS else 'doubt'}: {finding.told}")
    if verdict.is_hopeless:
        code, told = 2, "no poses are possible"
    elif prepared.table is None:
        code, told = 2, "no frame has a hull of a person's size; are the masks black, or the calibration wrong?"
    else:
        code, told = (1, "with doubts") if verdict.findings else (0, "good")
    say(f"{place}; verdict from {verdict.frames} frames: {told}")
    if code:
        raise typer.Exit(code)


def _draw(recording: Recording, prepared: Prepared, verdict: Verdict, drawn: int, output: Path) -> None:
    """Draw one frame; tabulate the share of the silhouettes that the hulls cover in a few frames."""
    assert prepared.table is not None
    cameras, grid = prepared.cameras, prepared.table.grid
    chosen = np.unique(np.append(np.linspace(0, len(recording) - 1, _FRAMES).astype(int), drawn))
    sils = np.asarray(recording.silhouettes[chosen])
    empty_views = find_empty_views(silhouette_areas(sils), cameras)
    hulls = carve(sils, prepared.table, empty_views, prepared.max_misses)
    width = 8 * sils.shape[3]
    results, images = [], []
    for i, number in enumerate(chosen):
        masks = unpack_silhouettes(sils[i], width)
        seen = reproject(hulls, i, cameras, *masks.shape[1:])
        results.append(agreement(seen, masks))
        if number == drawn:
            for c in range(len(cameras)):
                w, h = cameras.size[c]
                image = draw_silhouette(masks[c])[:h, :w]
                draw_hull(image, seen[c, :h, :w])
                draw_box(image, cameras, c, grid)
                images.append(image)
    coverage, spill = (np.array([getattr(r, k) for r in results]) for k in ("coverage", "spill"))
    coverage[empty_views], spill[empty_views] = np.nan, np.nan
    labels = [
        f"{name}: {100 * share:.1f} % covered" if np.isfinite(share) else f"{name}: no person"
        for name, share in zip(cameras.names, coverage[list(chosen).index(drawn)], strict=True)
    ]
    write_image(output, tile(images, labels, columns=min(5, len(images))))
    Console().print(_table(cameras.names, coverage, spill, empty_views, verdict))
    say(_describe(recording, grid, hulls, verdict))


def _table(
    names: tuple[str, ...], coverage: np.ndarray, spill: np.ndarray, empty_views: np.ndarray, verdict: Verdict
) -> Table:
    table = Table(title=f"hull and silhouettes in {len(empty_views)} frames")
    for column in ("view", "covered %", "worst %", "spill %", "misfit mm", "without person"):
        table.add_column(column, justify="left" if column == "view" else "right")
    for c, name in enumerate(names):
        there = ~empty_views[:, c]
        figures = ["-"] * 3
        if there.any():
            values = (np.median(coverage[there, c]), coverage[there, c].min(), np.median(spill[there, c]))
            figures = [f"{100 * value:.1f}" for value in values]
        misfit = np.nan if verdict.misfit is None else 1e3 * verdict.misfit[c]
        told = f"{misfit:.1f}" if np.isfinite(misfit) else "-"
        table.add_row(cell(name), *figures, told, str(int(empty_views[:, c].sum())))
    return table


def _describe(recording: Recording, grid: VoxelGrid, hulls: VisualHulls, verdict: Verdict) -> str:
    size = " x ".join(f"{s:.2f}" for s in np.array(grid.shape) * grid.spacing)
    away = ""
    if verdict.figures is not None:
        nearest, farthest = verdict.figures.distances.min(), verdict.figures.distances.max()
        away = f" {nearest:.1f} to {farthest:.1f} m away"
    litres = np.median(1e3 * hulls.volumes)
    return (
        f"{recording.name}: {len(recording)} frames at {recording.fps:g} fps, {len(recording.cameras)} cameras{away}, "
        f"up {recording.up}; voxel box {size} m of {1e3 * grid.spacing:g} mm voxels, median hull {litres:.0f} litres"
    )
