"""The share of the outlines that a pose leaves unexplained, on rays beside one capsule."""

import jax
import numpy as np
import pytest

from jaxskel import Pose, default_adult
from jaxskel.body import Body, rest_origins
from jaxskel.outlines import Contours
from jaxskel.search import unexplained_shares

ADULT = default_adult()
# A post of 100 mm radius on the pelvis, one metre tall.
POST = Body(
    ADULT, np.zeros(2, np.int32), np.array([[0.0, 0, 0], [0, 0, 1]]) - np.asarray(rest_origins(ADULT))[0],
    np.array([0.1, 0.1]), np.array([[0, 1]], np.int32),
)  # fmt: skip


def beside(*distances: float) -> Contours:
    """Level rays along x that pass the axis of a post at the origin at some distances (m)."""
    count = len(distances)
    centres = np.column_stack([np.full(count, 3.0), distances, np.full(count, 0.5)])
    return Contours(centres.astype(np.float32), np.tile(np.float32([-1, 0, 0]), (count, 1)))


def standing(*places: tuple[float, float, float]) -> Pose:
    return Pose(np.array(places, np.float32), np.tile(np.eye(3, dtype=np.float32), (len(places), 17, 1, 1)))


def stacked(*frames: Contours) -> Contours:
    return jax.tree.map(lambda *a: np.stack(a), *frames)


@pytest.mark.parametrize(
    ("distances", "share"),
    [
        ((0.1, -0.1), 0.0),
        ((0.0, 0.05), 0.0),  # rays through the body are explained, at any depth
        ((0.135, -0.135), 0.0),  # near enough
        ((0.145, -0.145), 1.0),
        ((0.1, 0.135, 0.145, -0.5), 0.5),
        ((0.1, 0.1, 0.1, 2.0), 0.25),
    ],
)
def test_shares_by_hand(distances, share):
    np.testing.assert_allclose(unexplained_shares(POST, standing((0, 0, 0)), stacked(beside(*distances))), [share])


def test_each_frame_has_its_pose_and_its_outlines():
    poses = standing((0, 0, 0), (0, 0.5, 0), (0, 0, 2))
    outlines = stacked(beside(0.1, 0.12, 0.6), beside(0.1, 0.6, 0.4), beside(0.1, -0.1, 0.0))
    np.testing.assert_allclose(unexplained_shares(POST, poses, outlines), [1 / 3, 1 / 3, 1.0], rtol=1e-6)
