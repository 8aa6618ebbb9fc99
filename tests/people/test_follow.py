"""Bodies followed in time: boxes of voxels that pass, touch, leave and come back."""

import numpy as np
import pytest

from jaxskel.people._follow import follow, present

SPACING, FPS, MOST = 0.05, 20.0, 8


def box(x, y, tall=34):
    """A body of 0.4 x 0.4 m (voxels)."""
    return np.argwhere(np.ones((8, 8, tall), bool)) + np.array([round(x), round(y), 0])


def joined(*boxes):
    return np.unique(np.concatenate(boxes), axis=0)


def middles(whereabouts, number):
    return [frame[number].mean(0)[:2] if number in frame else None for frame in whereabouts]


def test_two_who_pass_each_other_keep_their_names():
    frames = [[box(2 * f, 0), box(120 - 2 * f, 12)] for f in range(60)]
    found = follow(frames, SPACING, FPS, MOST)
    assert present(found).tolist() == [0, 1]
    ways = [np.ptp([middle[0] for middle in middles(found, number)]) for number in (0, 1)]
    np.testing.assert_allclose(ways, 118)


def test_two_who_touch_are_one_body_and_stay_two_people():
    """They come near, are one body for a second, and part again: both are followed throughout."""
    frames = []
    for f in range(60):
        gap = max(9, 40 - 2 * f, 2 * (f - 40))
        one, other = box(-gap / 2, 0), box(gap / 2, 0)
        frames.append([joined(one, other)] if gap <= 10 else [one, other])
    assert sum(len(frame) == 1 for frame in frames) > FPS
    found = follow(frames, SPACING, FPS, MOST)
    assert present(found).tolist() == [0, 1]
    assert all(len(frame) == 2 for frame in found)
    left, right = ([middle[0] for middle in middles(found, number)] for number in (0, 1))
    signs = np.sign(np.subtract(left, right))
    assert (signs == signs[0]).all()


def test_two_who_are_apart_for_a_moment_only():
    """Without being told that there are two, nobody can know that the second is no ghost."""
    frames = [[box(0, 0), box(11 - f, 0)] if f < 3 else [joined(box(0, 0), box(8, 0))] for f in range(60)]
    assert [len(frame) for frame in follow(frames, SPACING, FPS, MOST)][10:] == [1] * 50
    assert [len(frame) for frame in follow(frames, SPACING, FPS, 2, all_are_there=True)] == [2] * 60


def test_no_voxel_belongs_to_two_people():
    frames = [[joined(box(0, 0), box(7, 0))] if 5 < f < 15 else [box(0, 0), box(14, 0)] for f in range(20)]
    for frame, bodies in zip(follow(frames, SPACING, FPS, MOST), frames, strict=True):
        every = np.concatenate(list(frame.values()))
        assert len(np.unique(every, axis=0)) == len(every)
        if len(bodies) == 1:
            assert len(every) == len(bodies[0])


@pytest.mark.parametrize(("tall", "people"), [(34, 2), (26, 3)], ids=["the same", "a child"])
def test_who_comes_back_is_known_by_size(tall, people):
    """Somebody leaves for three seconds; who comes then, elsewhere, is the same person if as tall."""
    frames = [[box(0, 0)] + ([box(60, 0)] if f < 30 else [box(60, 70, tall)] if f >= 90 else []) for f in range(130)]
    found = follow(frames, SPACING, FPS, MOST)
    assert len(present(found)) == people
    assert [len(frame) for frame in found] == [len(frame) for frame in frames]


def test_somebody_who_is_there_for_a_moment_is_nobody():
    """Ghosts come and go within a second."""
    frames = [[box(0, 0)] + ([box(50, 0)] if 10 < f < 20 else []) for f in range(60)]
    frames[3].append(box(0, 60))
    found = follow(frames, SPACING, FPS, MOST)
    assert present(found).tolist() == [0]
    assert all(len(frame) == 1 for frame in found)


def test_somebody_who_comes_later_is_there_from_the_first_frame_on():
    frames = [[box(0, 0)] + ([box(50, f)] if f >= 25 else []) for f in range(60)]
    assert [len(frame) for frame in follow(frames, SPACING, FPS, MOST)] == [1] * 25 + [2] * 35


def test_no_more_people_than_wanted():
    frames = [[box(0, 0, 36), box(40, 0, 35), box(80, 0)] for _ in range(30)]
    found = follow(frames, SPACING, FPS, 2)
    assert present(found).tolist() == [0, 1]
    np.testing.assert_array_equal(found[0][0], frames[0][0])


def test_nobody():
    assert follow([[], []], SPACING, FPS, MOST) == [{}, {}]
    assert present([{}, {}]).tolist() == []


def test_a_child_beside_a_man_is_somebody():
    child = np.argwhere(np.ones((5, 5, 22), bool))  # a quarter of the man's volume
    frames = [[box(2 * f, 0), child + [60, 0, 0]] for f in range(40)]
    found = follow(frames, SPACING, FPS, MOST)
    assert [len(frame) for frame in found] == [2] * 40


def test_bodies_that_are_elsewhere_in_every_frame_are_ghosts():
    """As many as a person has frames in a second, but none of them goes on to the next frame."""
    frames = [[box(0, 0)] + ([box(60 * (-1) ** f, 30 * (f % 3))] if 10 < f < 35 else []) for f in range(60)]
    found = follow(frames, SPACING, FPS, MOST)
    assert present(found).tolist() == [0]
