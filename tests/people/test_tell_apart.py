"""People told apart in one mask for all, and their poses from end to end."""

from dataclasses import replace

import numpy as np
import pytest

from jaxskel import Settings, Tracking, paper_settings
from jaxskel.people import everybody, hide_others, reconstruct_people, tell_people_apart
from jaxskel.poses import score_people
from jaxskel.synthetic import draw_adult, handshake, make_people, stand_close, walk_by

FPS = 10.0


def scene(meeting, frames, seed=0, people=2, fps=FPS):
    skeletons = [draw_adult(10 * seed + place).skeleton for place in range(people)]
    motions = meeting(skeletons, frames, fps)
    return make_people({f"p{i}": pair for i, pair in enumerate(zip(skeletons, motions, strict=True))}, fps)


def bits(packed):
    return np.unpackbits(np.asarray(packed), axis=-1).astype(bool)


@pytest.fixture(scope="module")
def close():
    """Two people who stand shoulder to shoulder."""
    return scene(stand_close, 3)


def test_rendered_masks_share_no_pixel_and_all_are_seen_alone(close):
    one, other = (bits(recording.silhouettes) for recording in close.values())
    assert not (one & other).any()
    alone = make_people({"p0": (close["p0"].skeleton, _pose(close["p0"]))}, FPS)["p0"]
    np.testing.assert_array_equal(bits(alone.silhouettes) & ~other, one & bits(alone.silhouettes))
    assert (one & ~bits(alone.silhouettes)).sum() == 0


def _pose(recording):
    skeletons = [draw_adult(place).skeleton for place in range(2)]
    return stand_close(skeletons, 3, FPS)[0]


def test_pixels_are_divided_and_what_is_common_is_hidden_from_both(close):
    room = everybody(close)
    found = tell_people_apart(room)
    assert list(found) == ["person_1", "person_2"]
    whole = bits(room.silhouettes[:])
    own = {name: bits(recording.silhouettes[:]) for name, recording in found.items()}
    hidden = {name: bits(recording.hidden[:]) for name, recording in found.items()}
    assert not (own["person_1"] & own["person_2"]).any()
    for name in found:
        assert not (own[name] & ~whole).any()
        assert not (hidden[name] & ~whole).any()
        assert not (own[name] & hidden[name]).any()
    known = sum(own.values()) | sum(hidden.values())
    assert (whole & ~known.astype(bool)).sum() < 0.01 * whole.sum()
    # Mostly right: what is given to one of them shows that one.
    for recording in close.values():
        true = bits(recording.silhouettes)
        assert max((mask & true).sum() / mask.sum() for mask in own.values()) > 0.9


def test_frames_are_read_in_any_order(close):
    found = tell_people_apart(everybody(close))
    masks = found["person_2"].silhouettes
    np.testing.assert_array_equal(masks[2], masks[:][2])
    np.testing.assert_array_equal(masks[np.array([0, 2])], masks[:][[0, 2]])


def test_no_more_than_wanted_and_an_empty_room(close):
    assert list(tell_people_apart(everybody(close), 1)) == ["person_1"]
    empty = replace(close["p0"], silhouettes=np.zeros_like(close["p0"].silhouettes))
    assert tell_people_apart(empty) == {}
    assert reconstruct_people({}) == {}
    for people in (0, 9):
        with pytest.raises(ValueError, match="people: "):
            tell_people_apart(empty, people)


@pytest.mark.slow
@pytest.mark.parametrize("masks", ["each", "all"])
def test_two_who_shake_hands_are_found_with_dimensions_unknown(masks):
    """By the default preset, tracked, at 10 frames per second."""
    people = {name: replace(one, skeleton=None) for name, one in scene(handshake, 16, seed=3).items()}
    found = hide_others(people) if masks == "each" else tell_people_apart(everybody(people))
    poses = reconstruct_people(found, Settings(tracking=Tracking()))
    score = score_people(poses, {name: one.truth.joints for name, one in people.items()})
    assert (score.exchanged, score.missed, score.false) == (0, 0, 0)
    right = np.mean([(one.distances <= 0.1).mean() for one in score.scores.values()])
    assert right > 0.97
    # Bodies of tapered capsules come out at 16 to 21 mm, with one person in the room, too.
    assert np.median([one.percentile(50) for one in score.scores.values()]) < 0.025


@pytest.mark.slow
def test_four_who_walk_past_each_other_are_found_by_the_graph():
    people = scene(walk_by, 8, seed=1, people=4, fps=4.0)
    poses = reconstruct_people(hide_others(people), paper_settings())
    score = score_people(poses, {name: one.truth.joints for name, one in people.items()})
    assert score.exchanged == score.missed == score.false == 0
    assert {name: own for name, own in score.found_as.items()} == {name: name for name in people}
