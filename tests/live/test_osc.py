"""Programs with avatars get every pose, in the messages of the VMC protocol."""

import sys
from collections.abc import Iterator

import numpy as np
import pytest
from support.live_sessions import MOMENT, JumpingClock, StubStream, numbered, step_of
from support.poses import moving

from jaxskel.live import BONE_NAMES, OscSender, Playback, Tally, bones_of, play

pytest.importorskip("pythonosc", reason='needs python-osc: pip install "jaxskel[live]"')
from support.avatar import Avatar  # noqa: E402


@pytest.fixture
def receiver() -> Iterator[Avatar]:
    found = Avatar()
    yield found
    found.close()


def test_a_frame_is_a_bundle_of_its_bones(receiver):
    step = step_of(moving(5), 3)
    with OscSender("localhost", receiver.port) as sender:
        sender(step, MOMENT)
        receiver.wait(1)
    assert [address for address, *_ in receiver.messages[:3]] == ["/VMC/Ext/OK", "/VMC/Ext/T", "/VMC/Ext/Root/Pos"]
    assert receiver.of("/VMC/Ext/OK") == [[1, 3, 0, 1]]
    assert receiver.of("/VMC/Ext/T") == [[MOMENT.time]]
    assert receiver.of("/VMC/Ext/Root/Pos") == [["root", 0, 0, 0, 0, 0, 0, 1]]
    sent = receiver.of("/VMC/Ext/Bone/Pos")
    assert [name for name, *_ in sent] == list(BONE_NAMES)
    bones = bones_of(step)
    np.testing.assert_allclose(
        [values for _, *values in sent], np.hstack([bones.positions, bones.quaternions]), atol=1e-6
    )


def test_a_frame_without_a_pose_says_that_nobody_is_tracked(receiver):
    with OscSender("127.0.0.1", receiver.port) as sender:
        sender(step_of(moving(5, without=(3,)), 3), MOMENT)
        receiver.wait(1)
    assert receiver.of("/VMC/Ext/OK") == [[1, 3, 0, 0]]
    assert receiver.of("/VMC/Ext/Bone/Pos") == []


def test_every_pose_of_a_session_arrives(receiver):
    frames = 40
    with OscSender("127.0.0.1", receiver.port) as sender:
        play(Playback(numbered(frames)), StubStream(None).push, [sender], JumpingClock(), Tally(25.0))
        receiver.wait(frames)
    assert sender.lost == 0
    assert [time for (time,) in receiver.of("/VMC/Ext/T")] == pytest.approx([n / 25 for n in range(frames)])
    hips = [values for name, *values in receiver.of("/VMC/Ext/Bone/Pos") if name == "Hips"]
    walk = StubStream(None).walk
    assert len(hips) == frames
    np.testing.assert_allclose(
        [values[:3] for values in hips], walk.joints[:frames, 0][:, [1, 2, 0]] * [-1, 1, 1], atol=1e-5
    )


def test_a_host_that_is_not_there_is_named():
    with pytest.raises(ValueError, match=r"no\.such\.host\.invalid:39539: there is no such host"):
        OscSender("no.such.host.invalid", 39539)


def test_without_its_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pythonosc.osc_bundle_builder", None)
    with pytest.raises(ImportError, match=r'pip install "jaxskel\[live\]"'):
        OscSender("127.0.0.1", 39539)
