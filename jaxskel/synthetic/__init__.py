"""A scene that the package makes itself: body, motion, cameras, silhouettes and ground truth."""

from .._body import Body as Body
from .._body import place_body as place_body
from .._body import place_joints as place_joints
from .adult import draw_adult as draw_adult
from .anatomy import detailed_body as detailed_body
from .asf_amc import parse_asf_amc as parse_asf_amc
from .asf_amc import read_asf_amc as read_asf_amc
from .bvh import parse_bvh as parse_bvh
from .bvh import read_bvh as read_bvh
from .capture import Motion as Motion
from .motion import demo_motion as demo_motion
from .render import View as View
from .render import make_view as make_view
from .render import render as render
from .render import render_view as render_view
from .retarget import find_joints as find_joints
from .retarget import retarget as retarget
from .scene import camera_ring as camera_ring
from .scene import look_at as look_at
from .scene import make_scene as make_scene
