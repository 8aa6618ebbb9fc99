"""Synthetic scenes with ground truth: body, motion, cameras and silhouettes (cf. the paper's Sect. 4.1).

In: a number of frames and cameras. Out: a `Recording` with `Truth`.
"""

from ._adult import draw_adult as draw_adult
from ._anatomy import detailed_body as detailed_body
from ._meetings import handshake as handshake
from ._meetings import hug as hug
from ._meetings import stand_close as stand_close
from ._meetings import walk_by as walk_by
from ._motion import demo_motion as demo_motion
from ._people import make_people as make_people
from ._random_poses import random_poses as random_poses
from ._render import View as View
from ._render import make_view as make_view
from ._render import render as render
from ._render import render_view as render_view
from ._retarget import find_joints as find_joints
from ._retarget import retarget as retarget
from ._scene import camera_ring as camera_ring
from ._scene import look_at as look_at
from ._scene import make_scene as make_scene
