"""`run` and batches refuse hopeless recordings before any work; with `--anyway` they go on."""

import pytest
from support.command_line import jaxskel
from support.faked_batch import fake
from support.listings import tree
from support.spoilt_rigs import good, masks_of, with_masks, with_view

from jaxskel.batch import Method, Outcome, Source
from jaxskel.batch._one import reconstruct_one
from jaxskel.io.recordings import write_recording
from jaxskel.verdict import doubts_before_work


@pytest.fixture(scope="module")
def recording():
    return good()[5:8]


MIRRORED = "mirrored"


@pytest.mark.slow
def test_views_that_contradict_each_other_are_refused_and_nothing_is_written(recording, tmp_path, monkeypatch):
    write_recording(tmp_path / "a.npz", with_masks(recording, masks_of(recording)[..., ::-1]))
    before = tree(tmp_path)
    done = jaxskel("run", "a.npz", "-o", "out", cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert f"every view is {MIRRORED}" in done.stderr
    assert "--anyway goes on" in done.stderr
    assert tree(tmp_path) == before
    batches = fake(monkeypatch)
    source = Source("a", tmp_path / "a.npz")
    found = reconstruct_one(source, tmp_path / "out", Method())
    assert (found.outcome, batches) == (Outcome.FAILED, [])
    assert f"every view is {MIRRORED}" in str(found.problem)
    assert reconstruct_one(source, tmp_path / "out", Method(anyway=True)).outcome is Outcome.DONE
    assert batches == [0]


def test_a_good_recording_has_no_doubts_and_a_doubtful_one_goes_on(recording, tmp_path):
    assert doubts_before_work(tmp_path, recording) == []
    # Only one view of six is wrong, and the other five suffice.
    (line,) = doubts_before_work(tmp_path, with_view(recording, 2, lambda m: m[:, :, ::-1]))
    assert line.startswith(f"{tmp_path}: ")
    assert MIRRORED in line
    assert recording.cameras.names[2] in line
