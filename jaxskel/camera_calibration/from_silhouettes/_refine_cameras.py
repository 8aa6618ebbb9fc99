"""Extrinsics refined from silhouettes alone: no board, no points, only the person that all cameras see."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..._runtime.batching import single_precision
from ...cameras import Cameras, ExtrinsicChange, changed, no_change
from ...hull import body_middles
from ...recording import MIN_VIEWS, Recording, find_empty_views, silhouette_areas
from ._closed_gaps import silhouettes_without_gaps
from ._coherence import NOTHING, Sensitivity, sensitivity
from ._contacts import Contacts, find_contacts
from ._distance_images import DistanceImages, cell_size, distance_images
from ._epipolar_tangents import EpipolarTangents, epipolar_tangents, tangent_sensitivity
from ._outline_chains import OutlineChains, outline_chains
from ._sight_lines import SightLines, sight_lines
from ._step import LEAST_NOISE, LEAST_NOISE_OF_PLANES, CameraStep, camera_step, noise_of

FRAMES = 60
"""Frames that are used by default: the errors of their masks are independent, those of more rays of a frame are not."""
_RAYS = 300  # of a view: every fifth point of the outline of a person who is 400 px tall
_ROUNDS = 30
# Planes that are not outermost are taken for one if they miss each other by no more than so many standard deviations of
# the noise of the round before.
_GATE = 3.0
# The search ends where no unknown changes by more than this part of its own standard deviation, or where changes have
# not become smaller for some rounds: contacts and planes of poor masks are never quite the same again.
_CHANGE, _PATIENCE = 0.1, 5
# A search that ends so has come to rest if one of its rounds changed no more than this.
_REST = 0.3
# Distances reach as far as an error of this many of the prior's standard deviations moves a silhouette.
_SIGMAS = 4.0
# The prior's standard deviations are narrowed to this part at most.
_NARROWEST = 0.1
# A camera whose rotation is known no better than this, in units of the prior's, was hardly seen. (What the silhouettes
# cannot tell, a turn of the whole rig, leaves 0.6 of it in a rig of three, less in others.)
_HARDLY = 0.8


class RefinedCameras(eqx.Module):
    """A rig with refined extrinsics."""

    cameras: Cameras
    """Intrinsics, sizes and names are as they were."""
    rotation: Float[np.ndarray, "cams 3"]
    """How each camera turned: rotation vector in its own frame (rad), ``R_new = exp(rotation) R``."""
    shift: Float[np.ndarray, "cams 3"]
    """How its optical centre moved, in the world (m)."""
    before: Float[np.ndarray, " cams"]
    """By how much rays of the outlines of each camera miss the silhouettes of the others on average (px), as given."""
    after: Float[np.ndarray, " cams"]
    """Likewise, refined. NaN where a camera has no outline in the frames used."""
    hardly_seen: Bool[np.ndarray, " cams"]
    """The silhouettes say little about these cameras: they are, but for the others' turning away, as they were."""
    converged: bool
    """The search came to rest: a round changed next to nothing."""
    frames: Int[np.ndarray, " used"]
    """Which frames were used."""


def refine_cameras(
    recording: Recording,
    frames: int | Sequence[int] | Int[np.ndarray, " some"] = FRAMES,
    rotation_sd: float = float(np.radians(1.0)),
    shift_sd: float = 0.02,
) -> RefinedCameras:
    """Turn and move cameras until silhouettes agree.

    Every outline's ray must touch the hull of the other views, and a plane through two optical centres that touches one
    view's silhouette must touch the other's. Gaps of a pixel or two, as between fingers, are closed first. Robust
    Gauss-Newton: in each round the places where rays come nearest to the other silhouettes are looked up, and the
    planes that touch; the positive residuals (px) of rays and all residuals (px) of planes, linear in the extrinsics,
    are brought down together with the prior. The prior is narrowed to what the changes so far could be drawn from
    (empirical Bayes). Intrinsics and distortion stay.
    The silhouettes cannot tell a rigid motion or a scale of the whole rig: the prior keeps it where it is. Compare rigs
    by [`compare_rigs`][jaxskel.cameras.compare_rigs].

    Args:
        recording: With cameras that are roughly right: twice the standard deviations or so.
        frames: How many frames, spread over those that at least three views see the person in; or which ones.
        rotation_sd: How far off the rotation of a camera may be about each axis (rad, standard deviation). Cameras that
            are less far off than this need not be told: the prior narrows.
        shift_sd: How far off its optical centre may be along each axis (m, standard deviation), likewise.

    Returns:
        The refined rig. Without a frame that three views see the person in, the rig as it is, not converged.

    Raises:
        ValueError: A frame that the recording does not have, or a standard deviation that is none.
    """
    for name, value in (("rotation_sd", rotation_sd), ("shift_sd", shift_sd)):
        if not 0 < value < np.inf:
            raise ValueError(f"{name} {value}: give a standard deviation above zero, in radians or metres")
    # Names are no numbers, and other names would compile again.
    given = replace(recording.cameras, names=tuple(map(str, range(len(recording.cameras)))))
    chosen, empty_views = _frames(recording, frames)
    if len(chosen) == 0:
        return _unrefined(recording.cameras)

    outlines = _outlines(np.asarray(recording.silhouettes[chosen]), given, empty_views, rotation_sd)
    given_sd = np.repeat((rotation_sd, shift_sd), 3)
    total, sd, gate, least, waited = np.zeros((len(given), 6)), given_sd, 0.0, np.inf, 0
    rig, found = given, outlines.seen_by(given)
    before = outlines.missed(found)
    for _ in range(_ROUNDS):
        apart, tangents = outlines.apart_in(rig, gate)
        missing, between = found.value[found.value > 0], np.abs(apart.value[tangents.there])
        noise = np.array([noise_of(missing, LEAST_NOISE), noise_of(between, LEAST_NOISE_OF_PLANES)])
        step = _step(found, apart, tangents, total, sd, noise)
        reached = np.asarray(step.unknowns) * sd
        change, total = (np.abs(reached - total) / (np.asarray(step.spread) * sd)).max(), reached
        sd = _narrowed(step, sd, given_sd)
        rig, gate = _moved(given, total), _GATE * noise[1]
        found = outlines.seen_by(rig)
        least, waited = (change, 0) if change < least else (least, waited + 1)
        if least < _CHANGE or waited == _PATIENCE:
            break
    apart, tangents = outlines.apart_in(rig, gate)
    # By the prior as given: by a narrow one nothing would be told of a rig that is right.
    spread = np.asarray(_step(found, apart, tangents, total, given_sd, noise).spread)
    return RefinedCameras(
        cameras=_moved(recording.cameras, total),
        rotation=total[:, :3],
        shift=total[:, 3:],
        before=before,
        after=outlines.missed(found),
        hardly_seen=np.sqrt((spread[:, :3] ** 2).mean(1)) > _HARDLY,
        converged=bool(least < _REST),
        frames=chosen,
    )


def _step(
    found: Sensitivity,
    apart: Sensitivity,
    tangents: EpipolarTangents,
    total: Float[np.ndarray, "cams 6"],
    sd: Float[np.ndarray, "6"],
    noise: Float[np.ndarray, "2"],
) -> CameraStep:
    # The prior holds what the silhouettes cannot tell so weakly that single precision would lose it.
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, camera_step(found, apart, tangents.alike, total / sd, sd, noise))


def _narrowed(step: CameraStep, sd: Float[np.ndarray, "6"], given: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6"]:
    """Standard deviations of a prior that the changes so far could be drawn from (a step of EM; rad and m).

    What silhouettes hardly tell is left to the prior. One that is too wide lets noise turn cameras.
    """
    square = np.asarray(step.unknowns**2 + step.spread**2).reshape(-1, 2, 3).mean((0, 2))
    return np.clip(sd * np.repeat(np.sqrt(square), 3), _NARROWEST * given, given)


class _Outlines(eqx.Module):
    """What the rig is refined by."""

    lines: SightLines
    chains: OutlineChains
    images: DistanceImages
    middles: Float[np.ndarray, "frames 3"]

    def seen_by(self, rig: Cameras) -> Sensitivity:
        """Residuals of a rig, the contacts looked up anew; in double precision."""
        contacts = find_contacts(
            single_precision(rig), single_precision(self.lines), self.images, single_precision(self.middles)
        )
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, sensitivity(rig, self.lines, self.images, _double(contacts)))

    def apart_in(self, rig: Cameras, gate: float) -> tuple[Sensitivity, EpipolarTangents]:
        """How far apart the planes that touch two silhouettes are, and which of them there are; in double precision."""
        tangents = epipolar_tangents(rig, self.chains, self.middles, gate)
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, tangent_sensitivity(rig, tangents)), tangents

    def missed(self, found: Sensitivity) -> Float[np.ndarray, " cams"]:
        """Means of the positive residuals over the rays of each camera (px)."""
        camera, told = self.lines.camera.ravel(), found.value > NOTHING
        count = np.bincount(camera[told], minlength=found.slopes.shape[1])
        total = np.bincount(camera[told], np.maximum(found.value[told], 0.0), minlength=found.slopes.shape[1])
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _outlines(
    silhouettes: UInt8[np.ndarray, "frames cams h w8"],
    cameras: Cameras,
    empty_views: Bool[np.ndarray, "frames cams"],
    rotation_sd: float,
) -> _Outlines:
    focal = float(np.asarray(cameras.K)[:, 0, 0].max())
    closed = silhouettes_without_gaps(silhouettes, cell_size(silhouettes))
    images = distance_images(closed, cameras, empty_views, int(np.ceil(_SIGMAS * rotation_sd * focal)))
    lines = sight_lines(closed, cameras, empty_views, images, _RAYS)
    chains = outline_chains(silhouettes, cameras, empty_views, images)
    return _Outlines(lines, chains, jax.device_put(images), body_middles(cameras, silhouettes, empty_views))


def _frames(
    recording: Recording, frames: int | Sequence[int] | Int[np.ndarray, " some"]
) -> tuple[Int[np.ndarray, " chosen"], Bool[np.ndarray, "chosen cams"]]:
    """Numbers of the frames to use, and the views that are lost in them."""
    if isinstance(frames, int):
        if frames < 1:
            raise ValueError(f"frames {frames}: give one or more, or the numbers of the frames to use")
        asked = np.arange(len(recording))
    else:
        asked = np.unique(np.asarray(frames, int))
        outside = asked[(asked < 0) | (asked >= len(recording))]
        if len(outside):
            raise ValueError(f"{recording.name}: there is no frame {outside[0]}; give 0 to {len(recording) - 1}")
    empty_views = np.zeros((0, len(recording.cameras)), bool)
    if len(asked):
        empty_views = find_empty_views(silhouette_areas(recording.silhouettes)[asked], recording.cameras)
    usable = np.flatnonzero((~empty_views).sum(1) >= MIN_VIEWS)
    if isinstance(frames, int) and len(usable):
        usable = usable[np.unique(np.linspace(0, len(usable) - 1, frames).astype(int))]
    return asked[usable], empty_views[usable]


def _moved(cameras: Cameras, unknowns: Float[np.ndarray, "cams 6"]) -> Cameras:
    with jax.enable_x64(True):
        moved = changed(cameras, ExtrinsicChange(unknowns[:, :3], unknowns[:, 3:]))
        return eqx.tree_at(lambda c: (c.R, c.t), cameras, (np.asarray(moved.R), np.asarray(moved.t)))


def _double(contacts: Contacts) -> Contacts:
    return jax.tree.map(lambda a: np.asarray(a, np.float64) if a.dtype.kind == "f" else np.asarray(a), contacts)


def _unrefined(cameras: Cameras) -> RefinedCameras:
    count, change = len(cameras), no_change(cameras)
    nothing = np.full(count, np.nan)
    return RefinedCameras(
        cameras, np.asarray(change.rotation), np.asarray(change.shift), nothing, nothing, np.ones(count, bool), False,
        np.zeros(0, int),
    )  # fmt: skip
