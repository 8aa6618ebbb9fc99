"""Signed distances of points and rays to tapered capsules, on which the volume terms of objectives are based."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._math.rotations import perpendicular
from .._runtime.materialise import computed_once

_SMALL = 1e-8  # the root of zero has no gradient; an error of a tenth of a millimetre is negligible
# Capsules in one turn of the search for the nearest. Four were as fast, one took 1.1 times as long (3600 rays).
_TOGETHER = 2


class _Axes(eqx.Module):
    """Capsules, one array per component, because processors are fastest at loops over long arrays."""

    start: tuple[Float[Array, "*capsules"], ...]
    along: tuple[Float[Array, "*capsules"], ...]
    squared: Float[Array, "*capsules"]
    radius: Float[Array, "*capsules"]
    taper: Float[Array, "*capsules"]

    def place(
        self, points: tuple[Float[Array, "..."], ...]
    ) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"], tuple[Float[Array, "*batch"], ...]]:
        """Signed distance of points (m), position along the axis (0..1), vector from there (m); arguments broadcast."""
        away = tuple(point - start for point, start in zip(points, self.start, strict=True))
        part = sum(a * b for a, b in zip(away, self.along, strict=True)) / self.squared
        part = jnp.clip(part, 0.0, 1.0)
        away = tuple(a - part * b for a, b in zip(away, self.along, strict=True))
        distance = jnp.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2] + _SMALL)
        return distance - self.radius - part * self.taper, part, away


def _axes(ends: Float[Array, "*capsules 2 3"], radii: Float[Array, "*capsules 2"]) -> _Axes:
    ends, radii = jnp.asarray(ends), jnp.asarray(radii)
    start, along = ends[..., 0, :], ends[..., 1, :] - ends[..., 0, :]
    squared = (along * along).sum(-1) + 1e-9
    return _Axes(_components(start), _components(along), squared, radii[..., 0], radii[..., 1] - radii[..., 0])


def _components(vectors: Float[Array, "*batch 3"]) -> tuple[Float[Array, "*batch"], ...]:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


def capsule_distance(
    points: Float[Array, "*batch 3"], ends: Float[Array, "*batch 2 3"], radii: Float[Array, "*batch 2"]
) -> Float[Array, "*batch"]:
    """Signed distance of each point to its capsule (m), negative inside.

    The radius is taken at the foot of the perpendicular on the axis, which is exact for a cylinder and off by the
    square of the taper otherwise: under a millimetre on a body.
    """
    return toward_capsule(points, ends, radii)[0]


def toward_capsule(
    points: Float[Array, "*batch 3"], ends: Float[Array, "*batch 2 3"], radii: Float[Array, "*batch 2"]
) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"], Float[Array, "*batch 3"]]:
    """Signed distance of each point to its capsule (m), position along the axis (0..1), unit vector from there."""
    distance, part, away = _axes(ends, radii).place(_components(points))
    direction = jnp.stack(away, -1)
    return distance, part, direction / jnp.sqrt((direction * direction).sum(-1, keepdims=True) + _SMALL)


def all_distances(
    points: Float[Array, "points 3"], ends: Float[Array, "capsules 2 3"], radii: Float[Array, "capsules 2"]
) -> Float[Array, "points capsules"]:
    """Signed distance of every point to every capsule (m)."""
    axes = jax.tree.map(lambda a: a[None], _axes(ends, radii))
    return axes.place(tuple(point[:, None] for point in _components(points)))[0]


def nearest_capsule(
    points: Float[Array, "points 3"], ends: Float[Array, "capsules 2 3"], radii: Float[Array, "capsules 2"]
) -> tuple[Int[Array, " points"], Float[Array, " points"]]:
    """The nearest capsule of each point and its signed distance (m); of nearly equally near ones (1e-5), any."""
    axes, components = _axes(ends, radii), _components(points)

    def distance_to(number: Array) -> Array:
        return jax.tree.map(lambda a: a[number][None], axes).place(components)[0]

    which, least = _nearest(distance_to, len(ends), components[0], axes.radius[0])
    return which, _instead(least, capsule_distance(points, ends[which], radii[which]))


class Grazed(eqx.Module):
    """The nearest capsule of each ray.

    Attributes:
        distance: Distance from the capsule's surface (m), negative if the ray passes through it.
        part: Position along the capsule's axis (0..1).
        normal: Unit vector from that position to the ray, perpendicular to the ray.
    """

    capsule: Int[Array, " rays"]
    distance: Float[Array, " rays"]
    part: Float[Array, " rays"]
    normal: Float[Array, "rays 3"]


def nearest_to_rays(
    centres: Float[Array, "rays 3"],
    directions: Float[Array, "rays 3"],
    ends: Float[Array, "capsules 2 3"],
    radii: Float[Array, "capsules 2"],
) -> Grazed:
    """The nearest capsule of each ray, taken as an infinite line; of nearly equally near ones (1e-5), any.

    Seen along the ray, a capsule is a segment in the plane and the ray a point: `capsule_distance` in the plane.
    """
    axes = tuple(_components(axis) for axis in perpendicular(directions))
    middle = tuple(_dot(axis, _components(centres)) for axis in axes)

    def graze(ends: Array, radii: Array) -> tuple[Array, Array, Array, Array]:
        first, axis = _components(ends[..., 0, :]), _components(ends[..., 1, :] - ends[..., 0, :])
        # Coordinates in the planes across the rays (m).
        start = tuple(_dot(way, first) - own for way, own in zip(axes, middle, strict=True))
        along = tuple(_dot(way, axis) for way in axes)
        squared = along[0] * along[0] + along[1] * along[1] + 1e-9
        part = jnp.clip(-(start[0] * along[0] + start[1] * along[1]) / squared, 0.0, 1.0)
        x, y = start[0] + part * along[0], start[1] + part * along[1]
        apart = jnp.sqrt(x * x + y * y + _SMALL)
        return apart - radii[..., 0] - part * (radii[..., 1] - radii[..., 0]), part, x / apart, y / apart

    def distance_to(number: Array) -> Array:
        return graze(ends[number][None], radii[number][None])[0]

    capsule, least = _nearest(distance_to, len(ends), middle[0], radii[0, 0])
    exact, part, x, y = graze(ends[capsule], radii[capsule])
    normal = -jnp.stack([x * a + y * b for a, b in zip(*axes, strict=True)], -1)
    return Grazed(capsule, _instead(least, exact), part, normal)


def _nearest(
    distance_to: Callable[[Int[Array, ""]], Float[Array, " things"]],
    count: int,
    like: Float[Array, " things"],
    number: Float[Array, ""],
) -> tuple[Int[Array, " things"], Float[Array, " things"]]:
    """The nearest of some capsules for each of many things, and its distance, see `_numbered`.

    Args:
        distance_to: Distances of all things to the capsule of a number below `count` (m).
        count: How many capsules there are.
        like: An array of the shape and precision of the distances.
        number: See [`computed_once`][jaxskel._runtime.materialise.computed_once].
    """

    # As numbers and distances are one array, each turn is one kernel; as two arrays they took six. Distances to all
    # capsules at once would not fit into the processor's cache.
    def some(turn: Array, least: Array) -> Array:
        least = computed_once(least, number)
        for place in range(_TOGETHER):
            capsule = jnp.minimum(_TOGETHER * turn + place, count - 1)
            least = jnp.minimum(least, _numbered(distance_to(capsule), capsule, count))
        return least

    least = jax.lax.fori_loop(0, -(-count // _TOGETHER), some, jnp.full_like(like, jnp.inf))
    return _number_of(least, count), least


def _dot(one: tuple[Float[Array, "..."], ...], other: tuple[Float[Array, "..."], ...]) -> Float[Array, "..."]:
    """Dot products of vectors given by their components."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@jax.custom_jvp
def _instead(found: Float[Array, "*shape"], exact: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """What was found, with the derivative of `exact`, which is not computed where nothing is differentiated."""
    return found


@_instead.defjvp
def _(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    return primals[0], tangents[1]


def _numbered(distance: Float[Array, "*shape"], number: Int[Array, ""], count: int) -> Float[Array, "*shape"]:
    """Distances whose last bits are a number below `count`: of up to 64 numbers, they change by less than 1e-5."""
    bits = jax.lax.bitcast_convert_type(distance, _integers(distance)) & ~_last_bits(count)
    return jax.lax.bitcast_convert_type(bits | number.astype(bits.dtype), distance.dtype)


def _number_of(distance: Float[Array, "*shape"], count: int) -> Int[Array, "*shape"]:
    """The number in the last bits of distances, see `_numbered`; any one below `count` where they are not finite."""
    bits = jax.lax.bitcast_convert_type(distance, _integers(distance)) & _last_bits(count)
    return jnp.minimum(bits, count - 1).astype(jnp.int32)


def _integers(like: Float[Array, "..."]) -> np.dtype:
    return np.dtype(f"i{like.dtype.itemsize}")


def _last_bits(count: int) -> int:
    return (1 << (count - 1).bit_length()) - 1
