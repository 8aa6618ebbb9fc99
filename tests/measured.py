"""A person of proportions of their own, made of capsules and filmed: for what finds proportions."""

import numpy as np

from jaxskel import Recording, default_adult
from jaxskel._body import BALL_NAMES, FREE_BALLS, Body, place_body
from jaxskel._dimensions import LENGTH_NAMES, Shape, adults_prior, shaped_body
from jaxskel._recording import Truth
from jaxskel._skeleton import Pose
from jaxskel._stacks import taken
from jaxskel.synthetic import camera_ring, demo_motion, render

ADULT = default_adult()
# Relative to the average adult.
_LENGTHS = {
    "trunk": 1.05, "neck": 1.05, "shoulder": 0.98, "upper_arm": 0.95, "forearm": 1.05, "hip": 1.15, "thigh": 1.05,
    "shank": 1.12, "head_top": 1.05, "fingertip": 0.7, "toetip": 1.05,
}  # fmt: skip
_STOUTER = 0.008  # m, at waist and chest


def other_person() -> Body:
    """Taller, with short upper arms, long shanks, broad hips, stout, the hands half closed."""
    balls = np.zeros((len(FREE_BALLS), 4))
    for row, ball in enumerate(FREE_BALLS):
        balls[row, 3] = _STOUTER if BALL_NAMES[ball] in ("l_waist", "l_chest") else 0.0
    shape = Shape(np.log([_LENGTHS[name] for name in LENGTH_NAMES]), relaxed_shape().fingers, balls)
    body = shaped_body(ADULT, shape)
    skeleton = ADULT.__class__(
        *(np.asarray(a, np.float64) for a in (body.skeleton.rest_joints, body.skeleton.rest_tips))
    )
    return Body(skeleton, body.segments, np.asarray(body.offsets), np.asarray(body.radii), body.links)


def film_person(body: Body, frames: int) -> tuple[Recording, Pose]:
    """Film a body in poses from all of the demo's motion."""
    every = demo_motion(body.skeleton, 60)
    motion = taken(every, np.linspace(0, 59, frames).astype(int))
    cameras = camera_ring(size=(400, 300))
    silhouettes = render(cameras, *place_body(body, motion))
    nowhere = Truth(np.full((frames, 15, 3), np.nan))
    return Recording(cameras, silhouettes, 5.0, "+Z", np.arange(frames), body.skeleton, nowhere, "measured"), motion
