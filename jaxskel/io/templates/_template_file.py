"""Template files: the skeleton of any body in TOML, by names.

name = "arm"                        # at rest x is to the front, y to the left, z up; metres, of any size
graph_begins = "up"                 # which way the first tip lies farthest: up or down
described_by = ["top", "l_finger"]  # tips whose distances find the inner joints in the graph; all by default

[joints]                            # parents before children; the first is the root
trunk = { at = [0, 0, 1.0], inner = true }
l_elbow = { parent = "trunk", at = [0, 0.3, 1.0], bends = "front", range = [3, 145] }

[tips]                              # ends of limbs, which are the end nodes of the graph; it begins at the first
top = { parent = "trunk", at = [0, 0, 1.4] }
l_finger = { parent = "l_elbow", at = [0, 0.6, 1.0] }
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...body import HUMAN_15, POINT_NAMES, Skeleton, SkeletonTemplate, default_adult, human_points, make_skeleton
from ..files import check_known, fault, read_toml
from ._parts import attractions, hinges, parts_of
from ._point import Point

_KEYS = ("name", "graph_begins", "described_by", "joints", "tips")
_EXAMPLE = 'joints.l_elbow = { parent = "l_shoulder", at = [0, 0.5, 1.2] }'
_BEGINS = {"up": (0.0, 0.0, 1.0), "down": (0.0, 0.0, -1.0)}
_MOST_POINTS = 200
# What markers and bones may be called in all files that poses are written to.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}")


def read_template(path: str | Path) -> Skeleton:
    """Read a template of a skeleton, with its dimensions at rest, from a TOML file.

    Of each joint and tip: `parent`; `at`, its place at rest (m); or `is`, what it is on the human body, as shares of
    the points of [`POINT_NAMES`][jaxskel.body.POINT_NAMES], such as ``{ pelvis = 0.5, neck = 0.5 }``. A name of these
    means itself. Where all points are on the human body, searches find them, and `at` is not needed.

    Further keys: `inner = true` for joints that are found in the graph by their distances to the end nodes (Eq. 5);
    `segment`, the rigid part that carries it, by default its own; `bends`, to where the next bone moves (front, back,
    left, right, up, down), and `range`, how far, in degrees; `twist = false` if its bone does not turn about itself;
    `swing`, how far its bone turns from rest at most, in degrees; `firmness`, how firmly it stays near its rest in fits
    to the graph; `radius` of the flesh (m); `along`, the part of its bone that lies on the centre-line of the body, as
    two shares, or false. Names that begin with ``l_`` and ``r_`` are pairs.

    Raises:
        ValueError: One line that names the file, the key and how to mend it.
    """
    path = Path(path)
    table = read_toml(path, _KEYS, "a template of a skeleton", _EXAMPLE)
    name = table.get("name", path.stem)
    if not isinstance(name, str) or not name.strip() or name == HUMAN_15.name:
        raise fault(path, "name", f"is {name!r}; give a name of your own")
    joints, tips = _points(path, table, "joints"), _points(path, table, "tips")
    _check_tree(path, joints, tips)
    points = joints + tips
    names = [point.name for point in points]
    meanings = tuple(_meaning(path, point) for point in points)
    places = _places(path, points, meanings)
    parts = parts_of(path, joints, tips)
    inner = tuple(number for number, joint in enumerate(joints) if joint.switch("inner", False))
    if not inner:
        raise fault(path, "joints", "have no inner one; write inner = true at those where limbs meet")
    radii = [point.number("radius", 0.0, 10.0) for point in points]
    size = float(np.ptp(places, axis=0).max())
    template = SkeletonTemplate(
        name=name,
        joint_names=tuple(names[: len(joints)]),
        joint_parents=tuple(-1 if joint.parent is None else names.index(joint.parent) for joint in joints),
        tip_names=tuple(names[len(joints) :]),
        tip_parents=tuple(names.index(str(tip.parent)) for tip in tips),
        segment_names=parts.names,
        segment_parents=parts.parents,
        segment_of_joint=parts.of_points[: len(joints)],
        segment_of_tip=parts.of_points[len(joints) :],
        freedoms=parts.freedoms,
        inner=inner,
        described_by=_described_by(path, table, tips),
        attracted=attractions(joints, tips, places),
        firmness=parts.firmness,
        hinges=hinges(joints, parts),
        radii=tuple(float(radius / size) for radius in radii if radius is not None) if all(radii) else None,
        meanings=meanings,
        swings=parts.swings,
        begins=_begins(path, table),
    )
    try:
        return make_skeleton(places[: len(joints)], places[len(joints) :], template)
    except ValueError as error:
        raise fault(path, "joints", str(error)) from None


def _points(path: Path, table: dict[str, Any], kind: str) -> list[Point]:
    given = table.get(kind)
    if not isinstance(given, dict) or not given or len(given) > _MOST_POINTS:
        raise fault(path, kind, f"must be a table of 1 to {_MOST_POINTS}; write for example: {_EXAMPLE}")
    for name, keys in given.items():
        if not isinstance(keys, dict):
            raise fault(path, f"{kind}.{name}", f"is {keys!r}; write for example: {_EXAMPLE}")
        for key in keys:
            check_known(path, key, Point.keys, f"{kind}.{name}.")
    return [Point(path, kind, name, keys) for name, keys in given.items()]


def _check_tree(path: Path, joints: list[Point], tips: list[Point]) -> None:
    """Parents come before their children; there is one root; no name is used twice."""
    known: list[str] = []
    for point in joints + tips:
        if not _NAME.fullmatch(point.name):
            raise fault(path, point.key, "is no name; give letters, digits, _ and -, a letter first")
        if point.name in known:
            raise fault(path, point.key, "is a joint, too; give the tip a name of its own")
        if point.parent is None and known:
            raise fault(path, point.key, f"has no parent; write parent = one of {', '.join(known)}")
        if point.parent is not None and point.parent not in [joint.name for joint in joints]:
            raise fault(path, f"{point.key}.parent", f"is {point.parent!r}; give one of the joints")
        if point.parent is not None and point.parent not in known:
            raise fault(path, f"{point.key}.parent", f"{point.parent!r} comes later; write parents before children")
        known.append(point.name)
    if joints[0].parent is not None or len(joints) < 2 or len(tips) < 2:
        raise fault(path, "joints", "need a root without a parent, another joint, and two tips or more")


def _meaning(path: Path, point: Point) -> tuple[tuple[str, float], ...]:
    """What a point is on the human body; empty if it is not on it."""
    given = point.table.get("is", {point.name: 1.0} if point.name in POINT_NAMES else {})
    if not isinstance(given, dict):
        raise fault(path, f"{point.key}.is", f"is {given!r}; write for example {{ pelvis = 0.5, neck = 0.5 }}")
    for name, share in given.items():
        check_known(path, name, POINT_NAMES, f"{point.key}.is.")
        if isinstance(share, bool) or not isinstance(share, int | float):
            raise fault(path, f"{point.key}.is.{name}", f"is {share!r}; give a share, such as 0.5")
    if given and abs(sum(given.values()) - 1) > 1e-3:
        raise fault(path, f"{point.key}.is", f"sums up to {sum(given.values()):g}; let the shares sum up to one")
    return tuple((name, float(share)) for name, share in given.items())


def _places(
    path: Path, points: list[Point], meanings: tuple[tuple[tuple[str, float], ...], ...]
) -> Float[np.ndarray, "points 3"]:
    """Places at rest (m): as given, or where the average adult has them."""
    given = [point.place() for point in points]
    if all(place is not None for place in given):
        return np.array(given, np.float64)
    if any(place is not None for place in given) or not all(meanings):
        point = next(point for point, place in zip(points, given, strict=True) if place is None)
        raise fault(path, f"{point.key}.at", "is missing; give its place at rest in metres: [x, y, z]")
    return human_points(default_adult(), meanings)


def _described_by(path: Path, table: dict[str, Any], tips: list[Point]) -> tuple[int, ...]:
    names = [tip.name for tip in tips]
    given = table.get("described_by", names)
    if not isinstance(given, list) or not given or not all(name in names for name in given):
        raise fault(path, "described_by", f"is {given!r}; give some of the tips: {', '.join(names)}")
    return tuple(names.index(name) for name in names if name in given)


def _begins(path: Path, table: dict[str, Any]) -> tuple[float, float, float]:
    given = table.get("graph_begins", "up")
    if not isinstance(given, str) or given not in _BEGINS:
        raise fault(path, "graph_begins", f"is {given!r}; give up or down")
    return _BEGINS[given]
