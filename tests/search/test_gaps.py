"""A person who moves steadily is where the track expects it, however many frames are left out."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel import Pose
from jaxskel.search import Track, before_next, over_gap

RNG = np.random.default_rng(0)
START, TURN = Rotation.random(17, random_state=1), 0.15 * RNG.normal(size=(17, 3))


def steady(frame: float) -> Pose:
    """Every segment turns about a fixed axis, and the root moves along a line."""
    rotations = (Rotation.from_rotvec(frame * TURN) * START).as_matrix()
    return Pose((0.3 + 0.04 * frame * np.array([1.0, -2.0, 0.5])).astype(np.float32), rotations.astype(np.float32))


def track_of(last: float, before: float) -> Track:
    return Track(steady(last), steady(before), 3, np.full(5, 2.0))


def assert_same(found: Pose, expected: Pose, atol: float) -> None:
    np.testing.assert_allclose(found.root, expected.root, atol=1e-5)
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=atol)


@pytest.mark.parametrize("skipped", [1, 2, 5])
def test_before_a_gap_both_poses_move_on(skipped):
    found = before_next(track_of(7, 6), skipped)
    assert_same(found.last, steady(7 + skipped), 1e-5)
    assert_same(found.before, steady(6 + skipped), 1e-5)
    assert found.since == 3


def test_a_motion_is_not_continued_for_ever():
    assert_same(before_next(track_of(7, 6), 1000).last, before_next(track_of(7, 6), 5).last, 1e-6)


@pytest.mark.parametrize("skipped", [1, 2, 5])
def test_after_a_gap_the_velocity_is_that_of_one_frame(skipped):
    # What was expected before the gap does not matter any more.
    after = Track(steady(8 + skipped), steady(0), 0, np.full(5, 2.0))
    found = over_gap(track_of(7, 6), after, skipped)
    assert_same(found.last, steady(8 + skipped), 1e-6)
    assert_same(found.before, steady(7 + skipped), 1e-5)
    # The rotations are straight ones.
    product = found.before.rotations @ found.before.rotations.swapaxes(1, 2)
    np.testing.assert_allclose(product, np.tile(np.eye(3), (17, 1, 1)), atol=1e-5)


def test_who_is_found_anew_after_a_gap_has_no_velocity():
    after = track_of(9, 9)
    assert over_gap(track_of(7, 6), after, 1) is after
