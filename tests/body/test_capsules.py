"""Distances of points and of viewing rays to tapered capsules."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel.body import all_distances, nearest_capsule, nearest_to_rays, toward_capsule
from jaxskel.body._capsules import capsule_distance

UPRIGHT = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])


def graze(centres, directions, ends, radii):
    """`nearest_to_rays` for NumPy arrays of any precision, directions of any length."""
    directions = np.asarray(directions, float)
    directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return jax.jit(nearest_to_rays)(*(jnp.asarray(a, float) for a in (centres, directions, ends, radii)))


def random_rays(rng, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres some metres off, directions into the middle."""
    centres = 3 * rng.normal(size=(count, 3))
    directions = 0.5 * rng.normal(size=(count, 3)) - centres
    return centres, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def to_line(points, centre, direction) -> np.ndarray:
    """Distance of points to a whole line (m)."""
    return np.linalg.norm(np.cross(points - centre, direction), axis=-1)


# Points


def test_distance_to_a_capsule_by_hand():
    points = jnp.array([[3.0, 0.0, 1.0], [0.0, 0.0, 5.0], [0.0, 2.0, -1.0], [0.5, 0.0, 0.0]])
    ends, radii = jnp.asarray(UPRIGHT), jnp.array([1.0, 2.0])  # 1.5 half-way
    expected = [1.5, 1.0, np.sqrt(5.0) - 1.0, -0.5]
    many = jnp.broadcast_to(ends, (4, 2, 3)), jnp.broadcast_to(radii, (4, 2))
    np.testing.assert_allclose(capsule_distance(points, *many), expected, atol=1e-4)
    np.testing.assert_allclose(all_distances(points, ends[None], radii[None])[:, 0], expected, atol=1e-4)
    _, part, direction = toward_capsule(points, *many)
    np.testing.assert_allclose(part, [0.5, 1.0, 0.0, 0.0], atol=1e-6)
    outwards = np.array([[1.0, 0, 0], [0, 0, 1], [0, 2 / np.sqrt(5), -1 / np.sqrt(5)], [1, 0, 0]])
    np.testing.assert_allclose(direction, outwards, atol=1e-6)


def test_all_ways_to_a_distance_agree_far_from_the_origin():
    rng = np.random.default_rng(0)
    ends = jnp.asarray(rng.normal(size=(30, 2, 3)) + 20.0, jnp.float32)
    radii = jnp.asarray(rng.uniform(0.01, 0.1, (30, 2)), jnp.float32)
    points = jnp.asarray(rng.normal(size=(30, 3)) + 20.0, jnp.float32)
    every = all_distances(points, ends, radii)
    np.testing.assert_allclose(jnp.diagonal(every), capsule_distance(points, ends, radii), atol=2e-4)
    which, distance = nearest_capsule(points, ends, radii)
    np.testing.assert_array_equal(which, every.argmin(1))
    np.testing.assert_allclose(distance, every.min(1), atol=2e-4)


@pytest.mark.parametrize("count", [1, 2, 7, 64, 65, 200])
def test_of_any_number_of_capsules_the_nearest_is_found(count):
    rng = np.random.default_rng(count)
    ends, radii = rng.normal(size=(count, 2, 3)), rng.uniform(0.01, 0.1, (count, 2))
    points, (centres, directions) = rng.normal(size=(50, 3)), random_rays(rng, 50)
    which, distance = nearest_capsule(*map(jnp.asarray, (points, ends, radii)))
    every = np.asarray(all_distances(*map(jnp.asarray, (points, ends, radii))))
    np.testing.assert_allclose(every[np.arange(50), which], every.min(1), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(distance, every.min(1), rtol=1e-4, atol=1e-5)
    each = [graze(centres, directions, ends[[n]], radii[[n]]).distance for n in range(count)]
    near = graze(centres, directions, ends, radii)
    np.testing.assert_allclose(near.distance, np.min(each, 0), rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(np.array(each)[near.capsule, np.arange(50)], near.distance, rtol=1e-4, atol=1e-5)


def test_what_is_not_finite_has_a_capsule_that_exists():
    ends, points = jnp.full((5, 2, 3), jnp.nan), jnp.zeros((3, 3))
    which, distance = nearest_capsule(points, ends, jnp.ones((5, 2)))
    near = nearest_to_rays(points, jnp.eye(3), ends, jnp.ones((5, 2)))
    for capsules, distances in ((which, distance), (near.capsule, near.distance)):
        assert np.all((0 <= capsules) & (capsules < 5))
        assert not np.isfinite(distances).any()


def test_the_derivative_is_that_of_the_distance_to_the_nearest_capsule():
    rng = np.random.default_rng(3)
    ends, radii = jnp.asarray(rng.normal(size=(9, 2, 3))), jnp.asarray(rng.uniform(0.01, 0.1, (9, 2)))
    points, (centres, directions) = jnp.asarray(rng.normal(size=(20, 3))), random_rays(rng, 20)
    moves = jnp.asarray(rng.normal(size=ends.shape))

    def of_points(ends: jax.Array) -> jax.Array:
        return nearest_capsule(points, ends, radii)[1]

    def of_rays(ends: jax.Array) -> jax.Array:
        return graze(centres, directions, ends, radii).distance

    for distances in (of_points, of_rays):
        slope = jax.jvp(distances, (ends,), (moves,))[1]
        steps = (distances(ends + 1e-2 * moves) - distances(ends - 1e-2 * moves)) / 2e-2
        close = np.isclose(slope, steps, atol=2e-2)
        assert close.mean() > 0.8  # elsewhere the nearest part changes within the step
        back = jax.grad(lambda ends, of=distances: of(ends).sum())(ends)
        np.testing.assert_allclose((back * moves).sum(), slope.sum(), rtol=1e-4)


# Rays: a point on the ray, its direction, radii of the upright capsule; distance, part, normal.
RAYS = {
    "across": ([3, -7, 1], [0, 1, 0], (1, 1), 2.0, 0.5, [1, 0, 0]),
    "backwards": ([3, -7, 1], [0, -1, 0], (1, 1), 2.0, 0.5, [1, 0, 0]),
    "away from it": ([-3, 9, 1.5], [0, 1, 0], (1, 1), 2.0, 0.75, [-1, 0, 0]),
    "touching": ([0, 1, 0.4], [-1, 0, 0], (1, 1), 0.0, 0.2, [0, 1, 0]),
    "through it": ([0.25, -7, 0.5], [0, 1, 0], (1, 1), -0.75, 0.25, [1, 0, 0]),
    "above it": ([5, 0, 5], [1, 0, 0], (1, 1), 2.0, 1.0, [0, 0, 1]),
    "below it": ([5, 0, -4], [1, 0, 0], (1, 1), 3.0, 0.0, [0, 0, -1]),
    "slanting": ([3, 0, 1], [0, 1, 1], (1, 1), 2.0, 0.5, [1, 0, 0]),
    "parallel": ([0, 3, -9], [0, 0, 1], (1, 1), 2.0, None, [0, 1, 0]),
    "along the axis": ([0, 0, -9], [0, 0, 1], (1, 1), -1.0, None, None),
    "across the taper": ([3, -7, 1], [0, 1, 0], (1, 2), 1.5, 0.5, [1, 0, 0]),
    "across the thick end": ([4, -7, 2], [0, 1, 0], (1, 2), 2.0, 1.0, [1, 0, 0]),
    "slanting over the top": ([0, 0, 4], [0, 1, -1], (1, 2), np.sqrt(2) - 2, 1.0, [0, np.sqrt(0.5), np.sqrt(0.5)]),
}  # fmt: skip


@pytest.mark.parametrize("name", RAYS)
def test_rays_by_hand(name):
    centre, direction, radii, distance, part, normal = RAYS[name]
    near = graze([centre], [direction], UPRIGHT[None], [radii])
    assert int(near.capsule[0]) == 0
    np.testing.assert_allclose(near.distance[0], distance, atol=1.5e-4)
    assert 0 <= float(near.part[0]) <= 1
    if part is not None:
        np.testing.assert_allclose(near.part[0], part, atol=1e-6)
    if normal is not None:
        np.testing.assert_allclose(near.normal[0], normal, atol=1e-6)


def test_rays_meet_what_dense_samples_say():
    rng = np.random.default_rng(1)
    ends = rng.normal(size=(6, 2, 3))
    radii = np.repeat(rng.uniform(0.02, 0.3, (6, 1)), 2, 1)
    centres, directions = random_rays(rng, 60)
    near = graze(centres, directions, ends, radii)
    share = np.linspace(0, 1, 4001)
    samples = ends[:, None, 0] + share[None, :, None] * (ends[:, 1] - ends[:, 0])[:, None]
    for ray in range(60):
        apart = to_line(samples, centres[ray], directions[ray])
        surface = apart.min(1) - radii[:, 0]
        chosen = int(near.capsule[ray])
        np.testing.assert_allclose(surface[chosen], surface.min(), atol=1e-3)
        np.testing.assert_allclose(near.distance[ray], surface.min(), atol=1e-3)
        np.testing.assert_allclose(near.part[ray], share[apart[chosen].argmin()], atol=0.02)
    assert len(set(np.asarray(near.capsule).tolist())) > 3
    assert (np.asarray(near.distance) < 0).any()
    assert (np.asarray(near.distance) > 0).any()


def test_the_radius_of_a_tapered_capsule_is_that_beside_the_nearest_point_of_its_axis():
    # Hence never nearer than the solid itself (the union of its balls), and never farther by more than the taper.
    rng = np.random.default_rng(2)
    ends, radii = rng.normal(size=(60, 2, 3)), rng.uniform(0.05, 0.5, (60, 2))
    centres, directions = random_rays(rng, 60)
    pairs = (jnp.asarray(a, float)[:, None] for a in (centres, directions, ends, radii))
    near = jax.vmap(nearest_to_rays)(*pairs)
    share = np.linspace(0, 1, 4001)
    for ray, ((start, stop), (first, last)) in enumerate(zip(ends, radii, strict=True)):
        apart = to_line(start + share[:, None] * (stop - start), centres[ray], directions[ray])
        part, distance = float(near.part[ray, 0]), float(near.distance[ray, 0])
        np.testing.assert_allclose(distance, apart.min() - first - part * (last - first), atol=1e-3)
        solid = (apart - first - share * (last - first)).min()
        assert solid - 1e-3 < distance < solid + abs(last - first) + 1e-3


def test_normals_are_unit_and_lead_from_the_axis_to_the_ray():
    rng = np.random.default_rng(3)
    ends, radii = rng.normal(size=(8, 2, 3)), rng.uniform(0.02, 0.3, (8, 2))
    centres, directions = random_rays(rng, 200)
    # All octants and both poles, where two vectors across a direction are easily wrong.
    directions[:8] = np.array(np.meshgrid([1, -1], [1, -1], [1, -1])).reshape(3, 8).T / np.sqrt(3)
    directions[8], directions[9] = [0, 0, 1], [0, 0, -1]
    near = graze(centres, directions, ends, radii)
    normal, part = np.asarray(near.normal), np.asarray(near.part)[:, None]
    np.testing.assert_allclose((normal * directions).sum(1), 0.0, atol=1e-5)
    chosen = ends[np.asarray(near.capsule)]
    foot = (1 - part) * chosen[:, 0] + part * chosen[:, 1]
    away = foot - centres
    to_ray = (away * directions).sum(1, keepdims=True) * directions - away
    apart = np.linalg.norm(to_ray, axis=1, keepdims=True)
    np.testing.assert_allclose(apart * normal, to_ray, atol=1e-4)
    # The root is rounded off below a tenth of a millimetre: shorter only where the ray meets the axis.
    length = np.linalg.norm(normal, axis=1)
    np.testing.assert_allclose(length[apart[:, 0] > 0.01], 1.0, atol=1e-4)
    assert length.max() < 1 + 1e-6
    own = np.asarray(radii)[np.asarray(near.capsule)]
    np.testing.assert_allclose(near.distance, apart[:, 0] - own[:, 0] - part[:, 0] * (own[:, 1] - own[:, 0]), atol=1e-4)


def test_of_equally_near_capsules_the_first_is_taken():
    ends = np.stack([UPRIGHT + 5, UPRIGHT, UPRIGHT, UPRIGHT[::-1]])
    near = graze([[3, -7, 1]], [[0, 1, 0]], ends, np.ones((4, 2)))
    assert int(near.capsule[0]) == 1


def test_distances_shrink_as_the_normals_say():
    # What the quadrics are built on: moving the ends by (a, b) shortens by (1 - part) normal . a + part normal . b.
    with jax.enable_x64(True):
        rng = np.random.default_rng(4)
        ends = jnp.asarray(rng.normal(size=(5, 2, 3)))
        radii = jnp.repeat(jnp.asarray(rng.uniform(0.02, 0.3, (5, 1))), 2, 1)
        centres, directions = (jnp.asarray(a) for a in random_rays(rng, 40))
        near = jax.jit(nearest_to_rays)(centres, directions, ends, radii)
        part = np.asarray(near.part)[:, None]
        assert ((part > 0) & (part < 1)).any()
        assert ((part == 0) | (part == 1)).any()
        step, distance = 1e-6, jax.jit(lambda ends: nearest_to_rays(centres, directions, ends, radii).distance)
        for end, share in ((0, 1 - part), (1, part)):
            expected = -share * np.asarray(near.normal)
            for axis in range(3):
                move = step * jnp.zeros((5, 2, 3)).at[:, end, axis].set(1.0)
                slope = (distance(ends + move) - distance(ends - move)) / (2 * step)
                np.testing.assert_allclose(slope, expected[:, axis], atol=2e-4)
