"""Peers for carving and skeletal graphs: other libraries, called as a user would call them."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy import ndimage

from jaxskel import Cameras
from jaxskel.hull import ProjectionTable, VisualHulls

Run = Callable[[], Any]
_NEIGHBOURS = np.ones((3, 3, 3), bool)


def numpy_gather(masks: np.ndarray, table: ProjectionTable) -> Run:
    """One look-up for each voxel, camera and frame, in precomputed index tables."""
    pixels, observed = np.asarray(table.pixels), np.asarray(table.observed)

    def run() -> np.ndarray:
        hulls = np.empty((len(masks), pixels.shape[1]), bool)
        for hull, views in zip(hulls, masks, strict=True):
            hull[:] = observed
            for view, pixel in zip(views, pixels, strict=True):
                hull &= np.append(view.reshape(-1), True).take(pixel)
        return hulls

    return run


def naive_jax(masks: np.ndarray, table: ProjectionTable) -> Run:
    """The same in JAX, written for one frame, jitted and vmapped over eight."""

    @jax.jit
    @jax.vmap
    def carve(views: jax.Array) -> jax.Array:
        seen = jnp.pad(views.reshape(len(views), -1), ((0, 0), (0, 1)), constant_values=True)
        return jnp.take_along_axis(seen, table.pixels, 1).all(0) & table.observed

    def run() -> np.ndarray:
        return np.concatenate([np.asarray(carve(masks[i : i + 8])) for i in range(0, len(masks), 8)])

    return run


def numba_early_exit(masks: np.ndarray, table: ProjectionTable) -> Run:
    """A compiled loop that leaves a voxel at the first camera that misses it."""
    import numba  # pyright: ignore[reportMissingImports]

    @numba.njit
    def carve(views: np.ndarray, pixels: np.ndarray, observed: np.ndarray, hull: np.ndarray) -> None:
        for voxel in range(pixels.shape[1]):
            inside = observed[voxel]
            for camera in range(len(views)):
                if not inside:
                    break
                pixel = pixels[camera, voxel]
                if pixel < views.shape[1]:
                    inside = views[camera, pixel]
            hull[voxel] = inside

    pixels, observed = np.asarray(table.pixels), np.asarray(table.observed)

    def run() -> np.ndarray:
        hulls = np.empty((len(masks), pixels.shape[1]), np.bool_)
        for hull, views in zip(hulls, masks, strict=True):
            carve(views.reshape(len(views), -1), pixels, observed, hull)
        return hulls

    return run


def open3d_carving(masks: np.ndarray, table: ProjectionTable, cameras: Cameras) -> Run:
    """`VoxelGrid.carve_silhouette`, camera by camera. It tests the corners of voxels, not their centres."""
    import open3d as o3d  # pyright: ignore[reportMissingImports]

    grid, (height, width) = table.grid, table.size
    parameters = []
    for K, R, t in zip(cameras.K, cameras.R, cameras.t, strict=True):
        one = o3d.camera.PinholeCameraParameters()
        one.intrinsic = o3d.camera.PinholeCameraIntrinsic(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        extrinsic = np.eye(4)
        extrinsic[:3, :3], extrinsic[:3, 3] = R, t
        one.extrinsic = extrinsic
        parameters.append(one)
    size = [grid.spacing * n for n in grid.shape]

    def run() -> np.ndarray:
        hulls = np.zeros((len(masks), *grid.shape), bool)
        for hull, views in zip(hulls, masks, strict=True):
            voxels = o3d.geometry.VoxelGrid.create_dense(
                np.asarray(grid.origin, float), np.zeros(3), grid.spacing, *size
            )
            for view, one in zip(views, parameters, strict=True):
                voxels.carve_silhouette(o3d.geometry.Image(view.astype(np.float32)), one, True)
            index = np.array([voxel.grid_index for voxel in voxels.get_voxels()]).reshape(-1, 3)
            index = index[(index < grid.shape).all(1)]
            hull[tuple(index.T)] = True
        return hulls.reshape(len(masks), -1)

    return run


def simple_scooping(hulls: VisualHulls, roots: np.ndarray) -> Run:
    """Voxel scooping as published: frame by frame, cluster by cluster, with balls and `scipy.ndimage`."""

    def scooped(occupied: np.ndarray, root: np.ndarray) -> list[np.ndarray]:
        # A margin of one voxel, so that all neighbours are inside the array.
        low = np.argwhere(occupied).min(0) - 1
        free = np.pad(occupied[tuple(slice(a + 1, None) for a in low)], 1)
        seed = tuple(root - low)
        free[seed] = False
        nodes, wave = [np.array(seed, float)], [(np.array([seed]), 0, np.sqrt(3.0))]
        while wave:
            following = []
            for cluster, parent, before in wave:
                corner, stop = np.maximum(cluster.min(0) - 1, 0), cluster.max(0) + 2
                window = tuple(slice(a, b) for a, b in zip(corner, stop, strict=True))
                own = np.zeros(stop - corner, bool)
                own[tuple((cluster - corner).T)] = True
                touched = ndimage.binary_dilation(own, _NEIGHBOURS) & free[window]
                labels = np.zeros(touched.shape, int)
                ndimage.label(touched, _NEIGHBOURS, output=labels)
                for label in range(1, int(labels.max()) + 1):
                    reached = np.argwhere(labels == label) + corner
                    extent = float(np.linalg.norm(np.ptp(reached, axis=0) + 1))
                    share = 0.5 ** (min(extent, before) / max(extent, before))
                    node = nodes[parent] + share * (reached.mean(0) - nodes[parent])
                    radius = np.linalg.norm(reached - node, axis=1).max()
                    start = np.maximum(np.floor(np.minimum(node - radius, reached.min(0))), 0).astype(int)
                    end = np.ceil(np.maximum(node + radius, reached.max(0))).astype(int) + 1
                    end = np.minimum(end, free.shape)
                    around = tuple(slice(a, b) for a, b in zip(start, end, strict=True))
                    places = np.ix_(*(np.arange(a, b) for a, b in zip(start, end, strict=True)))
                    squares = [(axis - middle) ** 2 for axis, middle in zip(places, node, strict=True)]
                    ball = squares[0] + squares[1] + squares[2] < radius**2
                    grown = np.zeros(free[around].shape, bool)
                    grown[tuple((reached - start).T)] = True
                    mask = (free[around] & ball) | grown
                    grown = np.asarray(ndimage.binary_propagation(grown, _NEIGHBOURS, mask=mask), bool)
                    free[around] &= ~grown
                    nodes.append(node)
                    following.append((np.argwhere(grown) + start, len(nodes) - 1, extent))
            wave = following
        return nodes

    def run() -> list[list[np.ndarray]]:
        return [scooped(hulls.dense(f), hulls.voxels[root]) for f, root in enumerate(roots)]

    return run


def _cropped(hulls: VisualHulls) -> list[np.ndarray]:
    volumes = (hulls.dense(f) for f in range(len(hulls)))
    return [volume[ndimage.find_objects(volume.astype(np.uint8))[0]] for volume in volumes]


def skimage_thinning(hulls: VisualHulls) -> Run:
    """`skeletonize` of the volume around the body: thinning, without a graph of it."""
    from skimage.morphology import skeletonize  # pyright: ignore[reportMissingImports]

    volumes = _cropped(hulls)
    return lambda: [skeletonize(volume) for volume in volumes]


def kimimaro_skeletons(hulls: VisualHulls) -> Run:
    """TEASAR, with the published scale and constant adapted to a body in voxels."""
    import kimimaro  # pyright: ignore[reportMissingImports]

    volumes = [volume.astype(np.uint8) for volume in _cropped(hulls)]
    return lambda: [
        kimimaro.skeletonize(
            volume, teasar_params={"scale": 1.5, "const": 4}, dust_threshold=0, progress=False, parallel=1
        )
        for volume in volumes
    ]
