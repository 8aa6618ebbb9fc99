"""Scores of several people, with answers computed by hand."""

from dataclasses import replace

import numpy as np
import pytest
from support.poses import moving

from jaxskel.poses import score_people


def at(x, frames=4):
    """Somebody whose joints are all `x` m aside of where `moving` has them."""
    poses = moving(frames)
    return replace(poses, joints=poses.joints + np.array([x, 0, 0], np.float32))


TRUE = {"anna": at(0.0).joints.astype(float), "ben": at(2.0).joints.astype(float)}


def test_names_are_found_by_what_is_near():
    score = score_people({"x": at(2.05), "y": at(0.02)}, TRUE)
    assert score.found_as == {"anna": "y", "ben": "x"}
    assert (score.exchanged, score.missed, score.false, score.total) == (0, 0, 0, 8)
    assert score.accuracy == 1
    assert score.scores["anna"].percentile(50) == pytest.approx(0.02, abs=1e-6)
    assert score.scores["ben"].percentile(50) == pytest.approx(0.05, abs=1e-6)


def test_an_exchange_is_counted_for_both():
    """In the last two of four frames each follows the other."""
    one, other = at(0.0), at(2.0)
    late = np.arange(4)[:, None, None] >= 2
    mixed = {"x": replace(one, joints=np.where(late, other.joints, one.joints)),
             "y": replace(one, joints=np.where(late, one.joints, other.joints))}  # fmt: skip
    score = score_people(mixed, TRUE)
    assert (score.exchanged, score.missed, score.false) == (2, 0, 0)
    assert score.accuracy == pytest.approx(1 - 2 / 8)
    assert [one.all_correct() for one in score.scores.values()] == [0.5, 0.5]


def test_somebody_missed_and_somebody_too_many():
    score = score_people({"x": at(0.0)}, TRUE)
    assert (score.found_as["anna"], score.found_as["ben"]) == ("x", None)
    assert (score.missed, score.false) == (4, 0)
    assert score.scores["ben"].all_correct() == 0
    score = score_people({"x": at(0.0), "y": at(2.0), "ghost": at(5.0)}, TRUE)
    assert (score.missed, score.false) == (0, 4)
    assert score.accuracy == pytest.approx(0.5)


def test_frames_without_a_pose_or_a_truth():
    gone = moving(4, without=(1,))
    score = score_people({"x": gone, "y": at(2.0)}, TRUE)
    assert (score.exchanged, score.missed, score.false, score.total) == (0, 1, 0, 8)
    unknown = {"anna": TRUE["anna"].copy(), "ben": TRUE["ben"]}
    unknown["anna"][0] = np.nan
    score = score_people({"x": at(0.0), "y": at(2.0)}, unknown)
    assert (score.missed, score.false, score.total) == (0, 1, 7)


def test_nobody_is_refused():
    with pytest.raises(ValueError, match="there is nobody"):
        score_people({}, TRUE)
