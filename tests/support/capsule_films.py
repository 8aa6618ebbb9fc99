"""A capsule body of known radii in known poses, and its observations: for search, calibration and tracking."""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxskel import HullSettings, Pose, Recording, Settings, default_adult, make_body, observe_batch, prepare
from jaxskel.body import Body, place_body, place_joints
from jaxskel.refinement.terms import Observed
from jaxskel.search import graphless_poses, start_poses
from jaxskel.synthetic import camera_ring, render

ADULT = default_adult()
BODY = make_body(ADULT)


class Filmed(eqx.Module):
    """The truth, and the inputs of a search."""

    truth: Pose
    joints: np.ndarray
    starts: Pose
    fallback: Pose
    observed: Observed


def some(tree: Any, frames: Any) -> Any:
    return jax.tree.map(lambda a: np.asarray(a)[frames], tree)


def joints_of(poses: Pose) -> np.ndarray:
    """Joints (m)."""
    return np.asarray(place_joints(ADULT, poses)[0], np.float64)


def film_body(truth: Pose, fps: float, body: Body = BODY) -> Filmed:
    """Film a body in a stack of poses; every frame must show it."""
    count, cameras = len(truth.root), camera_ring(size=(320, 240))
    silhouettes = render(cameras, *place_body(body, truth))
    recording = Recording(cameras, silhouettes, fps, "+Z", np.arange(count), ADULT)
    settings = Settings(hull=HullSettings(max_misses=0))
    found = observe_batch(recording, prepare(recording, settings, calibrate=False), settings)
    labelled, outlines = found.labelled, found.outlines
    assert labelled is not None
    assert outlines is not None
    assert len(found.seen.frames) == count
    starts = start_poses(labelled.limbs, labelled.facing, ADULT)
    return Filmed(truth, joints_of(truth), starts, graphless_poses(outlines.middles, ADULT), outlines.observed)
