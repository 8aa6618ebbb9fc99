import io
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from jaxskel.body import JOINT_NAMES, MIRROR_JOINTS, default_adult
from jaxskel.poses import CURVE_THRESHOLDS_MM, LIMBS, Score, score, score_table
from jaxskel.poses.metrics import join_scores
from jaxskel.visualization.plots import plot_score

FRAMES = 4
ARMS = [JOINT_NAMES.index(f"{side}_{name}") for side in "lr" for name in ("shoulder", "elbow", "hand")]
LEGS = [JOINT_NAMES.index(f"{side}_{name}") for side in "lr" for name in ("hip", "knee", "foot")]


def truth(frames: int = FRAMES) -> np.ndarray:
    """A person at rest who moves on by a metre every frame."""
    return default_adult(1.8).rest_joints[None] + np.arange(float(frames))[:, None, None]


def joint(name: str) -> int:
    return JOINT_NAMES.index(name)


def wrongs(found: Score, forgive_swaps: bool = False) -> dict[str, int]:
    """The limbs that are wrong in any frame, with their counts."""
    counts = {limb: found.wrong(limb, forgive_swaps) for limb in LIMBS}
    return {limb: count for limb, count in counts.items() if count}


def test_perfect_poses():
    found = score(truth(), truth())
    for forgive in (False, True):
        assert wrongs(found, forgive) == {}
        assert found.all_correct(forgive) == 1.0
        assert found.percentile(95, None, forgive) == 0.0
        assert (found.curve(forgive) == 1.0).all()


@pytest.mark.parametrize("limb", LIMBS)
@pytest.mark.parametrize(("millimetres", "count"), [(99, 0), (101, 1)])
def test_one_limb_off(limb, millimetres, count):
    poses = truth()
    poses[2, joint(limb)] += np.array([2, -1, 2]) / 3 * millimetres / 1000
    found = score(poses, truth())
    for forgive in (False, True):
        assert wrongs(found, forgive) == ({limb: 1} if count else {})
        assert found.all_correct(forgive) == (FRAMES - count) / FRAMES
    assert found.distances[2, joint(limb)] == pytest.approx(millimetres / 1000)
    assert found.percentile(100, limb) == pytest.approx(millimetres / 1000)
    assert found.percentile(75, limb) == 0.0


def test_a_joint_that_is_no_limb_counts_for_all_15_only():
    poses = truth()
    poses[0, joint("l_knee")] += 1.0
    found = score(poses, truth())
    assert wrongs(found) == {}
    assert found.all_correct() == 3 / 4


@pytest.mark.parametrize(("group", "hands"), [(ARMS, ("l_hand", "r_hand")), (LEGS, ("l_foot", "r_foot"))])
def test_exchanged_sides_are_wrong_unless_forgiven(group, hands):
    poses = truth()
    poses[1:3, group] = poses[1:3][:, np.array(MIRROR_JOINTS)[group]]
    found = score(poses, truth())
    assert wrongs(found) == dict.fromkeys(hands, 2)
    assert found.all_correct() == 1 / 2
    assert wrongs(found, forgive_swaps=True) == {}
    assert found.all_correct(forgive_swaps=True) == 1.0
    assert not found.forgiven.any()


def test_arms_are_exchanged_as_a_whole():
    # Only the hands change places: exchanging the arms mends hands and breaks shoulders and elbows.
    poses = truth()
    left, right = joint("l_hand"), joint("r_hand")
    poses[0, [left, right]] = poses[0, [right, left]]
    found = score(poses, truth())
    assert wrongs(found) == {"l_hand": 1, "r_hand": 1}
    assert wrongs(found, forgive_swaps=True) == {}
    assert found.wrong("l_elbow") == 0
    assert found.wrong("l_elbow", forgive_swaps=True) == 1
    assert found.all_correct(forgive_swaps=True) == 3 / 4


def test_the_smaller_sum_of_both_hands_decides():
    # Isosceles: the true right hand and the left of the pose are 0.2 m from the true left hand, 0.3 m apart.
    # The right hand of the pose is on the true left one: keeping costs 0.2 + 0.2, exchanging 0 + 0.3.
    true, left, right = truth(1), joint("l_hand"), joint("r_hand")
    angle = 2 * np.arcsin(0.75)
    true[0, left], true[0, right] = 0.0, (0.2, 0.0, 0.0)
    poses = true.copy()
    poses[0, left], poses[0, right] = (0.2 * np.cos(angle), 0.2 * np.sin(angle), 0.0), 0.0
    found = score(poses, true)
    assert found.distances[0, [left, right]] == pytest.approx([0.2, 0.2])
    assert found.forgiven[0, [left, right]] == pytest.approx([0.0, 0.3])
    assert wrongs(found, forgive_swaps=True) == {"r_hand": 1}
    # With the sides of the pose exchanged, they are kept.
    poses[0, [left, right]] = poses[0, [right, left]]
    found = score(poses, true)
    np.testing.assert_array_equal(found.forgiven, found.distances)
    assert found.distances[0, [left, right]] == pytest.approx([0.0, 0.3])


def test_arms_and_legs_are_forgiven_apart():
    poses = truth()
    poses[0, ARMS] = poses[0, np.array(MIRROR_JOINTS)[ARMS]]
    poses[0, joint("l_foot")] += 0.5
    found = score(poses, truth())
    assert wrongs(found) == {"l_hand": 1, "r_hand": 1, "l_foot": 1}
    assert wrongs(found, forgive_swaps=True) == {"l_foot": 1}


def test_a_frame_without_a_pose_has_every_limb_wrong():
    poses = truth()
    poses[3] = np.nan
    found = score(poses, truth())
    for forgive in (False, True):
        assert wrongs(found, forgive) == dict.fromkeys(LIMBS, 1)
        assert found.all_correct(forgive) == 3 / 4
        assert (found.curve(forgive) == 3 / 4).all()
        assert found.percentile(100, None, forgive) == 0.0  # over frames with a pose
    assert found.to_dict()["frames_without_pose"] == 1


def test_has_pose_overrules_the_joints():
    found = score(truth(), truth(), np.array([True, False, True, True]))
    assert wrongs(found) == dict.fromkeys(LIMBS, 1)
    poses = truth()
    poses[1, joint("l_hand")] = np.nan
    # A pose that lacks one joint is wrong there only.
    assert wrongs(score(poses, truth(), np.ones(FRAMES, bool))) == {"l_hand": 1}


def test_frames_of_unknown_truth_are_left_out():
    true, poses = truth(), truth()
    true[1, 4, 2] = np.nan
    poses[1] += 1.0
    poses[2, joint("head")] += 1.0
    found = score(poses, true)
    assert len(found) == 3
    assert found.without_truth == 1
    assert wrongs(found) == {"head": 1}


def test_threshold_is_a_choice():
    poses = truth()
    poses[:, joint("head"), 2] += 0.05
    assert wrongs(score(poses, truth(), threshold=0.06)) == {}
    assert wrongs(score(poses, truth(), threshold=0.04)) == {"head": FRAMES}


def test_percentiles_and_curve_by_hand():
    poses = truth(5)
    poses[:, joint("neck"), 0] += [0.010, 0.021, 0.032, 0.043, 0.250]
    found = score(poses, truth(5))
    assert [found.percentile(q, "neck") for q in (25, 50, 75, 95)] == pytest.approx([0.021, 0.032, 0.043, 0.250])
    share = dict(zip(CURVE_THRESHOLDS_MM, found.curve()[:, joint("neck")], strict=True))
    assert [share[mm] for mm in (0, 5, 15, 25, 35, 45, 100, 200)] == pytest.approx([0, 0, 0.2, 0.4, 0.6, 0.8, 0.8, 0.8])


def test_to_dict_is_json():
    poses = truth()
    poses[0, joint("r_hand"), 1] += 0.15
    figures = json.loads(json.dumps(score(poses, truth()).to_dict(), allow_nan=False))
    assert figures["frames"] == FRAMES
    assert figures["threshold_mm"] == pytest.approx(100)
    for counting in ("sides_counted", "swaps_forgiven"):
        assert figures[counting]["wrong"]["r_hand"] == {"count": 1, "percent": 25.0}
        assert figures[counting]["wrong"]["head"] == {"count": 0, "percent": 0.0}
        assert figures[counting]["all_joints_correct_percent"] == 75.0
        assert figures[counting]["median_mm"] == 0.0
        assert figures[counting]["joints_mm"]["r_hand"]["p95"] == pytest.approx(150)
        assert len(figures[counting]["curve_percent"]["all"]) == len(figures["curve_threshold_mm"])
        assert figures[counting]["curve_percent"]["all"][0] == pytest.approx(100 * 59 / 60)


def test_to_dict_without_any_pose_is_json():
    figures = score(np.full((2, 15, 3), np.nan), truth(2)).to_dict()
    json.dumps(figures, allow_nan=False)
    assert figures["sides_counted"]["median_mm"] is None
    assert figures["sides_counted"]["wrong"]["head"] == {"count": 2, "percent": 100.0}


@pytest.mark.parametrize(
    ("poses", "true", "flags", "threshold", "message"),
    [
        (truth(3), truth(4), None, 0.1, "3 frames of poses but 4 of truth"),
        (truth(3), truth(3), np.ones(2, bool), 0.1, "2 flags"),
        (truth(0), truth(0), None, 0.1, "at least one"),
        (truth(2), truth(2) * np.nan, None, 0.1, "at least one"),
        (truth(2), truth(2), None, 0.0, "positive"),
        (truth(2), truth(2), None, np.nan, "positive"),
    ],
)
def test_arrays_that_do_not_match_are_refused(poses, true, flags, threshold, message):
    with pytest.raises(ValueError, match=message) as error:
        score(poses, true, flags, threshold)
    assert "\n" not in str(error.value)


def noisy(seed: int, frames: int = 6) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    poses = truth(frames) + rng.normal(size=(frames, 15, 3)) * rng.choice([0.01, 0.1, 0.3], (frames, 15, 1))
    poses[rng.random(frames) < 0.2] = np.nan
    return poses, truth(frames)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_laws_of_a_score(seed):
    poses, true = noisy(seed)
    found = score(poses, true)
    # Moving the world moves nothing.
    moved = score(poses + 3.0, true + 3.0)
    np.testing.assert_allclose(moved.distances, found.distances, atol=1e-9)
    # Exchanging all sides of the poses changes nothing once swaps are forgiven.
    mirrored = score(poses[:, list(MIRROR_JOINTS)], true)
    np.testing.assert_allclose(mirrored.forgiven, found.forgiven, atol=1e-9)
    # Forgiving never makes the hands worse in sum, nor touches the trunk.
    ends = [joint("l_hand"), joint("r_hand")]
    assert (found.forgiven[:, ends].sum(1) <= found.distances[:, ends].sum(1)).all()
    np.testing.assert_array_equal(found.forgiven[:, :3], found.distances[:, :3])
    # Share within the threshold and count of wrong joints agree.
    at_100_mm = found.curve()[CURVE_THRESHOLDS_MM.index(100)]
    for limb in LIMBS:
        assert at_100_mm[joint(limb)] == pytest.approx(1 - found.wrong(limb) / len(found))
    assert (np.diff(found.curve(), axis=0) >= 0).all()


def test_joined_scores_are_the_score_of_joined_recordings():
    (poses, true), (more_poses, more_true) = noisy(1), noisy(2, frames=9)
    more_true[0, 0] = np.nan
    joined = join_scores([score(poses, true), score(more_poses, more_true)])
    whole = score(np.concatenate([poses, more_poses]), np.concatenate([true, more_true]))
    assert joined.to_dict() == whole.to_dict()
    assert joined.without_truth == 1


def test_scores_that_cannot_be_joined():
    with pytest.raises(ValueError, match="no scores"):
        join_scores([])
    with pytest.raises(ValueError, match="thresholds differ"):
        join_scores([score(truth(), truth(), threshold=threshold) for threshold in (0.1, 0.2)])


def test_table_has_a_row_for_each_recording_and_the_total():
    poses = truth()
    poses[1, ARMS] = poses[1, np.array(MIRROR_JOINTS)[ARMS]]
    poses[0] = np.nan
    table = score_table({"13_17": score(poses, truth()), "13_18": score(truth(12), truth(12))})
    rows = list(zip(*([str(cell) for cell in column.cells] for column in table.columns), strict=True))
    # Columns: recording, frames, no pose, the limbs, all 15, median; second lines forgive swaps.
    assert rows[0][:3] == ("13_17", "4", "1")
    limbs = dict(zip(LIMBS, rows[0][3:8], strict=True))
    assert limbs["l_hand"] == limbs["r_hand"] == "2 50.0%\n1 25.0%"
    assert limbs["l_foot"] == limbs["r_foot"] == limbs["head"] == "1 25.0%\n1 25.0%"
    assert rows[0][8:] == ("50.0%\n75.0%", "0.0\n0.0")
    assert rows[1] == ("13_18", "12", "0", *["0 0.0%\n0 0.0%"] * 5, "100.0%\n100.0%", "0.0\n0.0")
    limbs = dict(zip(LIMBS, rows[2][3:8], strict=True))
    assert rows[2][:3] == ("total", "16", "1")
    assert limbs["l_hand"] == "2 12.5%\n1 6.2%"
    assert rows[2][8:] == ("87.5%\n93.8%", "0.0\n0.0")
    screen = io.StringIO()
    Console(file=screen, width=80).print(table)
    assert "total" in screen.getvalue()
    assert "…" not in screen.getvalue()


def test_table_shows_a_name_as_it_is():
    screen = io.StringIO()
    Console(file=screen, width=120).print(score_table({"[/b] a [red]": score(truth(), truth())}))
    assert "[/b] a [red]" in screen.getvalue()


@pytest.mark.parametrize("kind", [".png", ".pdf", ".svg"])
def test_plot_is_a_picture(tmp_path, kind):
    path = tmp_path / "new" / f"score{kind}"
    plot_score(score(*noisy(3, frames=40)), path)
    begins = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}
    assert path.read_bytes().startswith(begins[kind])


def test_plot_without_any_pose(tmp_path):
    plot_score(score(np.full((2, 15, 3), np.nan), truth(2)), tmp_path / "score.png")
    assert (tmp_path / "score.png").stat().st_size > 10_000
