"""Tables and figures of runs, against counts by hand."""

import itertools

import _drawings
import _measure
import _presets
import _runs
import _table
import accuracy
import cv2
import equinox as eqx
import figures
import numpy as np
import pytest
from _condition import Condition
from support.measured_runs import run_of_truth

from jaxskel import Recording, Settings, paper_settings
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import make_scene


@pytest.fixture(scope="module")
def scene() -> Recording:
    return make_scene(4)


def test_the_counts_of_the_paper_add_up_to_its_last_row():
    """A typing error in any row would break the printed sums and shares."""
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


def test_contenders_take_turns(capsys, monkeypatch):
    monkeypatch.setattr(_measure, "_TURN", 0.0)
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


def test_a_turn_is_as_many_runs_as_it_takes(monkeypatch):
    # A clock that goes on by 40 ms whenever it is looked at: a turn of 100 ms ends when it is looked at the third time.
    ticks = itertools.count(step=0.04)
    monkeypatch.setattr(_measure.time, "perf_counter", lambda: next(ticks))
    calls = []
    report = _measure.Report("machine", "clip")
    report.race("work", [_measure.Contender("we", lambda: calls.append("we"), 2)], 5)
    assert len(calls) == 1 + 5 * 3
    # From the first look to the fifth, of three runs of two frames.
    np.testing.assert_allclose(report.rows[0].value, 1e3 * 4 * 0.04 / (3 * 2))
