"""Poses from voxels without silhouettes: the method from the hulls on, as with the paper's settings."""

from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
from jaxtyping import Bool

from .._runtime.kinds import check_kind
from ..body import Skeleton, default_adult, make_body
from ..hull import Stopwatch, see_bodies
from ..poses import Poses, join_poses
from ..recording import rotation_to_z_up
from ..volumes import Volumes, hulls_of, make_volumes
from ._assemble import FramesOf, assemble
from ._coupled_batches import Started, coupled_batches
from ._observe_batch import graphs_of, label_graphs
from ._prepare import SUBJECT_FRAMES, template_of
from ._reconstruct import BATCH
from ._refine import refine
from ._settings import Settings, paper_settings
from ._start import start_by_graph


def reconstruct_hulls(
    occupied: Bool[np.ndarray, "frames x y z"],
    origin: Any,
    spacing: float,
    settings: Settings | None = None,
    skeleton: Skeleton | None = None,
    up: str = "+Z",
    fps: float = 30.0,
    frame_index: Any = None,
) -> Poses:
    """Reconstruct the pose of every frame from voxels, by the paper's method from the hulls on (Sect. 3.1 to 3.3).

    In each frame the largest connected body is the person. A frame without voxels is ``empty``; one without a body of
    eight litres has ``no_hull``; a second body of a person's size makes it ``several_people``; a body with twelve
    voxels at the edge of the volume is ``partly_outside``. Pad volumes that were cut out around a whole person by one
    empty voxel on each side. For a search, which is more accurate, see `virtual_recording`.

    Args:
        occupied: Which voxels are occupied.
        origin: Lower corner of the first voxel, ``(3,)`` (m, world).
        spacing: Edge length of a voxel (m).
        settings: Settings without a search; `paper_settings` if None. Those of carving are not used.
        skeleton: The subject's dimensions; if None, an average adult is scaled to the stature of the graphs of up to 24
            frames.
        up: World axis that points up.
        fps: Frames per second.
        frame_index: Number of each frame; by default counted from 0.

    Returns:
        Poses in the voxels' world, with a status for each frame, as from `reconstruct`.

    Raises:
        ValueError: One line that names the argument.
    """
    volumes = make_volumes(occupied, origin, spacing, up, fps, frame_index, skeleton)
    return join_poses(reconstruct_volumes(volumes, settings))


def reconstruct_volumes(
    volumes: Volumes, settings: Settings | None = None, stopwatch: Stopwatch = lambda _: nullcontext()
) -> Iterator[Poses]:
    """As `reconstruct_hulls`, batch by batch, in order."""
    settings = paper_settings() if settings is None else settings
    check_without_silhouettes(settings)
    with stopwatch("prepare"):
        skeleton = volumes.skeleton or _template(volumes, settings)
    objective = settings.refinement.objective_for(settings.body or make_body(skeleton))
    started = _started(volumes, skeleton, settings, stopwatch)
    if objective.couplings:
        yield from coupled_batches(started, skeleton, objective, settings.refinement, stopwatch=stopwatch)
        return
    for frames, seen, start in started:
        refined = None
        if start is not None:
            with stopwatch("refine"):
                refined = refine(start.poses, start.observed, skeleton, objective, settings.refinement)
        yield assemble(frames, skeleton, seen, start, refined)


def _started(volumes: Volumes, skeleton: Skeleton, settings: Settings, stopwatch: Stopwatch) -> Iterator[Started]:
    """All batches of some volumes, before their refinement."""
    to_z_up = rotation_to_z_up(volumes.up)
    for first in range(0, len(volumes), BATCH):
        frames = np.arange(first, min(first + BATCH, len(volumes)))
        with stopwatch("graph"):
            seen = see_bodies(hulls_of(volumes, frames))
        start = None
        if len(seen.frames):
            assert seen.hulls is not None
            with stopwatch("graph"):
                graphs = graphs_of(seen.hulls, skeleton, settings.graph)
            start = start_by_graph(label_graphs(graphs, skeleton, settings, stopwatch), BATCH, {})
        yield Started(FramesOf(to_z_up, volumes.up, volumes.fps, volumes.frame_index[frames]), seen, start)


def check_without_silhouettes(settings: Any) -> None:
    """Refuse settings that need silhouettes.

    Raises:
        ValueError: One line that says what to give.
    """
    check_kind("settings", settings, Settings, "paper_settings()")
    needs = None
    if settings.template is not None and not settings.template.template.is_human:
        raise ValueError("template: voxels are matched with humans only; give silhouettes for another template")
    if settings.search is not None:
        needs = "a search"
    elif settings.usual_objective().needs_outlines:
        needs = "an objective of outlines"
    if needs is not None:
        raise ValueError(
            f"settings: {needs} needs silhouettes, and voxels have none; give paper_settings(), or reconstruct("
            "virtual_recording(...), settings)"
        )
    if settings.hull.box is not None:
        raise ValueError("settings: hull.box is for carving; cut occupied to the box instead, and move origin")


def _template(volumes: Volumes, settings: Settings) -> Skeleton:
    """The template at the stature of the graphs of some frames."""
    chosen = np.unique(np.linspace(0, len(volumes) - 1, SUBJECT_FRAMES).astype(int))
    seen = see_bodies(hulls_of(volumes, chosen))
    if len(seen.frames) == 0:
        return default_adult()
    assert seen.hulls is not None
    return template_of(graphs_of(seen.hulls, default_adult(), settings.graph))
