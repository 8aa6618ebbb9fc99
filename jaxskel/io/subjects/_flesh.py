"""The table `flesh` of a subject file: a calibrated body as a list of balls, written by programs only.

[flesh]               # offset from the rotation centre of the ball's segment (front, left, up) and radius (m)
l_knee = [0.0, 0.0, 0.02, 0.055]
"""

import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from ...body import BALL_NAMES, Body, Skeleton, make_body
from ..files import fault

# Largest offset of a ball from its segment's rotation centre (m), and the range of its radius (m).
_FARTHEST, _RADII = 1.0, (0.003, 0.4)


def flesh_lines(body: Body) -> list[str]:
    """The table in TOML, rounded to a micrometre."""
    lines = ["[flesh]"]
    for name, offset, radius in zip(BALL_NAMES, np.asarray(body.offsets), np.asarray(body.radii), strict=True):
        lines.append(f"{name} = [{', '.join(f'{value:.6f}' for value in (*offset, radius))}]")
    return lines


def body_of(path: Path, skeleton: Skeleton, table: Any) -> Body:
    """The average body around a skeleton, with the balls of a table instead of its own.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    body = make_body(skeleton)
    offsets, radii = np.array(body.offsets), np.array(body.radii)
    if not isinstance(table, dict):
        raise fault(path, "flesh", "give a table: a line [flesh], then lines as `jaxskel calibrate-body` writes them")
    for key, value in table.items():
        if key not in BALL_NAMES:
            raise fault(path, key, "is no ball of a body; calibrate the subject again or leave the line out")
        numbers = isinstance(value, list) and len(value) == 4 and all(type(x) in (int, float) for x in value)
        if not numbers or not (np.abs(value[:3]) < _FARTHEST).all() or not _RADII[0] < value[3] < _RADII[1]:
            raise fault(path, key, f"is {reprlib.repr(value)}; give front, left, up and radius in metres")
        ball = BALL_NAMES.index(key)
        offsets[ball], radii[ball] = value[:3], value[3]
    return Body(skeleton, body.segments, offsets, radii, body.links)
