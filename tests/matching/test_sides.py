import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel.body import JOINT_NAMES, TIP_NAMES, default_adult
from jaxskel.matching import L_FOOT, L_HAND, R_FOOT, R_HAND, Limbs, tell_sides
from jaxskel.matching._limbs import PATH_POINTS

ADULT = default_adult()
AT = dict(zip(JOINT_NAMES + TIP_NAMES, np.vstack([ADULT.rest_joints, ADULT.rest_tips]), strict=True))
MIRROR = np.diag([1.0, -1.0, 1.0])


def along(points) -> tuple[np.ndarray, float]:
    """A path of evenly spaced points through some points, and its length."""
    points = np.asarray(points, float)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    where = np.linspace(0, way[-1], PATH_POINTS)
    return np.stack([np.interp(where, way, points[:, axis]) for axis in range(3)], -1), way[-1]


def person(toes=0.2, knees=0.0, turn=0.0, found=(True,) * 5, crossed=False) -> Limbs:
    """A standing person who faces x; feet extend and knees bend forwards by the given lengths (m)."""
    ways = [[AT["head_top"], AT["head_top"] - [0, 0, 0.01]]]
    trunk = [AT["head_top"], AT["neck"]]
    for side in "lr":
        elbow, hand = AT[f"{side}_elbow"], AT[f"{side}_fingertip"]
        if crossed:  # the forearms lie before the chest, each hand on the other side
            hand = elbow * [1, -0.6, 1] + [0.25, 0, 0.1]
        ways.append([*trunk, AT[f"{side}_shoulder"], elbow, hand])
    for side in "lr":
        hip, knee = AT[f"{side}_hip"], AT[f"{side}_knee"] + [knees, 0, 0]
        ankle = AT[f"{side}_knee"] * [1, 1, 0] + [0, 0, AT["l_foot"][2] + 0.04]
        ways.append([*trunk, AT["pelvis"], hip, knee, ankle, ankle + [toes, 0, -0.01]])
    paths, lengths = (np.array(part) for part in zip(*(along(way) for way in ways), strict=True))
    rotation = Rotation.from_euler("z", turn).as_matrix()
    return Limbs(
        (paths @ rotation.T)[None],
        lengths[None],
        np.array([found]),
        (np.stack([AT["pelvis"], AT["neck"]]) @ rotation.T)[None],
    )


def film(people: list[Limbs]) -> Limbs:
    """Frames one after the other."""
    fields = ("paths", "lengths", "found", "inner")
    return Limbs(*(np.concatenate([getattr(one, field) for one in people]) for field in fields))


def moved(limbs: Limbs, shift: np.ndarray) -> Limbs:
    return Limbs(limbs.paths + shift, limbs.lengths, limbs.found, limbs.inner + shift)


def mirrored(limbs: Limbs) -> Limbs:
    """The person in the mirror, who has the left limbs on the right."""
    return Limbs(limbs.paths @ MIRROR, limbs.lengths, limbs.found, limbs.inner @ MIRROR)


PEOPLE = {
    "standing": {},
    "in socks": {"toes": 0.12},
    "knees bent": {"toes": 0.2, "knees": 0.15},
    "on tiptoe": {"toes": 0.0, "knees": 0.2},
    "arms crossed": {"crossed": True},
    "hidden foot": {"found": (True, True, True, True, False)},
}
FEET_AND_HANDS = (L_HAND, R_HAND, L_FOOT, R_FOOT)


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.0, np.pi])
@pytest.mark.parametrize("name", PEOPLE)
def test_the_right_sides_stay(name, turn):
    limbs = person(**PEOPLE[name], turn=turn)
    told, facing, confidence = tell_sides(limbs, ADULT)
    np.testing.assert_array_equal(told.paths, limbs.paths)
    np.testing.assert_array_equal(told.found, limbs.found)
    np.testing.assert_allclose(facing, [[np.cos(turn), np.sin(turn), 0.0]], atol=0.05)
    assert 0.75 < confidence[0] <= 1.0


@pytest.mark.parametrize("hands", [False, True])
@pytest.mark.parametrize("feet", [False, True])
@pytest.mark.parametrize("name", PEOPLE)
def test_wrong_sides_are_exchanged(name, hands, feet):
    limbs = person(**PEOPLE[name], turn=0.7)
    exchanged = limbs.exchanged(np.array([hands]), np.array([feet]))
    assert (exchanged.paths != limbs.paths).any() == (hands or feet)
    told, facing, confidence = tell_sides(exchanged, ADULT)
    np.testing.assert_array_equal(told.paths, limbs.paths)
    np.testing.assert_array_equal(told.lengths, limbs.lengths)
    np.testing.assert_array_equal(told.found, limbs.found)
    _, expected_facing, expected_confidence = tell_sides(limbs, ADULT)
    np.testing.assert_allclose(facing, expected_facing)
    np.testing.assert_allclose(confidence, expected_confidence)


@pytest.mark.parametrize("name", PEOPLE)
def test_the_person_in_the_mirror_is_exchanged(name):
    limbs = mirrored(person(**PEOPLE[name]))
    told, facing, confidence = tell_sides(limbs, ADULT)
    both = np.array([True])
    np.testing.assert_array_equal(told.paths, limbs.exchanged(both, both).paths)
    np.testing.assert_allclose(facing, [[1.0, 0.0, 0.0]], atol=0.05)
    of_left, of_right = told.at(np.array([L_HAND, R_HAND]), np.full(2, 0.45))[0, :, 1]
    assert of_left > 0 > of_right
    assert confidence[0] > 0.75


def test_without_evidence_sides_are_a_guess():
    # No feet and straight knees: neither side is the front.
    _, facing, confidence = tell_sides(person(toes=0.0), ADULT)
    assert confidence[0] < 0.55
    # A very short foot shows which side is the front, with low confidence.
    _, facing, confidence = tell_sides(person(toes=0.01), ADULT)
    assert 0.5 < confidence[0] < 0.65
    # No legs at all.
    _, facing, confidence = tell_sides(person(found=(True, True, True, False, False)), ADULT)
    np.testing.assert_array_equal(facing, 0.0)
    assert confidence[0] == 0.5


def test_confidence_grows_with_the_evidence():
    confidence = [tell_sides(person(toes=toes), ADULT)[2][0] for toes in (0.03, 0.08, 0.15, 0.25)]
    assert (np.diff(confidence) > 0).all()


def test_single_frames_do_not_depend_on_their_batch():
    # Between them everybody walks farther than one does from frame to frame.
    people = [person(turn=0.3), mirrored(person(turn=1.3)), person(toes=0.05)]
    people = [moved(one, np.array([2.0 * f, 0.0, 0.0])) for f, one in enumerate(people)]
    told, facing, confidence = tell_sides(film(people), ADULT)
    for f, one in enumerate(people):
        alone, alone_facing, alone_confidence = tell_sides(one, ADULT)
        np.testing.assert_array_equal(told.paths[f], alone.paths[0])
        np.testing.assert_array_equal(facing[f], alone_facing[0])
        np.testing.assert_array_equal(confidence[f], alone_confidence[0])


def pirouette(frames: int = 24) -> list[Limbs]:
    """A whole turn on the spot, in the middle on tiptoe, so that feet seem to point backwards by 2 cm."""
    turns = 2 * np.pi * np.arange(frames) / frames
    return [person(toes=0.09 + 0.11 * np.cos(turn), turn=turn) for turn in turns]


@pytest.mark.parametrize("hands", [False, True])
@pytest.mark.parametrize("feet", [False, True])
def test_clear_frames_decide_unclear_ones_of_a_film(hands, feet):
    limbs = film(pirouette())
    some = np.arange(24) % 3 == 1
    told, facing, confidence = tell_sides(limbs.exchanged(some & hands, some & feet), ADULT)
    np.testing.assert_array_equal(told.paths, limbs.paths)
    turns = 2 * np.pi * np.arange(24) / 24
    np.testing.assert_allclose(facing, np.stack([np.cos(turns), np.sin(turns), 0 * turns], 1), atol=0.05)
    # By themselves the frames in the middle say the opposite, and they stay doubtful.
    alone = np.array([(tell_sides(one, ADULT)[0].paths != one.paths).any() for one in pirouette()])
    assert 1 <= alone.sum() <= 6
    assert (confidence[alone] == 0.5).all()
    assert (confidence[:8] > 0.75).all()


def test_limbs_that_are_not_found_hold_no_sides():
    hidden = (True, True, False, True, False)
    frames = [person(turn=0.1), person(turn=0.1, toes=-0.1, found=hidden), person(turn=0.1)]
    told, _, _ = tell_sides(film(frames), ADULT)
    np.testing.assert_array_equal(told.paths[1], tell_sides(frames[1], ADULT)[0].paths[0])


def test_points_along_a_path_by_hand():
    # One metre of a straight path, at 0, 0.25, 1 and more than the whole length from its end.
    path, length = along([(0, 0, 0), (0, 0, 1.0)])
    limbs = Limbs(np.tile(path, (1, 5, 1, 1)), np.full((1, 5), length), np.ones((1, 5), bool), np.zeros((1, 2, 3)))
    distances, heights = np.array([0.0, 0.25, 1.0, 3.0]), [1.0, 0.75, 0.0, 0.0]
    points = limbs.at(np.full(4, L_FOOT), distances)
    np.testing.assert_allclose(points, [[(0, 0, z) for z in heights]], atol=1e-12)
