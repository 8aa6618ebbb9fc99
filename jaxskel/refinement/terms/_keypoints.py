"""Term for keypoints that a detector has found in the images of some views."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..._runtime.kinds import check_kind
from ...body import HUMAN_15, SEGMENT_OF_PIVOT, KeypointSet
from ...cameras import Cameras
from ...recording import rotation_to_z_up
from ._base import AbstractTerm, Observed, PlacedBody, number
from ._losses import AbstractLoss, GemanMcClure, robust_rows

# Nearest depth (m) at which a camera sees a keypoint. What is nearer, or behind the camera, has no residual.
_NEAREST = 0.1
_PIVOTS = np.array(SEGMENT_OF_PIVOT, np.int32)


class Keypoints(AbstractTerm):
    """Reprojection of keypoints, in standard deviations, with a robust loss. Make one with [`keypoints_term`][].

    It reads ``observed.data[name]`` of each frame, (cams, keypoints, 3): x and y (px) without lens distortion, as
    `jaxskel.io.read_keypoints` gives them, and the confidence, from 0 to 1. NaN is a gap. A keypoint that the skeleton
    has no point for, or that lies behind the camera, has no residual.

    A distance in pixels counts as a distance in metres at the keypoint: detectors, and what they mean by a hip, err by
    a share of a person's size, whatever the resolution.

    Attributes:
        matrices: From the world with z up (m) to homogeneous image coordinates (px), without lens distortion.
        focal: Focal lengths (px).
        shares: Shares of the points of the skeleton in each keypoint, see `KeypointSet`.
        noise: Standard deviation of a keypoint across the viewing ray, along each image axis (m).
        loss: Of the distance from the keypoint, in standard deviations.
        name: Of the data.
    """

    needs_graph = False

    matrices: Float[Array, "cams 3 4"]
    focal: Float[Array, " cams"]
    shares: Float[Array, "keypoints points=24"]
    noise: Float[Array, ""] = eqx.field(converter=number)
    loss: AbstractLoss
    weight: Float[Array, ""] = eqx.field(converter=number)
    name: str = eqx.field(static=True, default="keypoints")

    def correspond(self, body: PlacedBody, observed: Observed) -> Float[Array, "cams keypoints"]:
        """How many standard deviations a pixel is at each keypoint; zero where it is behind the camera."""
        depth = self._projected(body)[..., 2]
        return jnp.where(depth > _NEAREST, depth / self.focal[:, None] / self.noise, 0.0)

    def residual(
        self, body: PlacedBody, observed: Observed, fixed: Float[Array, "cams keypoints"]
    ) -> Float[Array, "cams*keypoints rows"]:
        """Robust residuals of the distances, times the root of the confidence."""
        seen = self._seen(observed)
        projected = self._projected(body)
        depth, has_point = projected[..., 2:], (self.shares != 0).any(1)[None]
        usable = (depth[..., 0] > _NEAREST) & jnp.isfinite(seen).all(-1) & (seen[..., 2] > 0) & has_point
        # Unusable points are replaced before they are used: the derivative of what is not chosen must be finite, too.
        there = jnp.where(usable[..., None], projected[..., :2] / jnp.where(usable[..., None], depth, 1.0), 0.0)
        off = fixed[..., None] * (there - jnp.where(usable[..., None], seen[..., :2], 0.0))
        confidence = jnp.where(usable, jnp.clip(seen[..., 2], 0.0, 1.0), 1.0)
        root = jnp.where(usable, jnp.sqrt(confidence), 0.0)
        return root.reshape(-1, 1) * robust_rows(self.loss, off.reshape(-1, 2))

    def _projected(self, body: PlacedBody) -> Float[Array, "cams keypoints 3"]:
        """Homogeneous image coordinates (px m) of all keypoints; the last one is the depth (m)."""
        if body.template != HUMAN_15:
            raise ValueError(
                f"skeleton: is of {body.template.name!r}; keypoint sets are of points of {HUMAN_15.name!r}"
            )
        points = self.shares @ jnp.concatenate([body.joints, body.tips, body.origins[_PIVOTS]])
        return jnp.einsum("cij,kj->cki", self.matrices[:, :, :3], points) + self.matrices[:, None, :, 3]

    def _seen(self, observed: Observed) -> Float[Array, "cams keypoints 3"]:
        wanted = (len(self.matrices), len(self.shares), 3)
        if self.name not in observed.data:
            raise ValueError(f"observed: has no data {self.name!r}; give observed.with_data({self.name}=keypoints)")
        seen = jnp.asarray(observed.data[self.name])
        if seen.shape != wanted:
            raise ValueError(
                f"{self.name}: has shape {seen.shape} in each frame; give {wanted}: cameras, keypoints, and x, y (px), "
                "confidence"
            )
        return seen


def keypoints_term(
    cameras: Cameras,
    keypoint_set: KeypointSet,
    up: str = "+Z",
    weight: Any = 0.1,
    noise: Any = 0.02,
    loss: AbstractLoss | None = None,
    name: str = "keypoints",
) -> Keypoints:
    """Make a term for the keypoints of some cameras.

    Args:
        cameras: Those of the data, in the world of the recording. Their lens distortion is not used: the keypoints
            are undistorted once, when they are read.
        keypoint_set: Which keypoints, and which point of the skeleton each of them means: one of `jaxskel.body`, such
            as `HALPE_26`, or your own.
        up: Axis of the recording's world that points up: poses are refined in a world with z up.
        weight: Weight of the cost. Keypoints of several views err alike, so they count as fewer: the default was best
            beside silhouettes where keypoints were simulated, see `benchmarks/keypoints.py`.
        noise: Standard deviation of a keypoint along each image axis, as a length at the subject (m).
        loss: Robust loss of the distance in standard deviations; ``GemanMcClure(3)`` by default.
        name: Of the data, ``observed.with_data(name=...)``.

    Raises:
        ValueError: `cameras`, `keypoint_set` or `up` are of a wrong kind.
    """
    check_kind("cameras", cameras, Cameras, "the recording's cameras")
    check_kind("keypoint_set", keypoint_set, KeypointSet, "a KeypointSet, such as jaxskel.body.COCO_17")
    turned = cameras.rotated(rotation_to_z_up(up))
    K = np.asarray(turned.K)
    matrices = K @ np.concatenate([np.asarray(turned.R), np.asarray(turned.t)[:, :, None]], 2)
    matrices, focal, shares = (
        jnp.asarray(a, jnp.result_type(float)) for a in (matrices, (K[:, 0, 0] + K[:, 1, 1]) / 2, keypoint_set.shares)
    )
    return Keypoints(matrices, focal, shares, noise, loss or GemanMcClure(3.0), weight, name)
