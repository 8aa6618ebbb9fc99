"""Poses on the disk as they come."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.random_poses import some_poses, some_track

from jaxskel import join_poses
from jaxskel.batch._journal import Journal


def assert_equal(one, other):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert type(a) is type(b)
        assert np.asarray(a).dtype == np.asarray(b).dtype
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    "track",
    [None, some_track(2), some_track(2, rival=True), some_track(2, alternatives=3), some_track(2, True, 3)],
    ids=["none", "alone", "rival", "alternatives", "both"],
)
def test_goes_on_where_it_was_left(tmp_path, track):
    parts = [some_poses(0, 32), some_poses(32, 32), some_poses(64, 5)]
    for i, part in enumerate(parts):
        journal = Journal(tmp_path / "journal", "this")
        assert journal.frames == 32 * i
        if i:
            assert_equal(journal.track, track)
        journal.append(part, track)
    assert_equal(Journal(tmp_path / "journal", "this").poses(30.0, "+Y", None), join_poses(parts))


def test_other_work_starts_anew(tmp_path):
    Journal(tmp_path, "this").append(some_poses(0, 32), None)
    assert Journal(tmp_path, "that").frames == 0
    assert Journal(tmp_path, "this").frames == 0


def test_a_request_to_compute_again_goes_on_with_what_answers_it(tmp_path):
    Journal(tmp_path, "this").append(some_poses(0, 32), None)
    journal = Journal(tmp_path, "this", "again")
    assert journal.frames == 0
    journal.append(some_poses(0, 32), None)
    assert Journal(tmp_path, "this", "again").frames == 32
    assert Journal(tmp_path, "this").frames == 32
    assert Journal(tmp_path, "this", "once more").frames == 0


def test_rows_without_their_state_do_not_count(tmp_path):
    journal = Journal(tmp_path, "this")
    journal.append(some_poses(0, 32), None)
    whole = (tmp_path / "rows.bin").read_bytes()
    (tmp_path / "rows.bin").write_bytes(whole + whole[:1000])  # killed in the middle of the next batch
    journal = Journal(tmp_path, "this")
    assert journal.frames == 32
    journal.append(some_poses(32, 4), None)
    assert_equal(journal.poses(30.0, "+Y", None), join_poses([some_poses(0, 32), some_poses(32, 4)]))


@settings(deadline=None, max_examples=150)
@given(st.sampled_from(["rows.bin", "state.npz"]), st.floats(0, 0.999), st.sampled_from(["cut", "flip"]), st.data())
def test_damaged_journals_start_anew_or_are_as_they_were(tmp_path_factory, name, where, how, data):
    folder = tmp_path_factory.mktemp("journal")
    poses, track = some_poses(0, 3), some_track(1)
    Journal(folder, "this").append(poses, track)
    content = bytearray((folder / name).read_bytes())
    place = int(where * len(content))
    if how == "cut":
        del content[place:]
    else:
        content[place] ^= data.draw(st.integers(1, 255))
    (folder / name).write_bytes(content)
    journal = Journal(folder, "this")
    assert journal.frames in (0, 3)
    if journal.frames:
        assert_equal(journal.poses(30.0, "+Y", None), poses)
        assert_equal(journal.track, track)
