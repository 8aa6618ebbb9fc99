"""After `warm_up` nothing compiles in the middle of a stream."""

from pathlib import Path

import numpy as np
import pytest
from support.cached_functions import folder

from jaxskel import paper_settings, warm_up
from jaxskel._runtime.compile_cache import CachedJit
from jaxskel.pipeline import Stream
from jaxskel.synthetic import camera_ring, make_scene

__all__ = ["folder"]  # a fixture


@pytest.mark.slow
def test_a_stream_finds_everything_compiled(folder: Path, monkeypatch: pytest.MonkeyPatch):
    scene = make_scene(12, fps=1.0, cameras=camera_ring(4, radius=5.0, size=(176, 120)))
    warm_up(scene.cameras, paper_settings())
    asked: list[str] = []
    before = CachedJit._prepared

    def told(self: CachedJit, *rest):
        asked.append(self._name)
        return before(self, *rest)

    monkeypatch.setattr(CachedJit, "_prepared", told)
    with Stream(scene.cameras, paper_settings()) as stream:
        poses = [stream.push(frame) for frame in (*scene.silhouettes, np.zeros_like(scene.silhouettes[0]))]
    assert sum(bool(pose.has_pose[0]) for pose in poses) > 6
    assert asked == []
