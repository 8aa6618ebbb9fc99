"""`jaxskel check`: is the input as it should be? Draws voxel box and hull into every view."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import equinox as eqx
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from .._carve import carve
from .._grid import VoxelGrid
from .._hull import VisualHulls
from .._pictures import PICTURES, write_image
from .._pipeline import Settings, prepare
from .._recording import Recording, unpack_silhouettes
from .._reproject import agreement, reproject
from .._views import lost_views, silhouette_areas
from ..io import read_recording
from ..overlays import draw_box, draw_hull, draw_silhouette, tile
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
    spacing: Spacing = Settings.spacing,
    max_misses: MaxMisses = None,
    box: Box = None,
) -> None:
    """Draw the voxel box and the hull's reprojection; report its coverage of the silhouettes in every view."""
    settings = make_settings(Preset.DEFAULT, spacing, max_misses, box)
    output = chosen_file(output, "check.png", files_of(source), PICTURES)
    recording = read_recording(source)
    drawn = len(recording) // 2 if frame is None else frame
    if not 0 <= drawn < len(recording):
        raise ValueError(f"{source}: there is no frame {drawn}; give 0 to {len(recording) - 1}")
    # No pose is needed, hence no body.
    prepared = prepare(recording, replace(settings, search=None))
    if prepared.table is None:
        raise ValueError(f"{source}: no frame has a hull of a person's size; {_suspect(recording, settings)}")
    cameras, grid = recording.cameras.rotated(prepared.to_z_up), prepared.table.grid
    chosen = np.unique(np.append(np.linspace(0, len(recording) - 1, _FRAMES).astype(int), drawn))
    sils = recording.silhouettes[chosen]
    lost = lost_views(silhouette_areas(sils), cameras)
    hulls = carve(sils, prepared.table, lost, prepared.max_misses)
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
    coverage[lost], spill[lost] = np.nan, np.nan
    labels = [
        f"{name}: {100 * share:.1f} % covered" if np.isfinite(share) else f"{name}: no person"
        for name, share in zip(cameras.names, coverage[list(chosen).index(drawn)], strict=True)
    ]
    write_image(output, tile(images, labels, columns=min(5, len(images))))
    Console().print(_table(cameras.names, coverage, spill, lost))
    say(_describe(recording, grid, hulls))
    say(f"{output}: frame {drawn} of {recording.name}, silhouettes grey, hull yellow, voxel box violet")


def _table(names: tuple[str, ...], coverage: np.ndarray, spill: np.ndarray, lost: np.ndarray) -> Table:
    table = Table(title=f"hull and silhouettes in {len(lost)} frames")
    for column in ("view", "covered %", "worst %", "spill %", "without person"):
        table.add_column(column, justify="left" if column == "view" else "right")
    for c, name in enumerate(names):
        there = ~lost[:, c]
        figures = ["-"] * 3
        if there.any():
            values = (np.median(coverage[there, c]), coverage[there, c].min(), np.median(spill[there, c]))
            figures = [f"{100 * value:.1f}" for value in values]
        table.add_row(cell(name), *figures, str(int(lost[:, c].sum())))
    return table


def _describe(recording: Recording, grid: VoxelGrid, hulls: VisualHulls) -> str:
    size = " x ".join(f"{s:.2f}" for s in np.array(grid.shape) * grid.spacing)
    litres = np.median(1e3 * hulls.volumes)
    return (
        f"{recording.name}: {len(recording)} frames at {recording.fps:g} fps, {len(recording.cameras)} cameras, up "
        f"{recording.up}; voxel box {size} m of {1e3 * grid.spacing:g} mm voxels, median hull {litres:.0f} litres"
    )


def _suspect(recording: Recording, settings: Settings) -> str:
    """Name the camera without which there would be a hull."""
    for c, name in enumerate(recording.cameras.names):
        others = [i for i in range(len(recording.cameras)) if i != c]
        if len(others) < 3:
            break
        part = eqx.tree_at(
            lambda r: (r.cameras, r.silhouettes),
            recording,
            (recording.cameras[others], recording.silhouettes[:, others]),
        )
        if prepare(part, settings).table is not None:
            return f"without camera {name} there is one: calibrate or mask that camera again"
    return "are the masks black or inverted, or the calibration that of other views?"
