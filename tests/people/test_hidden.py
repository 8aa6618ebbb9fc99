"""What others hide of a person: masks drawn by hand, in front of cameras whose pictures are simple."""

from dataclasses import replace

import numpy as np
import pytest
from support.phantoms import looking_at
from support.recordings import graph_settings

from jaxskel import Recording, default_adult, make_cameras, pack_silhouettes, unpack_silhouettes
from jaxskel.hull import carve, make_grid, projection_table
from jaxskel.outlines import contours
from jaxskel.people import everybody, hide_others
from jaxskel.pipeline import observe_batch, prepare
from jaxskel.synthetic import make_people, stand_close
from jaxskel.verdict import judge

SIZE = 64, 48
PLACES = {"near": (-1.0, 0.0, 1.0), "far": (1.0, 0.0, 1.0)}


@pytest.fixture(scope="module")
def cameras():
    """One camera behind "near", who stands before "far" there; two at the sides, for which both are equally far."""
    centres = np.array([[-5.0, 0.0, 1.0], [0.0, -5.0, 1.0], [0.0, 5.0, 1.0]])
    R, t = (np.stack(parts) for parts in zip(*(looking_at(c, np.array([0.0, 0.0, 1.0])) for c in centres), strict=True))
    K = np.array([[40.0, 0, 31.5], [0, 40.0, 23.5], [0, 0, 1]])
    return make_cameras(np.tile(K, (3, 1, 1)), R, t, SIZE)


def recording(cameras, place, name):
    """Somebody 0.8 m wide and 1.6 m high, drawn as a rectangle in every view."""
    masks = np.zeros((1, 3, SIZE[1], SIZE[0]), bool)
    for view in range(3):
        x, y, z = np.asarray(cameras.R[view]) @ np.array(place) + np.asarray(cameras.t[view])
        u, v, half = 40 * x / z + 31.5, 40 * y / z + 23.5, 40 * 0.4 / z
        masks[0, view, int(v - 2 * half) : int(v + 2 * half), int(u - half) : int(u + half)] = True
    return Recording(cameras, pack_silhouettes(masks), 10.0, "+Z", np.arange(1), name=name)


@pytest.fixture(scope="module")
def people(cameras):
    return {name: recording(cameras, place, name) for name, place in PLACES.items()}


def bits(packed):
    return np.unpackbits(np.asarray(packed), axis=-1).astype(bool)


def test_who_stands_behind_hides_nobody_and_who_may_stand_before_does(people):
    found = hide_others(people)
    near, far = (bits(found[name].hidden[:])[0] for name in ("near", "far"))
    assert not near[0].any()  # "far" is 2 m farther from the first camera
    own = bits(people["far"].silhouettes)[0, 0]
    before = bits(people["near"].silhouettes)[0, 0]
    assert (far[0] & before).sum() == (before & ~own).sum() > 0
    # At the sides nobody is surely behind: all of the other, and a margin of two pixels.
    for view in (1, 2):
        other = bits(people["far"].silhouettes)[0, view]
        assert (near[view] & other).sum() == other.sum()
        rows, columns = (np.ptp(np.argwhere(mask), axis=0) for mask in (near[view], other))
        np.testing.assert_array_equal(rows - columns, [4, 4])


def test_own_pixels_are_never_hidden(people):
    found = hide_others(people)
    for name, recording in found.items():
        assert not (recording.hidden[:] & people[name].silhouettes).any()


def test_everybody_is_the_union(people):
    union = everybody(people)
    np.testing.assert_array_equal(union.silhouettes[:], people["near"].silhouettes | people["far"].silhouettes)
    assert union.hidden is None
    with pytest.raises(ValueError, match="people: there is nobody"):
        everybody({})


def test_somebody_alone_has_nothing_hidden(people):
    assert hide_others({"near": people["near"]})["near"].hidden is None


def test_recordings_of_different_frames_are_refused(people):
    longer = replace(people["far"], silhouettes=np.repeat(people["far"].silhouettes, 2, 0), frame_index=np.arange(2))
    with pytest.raises(ValueError, match="far: silhouettes of shape .* give the same cameras and frames"):
        hide_others({"near": people["near"], "far": longer})


def test_hidden_pixels_must_be_as_many_as_those_of_the_silhouettes(people):
    with pytest.raises((ValueError, TypeError), match="hidden"):
        replace(people["near"], hidden=people["near"].silhouettes[:, :2])


def test_an_outline_beside_hidden_pixels_is_none(people, cameras):
    """The right half of a rectangle is hidden: rays are left on the other three sides only."""
    own = np.zeros((1, 3, SIZE[1], SIZE[0]), bool)
    own[0, 0, 10:30, 20:30] = True
    hidden = np.zeros_like(own)
    hidden[0, 0, 10:30, 30:40] = True
    none = np.zeros((1, 3), bool)
    for given, right in ((None, True), (pack_silhouettes(hidden), False)):
        found = contours(pack_silhouettes(own), cameras, none, 200, given)
        seen = np.asarray(found.directions)[0] @ np.asarray(cameras.R[0]).T
        u = 40 * seen[:, 0] / seen[:, 2] + 31.5
        assert (u > 29).any() == right
        assert (u < 20).any()


def test_what_is_hidden_is_not_carved_and_others_are_taken_out(cameras, people):
    """A person half of whose silhouette is hidden in one view has the hull of the whole one."""
    grid = make_grid(np.array([-1.8, -0.8, 0.0]), np.array([1.8, 0.8, 2.0]), 0.1)
    table = projection_table(cameras, grid, SIZE[1], SIZE[0])
    whole = carve(people["near"].silhouettes, table).inside.sum()
    cut = people["near"].silhouettes.copy()
    cut[:, 1, :, : SIZE[0] // 16] &= 0xF0
    lost = people["near"].silhouettes & ~cut
    assert carve(cut, table).inside.sum() < whole or not lost.any()
    assert carve(cut | lost, table).inside.sum() == whole


@pytest.mark.slow
def test_a_person_behind_another_has_a_hull_of_their_own():
    skeleton = default_adult()
    motions = stand_close([skeleton, skeleton], 2, 1.0, gap=0.55)
    people = hide_others(make_people({"a": (skeleton, motions[0]), "b": (skeleton, motions[1])}, 1.0))
    for recording in people.values():
        settings = graph_settings()
        prepared = prepare(recording, settings)
        found = observe_batch(recording, prepared, settings, outlines=False)
        assert found.seen.status.tolist() == [0, 0]
        hulls = found.seen.hulls
        assert hulls is not None
        middles = np.stack([hulls.centres[inside].mean(0) for inside in hulls.inside])
        truth = recording.truth.joints[:, 0]
        assert np.linalg.norm((middles - truth)[:, :2], axis=1).max() < 0.1
        # Nothing of the neighbour, whose middle is 0.55 m away.
        away = np.abs(hulls.centres[:, 1] - truth[0, 1])
        assert (away[hulls.inside.any(0)] < 0.5).mean() > 0.98


def test_what_others_hide_is_no_contradiction_between_views_and_a_mirrored_view_is_one():
    skeletons = [default_adult(1.6), default_adult(1.8)]
    people = make_people(dict(zip("ab", zip(skeletons, stand_close(skeletons, 4, 4.0), strict=True), strict=True)), 4.0)
    for person in hide_others(people).values():
        assert judge(person).findings == ()
        mirrored = unpack_silhouettes(person.silhouettes[:], 640)
        mirrored[:, 3] = mirrored[:, 3, :, ::-1]
        (finding,) = judge(replace(person, silhouettes=pack_silhouettes(mirrored))).findings
        assert finding.views == (person.cameras.names[3],)
    # Where it is not known what is hidden, parts are missing that others stand before.
    assert all(judge(person).findings for person in people.values())
