"""Refines camera extrinsics from silhouettes alone: no board and no points, only a person whom all cameras see."""

from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ..._runtime.batching import single_precision
from ..._runtime.kinds import check_kind
from ...cameras import Cameras, ExtrinsicChange, changed, nameless, no_change
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
"""Default number of frames: mask errors are independent between frames, but not between more rays of one frame."""
_RAYS = 300  # for each view: every fifth outline point of a person 400 px tall
_ROUNDS = 30
# Inner tangent planes are paired if they miss each other by at most this many standard deviations of the noise of the
# previous round.
_GATE = 3.0
# The search ends if no unknown changes by more than this share of its standard deviation, or if the changes have not
# decreased for this many rounds: contacts and planes of poor masks never repeat exactly.
_CHANGE, _PATIENCE = 0.1, 5
# A search that stops decreasing has converged if one of its rounds changed at most this much.
_REST = 0.3
# Distances are exact up to the shift of a silhouette for an error of this many standard deviations of the prior.
_SIGMAS = 4.0
# Smallest factor by which the prior's standard deviations are narrowed.
_NARROWEST = 0.1
# A camera whose rotation keeps more than this share of the prior's uncertainty was hardly seen. (A turn of the whole
# rig, which silhouettes cannot determine, leaves 0.6 in a rig of three cameras and less in others.)
_HARDLY = 0.8


class RefinedCameras(eqx.Module):
    """A rig with refined extrinsics.

    Attributes:
        cameras: The rig with new extrinsics (world to camera, m); intrinsics, sizes and names are unchanged.
        rotation: Rotation of each camera: rotation vector in the camera's frame (rad), ``R_new = exp(rotation) R``.
        shift: Shift of each optical centre in the world (m).
        before: Mean distance by which outline rays of each camera miss the silhouettes of the others, as given (px).
        after: The same distance after refinement (px). NaN if a camera has no outline in the frames used.
        hardly_seen: Cameras of which the silhouettes tell little: they hardly moved, except along with the others.
        converged: Whether the search converged: a round changed almost nothing.
        frames: Numbers of the frames used.
    """

    cameras: Cameras
    rotation: Float[np.ndarray, "cams 3"]
    shift: Float[np.ndarray, "cams 3"]
    before: Float[np.ndarray, " cams"]
    after: Float[np.ndarray, " cams"]
    hardly_seen: Bool[np.ndarray, " cams"]
    converged: bool
    frames: Int[np.ndarray, " used"]


def refine_cameras(
    recording: Recording,
    frames: int | Sequence[int] | Int[np.ndarray, " some"] = FRAMES,
    rotation_sd: float = float(np.radians(1.0)),
    shift_sd: float = 0.02,
) -> RefinedCameras:
    """Rotate and shift cameras until the silhouettes agree.

    The ray of every outline point must touch the hull of the other views, and an epipolar plane that is tangent to one
    view's silhouette must be tangent to the other's. Gaps of a pixel or two, as between fingers, are closed first.
    Robust Gauss-Newton: each round finds the places where rays come nearest to the other silhouettes, and the tangent
    planes. It then minimises the positive residuals (px) of the rays and all residuals (px) of the planes, linear in
    the extrinsics, together with the prior. The prior is narrowed to fit the changes so far (empirical Bayes).
    Intrinsics and distortion stay.
    The silhouettes cannot determine a rigid motion or a scale of the whole rig: the prior keeps it in place. Compare
    rigs by [`compare_rigs`][jaxskel.cameras.compare_rigs].

    Args:
        recording: Recording whose cameras are roughly right: within about twice the standard deviations.
        frames: Number of frames, spread over those in which at least three views see the person; or frame numbers.
        rotation_sd: Prior standard deviation of the rotation of a camera about each axis (rad). It may be too large:
            the prior narrows.
        shift_sd: Prior standard deviation of an optical centre along each axis (m). It may be too large as well.

    Returns:
        The refined rig. If no frame shows the person in three views, the rig as it is, not converged.

    Raises:
        ValueError: A frame that the recording does not have, or an invalid standard deviation.
    """
    check_kind("recording", recording, Recording, "a Recording, as read_recording(path) reads it")
    for name, value in (("rotation_sd", rotation_sd), ("shift_sd", shift_sd)):
        if not 0 < value < np.inf:
            raise ValueError(f"{name} {value}: give a standard deviation above zero, in radians or metres")
    given = nameless(recording.cameras)
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
    # Use the prior as given: relative to a narrowed one, a correct rig would seem undetermined.
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
    # The prior alone holds what silhouettes cannot determine, too weakly for single precision.
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, camera_step(found, apart, tangents.alike, total / sd, sd, noise))


def _narrowed(step: CameraStep, sd: Float[np.ndarray, "6"], given: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6"]:
    """Standard deviations of a prior from which the changes so far could be drawn (one step of EM; rad and m).

    They are at most the given ones: a prior that is too wide lets noise turn cameras.
    """
    square = np.asarray(step.unknowns**2 + step.spread**2).reshape(-1, 2, 3).mean((0, 2))
    return np.clip(sd * np.repeat(np.sqrt(square), 3), _NARROWEST * given, given)


class _Outlines(eqx.Module):
    """The evidence that the rig is refined by."""

    lines: SightLines
    chains: OutlineChains
    images: DistanceImages
    middles: Float[np.ndarray, "frames 3"]

    def seen_by(self, rig: Cameras) -> Sensitivity:
        """Residuals of a rig with newly found contacts, in double precision."""
        contacts = find_contacts(
            single_precision(rig), single_precision(self.lines), self.images, single_precision(self.middles)
        )
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, sensitivity(rig, self.lines, self.images, _double(contacts)))

    def apart_in(self, rig: Cameras, gate: float) -> tuple[Sensitivity, EpipolarTangents]:
        """Residuals of the tangent planes of a rig, and the tangents themselves, in double precision."""
        tangents = epipolar_tangents(rig, self.chains, self.middles, gate)
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, tangent_sensitivity(rig, tangents)), tangents

    def missed(self, found: Sensitivity) -> Float[np.ndarray, " cams"]:
        """Mean of the positive residuals over the rays of each camera (px)."""
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
    """Numbers of the frames to use, and the views that have lost the person in them."""
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
