"""The page of a live session: the report's scene, and a message for each frame."""

import json
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ...body import Skeleton, default_adult
from ...poses import Poses
from ...recording import Recording, rotation_to_z_up
from ._filled import filled
from ._numbers import pose_numbers, scene_numbers

# Resolution of points (m): with 16 bits, those up to 16 m from the middle of the cameras are shown.
_STEP = 5e-4
# In order of their dependencies.
_SCRIPTS = ("data.js", "orbit.js", "scene.js", "options.js", "live.js")


@dataclass(frozen=True)
class LivePage:
    """A page that shows the frames of a session as they come. Make one with [`live_page`][].

    Attributes:
        html: The page, which loads nothing else, but asks for messages at ``ws://HOST/poses`` of the host that it is
            from.
        origin: What the points in messages refer to (m, z up).
    """

    html: str
    origin: Float[np.ndarray, "3"]

    def message(self, poses: Poses, told: str) -> str:
        """The message about one frame; the page shows what is told as it is."""
        numbers = pose_numbers(poses, self.origin, _STEP)
        return json.dumps(numbers | {"number": int(poses.frame_index[0]), "told": told}, separators=(",", ":"))


def live_page(rig: Recording, skeleton: Skeleton | None, hosts: tuple[str, ...]) -> LivePage:
    """The page of a rig.

    Args:
        rig: Cameras, up axis and name; its frames are not looked at.
        skeleton: Of the template of the session's poses; None for the paper's human.
        hosts: Names of the server, with its port, that the page may ask for messages.
    """
    origin = (rig.cameras.centres @ rotation_to_z_up(rig.up).T).mean(0)
    address = " ".join(f"ws://{host}" for host in hosts)
    shown = default_adult() if skeleton is None else skeleton
    points = np.concatenate([shown.rest_joints, shown.rest_tips])[None].astype(np.float64)
    numbers = scene_numbers(rig, shown.template, points, origin, _STEP)
    return LivePage(filled("live.html", _SCRIPTS, rig.name, numbers, address=address), origin)
