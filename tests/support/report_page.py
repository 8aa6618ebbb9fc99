"""A small recording with poses near its truth, shared by the tests of the report, and the data in its page."""

import base64
import json
import re
from dataclasses import replace
from functools import cache

import equinox as eqx
import numpy as np

from jaxskel import Poses, Recording, default_adult
from jaxskel.poses import Status
from support.phantoms import ring
from support.scenes import frames_of_scene

FRAMES = 12
LOST = 4
"""The frame without a pose."""


@cache
def filmed() -> Recording:
    """Four views, the first through a lens that bends lines, in frames numbered from 100; poses differ widely."""
    cameras = ring(4, size=(200, 160), focal=120.0)
    dist = np.zeros((4, 8))
    dist[0, :4] = -0.5, 0.1, 0.01, -0.01
    cameras = eqx.tree_at(lambda c: c.dist, cameras, dist)
    scene = frames_of_scene(5 * FRAMES, slice(None, None, 5), cameras=cameras)
    return eqx.tree_at(lambda r: r.frame_index, scene, np.arange(FRAMES) + 100)


def poses_of(recording: Recording) -> Poses:
    """The truth, a few millimetres off, with a frame that has no pose and one that has not converged."""
    assert recording.truth is not None
    assert recording.truth.tips is not None
    n, noise = len(recording), np.random.default_rng(3)
    joints = recording.truth.joints + noise.normal(0, 0.005, recording.truth.joints.shape)
    tips, confidence = recording.truth.tips.copy(), noise.uniform(0.2, 1, (n, 15))
    status = np.full(n, Status.OK)
    joints[LOST], tips[LOST], confidence[LOST], status[LOST] = np.nan, np.nan, 0, Status.SEVERAL_PEOPLE
    status[LOST + 2] = Status.NOT_CONVERGED
    return Poses(
        joints=joints.astype(np.float32), tips=tips.astype(np.float32), rotations=None, skeleton=default_adult(1.71),
        confidence=confidence.astype(np.float32), side_confidence=noise.uniform(0.5, 1, n).astype(np.float32),
        status=status, fps=recording.fps, up=recording.up, frame_index=recording.frame_index,
        stature_deviation=0.02,
    )  # fmt: skip


def two_people(recording: Recording) -> dict[str, Poses]:
    """Anna as `poses_of`, and Ben a step aside, who has a pose in every frame, less sure, with covariances."""
    anna = poses_of(recording)
    aside = np.array([0.9, 0.1, 0], np.float32)
    found = replace(anna, joints=np.array(anna.joints), tips=np.array(anna.tips), status=np.full(FRAMES, Status.OK))
    found.joints[LOST], found.tips[LOST] = anna.joints[LOST + 1], anna.tips[LOST + 1]
    ben = replace(
        found, joints=found.joints + aside, tips=found.tips + aside, confidence=0.5 * anna.confidence,
        covariance=np.broadcast_to(1e-4 * np.eye(3, dtype=np.float32), (FRAMES, 15, 3, 3)),
    )  # fmt: skip
    return {"anna": anna, "ben": ben}


def numbers_in(page: str) -> dict:
    """The data that the scripts of a page read."""
    found = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert len(found) == 1
    return json.loads(found[0])


def unpacked(text: str, kind: str, *shape: int) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind).reshape(shape)
