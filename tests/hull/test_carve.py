import equinox as eqx
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.phantoms import chain, film, ring

from jaxskel.cameras import make_cameras
from jaxskel.hull import carve, hulls_from_dense, make_grid, projection_table

GRID = make_grid(np.array([-0.5, -0.4, 0.6]), np.array([0.5, 0.4, 1.5]), 0.1)


def carved(silhouettes, cameras, grid, empty_views=None, max_misses=0, min_views=1):
    """Dense occupancy (frames x y z)."""
    table = projection_table(cameras, grid, silhouettes.shape[2], 8 * silhouettes.shape[3], min_views)
    hulls = carve(silhouettes, table, empty_views, max_misses)
    assert len(hulls) == len(silhouettes)
    return np.stack([hulls.dense(f) for f in range(len(hulls))])


def reference(masks, rig, fold, grid, empty_views, max_misses, min_views):
    """Textbook space carving: a loop over cameras, frames and voxels."""
    frames = len(masks)
    occupied = np.zeros((frames, *grid.shape), bool)
    for place in np.ndindex(grid.shape):
        world = np.asarray(grid.origin) + grid.spacing * (np.array(place) + 0.5)
        views, misses = 0, np.zeros(frames, int)
        for c in range(len(rig["K"])):
            k1, k2, p1, p2 = rig["lens"][c]
            x, y, z = rig["R"][c] @ world + rig["t"][c]
            if z <= 0 or np.hypot(x / z, y / z) >= fold[c]:
                continue
            x, y = x / z, y / z
            r2 = x * x + y * y
            stretch = 1 + k1 * r2 + k2 * r2 * r2
            xd = x * stretch + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
            yd = y * stretch + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
            u, v, _ = rig["K"][c] @ np.array([xd, yd, 1.0])
            column, row = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
            width, height = rig["size"][c]
            if 0 <= column < width and 0 <= row < height:
                views += 1
                misses += ~masks[:, c, row, column] & ~empty_views[:, c]
        occupied[(slice(None), *place)] = (misses <= max_misses) & (views >= min_views)
    return occupied


def random_rig(rng):
    """Five cameras of every kind; the fourth stands in the volume, the last one has a lens that folds back."""
    size = np.array([[61, 48], [64, 40], [37, 33], [64, 48], [50, 45]])
    R = Rotation.random(5, rng).as_matrix()
    # Each camera looks at a point near the middle of the grid from its own distance.
    distance = np.array([2.0, 1.2, 3.0, 0.1, 0.9])
    middle = np.array([0.0, 0.0, 1.0]) + rng.normal(0, 0.1, (5, 3))
    t = -np.einsum("cij,cj->ci", R, middle) + distance[:, None] * [0, 0, 1]
    K = np.array([[[60.0, 4.0 * c, w / 2], [0.0, 50.0 + c, h / 2], [0.0, 0.0, 1.0]] for c, (w, h) in enumerate(size)])
    K[4, [0, 1], [0, 1]] = 25.0
    lens = np.array([[0, 0, 0, 0], [-0.2, 0.05, 0.01, -0.01], [0.1, 0, 0, 0.02], [0, 0, 0, 0], [-0.36, 0, 0, 0]])
    return {"K": K, "R": R, "t": t, "size": size, "lens": lens}


@pytest.mark.parametrize(
    ("frames", "max_misses", "min_views"),
    [(1, 0, 1), (31, 0, 2), (32, 1, 2), (33, 2, 1), (5, 1, 3), (3, 0, 5), (2, 2, 0)],
)
def test_carve_equals_the_text_book(frames, max_misses, min_views):
    rng = np.random.default_rng(frames)
    rig = random_rig(rng)
    cameras = make_cameras(rig["K"], rig["R"], rig["t"], rig["size"], rig["lens"])
    np.testing.assert_allclose(cameras.max_radius, [np.inf] * 4 + [1 / np.sqrt(3 * 0.36)], atol=1e-3)
    masks = rng.random((frames, 5, 48, 64)) < (0.8, 0.6, 0.4)[max_misses]
    empty_views = rng.random((frames, 5)) < 0.2
    expected = reference(masks, rig, cameras.max_radius, GRID, empty_views, max_misses, min_views)
    assert 0.05 < expected.mean() < 0.9  # otherwise the comparison would be empty
    ours = carved(np.packbits(masks, -1), cameras, GRID, empty_views, max_misses, min_views)
    np.testing.assert_array_equal(ours, expected)


def test_many_blocks_are_looked_up_in_parts(monkeypatch):
    cameras, grid = ring(4), make_grid(np.array([-0.5, -0.5, 0.6]), np.array([0.5, 0.5, 1.5]), 0.05)
    silhouettes = np.packbits(np.random.default_rng(0).random((3, 4, 120, 160)) < 0.8, -1)
    at_once = carved(silhouettes, cameras, grid)
    monkeypatch.setattr("jaxskel.hull._carve._AT_ONCE", 7)
    assert at_once.any()
    np.testing.assert_array_equal(carved(silhouettes, cameras, grid), at_once)


def test_hulls_store_no_voxel_that_is_empty_in_every_frame():
    # 33 frames leave 31 unused bits in the second word, which must not count.
    cameras, rng = ring(3), np.random.default_rng(0)
    silhouettes = np.packbits(rng.random((33, 3, 120, 160)) < 0.2, -1)
    hulls = carve(silhouettes, projection_table(cameras, GRID, 120, 160))
    assert 0 < len(hulls.voxels) < GRID.size
    assert hulls.inside.any(0).all()
    flat = np.ravel_multi_index(tuple(hulls.voxels.T), GRID.shape)
    assert (np.diff(flat) > 0).all()  # in the grid's order


BODIES = {
    "ball": np.array([[0.05, -0.1, 1.05, 0.3]]),
    "capsule": chain((-0.3, 0.2, 0.8), (0.3, -0.2, 1.35), 0.12),
    "two balls": np.array([[0.3, 0.2, 0.9, 0.12], [-0.3, -0.15, 1.2, 0.15]]),
}


@pytest.mark.parametrize("body", BODIES)
def test_hull_contains_the_body(body):
    balls, spacing = BODIES[body], 0.04
    # One pixel is 4 m / 200 px = 20 mm wide there: half a voxel.
    cameras = ring(8, size=(200, 160), focal=200.0)
    grid = make_grid(np.array([-0.6, -0.6, 0.5]), np.array([0.6, 0.6, 1.6]), spacing)
    hull = carved(film(cameras, [balls]), cameras, grid)[0]
    distance = np.linalg.norm(grid.centres()[:, None] - balls[:, :3], axis=-1) - balls[:, 3]
    depth = -distance.min(1).reshape(grid.shape)
    assert (depth > spacing).any()
    assert hull[depth > spacing].all()
    # The hull is tight too: eight views leave no volume far from the body.
    assert not hull[depth < -0.25].any()
    assert (depth < -0.25).any()


@pytest.mark.slow
@pytest.mark.parametrize("max_misses", [0, 1])
def test_adding_a_camera_never_grows_the_hull(max_misses):
    cameras, rng = ring(6), np.random.default_rng(1)
    silhouettes = np.packbits(rng.random((3, 6, 120, 160)) < 0.8, -1)
    volumes = []
    for count in range(1, 6):
        fewer = carved(silhouettes[:, :count], cameras[:count], GRID, max_misses=max_misses)
        more = carved(silhouettes[:, : count + 1], cameras[: count + 1], GRID, max_misses=max_misses)
        assert (fewer | ~more).all()
        volumes.append(more.sum())
    assert volumes[-1] < volumes[0]


@pytest.mark.parametrize("max_misses", [0, 1])
def test_a_lost_view_is_a_camera_left_out(max_misses):
    cameras, rng = ring(5), np.random.default_rng(2)
    masks = rng.random((4, 5, 120, 160)) < 0.8
    masks[:, 2] = False
    empty_views = np.zeros((4, 5), bool)
    empty_views[1, 2] = empty_views[3, 2] = True
    silhouettes = np.packbits(masks, -1)
    with_lost = carved(silhouettes, cameras, GRID, empty_views, max_misses)
    others = [0, 1, 3, 4]
    without = carved(silhouettes[:, others], cameras[others], GRID, None, max_misses)
    assert without.any()
    np.testing.assert_array_equal(with_lost[empty_views[:, 2]], without[empty_views[:, 2]])
    # A black view that is not lost counts as one miss everywhere.
    expected = carved(silhouettes[:, others], cameras[others], GRID, None, 0) if max_misses else np.zeros_like(without)
    np.testing.assert_array_equal(with_lost[~empty_views[:, 2]], expected[~empty_views[:, 2]])


def test_a_world_twice_as_large_has_the_same_voxels():
    cameras = ring(4)
    silhouettes = film(cameras, [BODIES["capsule"]])
    table = projection_table(cameras, GRID, 120, 160)
    hulls = carve(silhouettes, table)
    larger_rig = eqx.tree_at(lambda c: c.t, cameras, 2 * cameras.t)
    larger_grid = make_grid(2 * np.asarray(GRID.origin), 2 * GRID.upper, 2 * GRID.spacing)
    larger = carve(silhouettes, projection_table(larger_rig, larger_grid, 120, 160))
    assert len(hulls.voxels) > 0
    np.testing.assert_array_equal(larger.voxels, hulls.voxels)
    np.testing.assert_allclose(larger.volumes, 8 * hulls.volumes)
    np.testing.assert_allclose(larger.centres, 2 * hulls.centres)
    np.testing.assert_array_equal(carved(silhouettes, cameras, GRID, min_views=2)[0], hulls.dense(0))


def test_hulls_go_from_dense_to_sparse_and_back():
    occupancy = np.random.default_rng(5).random((3, *GRID.shape)) < 0.1
    occupancy[1] = False
    hulls = hulls_from_dense(occupancy, GRID)
    for f in range(3):
        np.testing.assert_array_equal(hulls.dense(f), occupancy[f])
    np.testing.assert_allclose(hulls.volumes, occupancy.sum((1, 2, 3)) * 0.1**3)
    centres = GRID.centres().reshape(*GRID.shape, 3)
    np.testing.assert_allclose(hulls.centres[hulls.inside[0]], centres[occupancy[0]])
    assert hulls_from_dense(occupancy[1:2], GRID).voxels.shape == (0, 3)
