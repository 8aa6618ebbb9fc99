"""A person with individual proportions, made of capsules and filmed, for tests of body calibration."""

from functools import cache

import numpy as np

from jaxskel import Recording, default_adult
from jaxskel._runtime.batching import take
from jaxskel.body import BALL_NAMES, Body, Pose, place_body
from jaxskel.recording import Truth
from jaxskel.synthetic import camera_ring, demo_motion, draw_adult, render

ADULT = default_adult()
_STOUTER = 0.008  # m, at waist and chest


@cache
def other_person() -> Body:
    """A typical adult, but with more flesh at waist and chest."""
    body = draw_adult(1, 1.78)
    stouter = [_STOUTER * (name[2:] in ("waist", "chest")) for name in BALL_NAMES]
    return Body(body.skeleton, body.segments, body.offsets, np.asarray(body.radii) + stouter, body.links)


def film_person(body: Body, frames: int) -> tuple[Recording, Pose]:
    """Film a body in poses from all of the demo's motion."""
    every = demo_motion(body.skeleton, 60)
    motion = take(every, np.linspace(0, 59, frames).astype(int))
    cameras = camera_ring(size=(400, 300))
    silhouettes = render(cameras, *place_body(body, motion))
    nowhere = Truth(np.full((frames, 15, 3), np.nan))
    return Recording(cameras, silhouettes, 5.0, "+Z", np.arange(frames), body.skeleton, nowhere, "measured"), motion
