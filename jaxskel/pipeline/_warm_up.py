"""Compiles what a stream needs before its first frame comes."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .._runtime.kinds import check_kind
from ..body import HUMAN_15, Body, Skeleton, make_body, place_body
from ..cameras import Cameras, make_cameras
from ..hull import carve, most_misses, projection_table
from ..synthetic import camera_ring, demo_motion, random_poses, render
from ._moving_grid import grid_around
from ._prepare import scale_for
from ._settings import Settings
from ._stream import Stream, streaming

# Frames of the built-in motion, as a quarter of a second has at most: the first is searched in, others are followed.
_FRAMES = 4


def warm_up(cameras: Cameras, settings: Settings | None = None, subject: Body | Skeleton | None = None) -> None:
    """Compile everything that a `Stream` with these arguments needs, or load what `keep_compiled` has kept.

    Nothing then compiles in the middle of a stream. A rendered person is reconstructed in a ring of as many cameras:
    programs depend on the number of cameras, the sizes of images, the kinds of lenses and the settings, not on where
    cameras stand.

    Args:
        cameras: The rig.
        settings: As for `Stream`.
        subject: As for `Stream`; only what is known matters, not who it is.
    """
    check_kind("cameras", cameras, Cameras, "Cameras, as a recording has them")
    settings = streaming(settings)
    average = settings.average
    rig, body = _ring_like(cameras).scaled(1 / scale_for(average)), make_body(average)
    human = average.template == HUMAN_15
    motion = demo_motion(average, _FRAMES, 30.0) if human else random_poses(average, _FRAMES)
    masks = render(rig, *place_body(body, motion))
    for stream in _streams(rig, settings, subject, body):
        with stream:
            for frame in masks:
                stream.push(frame)
    _carve_all_ways(rig, settings)


def _streams(rig: Cameras, settings: Settings, subject: Body | Skeleton | None, body: Body) -> Iterator[Stream]:
    """Streams that go every way: a subject to be found, searches from all starts, masks that contradict each other."""
    yield Stream(rig, settings, subject)
    if settings.search is None:
        return
    doubtful = replace(settings, search=replace(settings.search, doubtful=-np.inf))
    yield Stream(rig, doubtful, body)
    if settings.hull.max_misses is None and most_misses(len(rig)):
        yield Stream(rig, replace(settings, hull=replace(settings.hull, max_misses=1)), body)


def _carve_all_ways(rig: Cameras, settings: Settings) -> None:
    """Carve with all numbers of views that may err."""
    width, height = rig.size.max(0).tolist()
    grid, told = grid_around(np.array([0.0, 0.0, 1.0]), settings.hull.spacing), settings.hull.max_misses
    columns = -(-width // 8)
    table = projection_table(rig, grid, height, 8 * columns)
    everywhere = np.full((1, len(rig), height, columns), 0xFF, np.uint8)
    for misses in range(most_misses(len(rig)) + 1) if told is None else (told,):
        carve(everywhere, table, max_misses=misses, at_once=1)


def _ring_like(cameras: Cameras) -> Cameras:
    """The same number and kinds of cameras, in a ring around the origin."""
    right, low = cameras.size.min(0).tolist()
    ring = camera_ring(len(cameras), size=(right, low))
    return make_cameras(ring.K, ring.R, ring.t, cameras.size, names=cameras.names, fisheye=cameras.are_fisheye)
