"""A person of proportions of their own, made of capsules and filmed: for what finds proportions."""

import numpy as np

from jaxskel import Recording, default_adult
from jaxskel._body import Body, place_body
from jaxskel._dimensions import QUANTITIES, Shape, adults_prior, shaped_body
from jaxskel._recording import Truth
from jaxskel._skeleton import Pose
from jaxskel._stacks import taken
from jaxskel.synthetic import camera_ring, demo_motion, render

ADULT = default_adult()
_STOUTER = 0.008  # m, at waist and chest


def other_person() -> Body:
    """Somebody as adults are, drawn at random, but stouter at waist and chest than goes with the rest."""
    prior = adults_prior(ADULT)
    sizes, directions = np.linalg.eigh(prior.precision)
    # The first is the size, which is free.
    drawn = np.random.default_rng(1).normal(size=len(sizes) - 1) / np.sqrt(sizes[1:])
    vector = prior.mean.vector + directions[:, 1:] @ drawn
    hands = [i for i, name in enumerate(QUANTITIES) if name.startswith(("finger", "palm"))]
    vector[hands] = prior.mean.vector[hands]
    for name in ("waist", "chest"):
        vector[QUANTITIES.index(f"{name} radius")] += _STOUTER
    body = shaped_body(ADULT, Shape.of(vector))
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
