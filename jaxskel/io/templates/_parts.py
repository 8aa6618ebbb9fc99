"""Rigid segments, hinges and attracted bones of a template file."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...body import ACROSS, FREE, HINGE, Attraction, Hinge
from ..files import fault
from ._point import Point

_WAYS = {
    "front": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0), "down": (0.0, 0.0, -1.0),
}  # fmt: skip
# Defaults for bones whose file says nothing: limits of a hinge, how far a bone swings from rest (degrees), how firmly
# it stays near rest in fits to the graph, and the part of it that lies on the centre-line.
_RANGE, _SWING, _FIRM, _ALONG = (3.0, 143.0), 30.0, 0.2, (0.2, 1.0)


class Parts(NamedTuple):
    """The rigid segments, see `SkeletonTemplate`.

    Attributes:
        about: Joint that each segment turns about.
        of_points: Segment that carries each joint, then each tip.
    """

    names: tuple[str, ...]
    about: tuple[int, ...]
    parents: tuple[int, ...]
    of_points: tuple[int, ...]
    freedoms: tuple[int, ...]
    firmness: tuple[float, ...]
    swings: tuple[float, ...]


def parts_of(path: Path, joints: list[Point], tips: list[Point]) -> Parts:
    """Which segment carries each point. The first is named like the root and turns about it.

    Raises:
        ValueError: A segment would turn about two points.
    """
    order = [joint.name for joint in joints]
    names, owners, of_points = [joints[0].name], [joints[0]], [0]
    for point in (joints + tips)[1:]:
        name = point.text("segment") or point.name
        if name not in names:
            names.append(name)
            owners.append(point)
        of_points.append(names.index(name))
    places = {point.name: place for point, place in zip(joints + tips, of_points, strict=True)}
    about = [joints[0].name, *(str(owner.parent) for owner in owners[1:])]
    for point, segment in zip((joints + tips)[1:], of_points[1:], strict=True):
        # What a segment carries hangs on the point that it turns about, or on something else that it carries.
        if point.parent != about[segment] and places[str(point.parent)] != segment:
            raise fault(
                path, f"{point.key}.segment",
                f"{names[segment]!r} turns about {about[segment]}, but {point.name} hangs on {point.parent}; give "
                "another segment",
            )  # fmt: skip
    freedoms = [FREE]
    for owner in owners[1:]:
        bends = joints[order.index(str(owner.parent))].text("bends")
        freedoms.append(HINGE if bends else FREE if owner.switch("twist", True) else ACROSS)
    swings = [owner.number("swing", 0.0, 180.0) for owner in owners]
    firm = [owner.number("firmness", 0.0, 1e3) for owner in owners[1:]]
    return Parts(
        tuple(names),
        tuple(order.index(joint) for joint in about),
        (-1, *(places[joint] for joint in about[1:])),
        tuple(of_points),
        tuple(freedoms),
        tuple(_FIRM if each is None else each for each in firm),
        tuple(float(np.radians(_SWING if each is None else each)) for each in swings),
    )


def hinges(joints: list[Point], parts: Parts) -> tuple[Hinge, ...]:
    """The joints that bend in one direction; each turns the one segment beyond it."""
    found = []
    for number, joint in enumerate(joints):
        way = joint.text("bends")
        if way is None and "range" in joint.table:
            raise fault(joint.path, f"{joint.key}.range", 'needs bends, such as bends = "front"')
        if way is None:
            continue
        if way not in _WAYS:
            raise fault(joint.path, f"{joint.key}.bends", f"is {way!r}; give one of {', '.join(_WAYS)}")
        beyond = [segment for segment in range(1, len(parts.names)) if parts.about[segment] == number]
        if joint.parent is None or len(beyond) != 1:
            raise fault(joint.path, f"{joint.key}.bends", "is for a joint inside a limb: with a parent and one bone")
        low, high = joint.numbers("range", 2, -180.0, 180.0) or _RANGE
        end = parts.of_points.index(beyond[0])
        found.append(Hinge(number, beyond[0], end, _WAYS[way], float(np.radians(low)), float(np.radians(high))))
    return tuple(found)


def attractions(
    joints: list[Point], tips: list[Point], places: Float[np.ndarray, "points 3"]
) -> tuple[Attraction, ...]:
    """The bones that lie on paths of the graph from the first tip: each on the longest one that it is on."""
    points = joints + tips
    number = {point.name: index for index, point in enumerate(points)}
    above = [[index] for index in range(len(points))]  # each point, and what it hangs on
    reach = np.zeros(len(points))  # from the root along the bones (m)
    for index, point in enumerate(points[1:], 1):
        parent = number[str(point.parent)]
        above[index] += above[parent]
        reach[index] = reach[parent] + np.linalg.norm(places[index] - places[parent])
    begin = len(joints)
    found = []
    for index, joint in enumerate(joints[1:], 1):
        along = joint.table.get("along", list(_ALONG))
        if along is False:
            continue
        # A bone is on the path between two tips if exactly one of them hangs on it.
        ends = [end for end in range(begin + 1, len(points)) if (index in above[end]) != (index in above[begin])]
        if ends:
            last = max(ends, key=lambda end: reach[end] - 2 * max(reach[p] for p in above[end] if p in above[begin]))
            low, high = joint.numbers("along", 2, 0.0, 1.0) or _ALONG
            found.append(Attraction(index, last - begin, low, high))
    return tuple(found)
