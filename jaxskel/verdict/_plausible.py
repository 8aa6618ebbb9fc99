"""Is what the silhouettes show a person in a room? Checks its size, the up axis and the cameras' distances."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage

from ..cameras import upright
from ..recording import UP_AXES
from ._scene import Scene
from ._views import POINTS

# Litres of a hull, and half of its largest extent (m). A three-year-old child has 14 litres, and 0.25 m when
# crouching; hulls are a fifth larger than bodies. A small volume alone proves nothing: holes in masks cut tunnels.
_LEAST_VOLUME, _LEAST_HALF = 8.0, 0.3
# The hull of a heavy man from three cameras has 300 litres; four people standing together made one piece of 880. A
# large extent alone proves nothing: people may stand far apart.
_MOST_VOLUME, _LARGE_VOLUME, _MOST_HALF = 1500.0, 600.0, 2.6
# Units that a calibration may have used by mistake, in metres.
_UNITS = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048, "decimetres": 0.1}
_USUAL_HALF = 0.8
# How well the cameras must agree on the upright to be used (length of the mean), and the least cosine between that
# upright and `up`.
_AGREED, _SAME = 0.6, 0.5


class Plausibility(NamedTuple):
    """Measurements of what the silhouettes show.

    Attributes:
        half: Half of the person's largest extent (m).
        litres: Volume of the largest connected part of the hull (litres), median over the frames.
        distances: Distance from each camera to the middle of the person, median over the frames (m).
    """

    half: float
    litres: float
    distances: Float[np.ndarray, " cams"]


def plausibility(scene: Scene) -> Plausibility:
    """Measure what the silhouettes show."""
    samples = scene.samples
    litres = []
    for f, frame in enumerate(scene.frames):
        inside = np.zeros(len(samples.points), bool)
        inside[frame.near[(np.sort(frame.distance, axis=0)[-1 - scene.misses] <= 0)]] = True
        part = np.zeros((POINTS, POINTS, POINTS), np.int32)
        ndimage.label(inside.reshape(part.shape), np.ones((3, 3, 3)), output=part)
        largest = np.bincount(part[part > 0], minlength=1).max()
        litres.append(1e3 * largest * samples.spacing[f] ** 3)
    away = np.linalg.norm(samples.middle[:, None] - scene.cameras.centres, axis=-1)
    return Plausibility(float(np.nanmedian(samples.half)), float(np.nanmedian(litres)), np.median(away, axis=0))


def wrong_unit(found: Plausibility) -> str | None:
    """Message if lengths seem not to be metres; None otherwise."""
    small = found.half < _LEAST_HALF and found.litres < _LEAST_VOLUME
    large = found.litres > _MOST_VOLUME or (found.half > _MOST_HALF and found.litres > _LARGE_VOLUME)
    if not (small or large):
        return None
    told = (
        f"what the silhouettes show is {2 * found.half:.2g} m large and has {found.litres:.3g} litres, seen from "
        f"{found.distances.min():.2g} to {found.distances.max():.2g} m: lengths of the calibration are not metres"
    )
    ratio = found.half / _USUAL_HALF
    # Metres divided by a thousand are as wrong as millimetres left as they are.
    factors = {f"{name} taken for metres": each for name, each in _UNITS.items()}
    factors |= {f"metres taken for {name}": 1 / each for name, each in _UNITS.items()}
    name, factor = min(factors.items(), key=lambda item: abs(np.log(ratio * item[1])))
    if abs(np.log(ratio * factor)) < np.log(1.6):
        told += f" but perhaps {name}: unit times {factor:.4g} in recording.toml"
    return told


def wrong_up(scene: Scene, up: str, turns: Int[np.ndarray, " cams"] | None) -> str | None:
    """Message if the cameras' own upright contradicts the world's up axis; None otherwise.

    If images were turned, the cameras may be upright with or without that turn: one of the two suffices.
    """
    means = [upright(scene.cameras), upright(scene.cameras, turns)]
    agreed = [mean / np.linalg.norm(mean) for mean in means if np.linalg.norm(mean) >= _AGREED]
    if not agreed or any(_direction(up) @ direction >= _SAME for direction in agreed):
        return None
    best = max(UP_AXES, key=lambda axis: _direction(axis) @ agreed[0])
    return (
        f'up is {up}, but the cameras stand upright with {best} up: up = "{best}" in recording.toml, unless they '
        "were mounted that way"
    )


def _direction(axis: str) -> Float[np.ndarray, "3"]:
    unit = np.zeros(3)
    unit["XYZ".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return unit
