"""A played recording keeps to its clock: late frames are dropped and counted, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest
from support.live_sessions import JumpingClock, StubStream, numbered

from jaxskel.live import LONGEST, PATIENCE, Playback, Tally, play


def played(source: Playback, clock: JumpingClock, takes) -> tuple[list[int], list[int], Tally]:
    """Numbers of the frames, what their images say, and the counts, where the n-th frame takes `takes(n)` seconds."""
    numbers, shown, tally, stream = [], [], Tally(source.rig.fps), StubStream(None)

    def reconstruct(silhouettes: np.ndarray, skipped: int, hurry: bool):
        shown.append(int(silhouettes[0, 0, 0]))
        clock.time += takes(len(shown) - 1)
        return stream.push(silhouettes)

    play(source, reconstruct, [lambda poses, moment: numbers.append(int(poses.frame_index[0]))], clock, tally)
    return numbers, shown, tally


def test_every_frame_comes_at_its_time():
    clock = JumpingClock()
    numbers, shown, tally = played(Playback(numbered(20)), clock, lambda n: 0.03)
    assert numbers == shown == list(range(20))
    assert (tally.frames, tally.dropped) == (20, 0)
    assert tally.latency(0.5) == tally.latency(1.0) == pytest.approx(0.03, abs=1e-3)
    assert clock.time == pytest.approx(100.0 + 19 / 25 + 0.03)


def test_a_slow_consumer_drops_frames_and_does_not_fall_behind():
    numbers, shown, tally = played(Playback(numbered(250)), JumpingClock(), lambda n: 0.1)
    assert numbers == shown == sorted(set(numbers))
    assert numbers[-1] == 249
    # A tenth of a second each: 10 s have room for 100 frames, and a few wait at the end.
    assert 99 <= tally.frames <= 106
    assert tally.dropped == 250 - tally.frames
    assert tally.latency(1.0) <= 0.1 + LONGEST + 1e-3


def test_a_single_slow_frame_is_caught_up_with():
    def numbers_after(seconds: float) -> list[int]:
        return played(Playback(numbered(30)), JumpingClock(), lambda n: seconds if n == 10 else 0.02)[0]

    assert numbers_after(PATIENCE + 0.03) == list(range(30))
    # Never two at a time.
    assert numbers_after(2 * PATIENCE) == [*range(11), 12, 14, *range(16, 30)]
    # Frame 10 is done at 0.95 s: frames due before 0.75 s come too late to help.
    assert numbers_after(0.55) == [*range(11), *range(19, 30)]


def test_it_is_told_what_was_left_out_and_whether_frames_wait():
    told, clock = [], JumpingClock()

    def reconstruct(silhouettes: np.ndarray, skipped: int, hurry: bool):
        told.append((int(silhouettes[0, 0, 0]), skipped, hurry))
        clock.time += 0.55 if len(told) == 3 else 0.02
        return StubStream(None).push(silhouettes)

    play(Playback(numbered(30)), reconstruct, [], clock, Tally(25.0))
    # Frame 2 is done at 0.63 s, and frame 11, which is due at 0.44 s, is the first to be taken then.
    assert told[:4] == [(0, 0, False), (1, 0, False), (2, 0, False), (11, 8, True)]
    assert told[-1] == (29, 0, False)


def test_who_is_a_little_too_slow_for_every_frame_gets_every_other_one():
    numbers, _, tally = played(Playback(numbered(200)), JumpingClock(), lambda n: 0.06)
    assert np.diff(numbers).max() == 2
    assert tally.latency(1.0) < PATIENCE + 0.1


def test_a_loop_begins_again_and_ends_with_the_time():
    numbers, shown, tally = played(Playback(numbered(4), loop=True, seconds=0.4), JumpingClock(), lambda n: 0.0)
    assert numbers == list(range(10))
    assert shown == [0, 1, 2, 3] * 2 + [0, 1]
    numbers, _, _ = played(Playback(numbered(4), seconds=0.1), JumpingClock(), lambda n: 0.0)
    assert numbers == [0, 1]


def test_another_rate_is_kept_to():
    source = Playback(numbered(10), fps=5.0)
    clock = JumpingClock()
    numbers, _, _ = played(source, clock, lambda n: 0.0)
    assert (source.rig.fps, len(source.rig), numbers) == (5.0, 0, list(range(10)))
    assert clock.time == pytest.approx(100.0 + 9 / 5)


def test_a_stopped_clock_ends_it():
    numbers, _, _ = played(Playback(numbered(4), loop=True), JumpingClock(stop_at=0.5), lambda n: 0.0)
    assert numbers == list(range(13))


def test_the_tally_counts_latencies_without_keeping_them():
    tally = Tally(25.0)
    for number in range(1000):
        moment = tally.begin(number)
        tally.end(0.04 * number, 0.04 * number + (0.3 if number % 100 == 0 else 0.02))
    assert tally.latency(0.5) == pytest.approx(0.02, abs=1e-3)
    assert tally.latency(0.999) == pytest.approx(0.3, abs=1e-3)
    assert moment.fps == pytest.approx(25.0, rel=0.05)
    assert moment.latency == pytest.approx(0.02)
    assert np.isnan(Tally(25.0).latency(0.5))
    assert str(tally) == "0 dropped (0.0%), latency 20 ms, in 99 % of the frames below 20 ms"
    assert str(replace(moment, latency=0.0314)).endswith("latency 31 ms, 0 dropped")
