"""A body that is found in poor masks: each view has other holes in every frame."""

import cv2
import jax
import numpy as np
import pytest
from support.people import ADULT, film_person, other_person
from support.phantoms import ideal_graph

from jaxskel import Pose, pack_silhouettes, unpack_silhouettes
from jaxskel._runtime.batching import filled, on_device
from jaxskel.body import BALL_NAMES, Prior, measured_body, people_prior
from jaxskel.body_calibration import bundle_adjust
from jaxskel.outlines import contours, credible, silhouette_distances
from jaxskel.refinement.terms import Observed

pytestmark = pytest.mark.slow

FRAMES = 12
RADIUS = 15  # of a hole (px); the person is about 110 px tall
# Wide, so that the masks decide.
USUAL = people_prior(ADULT, ADULT.stature)
PRIOR = Prior(USUAL.mean, 0.03 * USUAL.precision)
TRUNK_AND_LIMBS = [i for i, name in enumerate(BALL_NAMES) if name[2:] in ("hip", "knee", "calf", "shoulder", "elbow")]


def poor(masks: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Each view a pixel or two too wide or too narrow, with up to two holes."""
    holed = np.array(masks)
    rows, columns = np.ogrid[: masks.shape[2], : masks.shape[3]]
    for mask in holed.reshape(-1, *masks.shape[2:]):
        change = cv2.erode if rng.integers(2) else cv2.dilate
        mask[:] = change(mask.astype(np.uint8), np.ones((3, 3)), iterations=int(rng.integers(3)))
        person = np.argwhere(mask)
        for _ in range(rng.integers(3)):
            v, u = person[rng.integers(len(person))]
            mask[(rows - v) ** 2 + (columns - u) ** 2 <= RADIUS**2] = False
    return holed


def test_poor_masks_do_not_make_a_body_thin():
    body = other_person()
    recording, motion = film_person(body, FRAMES)
    width = int(recording.cameras.size[0, 0])
    masks = np.asarray(unpack_silhouettes(recording.silhouettes[:], width))
    packed = pack_silhouettes(poor(masks, np.random.default_rng(0)))
    lost, views = np.zeros(packed.shape[:2], bool), np.full(FRAMES, packed.shape[1])
    distances = silhouette_distances(packed, recording.cameras, lost, 3)
    middles = np.asarray(motion.root, np.float64)
    rays = credible(contours(packed, recording.cameras, lost, 4800), distances, middles, views, 2400)
    graph = ideal_graph(ADULT, Pose(np.zeros(3), np.tile(np.eye(3), (17, 1, 1))))
    stack = jax.tree.map(lambda a: np.repeat(np.asarray(a)[None], FRAMES, 0), graph)
    observed = on_device(Observed(stack.paths, stack.found, stack.inner, rays, distances))
    found = bundle_adjust(ADULT, PRIOR, PRIOR.mean, filled(motion), observed, np.ones(FRAMES, bool))
    own = measured_body(ADULT, found.shape)
    thicker = (np.asarray(own.radii) - np.asarray(body.radii))[TRUNK_AND_LIMBS]
    # A pixel is 12 mm; where holes count, the body is 35 mm too thin.
    assert abs(np.median(thicker)) < 0.01
