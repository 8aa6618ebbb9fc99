"""The benchmarks do what they say: the disturbances are measured, the scripts run."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import equinox as eqx
import numpy as np
import pytest

from jaxskel import (
    JOINT_NAMES,
    Recording,
    Settings,
    make_cameras,
    pack_silhouettes,
    paper_settings,
    unpack_silhouettes,
)
from jaxskel._skeleton import MIRROR_JOINTS, MIRROR_TIPS
from jaxskel.io import write_recording
from jaxskel.synthetic import make_scene

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))

import _drawings  # noqa: E402
import _measure  # noqa: E402
import _presets  # noqa: E402
import _runs  # noqa: E402
import _table  # noqa: E402
import accuracy  # noqa: E402
import cameras as rigs  # noqa: E402
import figures  # noqa: E402
from _condition import Condition, disturbed  # noqa: E402
from disturb import (  # noqa: E402
    holes_and_blobs,
    rough_edges,
    with_cameras,
    with_dirty_masks,
    with_wrong_bones,
)

SEEDS = range(24)


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4)


def masks_of(recording: Recording) -> np.ndarray:
    return unpack_silhouettes(recording.silhouettes, int(recording.cameras.size[0, 0]))


def a_person() -> np.ndarray:
    """A body, a head, and an arm of 5 px that sticks out; one foot stands on the edge of the image."""
    mask = np.zeros((200, 160), bool)
    mask[60:, 60:100] = True
    mask[80:85, 100:140] = True
    cv2.circle(mask.view(np.uint8), (80, 45), 14, 1, -1)
    return mask


def ring(mask: np.ndarray, width: int) -> np.ndarray:
    """Pixels whose nearest pixel of the other kind is at most `width` away, counted the slow way."""
    near = np.zeros_like(mask)
    for dv in range(-width, width + 1):
        for du in range(-width, width + 1):
            if dv * dv + du * du <= width * width:
                padded = np.pad(mask, width, mode="edge")
                h, w = mask.shape
                near |= padded[width + dv : width + dv + h, width + du : width + du + w] != mask
    return near


def unchanged(before: Recording, copy: np.ndarray) -> bool:
    return np.array_equal(before.silhouettes, copy)


# --- cameras


def test_cameras_are_chosen_with_their_silhouettes(scene):
    fewer = with_cameras(scene, [5, 0, 2])
    assert fewer.cameras.names == tuple(scene.cameras.names[i] for i in (5, 0, 2))
    np.testing.assert_array_equal(fewer.cameras.t, scene.cameras.t[[5, 0, 2]])
    np.testing.assert_array_equal(fewer.silhouettes, scene.silhouettes[:, [5, 0, 2]])
    assert len(scene.cameras) == 8


@pytest.mark.parametrize("indices", [[0, 8], [-1], [1, 1], []])
def test_impossible_cameras_are_refused(scene, indices):
    with pytest.raises(ValueError, match=r"synthetic: cameras .* from 0 to 7"):
        with_cameras(scene, indices)


# --- masks


@pytest.mark.parametrize("seed", SEEDS)
def test_edges_move_by_at_most_two_pixels(seed):
    mask = a_person()
    rough = rough_edges(mask, np.random.default_rng(seed))
    assert not (rough != mask)[~ring(mask, 2)].any()


def test_edges_move_both_ways_by_every_amount_and_raggedly():
    mask = a_person()
    grown, layers = [], []
    for seed in SEEDS:
        rough = rough_edges(mask, np.random.default_rng(seed))
        moved = rough != mask
        grown.append(int(rough.sum()) - int(mask.sum()))
        # Shares of the outline's first and second pixel that changed.
        one, two = ring(mask, 1), ring(mask, 2) & ~ring(mask, 1)
        side = rough if grown[-1] > 0 else ~rough
        kind = ~mask if grown[-1] > 0 else mask
        layers.append([(moved & side & kind)[layer & kind].mean() for layer in (one, two)])
    outline = (ring(mask, 1) & mask).sum()
    assert min(grown) < -outline
    assert max(grown) > outline
    first, second = np.array(layers).T
    assert (first > 0.95).any()
    assert (second > 0.5).any()
    assert ((first > 0.05) & (first < 0.7)).any()  # ragged: moved in places only


def test_nothing_stays_nothing():
    empty = np.zeros((50, 60), bool)
    assert not rough_edges(empty, np.random.default_rng(0)).any()
    assert not holes_and_blobs(empty, np.random.default_rng(0)).any()
    assert rough_edges(~empty, np.random.default_rng(0)).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_two_discs_of_twenty_pixels_on_or_near_the_person(seed):
    # A person too large for two discs to touch the edge, or a small one far from the edges.
    large, small = np.ones((400, 400), bool), np.zeros((400, 400), bool)
    small[190:210, 190:210] = True
    (v, u) = np.mgrid[:400, :400]
    disc = int(((v - 200) ** 2 + (u - 200) ** 2 <= 400).sum())
    assert disc == pytest.approx(np.pi * 20**2, rel=0.01)
    holes = large & ~holes_and_blobs(large, np.random.default_rng(seed))
    assert holes.sum() <= 2 * disc
    blobs = holes_and_blobs(small, np.random.default_rng(seed)) & ~small
    assert blobs.sum() <= 2 * disc
    rows, columns = np.nonzero(blobs)
    if len(rows):
        # A centre lies within 40 px of the person in u and in v, and the disc reaches 20 px farther.
        assert min(rows.min(), columns.min()) >= 190 - 40 - 20
        assert max(rows.max(), columns.max()) <= 209 + 40 + 20


def test_holes_and_blobs_both_occur_and_are_whole():
    large = np.ones((600, 600), bool)
    small = np.zeros((600, 600), bool)
    small[300, 300] = True
    disc = 1257  # pixels whose centre is at most 20 px from that of the middle
    holes = [int((~holes_and_blobs(large, np.random.default_rng(seed))).sum()) for seed in SEEDS]
    blobs = [int(holes_and_blobs(small, np.random.default_rng(seed)).sum()) for seed in SEEDS]
    assert disc in holes
    assert 2 * disc in holes
    assert any(count in blobs for count in (disc, disc + 1))
    # A single point with two holes on it is gone.
    assert 0 in blobs


def test_one_view_of_each_frame_is_black(scene):
    dirty = masks_of(with_dirty_masks(scene, 3))
    assert masks_of(scene).any((2, 3)).all()
    np.testing.assert_array_equal((~dirty.any((2, 3))).sum(1), 1)
    seeds = [np.flatnonzero(~masks_of(with_dirty_masks(scene, seed)).any((2, 3)).ravel()) % 8 for seed in range(4)]
    assert len(np.unique(seeds)) > 3


def test_far_from_edges_and_discs_a_dirty_mask_is_the_clean_one(scene):
    clean, dirty = masks_of(scene), masks_of(with_dirty_masks(scene, 3))
    disc = 1257
    for frame, frame_dirty in zip(clean, dirty, strict=True):
        seen = frame_dirty.any((1, 2))
        for before, after in zip(frame[seen], frame_dirty[seen], strict=True):
            assert (before != after).any()
            assert ((before != after) & ~ring(before, 2)).sum() <= 2 * disc


def test_dirt_is_reproducible_and_differs_by_seed_and_recording(scene):
    first = with_dirty_masks(scene, 1).silhouettes
    np.testing.assert_array_equal(first, with_dirty_masks(scene, 1).silhouettes)
    assert not np.array_equal(first, with_dirty_masks(scene, 2).silhouettes)
    assert not np.array_equal(first, with_dirty_masks(eqx.tree_at(lambda r: r.name, scene, "other"), 1).silhouettes)


def test_a_frame_is_disturbed_alike_whichever_are_chosen_with_it(scene):
    some = with_dirty_masks(scene[1::2], 1).silhouettes
    np.testing.assert_array_equal(some, with_dirty_masks(scene, 1).silhouettes[1::2])


def test_pixels_beside_a_narrow_image_stay_empty():
    """Widths that are no multiple of 8, and cameras of two sizes, share one stack of bits."""
    sizes = np.array([[61, 50], [80, 40]])
    K = np.tile(np.array([[50.0, 0, 30], [0, 50, 20], [0, 0, 1]]), (2, 1, 1))
    cameras = make_cameras(K, np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), sizes)
    masks = np.zeros((30, 2, 50, 80), bool)
    masks[:, 0, 20:50, 40:61] = masks[:, 1, 5:40, 40:80] = True
    narrow = Recording(cameras, pack_silhouettes(masks), 1.0, "+Z", np.arange(30))
    dirty = unpack_silhouettes(with_dirty_masks(narrow, 0).silhouettes, 80)
    assert not dirty[:, 0, :, 61:].any()
    assert not dirty[:, 1, 40:].any()
    assert dirty[:, 0, :, 60].any()


# --- bones


@pytest.mark.parametrize("seed", range(8))
def test_bones_are_off_by_the_share_and_alike_on_both_sides(scene, seed):
    wrong = with_wrong_bones(scene, 0.05, seed).skeleton
    assert wrong is not None
    ratio = np.insert(wrong.bone_lengths / scene.skeleton.bone_lengths, 0, 1.0)
    np.testing.assert_allclose(np.abs(ratio[1:] - 1), 0.05, atol=1e-12)
    np.testing.assert_allclose(ratio, ratio[list(MIRROR_JOINTS)], atol=1e-12)
    flip = np.array([1.0, -1.0, 1.0])
    np.testing.assert_allclose(wrong.rest_joints, wrong.rest_joints[list(MIRROR_JOINTS)] * flip, atol=1e-12)
    np.testing.assert_allclose(wrong.rest_tips, wrong.rest_tips[list(MIRROR_TIPS)] * flip, atol=1e-12)


def test_tips_follow_the_bone_of_their_joint(scene):
    wrong = with_wrong_bones(scene, 0.05, 0).skeleton
    assert wrong is not None
    ratio = wrong.bone_lengths / scene.skeleton.bone_lengths
    ends = [JOINT_NAMES.index(name) - 1 for name in ("head", "l_hand", "r_hand", "l_foot", "r_foot")]
    np.testing.assert_allclose(wrong.tip_lengths / scene.skeleton.tip_lengths, ratio[ends], atol=1e-12)


def test_bones_are_reproducible_and_the_rest_is_untouched(scene):
    joints = scene.skeleton.rest_joints.copy()
    first = with_wrong_bones(scene, 0.05, 1)
    assert first.skeleton is not None
    np.testing.assert_array_equal(first.skeleton.rest_joints, with_wrong_bones(scene, 0.05, 1).skeleton.rest_joints)
    drawn = {with_wrong_bones(scene, 0.05, seed).skeleton.bone_lengths.tobytes() for seed in range(8)}
    assert len(drawn) > 4
    np.testing.assert_array_equal(scene.skeleton.rest_joints, joints)
    np.testing.assert_array_equal(first.truth.joints, scene.truth.joints)
    assert unchanged(scene, first.silhouettes)


def test_share_of_nothing_changes_nothing(scene):
    same = with_wrong_bones(scene, 0.0, 1).skeleton
    np.testing.assert_allclose(same.rest_joints, scene.skeleton.rest_joints, atol=1e-12)
    np.testing.assert_allclose(same.rest_tips, scene.skeleton.rest_tips, atol=1e-12)


def test_bones_that_cannot_be_disturbed_are_refused(scene):
    unknown = eqx.tree_at(lambda r: r.skeleton, scene, None)
    with pytest.raises(ValueError, match=r"synthetic: key 'rest_joints'"):
        with_wrong_bones(unknown, 0.05, 0)
    with pytest.raises(ValueError, match=r"share 5"):
        with_wrong_bones(scene, 5, 0)


# --- conditions


def test_a_condition_does_all_it_names_and_leaves_its_input(scene):
    before = scene.silhouettes.copy()
    result = disturbed(scene, Condition(cameras=(0, 2, 4, 6), dirty=1, bones=0.05, seed=2, step=2))
    assert unchanged(scene, before)
    assert (len(result), len(result.cameras), result.fps) == (2, 4, scene.fps / 2)
    np.testing.assert_array_equal(result.frame_index, [0, 2])
    np.testing.assert_array_equal(result.truth.joints, scene.truth.joints[::2])
    assert ((~masks_of(result).any((2, 3))).sum(1) == 1).all()  # one of the four, not one left out
    assert not np.allclose(result.skeleton.bone_lengths, scene.skeleton.bone_lengths)
    named = str(Condition(cameras=(0, 2), dirty=1, bones=0.05, seed=2, step=4))
    assert named == "cameras 0 2, dirty masks (seed 1), bones ±5 % (seed 2), 1 frame in 4"
    assert str(Condition()) == ""


# --- Table 1 and its figures


def run_of_truth(scene: Recording, code: str = "a") -> _runs.Run:
    """The truth as if reconstructed: in frame 1 the left hand 50 mm off, in frame 2 both hands 200 mm, 3 is lost."""
    joints = scene.truth.joints.astype(np.float32)
    joints[1, JOINT_NAMES.index("l_hand")] += np.array([0.03, 0.0, 0.04], np.float32)
    joints[2, [JOINT_NAMES.index("l_hand"), JOINT_NAMES.index("r_hand")]] += np.array([0.0, 0.2, 0.0], np.float32)
    joints[3] = np.nan
    return _runs.Run(joints, scene.truth.joints, np.array([1, 1, 1, 0], bool), scene.frame_index, code)


def test_the_counts_of_the_paper_add_up_to_its_last_row():
    """Its printed sums and shares, which a slip in any row would break."""
    total = _table.paper_total(list(_table.PAPER_TABLE_1))
    assert total == (19856, 151, 170, 541, 457)
    shares = _table.paper_dict()["all"]["wrong"]
    assert [round(shares[limb]["percent"], 1) for limb in _table.PAPER_LIMBS] == [0.8, 0.9, 2.7, 2.3]
    printed = {"02_01": [0.0, 0.0, 2.9, 13.7], "05_02": [0.7, 0.4, 0.4, 0.6], "13_29": [1.6, 2.1, 3.7, 2.0]}
    for clip, percents in printed.items():
        wrong = _table.paper_dict()[clip]["wrong"]
        assert [round(wrong[limb]["percent"], 1) for limb in _table.PAPER_LIMBS] == percents


@pytest.mark.parametrize(
    ("stem", "clip", "body"),
    [
        ("13_18_male", "13_18", "male"),
        ("13_18", "13_18", ""),
        ("13_18_tall_male", "13_18", "tall_male"),
        ("13_19_male", "", ""),  # not in the table
        ("113_18_male", "", ""),
        ("13_180", "", ""),
        ("scene", "", ""),
    ],
)
def test_clip_and_body_are_told_by_the_stem(stem, clip, body):
    assert _table.clip_and_body(stem) == (clip, body)


def test_a_table_counts_what_was_counted_by_hand(scene):
    result = _runs.score_run(run_of_truth(scene))
    preset = _presets.PRESETS["paper"]
    scores = {preset.name: {"13_18_male": result, "13_18_female": result, "02_01_male": result}}
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in _table.table_markdown("full", scores, [preset]).splitlines()
        if line.startswith("|")
    ]
    by_name = {row[0]: row[1:] for row in rows}
    # Of 4 frames each foot is wrong in the lost one, each hand in two.
    assert by_name["13_18_male"] == ["4", "2999", "1.2 / 1.4 / 5.4 / 4.3", "25.0 / 25.0 / 50.0 / 50.0"]
    assert by_name["**all female**"] == ["4", "2999", "1.2 / 1.4 / 5.4 / 4.3", "25.0 / 25.0 / 50.0 / 50.0"]
    assert by_name["**all male**"][:2] == ["8", "3341"]
    # Two bodies act one clip, which the paper has once.
    assert by_name["**all**"][:2] == ["12", "3341"]
    assert by_name["the paper"] == ["3341", "–", "37 (1.1 %)", "41 (1.2 %)", "172 (5.1 %)", "176 (5.3 %)", *"–––"]
    assert by_name[preset.title][:6] == ["12", "3", "3 (25.0 %)", "3 (25.0 %)", "6 (50.0 %)", "6 (50.0 %)"]
    assert by_name[preset.title][7] == "50.0 %"


def test_a_sequence_that_the_paper_lacks_has_no_numbers_of_the_paper(scene):
    preset = _presets.PRESETS["paper"]
    result = _runs.score_run(run_of_truth(scene))
    table = _table.table_markdown("x", {preset.name: {"scene": result, "02_01": result}}, [preset])
    assert "| scene | 4 | – | – | 25.0 /" in table
    assert "| **all** | 8 | – | – | 25.0 /" in table
    assert "| 02_01 | 4 | 342 | 0.0 / 0.0 / 2.9 / 13.7 |" in table


def test_distance_of_a_joint_is_taken_where_the_truth_is_known(scene):
    run = run_of_truth(scene)
    numbers, distances = _drawings.joint_distance(run)
    np.testing.assert_array_equal(numbers, [0, 1, 2, 3])
    np.testing.assert_allclose(distances, [0.0, 0.05, 0.2, np.nan], atol=1e-6)
    unknown = run.truth.copy()
    unknown[1] = np.nan
    numbers, distances = _drawings.joint_distance(eqx.tree_at(lambda r: r.truth, run, unknown))
    np.testing.assert_array_equal(numbers, [0, 2, 3])
    np.testing.assert_allclose(distances, [0.0, 0.2, np.nan], atol=1e-6)


@pytest.mark.parametrize(
    ("wrong", "length", "first", "end"),
    [
        ("0110100", 3, 2, 5),  # 1-0-1 twice jumps; 0-1-0 too, but later
        ("0000111", 2, 3, 5),
        ("1111", 2, 0, 2),  # no jump anywhere
        ("0101", 9, 0, 4),  # all there is
        ("1", 5, 0, 1),
    ],
)
def test_the_interval_shown_jumps_most(wrong, length, first, end):
    flags = np.array([letter == "1" for letter in wrong])
    assert _drawings.jumpy_interval(flags, length) == slice(first, end)


@pytest.mark.parametrize("interval", [(1000, 1004), (1001, 1003)])
def test_panels_of_late_frames_fill_the_picture(scene, tmp_path, interval):
    """With a frame without a pose, and with none: matplotlib warns, hence fails here, where panels collapse."""
    run = eqx.tree_at(lambda r: r.frame_index, run_of_truth(scene), np.arange(1000, 1004))
    _drawings.draw_joint_distance({"a": run, "b": run}, "scene", tmp_path / "hand.png", interval)
    ink = (cv2.imread(str(tmp_path / "hand.png"), cv2.IMREAD_GRAYSCALE) < 250).any(1)
    assert ink.mean() > 0.9


def test_an_interval_without_frames_is_refused(scene, tmp_path):
    with pytest.raises(ValueError, match=r"scene: no frame from 7 to 8; its frames are 0\.\.3"):
        _drawings.draw_joint_distance({"a": run_of_truth(scene)}, "scene", tmp_path / "hand.png", (7, 9))


def test_a_run_is_kept_as_it_is_and_not_taken_for_another(scene, tmp_path):
    write_recording(tmp_path / "scene.npz", scene)
    run, settings = run_of_truth(scene), paper_settings()
    source = _runs.made_from(tmp_path / "scene.npz", Condition(), settings)
    _runs.write_run(tmp_path / "kept.npz", run, source)
    back = _runs.read_run(tmp_path / "kept.npz", source)
    np.testing.assert_array_equal(back.joints, run.joints)
    np.testing.assert_array_equal(back.truth, run.truth)
    np.testing.assert_array_equal(back.has_pose, run.has_pose)
    np.testing.assert_array_equal(back.frame_index, run.frame_index)
    assert back.code == run.code

    write_recording(tmp_path / "again.npz", scene)  # the same arrays, another file
    assert _runs.made_from(tmp_path / "again.npz", Condition(), settings) == source
    write_recording(tmp_path / "other.npz", scene[:3])
    others = {
        "sequence": _runs.made_from(tmp_path / "other.npz", Condition(), settings),
        "condition": _runs.made_from(tmp_path / "scene.npz", Condition(dirty=1), settings),
        "settings": _runs.made_from(tmp_path / "scene.npz", Condition(), Settings()),
    }
    for what, other in others.items():
        with pytest.raises(ValueError, match=rf"kept\.npz: was made with another {what}; delete it"):
            _runs.read_run(tmp_path / "kept.npz", other)
    with pytest.raises(ValueError, match=r"gone\.npz: cannot be read"):
        _runs.made_from(tmp_path / "gone.npz", Condition(), settings)


def test_sequences_of_one_name_are_told_apart_by_their_folders(tmp_path):
    a, b = tmp_path / "full" / "13_18_male.npz", tmp_path / "sparse" / "13_18_male.npz"
    assert figures.sets_of([a, b]) == {"full": {"13_18_male": a}, "sparse": {"13_18_male": b}}
    with pytest.raises(ValueError, match="rename one of them"):
        figures.sets_of([a, tmp_path / "else" / "full" / "13_18_male.npz"])


# --- the scripts


def benchmark(name: str, *arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, str(BENCHMARKS / name), *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("name", ["accuracy.py", "speed.py", "figures.py"])
def test_help_tells_the_command(name, tmp_path):
    done = benchmark(name, "--help", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"python benchmarks/{name}" in done.stdout


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--cameras", "0,x"], "commas"),
        (["--step", "0"], "from 1 on"),
        (["--bones", "5"], "0.05 for 5 %"),
        (["--dirty", "-1"], "--dirty"),
    ],
)
def test_options_are_checked(options, complaint, tmp_path):
    done = benchmark("accuracy.py", "scene.npz", *options, cwd=tmp_path)
    assert done.returncode == 2
    assert complaint in done.stderr


def run(main: Callable[[], None], monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    """Run a script in this process, so that the scripts share what they compile."""
    monkeypatch.setattr(sys, "argv", ["benchmark", *map(str, arguments)])
    main()


def test_scripts_run_on_four_frames(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "scene.npz", scene)
    condition = ["--cameras", "0,1,2,3,4,5,6", "--step", "2"]
    run(accuracy.main, monkeypatch, "scene.npz", *condition, "--output", "all.json")
    rows, trust = (
        [line for line in part.splitlines() if line.startswith("|")] for part in capsys.readouterr().out.split("\n\n")
    )
    assert len(rows) == 4
    assert len(trust) == 5
    assert len({row.count("|") for row in rows}) == 1
    assert rows[2].startswith("| scene, cameras 0 1 2 3 4 5 6, 1 frame in 2 | 2 | 0 |")
    assert rows[3].startswith("| **all**, cameras 0 1 2 3 4 5 6, 1 frame in 2 | 2 | 0 |")
    written = json.loads((tmp_path / "all.json").read_text())
    assert written["condition"] == "cameras 0 1 2 3 4 5 6, 1 frame in 2"
    assert set(written["accuracy"]) == {"scene", "all"}


def test_figures_go_on_where_they_were_cut_off(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "clips" / "13_18_male.npz", scene)
    write_recording(tmp_path / "clips" / "scene.npz", scene[:2])
    clips, presets = ["clips/13_18_male.npz", "clips/scene.npz"], ["--presets", "paper,default"]
    done = []
    reconstruct_run = figures.reconstruct_run

    def cut_off(recording, settings, label):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append((recording.name, label.split()[-1]))
        return reconstruct_run(recording, settings, label)

    monkeypatch.setattr(figures, "reconstruct_run", cut_off)
    with pytest.raises(KeyboardInterrupt):
        run(figures.main, monkeypatch, *clips, *presets, "-o", "out")
    assert not (tmp_path / "out" / "table1.md").exists()
    first, done[:] = list(done), []
    run(figures.main, monkeypatch, *clips, *presets, "-o", "out")
    assert sorted(first + done) == [
        (name, preset) for name in ("13_18_male", "scene") for preset in ("default", "paper")
    ]
    assert len(done) == 1

    table = (tmp_path / "out" / "table1.md").read_text(encoding="utf-8")
    assert table in capsys.readouterr().out
    assert "| 13_18_male | 4 | 2999 | 1.2 / 1.4 / 5.4 / 4.3 |" in table
    assert "versions" not in table
    written = json.loads((tmp_path / "out" / "table1.json").read_text())
    assert written["paper"]["all"]["frames"] == 19856
    assert {preset: by["all"]["frames"] for preset, by in written["sets"]["clips"].items()} == {
        "paper": 6,
        "default": 6,
    }
    for name in ("boxplots.png", "threshold.png", "hand_distance.png"):
        picture = cv2.imread(str(tmp_path / "out" / name))
        assert picture is not None
        assert picture.std() > 5


def test_what_is_kept_is_used_only_for_what_it_was_made_from(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "clips" / "scene.npz", scene)
    source = _runs.made_from(tmp_path / "clips" / "scene.npz", Condition(), paper_settings())
    _runs.write_run(tmp_path / "out/runs/clips/scene.paper.npz", run_of_truth(scene), source)
    source = _runs.made_from(tmp_path / "clips" / "scene.npz", Condition(), Settings())
    _runs.write_run(tmp_path / "out/runs/clips/scene.default.npz", run_of_truth(scene, code="b"), source)
    run(figures.main, monkeypatch, "clips/scene.npz", "--presets", "paper,default", "-o", "out")
    table = capsys.readouterr().out
    assert "no hand_distance.png" in table
    assert "2 versions of the code (a, b)" in table
    with pytest.raises(ValueError, match="another condition"):
        run(figures.main, monkeypatch, "clips/scene.npz", "--presets", "paper,default", "-o", "out", "--step", "2")


def test_presets_are_checked(tmp_path):
    done = benchmark("figures.py", "scene.npz", "-o", "out", "--presets", "paper,good", cwd=tmp_path)
    assert done.returncode == 2
    assert "give some of paper,default,tracked" in done.stderr


def test_reliability_by_hand():
    confidence = np.array([0.1, 0.5, 0.6, 0.9, 0.95, 1.0, 1.0, 1.0])
    right = np.array([False, True, False, True, True, True, True, False])
    assert accuracy.reliability(confidence, right).splitlines()[2:] == [
        "| 0 to 0.5 | 12.5 % | 0.0 % |",
        "| 0.5 to 0.9 | 25.0 % | 50.0 % |",
        "| 0.9 to 1 | 62.5 % | 80.0 % |",
    ]


def test_a_stored_run_tells_what_has_become_worse(tmp_path):
    def report(slower: float, error: float) -> _measure.Report:
        found = _measure.Report("machine", "clip")
        found.add(_measure.Row("carve", "peer", 3.0, ratio=3.0 / slower, required=2.5))
        found.add(_measure.Row("whole", "median error", error, "mm"))
        return found

    report(1.0, 50.0).write(tmp_path / "before.json")
    assert _measure.regressions(report(1.05, 51.0), tmp_path / "before.json") == []
    assert _measure.regressions(report(0.5, 20.0), tmp_path / "before.json") == []
    (worse,) = _measure.regressions(report(1.3, 50.0), tmp_path / "before.json")
    assert worse.startswith("carve, peer")
    (worse,) = _measure.regressions(report(1.0, 60.0), tmp_path / "before.json")
    assert worse.startswith("whole, median error")


def test_contenders_take_turns(capsys):
    calls = []
    contenders = [
        _measure.Contender("we", lambda: calls.append("we") or 1, 2),
        _measure.Contender("they", lambda: calls.append("they") or 2, 1, required=0.0),
    ]
    report = _measure.Report("machine", "clip")
    assert report.race("work", contenders, 3) == [1, 2]
    assert calls == ["we", "they"] * 4
    ours, theirs = report.rows
    assert ours.ratio is None
    assert theirs.ratio == pytest.approx(theirs.value / ours.value)
    assert theirs.met
    assert "| work | they |" in capsys.readouterr().out


def test_cameras_are_put_wrong_by_what_it_says_and_the_hull_shows_it(scene):
    wrong = rigs.perturbed(scene.cameras, 3)
    turned = np.asarray(wrong.R) @ np.asarray(scene.cameras.R).swapaxes(-1, -2)
    angles = np.arccos((np.trace(turned, axis1=1, axis2=2) - 1) / 2)
    np.testing.assert_allclose(angles, rigs.TURN)
    np.testing.assert_allclose(np.linalg.norm(wrong.centres - scene.cameras.centres, axis=1), rigs.SHIFT)
    assert not np.allclose(turned, rigs.perturbed(scene.cameras, 4).R @ np.asarray(scene.cameras.R).swapaxes(-1, -2))
    frames = np.arange(2)
    true = rigs.drawn_agreement(scene, frames)
    # Half a voxel is missing around; the person is as wide as a dozen voxels.
    assert 0.85 < true < 1
    assert rigs.drawn_agreement(eqx.tree_at(lambda r: r.cameras, scene, wrong), frames) < true - 0.05
