"""A capsule body of known radii in known poses and what is seen of it: for search, calibration and tracking."""

from typing import Any

import equinox as eqx
import jax
import numpy as np

from jaxskel import (
    Pose,
    Recording,
    Settings,
    default_adult,
    labelled_limbs,
    make_body,
    person_graphs,
    prepare,
    see_people,
)
from jaxskel._body import place_body, place_joints
from jaxskel._observe import middles_of_people, observed_volume
from jaxskel._starts import graphless_poses, start_poses
from jaxskel.synthetic import camera_ring, render
from jaxskel.terms import Observed

ADULT = default_adult()
BODY = make_body(ADULT)


class Filmed(eqx.Module):
    """The truth, and what a search is given."""

    truth: Pose
    joints: np.ndarray
    starts: Pose
    fallback: Pose
    observed: Observed


def some(tree: Any, frames: Any) -> Any:
    return jax.tree.map(lambda a: np.asarray(a)[frames], tree)


def joints_of(poses: Pose) -> np.ndarray:
    """(m)"""
    return np.asarray(place_joints(ADULT, poses)[0], np.float64)


def film_body(truth: Pose, fps: float) -> Filmed:
    """Film the body in a stack of poses; every frame must show it."""
    count, cameras = len(truth.root), camera_ring(size=(320, 240))
    silhouettes = render(cameras, *place_body(BODY, truth))
    recording = Recording(cameras, silhouettes, fps, "+Z", np.arange(count), ADULT)
    settings = Settings(search=None, max_misses=0)
    prepared = prepare(recording, settings)
    seen = see_people(silhouettes, cameras, prepared)
    assert len(seen.frames) == count
    assert seen.hulls is not None
    graphs = person_graphs(seen.hulls, ADULT, settings)
    limbs, facing, _ = labelled_limbs(graphs, ADULT, settings)
    middles = middles_of_people(seen, silhouettes, cameras)
    observed = observed_volume(limbs, seen, silhouettes, cameras, middles, 0)
    return Filmed(truth, joints_of(truth), start_poses(limbs, facing, ADULT), graphless_poses(middles, ADULT), observed)
