"""`jaxskel check`: judges the input, and draws the voxel box and the hull into every view."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from .._runtime.picture_files import PICTURES, write_image
from ..hull import VisualHulls, VoxelGrid, agreement, carve, reproject, without_others
from ..io.recordings import holds_people, read_people, read_recording
from ..people import hide_others
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
    people = hide_others(read_people(source)) if holds_people(source) else {"": read_recording(source)}
    first = next(iter(people.values()))
    drawn = len(first) // 2 if frame is None else frame
    if not 0 <= drawn < len(first):
        raise ValueError(f"{source}: there is no frame {drawn}; give 0 to {len(first) - 1}")
    # No pose is needed, so skip the calibration of the body.
    found = [
        _Checked(name, one, prepare(one, settings, calibrate=False), judge(one, thorough=True))
        for name, one in people.items()
    ]
    place = f"{source}"
    if any(one.prepared.table is not None for one in found):
        _draw(found, drawn, output)
        told = source.name if people.keys() != {""} else first.name
        place = f"{output}: frame {drawn} of {told}, silhouettes grey, hull yellow, voxel box violet"
    for one in found:
        for finding in one.verdict.findings:
            say(f"{one.who}{'wrong' if finding.severity is Severity.HOPELESS else 'doubt'}: {finding.told}")
    code, told = max((_judgement(one) for one in found), key=lambda each: each[0])
    say(f"{place}; verdict from {max(one.verdict.frames for one in found)} frames: {told}")
    if code:
        raise typer.Exit(code)


@dataclass(frozen=True)
class _Checked:
    """One person of a recording, with an empty name if there is no other."""

    name: str
    recording: Recording
    prepared: Prepared
    verdict: Verdict

    @property
    def who(self) -> str:
        return f"{self.name}: " if self.name else ""


def _judgement(one: _Checked) -> tuple[int, str]:
    """Exit code and the words for it."""
    if one.verdict.is_hopeless:
        return 2, "no poses are possible"
    if one.prepared.table is None:
        return 2, "no frame has a hull of a person's size; are the masks black, or the calibration wrong?"
    return (1, "with doubts") if one.verdict.findings else (0, "good")


def _draw(found: list[_Checked], drawn: int, output: Path) -> None:
    """Draw one frame; tabulate the share of the silhouettes that the hulls cover in a few frames."""
    cameras = found[0].prepared.cameras
    everybody = np.bitwise_or.reduce([np.asarray(one.recording.silhouettes[drawn]) for one in found])
    masks = unpack_silhouettes(everybody, 8 * everybody.shape[-1])
    images = [draw_silhouette(mask)[:h, :w] for mask, (w, h) in zip(masks, cameras.size.tolist(), strict=True)]
    shares, tables = [], []
    for one in found:
        if one.prepared.table is None:
            continue
        covered, table = _compared(one, drawn, images)
        shares.append(covered)
        tables.append(table)
    labels = [
        f"{name}: {', '.join(f'{100 * share:.1f} %' for share in of_view if np.isfinite(share)) or 'no person'}"
        + (" covered" if np.isfinite(of_view).any() else "")
        for name, of_view in zip(cameras.names, np.transpose(shares), strict=True)
    ]
    write_image(output, tile(images, labels, columns=min(5, len(images))))
    for table, told in tables:
        Console().print(table)
        say(told)


def _compared(one: _Checked, drawn: int, images: list[np.ndarray]) -> tuple[np.ndarray, tuple[Table, str]]:
    """Draw hull and box of somebody; return the covered share in each view, and what is to be told of a few frames."""
    recording, prepared = one.recording, one.prepared
    assert prepared.table is not None
    cameras = prepared.cameras
    chosen = np.unique(np.append(np.linspace(0, len(recording) - 1, _FRAMES).astype(int), drawn))
    sils = np.asarray(recording.silhouettes[chosen])
    hidden = np.zeros_like(sils) if recording.hidden is None else np.asarray(recording.hidden[chosen])
    empty_views = find_empty_views(silhouette_areas(sils), cameras)
    hulls = carve(sils | hidden, prepared.table, empty_views, prepared.max_misses)
    if recording.hidden is not None:
        hulls = without_others(hulls, prepared.table, sils, hidden)
    width = 8 * sils.shape[3]
    results = []
    for i, number in enumerate(chosen):
        masks, others = unpack_silhouettes(sils[i], width), unpack_silhouettes(hidden[i], width)
        seen = reproject(hulls, i, cameras, *masks.shape[1:])
        results.append(agreement(seen & ~others, masks))
        if number == drawn:
            for c, image in enumerate(images):
                draw_hull(image, seen[c, : image.shape[0], : image.shape[1]])
                draw_box(image, cameras, c, prepared.table.grid)
    coverage, spill = (np.array([getattr(r, k) for r in results]) for k in ("coverage", "spill"))
    coverage[empty_views], spill[empty_views] = np.nan, np.nan
    table = _table(cameras.names, coverage, spill, empty_views, one.verdict, one.who)
    return coverage[list(chosen).index(drawn)], (table, _describe(recording, prepared.table.grid, hulls, one.verdict))


def _table(
    names: tuple[str, ...],
    coverage: np.ndarray,
    spill: np.ndarray,
    empty_views: np.ndarray,
    verdict: Verdict,
    who: str = "",
) -> Table:
    table = Table(title=f"{who}hull and silhouettes in {len(empty_views)} frames")
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
