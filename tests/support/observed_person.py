"""A person with volume, seen by a ring of cameras: silhouettes, hull and ideal graph of any pose. Tests share it."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from jaxskel import Pose, default_adult
from jaxskel.body import SEGMENT_NAMES, SEGMENT_PARENTS, make_body, place_body
from jaxskel.hull import make_grid
from jaxskel.outlines import contours, silhouette_distances
from jaxskel.refinement.parametrisations import HingedLimbs
from jaxskel.refinement.terms import Observed
from jaxskel.synthetic import render
from support.phantoms import ideal_graph, ring

ADULT = jax.tree.map(lambda a: np.asarray(a, np.float32), default_adult())
BODY = jax.tree.map(lambda a: a if a.dtype == np.int32 else np.asarray(a, np.float32), make_body(default_adult()))
GRID = make_grid(np.array([-0.4, -0.8, -1.1]), np.array([0.4, 0.8, 1.0]), 0.02)
# Around the origin, where the pelvis is: a pixel is 11 mm wide there.
CAMERAS = ring(8, (320, 320), 360.0, height=-0.1)

HINGED = HingedLimbs()
UNKNOWNS = 42


@cache
def standing() -> Pose:
    """A relaxed pose with slightly bent knees and elbows, because fully straight ones are beyond the limits."""
    flexions = np.zeros(UNKNOWNS, np.float32)
    flexions[[17, 23, 27, 31]] = 0.1  # see test_parametrisations
    rest = Pose(np.zeros(3, np.float32), np.tile(np.eye(3, dtype=np.float32), (17, 1, 1)))
    return jax.tree.map(np.asarray, jax.jit(HINGED.retract)(jnp.asarray(flexions), rest, ADULT))


def turned(segment: str, axis: str, degrees: float) -> Pose:
    """Standing, with one segment and its descendants rotated about an axis."""
    turn = Rotation.from_euler(axis, degrees, degrees=True).as_matrix().astype(np.float32)
    carried, pose = [name == segment for name in SEGMENT_NAMES], standing()
    for number, parent in enumerate(SEGMENT_PARENTS[1:], 1):
        carried[number] |= carried[parent]
    return Pose(pose.root, np.where(np.array(carried)[:, None, None], turn @ pose.rotations, pose.rotations))


def observe(pose: Pose) -> Observed:
    """Observations of the body."""
    ends, radii = place_body(make_body(default_adult()), jax.tree.map(lambda a: a[None], pose))
    seen, empty_views = render(CAMERAS, ends, radii), np.zeros((1, len(CAMERAS)), bool)
    outlines, inside = (
        jax.tree.map(lambda a: a[0], each(seen, CAMERAS, empty_views)) for each in (contours, silhouette_distances)
    )
    graph = ideal_graph(ADULT, pose)
    return Observed(graph.paths, graph.found, graph.inner, outlines, inside)
