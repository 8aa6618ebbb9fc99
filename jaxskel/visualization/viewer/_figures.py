"""Who is drawn: poses of a person with their colours, and where in the viewer's tree they are."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from ...poses import Poses
from .. import PEOPLE, check_people, colours_of, thickness
from ._rerun import rr


@dataclass(frozen=True)
class Figure:
    """A person as drawn.

    Attributes:
        poses: Poses of the person.
        name: None for somebody who is alone.
        colours: Of each joint, then each tip, and of the bone that ends there: red, green, blue.
        thick: Thickness relative to a human's bones.
    """

    poses: Poses
    name: str | None
    colours: UInt8[np.ndarray, "points 3"]
    thick: float

    def under(self, path: str) -> str:
        """The person's own place below a path of the viewer; the path itself for somebody who is alone."""
        return path if self.name is None else f"{path}/{rr.escape_entity_path_part(self.name)}"

    def points(self, frame: int) -> Float[np.ndarray, "points 3"]:
        """Joints followed by tips of one frame in the recording's world (m); NaN if missing."""
        return np.concatenate([self.poses.joints[frame], self.poses.tips[frame]]).astype(np.float64)


def figures_of(poses: Poses | Mapping[str, Poses] | None) -> list[Figure]:
    """Somebody who is alone has a colour for each side, several people one each.

    Raises:
        ValueError: Of several people, frames, rate, up axis or template differ.
    """
    if poses is None:
        return []
    if not isinstance(poses, Mapping):
        return [Figure(poses, None, colours_of(poses.template), _thickness(poses))]
    check_people(poses)
    found = []
    for place, (name, each) in enumerate(poses.items()):
        colour = np.array(PEOPLE[place % len(PEOPLE)], np.uint8)
        points = len(each.template.point_names)
        found.append(Figure(each, name, np.tile(colour, (points, 1)), _thickness(each)))
    return found


def _thickness(poses: Poses) -> float:
    return thickness(poses.template, np.concatenate([poses.joints, poses.tips], 1))
