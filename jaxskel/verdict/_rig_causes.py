"""Faults of all views at once: tests which repair of the whole rig makes the silhouettes agree."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from ..cameras import Cameras
from ._repairs import Flipped, HalfTurn, Masks, Mirrored, QuarterTurn, Similarity
from ._scene import Scene, make_scene
from ._views import POINTS

Views = Bool[np.ndarray, "frames cams rows columns"]

# Number of frames tried: each repair evaluates the whole rig anew.
_FRAMES = 4
# All repairs are tried with few points along an edge of the cube around the person, and the best ones with all.
_ROUGH, _CLOSELY = 24, 4
# A repair explains the contradiction if at most this share of the misfit remains.
_LEFT = 0.35
# Ratios of image size to calibrated size that cameras and people commonly choose.
_SCALES = (1 / 3, 0.4, 0.5, 0.6, 2 / 3, 0.75, 0.8, 5 / 4, 4 / 3, 1.5, 5 / 3, 2.0, 2.5, 3.0)


class RigCause(NamedTuple):
    """A fault of all views that explains why they contradict each other.

    Attributes:
        misfit: Misfit that remains once the fault is mended (half heights).
    """

    told: str
    misfit: float


def rig_cause(scene: Scene) -> RigCause | None:
    """The fault of the whole rig that explains most of the contradiction; None if no fault explains enough of it."""
    chosen = np.unique(np.linspace(0, len(scene.masks) - 1, _FRAMES).round().astype(int))
    cameras, masks = scene.cameras, scene.masks[chosen]
    hidden = None if scene.hidden is None else scene.hidden[chosen]
    before = make_scene(cameras, masks, hidden=hidden).misfit()
    tried = []
    for told, change in _repairs(cameras):
        others, mended = change(cameras, masks)
        behind = None if hidden is None else change(cameras, hidden)[1]
        if mended.any((2, 3)).sum() == masks.any((2, 3)).sum():  # else the person left some view, with all its misfit
            tried.append((_misfit(others, mended, behind, _ROUGH), told, others, mended, behind))
    best = RigCause("", _LEFT * before)
    for _, told, others, mended, behind in sorted(tried, key=lambda each: each[0])[:_CLOSELY]:
        misfit = _misfit(others, mended, behind, POINTS)
        if misfit < best.misfit:
            best = RigCause(told, misfit)
    return best if best.told else None


def _misfit(cameras: Cameras, masks: Views, hidden: Views | None, points: int) -> float:
    """The misfit of a rig (half heights), infinite where a view no longer sees the person of the others."""
    scene = make_scene(cameras, masks, points, hidden)
    return scene.misfit() if np.isfinite(scene.by_view()).all() else np.inf


_Change = Callable[[Cameras, Views], tuple[Cameras, Views]]


def _repairs(cameras: Cameras) -> Iterator[tuple[str, _Change]]:
    for repair in (HalfTurn(), Mirrored(), Flipped(), QuarterTurn(1), QuarterTurn(3)):
        yield f"every view {repair.told}", lambda c, m, r=repair: (c, _each(c, m, r.apply))
    count = len(cameras)
    orders = [np.roll(np.arange(count), shift) for shift in range(1, count)] + [np.arange(count)[::-1]]
    for order in orders:
        if (cameras.size == cameras.size[order]).all():
            first = f"{cameras.names[0]} has the images of {cameras.names[order[0]]}"
            yield (
                f"the views are in another order than the cameras ({first}, and so on)",
                (lambda c, m, o=order: (c, m[:, np.argsort(o)])),
            )
    yield "the extrinsics take points from the camera to the world: invert them", lambda c, m: (_inverted(c), m)
    yield "the translations are optical centres: t = -R centre", lambda c, m: (_from_centres(c), m)
    yield (
        "the cameras' y is up and z backwards, as in OpenGL: turn them by 180 degrees about x",
        (lambda c, m: (_from_opengl(c), m)),
    )
    yield (
        "the extrinsics are camera to world with y up and z backwards, as in OpenGL and Blender",
        (lambda c, m: (_from_opengl(_inverted(c)), m)),
    )
    for scale in _SCALES:
        told = f"every view is resized to {scale:.3g} times the size that was calibrated (scale in recording.toml)"
        yield told, lambda c, m, s=scale: (c, _each(c, m, _from_corner(s, c).apply))


def _each(cameras: Cameras, masks: Views, change: Callable[[Masks], Masks]) -> Views:
    found = np.zeros_like(masks)
    for c, (width, height) in enumerate(cameras.size):
        found[:, c, :height, :width] = change(masks[:, c, :height, :width])
    return found


def _from_corner(scale: float, cameras: Cameras) -> Similarity:
    """Images that are resized, with their first pixel at that of the calibrated ones."""
    width, height = cameras.size[0]
    return Similarity(scale, (scale - 1) * (width - 1) / 2, (scale - 1) * (height - 1) / 2)


def _inverted(cameras: Cameras) -> Cameras:
    R, t = np.asarray(cameras.R), np.asarray(cameras.t)
    back = np.swapaxes(R, 1, 2)
    return replace(cameras, R=back, t=-np.einsum("cij,cj->ci", back, t))


def _from_centres(cameras: Cameras) -> Cameras:
    R, t = np.asarray(cameras.R), np.asarray(cameras.t)
    return replace(cameras, t=-np.einsum("cij,cj->ci", R, t))


def _from_opengl(cameras: Cameras) -> Cameras:
    flip = np.diag([1.0, -1.0, -1.0])
    return replace(cameras, R=flip @ np.asarray(cameras.R), t=np.asarray(cameras.t) @ flip)
