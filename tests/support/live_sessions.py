"""What live sessions need in tests: a clock that jumps, and poses that cost nothing."""

from dataclasses import replace

import numpy as np

from jaxskel import Poses, Recording
from jaxskel.io.poses import with_up
from jaxskel.live import Moment
from jaxskel.synthetic import camera_ring
from support.poses import moving

MOMENT = Moment(time=0.25, number=6, dropped=1, fps=24.9, latency=0.031)
_WALK = moving(50, fps=25.0)


class JumpingClock:
    """Time passes only while somebody sleeps, or says so."""

    def __init__(self, stop_at: float = np.inf):
        self.time, self.stop_at = 100.0, 100.0 + stop_at

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += max(0.0, seconds)

    def stopped(self) -> bool:
        return self.time >= self.stop_at


class StubStream:
    """A `Stream` of a person who walks whatever the silhouettes show."""

    def __init__(self, cameras, settings=None, subject=None, up: str = "+Z", fps: float = 25.0):
        self.walk, self.count = replace(with_up(_WALK, up), fps=fps), 0

    def push(self, masks: np.ndarray, skipped: int = 0, hurry: bool = False) -> Poses:
        self.count += 1
        return step_of(self.walk, (self.count - 1) % len(self.walk))

    def __enter__(self) -> "StubStream":
        return self

    def __exit__(self, *_) -> None:
        pass


def step_of(poses: Poses, row: int) -> Poses:
    """The poses of one frame."""
    some = slice(row, row + 1)
    return Poses(
        poses.joints[some], poses.tips[some], None if poses.rotations is None else poses.rotations[some],
        poses.skeleton, poses.confidence[some], poses.side_confidence[some], poses.status[some], poses.fps, poses.up,
        poses.frame_index[some], None if poses.covariance is None else poses.covariance[some],
        template=poses.template,
    )  # fmt: skip


def numbered(frames: int, fps: float = 25.0) -> Recording:
    """A recording of tiny images, each of which holds its number in its first byte."""
    cameras = camera_ring(3, size=(32, 24))
    masks = np.zeros((frames, 3, 24, 4), np.uint8)
    masks[:, :, 0, 0] = np.arange(frames)[:, None]
    return Recording(cameras, masks, fps, "+Z", np.arange(frames), name="numbered")
