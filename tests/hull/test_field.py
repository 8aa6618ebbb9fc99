"""The distance field of a hull and the points on its surface, against shapes of known distance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxskel.hull import DistanceField, VisualHulls, hull_volume, hull_volumes, hulls_from_dense, make_grid

EXACT = 0.2  # up to here outside distances are exact (m)


def ball(points):
    return np.linalg.norm(points - np.array([0.05, -0.02, 0.11]), axis=-1) - 0.4


def box(points):
    """Edges at multiples of 30 mm, where all the voxels below have faces."""
    out = np.abs(points - np.array([0.06, 0.0, -0.03])) - np.array([0.21, 0.15, 0.48])
    return np.linalg.norm(np.maximum(out, 0.0), axis=-1) + np.minimum(out.max(-1), 0.0)


def capsule(points):
    axis = np.array([0.2, 0.15, 0.45])
    along = np.clip(points @ axis / (axis @ axis), -1.0, 1.0)
    return np.linalg.norm(points - along[..., None] * axis, axis=-1) - 0.08


SHAPES = {"ball": ball, "box": box, "capsule": capsule}


def hull_of(*shapes, spacing: float = 0.015) -> VisualHulls:
    """One frame a shape: voxels whose centres lie in it."""
    grid = make_grid(np.full(3, -0.7), np.full(3, 0.7), spacing)
    occupancy = [(shape(grid.centres()) < 0).reshape(grid.shape) for shape in shapes]
    return hulls_from_dense(np.stack(occupancy), grid)


def cells(field: DistanceField) -> np.ndarray:
    """Where the values stand (m)."""
    return np.moveaxis(np.indices(field.values.shape), 0, -1) * float(field.spacing) + np.asarray(field.origin, float)


@pytest.mark.parametrize(
    ("name", "spacing"),
    # Other voxels have no faces where the box has.
    [(n, s) for n in SHAPES for s in (0.01, 0.015, 0.02, 0.04) if n != "box" or s < 0.02],
)
def test_distances_are_those_of_the_shape(name, spacing):
    field, _ = hull_volume(hull_of(SHAPES[name], spacing=spacing), 0)
    assert field.values.shape == (80, 80, 80)
    assert field.spacing == np.float32(0.03)
    truth = SHAPES[name](cells(field))
    error = field.values - truth
    near = truth < EXACT - 2 * spacing
    # Half a voxel, and up to half of one more where values are interpolated between voxels.
    aligned = spacing in (0.01, 0.015)
    assert np.abs(error[near]).max() < (0.51 if aligned else 1.0) * spacing
    assert abs(error[near].mean()) < 0.4 * spacing
    # Rough farther out, most so near corners just where the exact distances end.
    rough = np.abs(error[~near] / truth[~near])
    assert np.percentile(rough, 99) < 0.1
    assert rough.max() < 0.16


def test_distances_to_a_box_are_exact():
    """Faces of voxels are the faces of the box; only where the nearest point is on an edge, it is not so."""
    field, _ = hull_volume(hull_of(box), 0)
    places = cells(field)
    out = np.abs(places - np.array([0.06, 0.0, -0.03])) - np.array([0.21, 0.15, 0.48])
    beside_a_face = ((out > 0).sum(-1) < 2) & (out.max(-1) < EXACT - 0.015)
    np.testing.assert_allclose(field.values[beside_a_face], out.max(-1)[beside_a_face], atol=1e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_gradient_points_away_from_the_hull(name):
    field, _ = hull_volume(hull_of(SHAPES[name]), 0)
    field = jax.tree.map(jnp.asarray, field)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.05, 1.05, (2000, 3))
    truth = SHAPES[name](points)
    points = points[truth > 0.03]
    step = 1e-4
    outwards = np.stack([SHAPES[name](points + step * e) - SHAPES[name](points - step * e) for e in np.eye(3)], -1)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    gradient = jax.vmap(jax.grad(field.at))(jnp.asarray(points, jnp.float32))
    slope = (np.asarray(gradient) * outwards).sum(1)
    assert slope.min() > 0
    assert np.median(np.abs(slope - 1)) < 0.1


def test_beyond_the_grid_the_distance_is_that_of_its_edge():
    field, _ = hull_volume(hull_of(capsule), 0)
    edge = field.origin + 79 * 0.03
    far = field.at(jnp.asarray(np.stack([edge, edge + 5.0]), jnp.float32))
    assert far[0] > 0.5
    np.testing.assert_allclose(far[1], far[0], rtol=1e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_points_lie_on_the_surface_and_evenly_so(name):
    hulls = hull_of(SHAPES[name])
    _, surface = hull_volume(hulls, 0)
    assert surface.shape == (1200, 3)
    assert np.abs(SHAPES[name](surface)).max() < 0.7 * 0.015
    assert abs(SHAPES[name](surface).mean()) < 0.15 * 0.015
    # As many points as boundary voxels on either side of planes through the middle, within three standard deviations.
    occupied = np.pad(hulls.dense(0), 1)
    full = np.ones_like(occupied)
    for axis in range(3):
        full &= np.roll(occupied, 1, axis) & np.roll(occupied, -1, axis)
    grid = hulls.grid
    boundary = np.asarray(grid.origin) + grid.spacing * (np.argwhere(occupied & ~full) - 0.5)
    middle = boundary.mean(0) + 0.1
    share = (boundary > middle).mean(0)
    assert ((surface > middle).mean(0) - share < 3 * np.sqrt(share * (1 - share) / 1200)).all()
    assert ((surface > middle).mean(0) - share > -3 * np.sqrt(share * (1 - share) / 1200)).all()


def test_a_hull_of_few_voxels_gives_its_points_again():
    grid = make_grid(np.zeros(3), np.ones(3), 0.1)
    occupied = np.zeros((1, *grid.shape), bool)
    occupied[0, 4, 5, 6:8] = True
    field, surface = hull_volume(hulls_from_dense(occupied, grid), 0, count=10)
    np.testing.assert_allclose(np.unique(surface, axis=0), [[0.45, 0.55, 0.61], [0.45, 0.55, 0.79]], atol=1e-6)
    centres = jnp.asarray([[0.45, 0.55, 0.65], [0.45, 0.55, 0.85], [0.45, 0.85, 0.75]], jnp.float32)
    np.testing.assert_allclose(field.at(centres), [-0.05, 0.05, 0.25], atol=0.02)


def test_moving_a_hull_by_whole_voxels_moves_all_of_it():
    grid = make_grid(np.full(3, -1.0), np.full(3, 1.0), 1 / 64)  # a power of two: sums are exact
    occupied = (capsule(grid.centres()) < 0).reshape(grid.shape)
    move = np.array([5, -8, 3])
    both = hulls_from_dense(np.stack([occupied, np.roll(occupied, move, (0, 1, 2))]), grid)
    field, surface = hull_volume(both, 0)
    moved, moved_surface = hull_volume(both, 1)
    np.testing.assert_array_equal(moved.values, field.values)
    np.testing.assert_allclose(moved.origin - field.origin, move / 64, atol=1e-6)
    np.testing.assert_allclose(moved_surface - surface, np.broadcast_to(move / 64, surface.shape), atol=1e-6)


def test_a_batch_is_its_frames_one_by_one():
    hulls = hull_of(ball, box, capsule)
    fields, surfaces = hull_volumes(hulls, np.array([2, 0]), count=300)
    assert fields.values.shape == (2, 80, 80, 80)
    assert surfaces.shape == (2, 300, 3)
    for i, frame in enumerate((2, 0)):
        field, surface = hull_volume(hulls, frame, count=300)
        jax.tree.map(np.testing.assert_array_equal, jax.tree.map(lambda a, i=i: a[i], fields), field)
        np.testing.assert_array_equal(surfaces[i], surface)
    assert len(hull_volumes(hulls)[1]) == 3
    assert hull_volumes(hulls, np.zeros(0, int))[0].values.shape == (0, 80, 80, 80)


def test_an_empty_hull_has_no_volume():
    grid = make_grid(np.zeros(3), np.ones(3), 0.1)
    occupied = np.zeros((2, *grid.shape), bool)
    occupied[0, 3:6, 3:6, 3:6] = True
    hulls = hulls_from_dense(occupied, grid)
    with pytest.raises(ValueError, match="frame 1 is empty"):
        hull_volume(hulls, 1)
    with pytest.raises(ValueError, match="frame 1 is empty"):
        hull_volumes(hulls)
