"""Radii of a subject's body, and positions of its flesh around the skeleton, from outlines in a few frames."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._runtime.batching import on_device, single_precision, take
from .._runtime.compile_cache import cached_jit
from ..body import (
    BALL_NAMES,
    BALL_SIDES,
    FREE_BALLS,
    LIKE_BALL,
    Body,
    Pose,
    capsule_ends,
    nearest_to_rays,
    place_segments,
)
from ..outlines import Contours
from ..refinement.terms import Observed
from ..search import Search, fit_poses, fit_scales, make_model, solve_frames

_ROUNDS = 4
# Share of the frames used, those with the best fits; the others may have wrong poses.
_USED = 0.8
# Rays farther than _REACH from the body (m) belong to something else; beyond _SCALE (m) rays have little weight.
_REACH, _SCALE = 0.05, 0.018
# Neighbouring rays are correlated: this many count as one measurement.
_ALIKE = 50
# Standard deviations (m) of the balls' positions around the average, and of the radii. Limbs: flesh is centred on the
# bone. Hands and feet vary little. Trunk and head vary most.
_LIMB_PLAY, _END_PLAY, _TRUNK_PLAY, _RADIUS_PLAY = 0.002, 0.005, 0.012, 0.025
_LIMB = ("shoulder", "elbow", "forearm", "wrist", "palm", "finger", "knee", "calf", "ankle")
_END = ("heel", "ball", "toe")
_THINNEST = 0.010  # m
_SCALES = fit_scales((0.04, 4))


class Costs(eqx.Module):
    """Costs of correct poses of a subject in one recording, in the units of `volume_objective`."""

    low: float
    """The 10 % quantile over the frames."""
    typical: float
    """The median over the frames."""


class CalibratedFlesh(eqx.Module):
    """A subject's calibrated body, and the costs of its poses."""

    body: Body
    costs: Costs


def calibrate_flesh(
    body: Body, starts: Pose, fallback: Pose, observed: Observed, search: Search | None = None
) -> CalibratedFlesh:
    """Fit the radii of a body, and the positions of its balls, to the outlines of one subject in different poses.

    Poses and body are fitted in alternation; left and right stay mirror images.

    Args:
        body: Body to begin with (m), see [`make_body`][jaxskel.make_body].
        starts: Start poses (m, in the world), with axes ``frames starts``.
        fallback: Start poses where `starts` fail, with the same axes, see `solve_frames`.
        observed: Outlines and silhouettes, with a leading axis ``frames``; 15 to 30 frames are enough.
        search: Breadth and depth of the search for the poses.
    """
    search = search or Search()
    found = solve_frames(make_model(body), search, starts, fallback, observed)
    used = np.flatnonzero(found.cost[:, 0] <= np.quantile(found.cost[:, 0], _USED))
    poses, outlines = jax.tree.map(lambda a: a[used, :1], found.poses), take(observed.contours, used)
    stack = on_device(take(observed, used))
    costs = np.zeros(1)
    for _ in range(_ROUNDS):
        body = _updated(body, jax.tree.map(lambda a: a[:, 0], poses), outlines)
        fitted = fit_poses(single_precision(body), poses, stack, _SCALES)
        poses, costs = fitted.poses, fitted.cost[:, 0]
    low, typical = np.quantile(costs, (0.1, 0.5))
    return CalibratedFlesh(body, Costs(float(low), float(typical)))


def _updated(body: Body, poses: Pose, outlines: Contours) -> Body:
    """One Gauss-Newton step for all radii and offsets at once, with the poses fixed."""
    which, part, distance, normals = (np.asarray(a, np.float64) for a in _nearest(body, poses, outlines))
    links = np.asarray(body.links)[which.astype(int).ravel()]
    part, distance = part.ravel(), distance.ravel()
    used = np.abs(distance) < _REACH
    links, part, distance = links[used], part[used], distance[used]
    weight = 1 / (1 + (distance / _SCALE) ** 2) ** 2 / _ALIKE

    rows = np.zeros((len(distance), 4 * len(FREE_BALLS)))
    every = np.arange(len(distance))
    for end, share in ((0, 1 - part), (1, part)):
        ball = links[:, end]
        normal = normals.reshape(-1, 2, 3)[used, end] * BALL_SIDES[ball][:, None] ** [0, 1, 0]
        for column in range(3):
            rows[every, 4 * LIKE_BALL[ball] + column] += share * normal[:, column]
        rows[every, 4 * LIKE_BALL[ball] + 3] += share
    play = np.concatenate([_play(BALL_NAMES[ball]) for ball in FREE_BALLS])
    matrix = (rows * weight[:, None]).T @ rows + np.diag((_SCALE / play) ** 2)
    change = np.linalg.solve(matrix, rows.T @ (weight * distance)).reshape(-1, 4)[LIKE_BALL]
    offsets = np.asarray(body.offsets) + change[:, :3] * BALL_SIDES[:, None] ** [0, 1, 0]
    radii = np.maximum(np.asarray(body.radii) + change[:, 3], _THINNEST)
    return Body(body.skeleton, body.segments, offsets, radii, body.links)


@cached_jit
def _nearest(
    body: Body, poses: Pose, outlines: Contours
) -> tuple[
    Int[Array, "frames rays"], Float[Array, "frames rays"], Float[Array, "frames rays"], Float[Array, "frames rays 2 3"]
]:
    """Capsule of each ray, position along it, distance (m), and the normal in the frames of the balls' segments."""

    def one(pose: Pose, outlines: Contours) -> tuple[Array, Array, Array, Array]:
        rotations = jnp.asarray(pose.rotations)
        ends = jnp.asarray(capsule_ends(body, place_segments(body.skeleton, pose)[2], rotations))
        radii, links = jnp.asarray(body.radii)[body.links], jnp.asarray(body.links)
        near = nearest_to_rays(jnp.asarray(outlines.centres), jnp.asarray(outlines.directions), ends, radii)
        turned = rotations[jnp.asarray(body.segments)[links[near.capsule]]]
        return near.capsule, near.part, near.distance, jnp.einsum("reji,rj->rei", turned, near.normal)

    return jax.vmap(one)(poses, outlines)


def _play(name: str) -> Float[np.ndarray, "4"]:
    """Standard deviations of a ball's offset and radius (m)."""
    sided = name.startswith("l_")
    kind = name.removeprefix("l_")
    play = _LIMB_PLAY if kind in _LIMB else _END_PLAY if kind in _END else _TRUNK_PLAY
    return np.array([play, play if sided else 1e-6, play, _RADIUS_PLAY])
