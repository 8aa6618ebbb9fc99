import re

import numpy as np
import pytest

from jaxskel.body import JOINT_NAMES, MIRROR_JOINTS, Skeleton, default_adult, make_skeleton
from jaxskel.body._human import MIRROR_TIPS
from jaxskel.io.subjects import read_subject, write_subject

# The place of each length in (bone_lengths, tip_lengths); two-sided ones left, then right.
PLACES = {
    "trunk": (0,), "neck": (1,), "shoulder": (2, 5), "upper_arm": (3, 6), "forearm": (4, 7),
    "hip": (8, 11), "thigh": (9, 12), "shank": (10, 13),
    "head_top": (14,), "fingertip": (15, 16), "toetip": (17, 18),
}  # fmt: skip


def lengths(skeleton: Skeleton) -> np.ndarray:
    return np.concatenate([skeleton.bone_lengths, skeleton.tip_lengths])


@pytest.fixture
def subject(tmp_path):
    """Writes a text to a file and reads it as a subject."""
    path = tmp_path / "subject.toml"

    def read(text: str) -> Skeleton:
        path.write_text(text)
        return read_subject(path)

    return read


def test_places_are_those_of_the_joints():
    ends = {"shoulder": "shoulder", "upper_arm": "elbow", "forearm": "hand", "hip": "hip", "thigh": "knee",
            "shank": "foot"}  # fmt: skip
    for key, end in ends.items():
        assert [JOINT_NAMES[1 + place] for place in PLACES[key]] == [f"l_{end}", f"r_{end}"]


@pytest.mark.parametrize("stature", [1.5, 1.75, 2])
def test_stature_alone_is_the_average_adult(subject, stature):
    skeleton = subject(f"stature = {stature}")
    np.testing.assert_allclose(skeleton.stature, stature, atol=1e-9)
    np.testing.assert_allclose(skeleton.rest_joints, default_adult(float(stature)).rest_joints, atol=1e-9)
    np.testing.assert_allclose(skeleton.rest_tips, default_adult(float(stature)).rest_tips, atol=1e-9)


@pytest.mark.parametrize("key", PLACES)
@pytest.mark.parametrize("side", ["", "l_", "r_"])
def test_one_length_changes_nothing_else(subject, key, side):
    if side and len(PLACES[key]) == 1:
        with pytest.raises(ValueError, match=f"key '{side}{key}': is not known"):
            subject(f"stature = 1.7\n[lengths]\n{side}{key} = 0.31")
        return
    expected = lengths(default_adult(1.7))
    expected[list(PLACES[key] if not side else PLACES[key][:1] if side == "l_" else PLACES[key][1:])] = 0.31
    found = lengths(subject(f"stature = 1.7\n[lengths]\n{side}{key} = 0.31"))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_one_side_goes_before_both(subject):
    skeleton = subject("stature = 1.7\n[lengths]\nthigh = 0.4\nr_thigh = 0.3")
    assert lengths(skeleton)[[9, 12]] == pytest.approx([0.4, 0.3])


def test_directions_at_rest_are_kept(subject):
    adult = default_adult(1.7)
    skeleton = subject("stature = 1.7\n[lengths]\nthigh = 0.5\nl_upper_arm = 0.2")
    knee, elbow, hand = (JOINT_NAMES.index(name) for name in ("l_knee", "l_elbow", "l_hand"))
    thigh = skeleton.rest_joints[knee] - skeleton.rest_joints[knee - 1]
    usual = adult.rest_joints[knee] - adult.rest_joints[knee - 1]
    np.testing.assert_allclose(thigh / 0.5, usual / np.linalg.norm(usual), atol=1e-9)
    # What hangs on a shorter bone moves with it.
    forearm = skeleton.rest_joints[hand] - skeleton.rest_joints[elbow]
    np.testing.assert_allclose(forearm, adult.rest_joints[hand] - adult.rest_joints[elbow], atol=1e-9)


def test_lengths_alone_set_the_scale(subject):
    # Forearms are 1.1, one thigh 1.3 times the average: least squares weighs a scale by length squared.
    adult = lengths(default_adult(1.0))
    forearm, thigh = 1.1 * adult[4], 1.3 * adult[9]
    scale = (2 * 1.1 * adult[4] ** 2 + 1.3 * adult[9] ** 2) / (2 * adult[4] ** 2 + adult[9] ** 2)
    expected = adult * scale
    expected[[4, 7, 9]] = forearm, forearm, thigh
    found = lengths(subject(f"[lengths]\nforearm = {float(forearm)}\nl_thigh = {float(thigh)}"))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_round_trip_keeps_lengths(tmp_path):
    rng = np.random.default_rng(0)
    adult = default_adult(1.83)
    uneven = make_skeleton(
        adult.rest_joints + rng.normal(size=(15, 3)) * 0.01, adult.rest_tips + rng.normal(size=(5, 3)) * 0.01
    )
    for skeleton in (adult, uneven):
        write_subject(tmp_path / "subject.toml", skeleton)
        np.testing.assert_allclose(lengths(read_subject(tmp_path / "subject.toml")), lengths(skeleton), atol=1e-6)


def test_an_even_body_is_written_once_for_both_sides(tmp_path):
    adult = default_adult()
    mirrored = np.array([1, -1, 1])
    np.testing.assert_allclose(adult.rest_joints[list(MIRROR_JOINTS)] * mirrored, adult.rest_joints, atol=1e-12)
    np.testing.assert_allclose(adult.rest_tips[list(MIRROR_TIPS)] * mirrored, adult.rest_tips, atol=1e-12)
    write_subject(tmp_path / "subject.toml", adult)
    assert "l_" not in (tmp_path / "subject.toml").read_text()


WRONG = {
    "nothing": ("", "stature", "stature = 1.75"),
    "no lengths": ("[lengths]", "stature", "is missing"),
    "misspelt": ("stature = 1.7\n[lengths]\nupperarm = 0.3", "upperarm", "did you mean upper_arm?"),
    "misspelt side": ("stature = 1.7\n[lengths]\nl_tigh = 0.3", "l_tigh", "did you mean l_thigh?"),
    "misspelt stature": ("statur = 1.7", "statur", "did you mean stature?"),
    "far from any": ("stature = 1.7\n'äöü\\n' = 3", "äöü\\\\n", "did you mean"),
    "stature in centimetres": ("stature = 175", "stature", "divide cm by 100"),
    "stature of a doll": ("stature = 0.2", "stature", "more than 0.4"),
    "stature as text": ("stature = '1.75 m'", "stature", "metres"),
    "stature is true": ("stature = true", "stature", "metres"),
    "stature is not a number": ("stature = nan", "stature", "metres"),
    "endless stature": ("stature = inf", "stature", "metres"),
    "huge integer": ("stature = 1" + "0" * 400, "stature", "metres"),
    "length in millimetres": ("stature = 1.7\n[lengths]\nthigh = 420", "thigh", "mm by 1000"),
    "length in centimetres": ("stature = 1.7\n[lengths]\nr_fingertip = 9.5", "r_fingertip", "cm by 100"),
    "negative length": ("stature = 1.7\n[lengths]\nneck = -0.1", "neck", "more than 0"),
    "no length": ("stature = 1.7\n[lengths]\nneck = 0", "neck", "more than 0"),
    "vanishing length": ("[lengths]\nneck = 1e-300", "neck", "more than 0.005"),
    "tiny bone": ("stature = 1.7\n[lengths]\nneck = 0.008", "lengths", "shorter than 1 cm"),
    "giant": ("[lengths]\nneck = 1.4", "lengths", "from toe to head"),
    "lengths not a table": ("stature = 1.7\nlengths = 3", "lengths", "[lengths]"),
    "length is a table": ("stature = 1.7\n[lengths.thigh]\nl = 0.4", "thigh", "metres"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_subject_names_file_key_and_remedy(tmp_path, what):
    text, key, remedy = WRONG[what]
    path = tmp_path / "subject.toml"
    path.write_text(text)
    with pytest.raises(ValueError, match="^" + re.escape(f"{path}: key '{key}': ")) as error:
        read_subject(path)
    assert "\n" not in str(error.value)
    assert remedy in str(error.value)


@pytest.mark.parametrize(
    ("content", "remedy"),
    [(b"stature: 1.75", "is not TOML"), (b"\xff\xfe", "is not TOML"),
     (b"#" * 200_000, "is longer than 0.1 MB, too long"), (b"a = " + b"[" * 90_000, "is not TOML")],
)  # fmt: skip
def test_not_toml(tmp_path, content, remedy):
    path = tmp_path / "subject.toml"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=f"^{re.escape(str(path))}: {remedy}") as error:
        read_subject(path)
    assert "\n" not in str(error.value)


def test_no_file(tmp_path):
    with pytest.raises(ValueError, match="check the path"):
        read_subject(tmp_path / "none.toml")
