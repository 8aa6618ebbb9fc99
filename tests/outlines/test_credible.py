"""Outlines that other views contradict: of holes in masks, and of blobs beside the person."""

import numpy as np
import pytest
from support.phantoms import chain, film, ring

from jaxskel import pack_silhouettes, unpack_silhouettes
from jaxskel.outlines import Contours, SilhouetteDistances, contours, credible, silhouette_distances

CAMERAS = ring(8, size=(400, 300), focal=240.0)
POST = chain([0.0, 0.0, 0.4], [0.0, 0.0, 1.6], 0.15)
MIDDLE = np.array([[0.0, 0.0, 1.0]])
NONE_LOST, EIGHT = np.zeros((1, 8), bool), np.array([8])


def seen(*discs: tuple[int, tuple[float, float, float], float, bool]) -> tuple[Contours, SilhouetteDistances]:
    """A post of 15 cm radius in eight views; discs around a point (m) of some radius (px) are painted in one view."""
    width = int(CAMERAS.size[0, 0])
    masks = np.array(unpack_silhouettes(film(CAMERAS, [POST]), width))
    for view, point, radius, filled in discs:
        x, y, depth = CAMERAS.R[view] @ np.array(point) + CAMERAS.t[view]
        K = CAMERAS.K[view]
        v, u = np.mgrid[: masks.shape[2], : masks.shape[3]]
        disc = np.hypot(u - K[0, 0] * x / depth - K[0, 2], v - K[1, 1] * y / depth - K[1, 2]) < radius
        masks[0, view, disc] = filled
    packed = pack_silhouettes(masks)
    return contours(packed, CAMERAS, NONE_LOST, 2000), silhouette_distances(packed, CAMERAS, NONE_LOST, 2)


def off_the_post(outlines: Contours) -> np.ndarray:
    """How far each ray passes from the outline of the post (m)."""
    centres, directions = (np.asarray(a, np.float64)[0] for a in (outlines.centres, outlines.directions))
    # Of the closest points of a ray and the post's axis, which is vertical.
    level = np.linalg.norm(directions[:, :2], axis=1)
    away = np.abs(centres[:, 0] * directions[:, 1] - centres[:, 1] * directions[:, 0]) / level
    along = -(centres[:, :2] * directions[:, :2]).sum(1) / level**2
    height = centres[:, 2] + along * directions[:, 2]
    beyond = np.maximum(np.abs(height - 1.0) - 0.6, 0.0)
    return np.abs(np.hypot(away, beyond) - 0.15)


def test_outlines_of_clean_masks_are_credible():
    outlines, silhouettes = seen()
    kept = credible(outlines, silhouettes, MIDDLE, EIGHT, 2000)
    given, left = (len(np.unique(np.asarray(rays.directions)[0], axis=0)) for rays in (outlines, kept))
    assert left > 0.99 * given > 100


@pytest.mark.parametrize(
    "disc",
    [(2, (0.0, 0.0, 1.0), 5.0, False), (5, (0.05, 0.0, 1.2), 12.0, False), (3, (0.0, 0.0, 2.1), 12.0, True)],
    ids=["hole", "bite", "blob"],
)
def test_holes_and_blobs_are_left_out(disc):
    outlines, silhouettes = seen(disc)
    assert (off_the_post(outlines) > 0.05).sum() > 20
    kept = credible(outlines, silhouettes, MIDDLE, EIGHT, 1500)
    assert kept.centres.shape == (1, 1500, 3)
    assert (off_the_post(kept) > 0.05).sum() < 0.2 * (off_the_post(outlines) > 0.05).sum()
    # True outlines stay, also in the damaged view.
    assert (off_the_post(kept) < 0.03).sum() > 1400
    own = np.linalg.norm(np.asarray(kept.centres[0]) - CAMERAS.centres[disc[0]], axis=1) < 1e-3
    assert own.sum() > 100


@pytest.mark.parametrize("height", [0.0, 5.0], ids=["credible", "nothing credible"])
def test_no_view_is_left_out(height):
    outlines, silhouettes = seen()
    moved = Contours(outlines.centres + np.float32([0, 0, height]), outlines.directions)
    kept = credible(moved, silhouettes, MIDDLE, EIGHT, 400)
    apart = np.linalg.norm(kept.centres[0][:, None] - CAMERAS.centres - [0, 0, height], axis=-1)
    np.testing.assert_allclose(np.bincount(apart.argmin(1), minlength=8), 50, atol=2)


def test_rays_are_repeated_where_few_are_credible():
    outlines, silhouettes = seen((3, (0.0, 0.0, 2.1), 12.0, True))
    kept = credible(outlines, silhouettes, MIDDLE, EIGHT, 3000)
    assert kept.centres.shape == (1, 3000, 3)
    assert (off_the_post(kept) < 0.03).mean() > 0.98
