"""Settings, and changes to a recording, that the tests of the whole pipeline share."""

from dataclasses import replace

import equinox as eqx
import numpy as np

from jaxskel import (
    GraphSettings,
    MatchingSettings,
    Recording,
    Settings,
    make_body,
    make_cameras,
    pack_silhouettes,
    paper_settings,
    unpack_silhouettes,
)
from jaxskel.graph import HeadBall
from jaxskel.matching import HANDLESS_DESCRIPTOR, DtwMatcher, Matcher


def with_masks(recording: Recording, masks: np.ndarray) -> Recording:
    """The same recording with other packed silhouettes."""
    return eqx.tree_at(lambda r: r.silhouettes, recording, masks)


def moved(recording: Recording, rotation: np.ndarray, shift: np.ndarray, up: str = "+Z") -> Recording:
    """The same recording in a world whose points are ``rotation @ x + shift``."""
    cameras = recording.cameras
    R = np.asarray(cameras.R) @ rotation.T
    t = np.asarray(cameras.t) - R @ shift
    new = make_cameras(cameras.K, R, t, cameras.size)
    return eqx.tree_at(lambda r: (r.cameras, r.up), recording, (new, up))


def mirrored(recording: Recording) -> Recording:
    """The recording of the scene mirrored at the plane y = 0: images are flipped from left to right."""
    cameras = recording.cameras
    width = int(cameras.size[0, 0])
    K = np.array(cameras.K)
    K[:, 0, 2] = width - 1 - K[:, 0, 2]
    flip_image, flip_world = np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0])
    R = flip_image @ np.asarray(cameras.R) @ flip_world
    new = make_cameras(K, R, np.asarray(cameras.t) @ flip_image, cameras.size)
    masks = unpack_silhouettes(recording.silhouettes, width)[..., ::-1]
    return eqx.tree_at(lambda r: (r.cameras, r.silhouettes), recording, (new, pack_silhouettes(masks)))


def with_known_body(recording: Recording) -> Settings:
    """Default settings with an average adult of the recording's dimensions, to save the time of calibration."""
    assert recording.skeleton is not None
    return Settings(body=make_body(recording.skeleton))


def with_hull(settings: Settings, **changes) -> Settings:
    """The same settings with other hull settings."""
    return replace(settings, hull=replace(settings.hull, **changes))


def graph_settings(matcher: Matcher | None = None) -> Settings:
    """No search either: the pose of the graph that starts at the ball of the head, refined against the graph."""
    matching = MatchingSettings(matcher or DtwMatcher(), HANDLESS_DESCRIPTOR)
    return replace(paper_settings(), graph=GraphSettings(root_finder=HeadBall()), matching=matching)
