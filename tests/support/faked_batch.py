"""A recording with random numbers as poses, for tests of the batch around a reconstruction."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jaxskel import Recording, default_adult
from jaxskel.batch import Source
from jaxskel.batch import _one as one
from jaxskel.io.recordings import write_recording
from jaxskel.synthetic import camera_ring, make_scene
from support.random_poses import some_poses, some_track


class Killed(BaseException):
    """As if the process ended here: nothing of the package handles it."""


@cache
def _walk() -> Recording:
    return make_scene(70, cameras=camera_ring(3, size=(64, 48)))


def fake(patch: pytest.MonkeyPatch) -> list[int]:
    """Replace the reconstruction by random poses that depend on the frame; return a growing list of batch starts."""
    batches = []

    def batches_from(first, track, recording, settings, prepared):
        for start in range(first, len(recording), 32):
            assert (None if start == 0 else start) == (track and track.since)
            batches.append(start)
            count = min(32, len(recording) - start)
            track = some_track(start + count)
            poses = some_poses(start, count)
            yield replace(poses, status=poses.status * 0, tips=np.ones_like(poses.tips)), track

    prepared = SimpleNamespace(skeleton=default_adult(1.6), stature_deviation=None)
    patch.setattr(one, "prepare", lambda recording, settings: prepared)
    patch.setattr(one, "batches_from", batches_from)
    return batches


def faked_source(folder: Path, name: str = "walk") -> Source:
    write_recording(folder / f"{name}.npz", _walk())
    return Source(name, folder / f"{name}.npz")
