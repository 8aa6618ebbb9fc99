"""Drawn voxel bodies, and their skeletons."""

import numpy as np

from jaxskel.graph import SkeletalGraph, Skeletoniser, VoxelScooping
from jaxskel.hull import VisualHulls, VoxelGrid, hulls_from_dense

SHAPE, SPACING = (40, 30, 40), 1 / 64
ROOT = (20, 15, 36)


def bar(start, end, thickness=0) -> np.ndarray:
    """Voxels on the straight line between two voxels, and those up to `thickness` away along each axis."""
    steps = int(np.abs(np.subtract(end, start)).max())
    line = np.round(np.linspace(start, end, steps + 1)).astype(int)
    around = np.stack(np.meshgrid(*[np.arange(-thickness, thickness + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return (line[:, None] + around).reshape(-1, 3)


def ball(centre, radius) -> np.ndarray:
    cells = np.argwhere(np.ones(SHAPE, bool))
    return cells[((cells - centre) ** 2).sum(1) <= radius**2]


def drawn(*parts: np.ndarray) -> np.ndarray:
    occupancy = np.zeros(SHAPE, bool)
    occupancy[tuple(np.concatenate(parts).T)] = True
    return occupancy


def crumbled() -> tuple[list[np.ndarray], list[tuple[int, int, int]]]:
    """Random voxels of several densities, and a root in each."""
    rng = np.random.default_rng(5)
    occupancies = [np.pad(rng.random((17, 16, 19)) < density, 2) for density in (0.15, 0.25, 0.3, 0.4, 0.6, 0.9)]
    x, y, z = np.transpose([np.argwhere(occupancy)[-1] for occupancy in occupancies]).tolist()
    return occupancies, list(zip(x, y, z, strict=True))


def skeletons(
    occupancies, roots=None, spacing=SPACING, origin=(0.0, 0.0, 0.0), skeletoniser: Skeletoniser | None = None
) -> list[SkeletalGraph]:
    grid = VoxelGrid(np.array(origin), spacing, occupancies[0].shape)
    hulls = hulls_from_dense(np.stack(occupancies), grid)
    return (skeletoniser or VoxelScooping()).skeletonise(hulls, root_indices(hulls, roots or [ROOT] * len(occupancies)))


def root_indices(hulls: VisualHulls, roots) -> np.ndarray:
    return np.array([np.flatnonzero((hulls.voxels == root).all(1))[0] for root in roots])


def voxels_from_root(graph, nodes) -> np.ndarray:
    """Positions in voxels, relative to the root."""
    return (graph.positions[nodes] - graph.positions[0]) / SPACING


JUNCTION, BELOW = (20, 15, 20), (20, 15, 4)
LEFT, RIGHT = (6, 15, 20), (34, 15, 20)

# Shape: voxels, ends beside the root, their distance from the root through the drawing (voxels).
SHAPES = {
    "line": (drawn(bar(ROOT, BELOW)), [BELOW], [32]),
    "L": (drawn(bar(ROOT, JUNCTION), bar(JUNCTION, RIGHT)), [RIGHT], [30]),
    "T": (drawn(bar(ROOT, JUNCTION), bar(LEFT, RIGHT)), [LEFT, RIGHT], [30, 30]),
    "cross": (drawn(bar(ROOT, BELOW), bar(LEFT, RIGHT)), [LEFT, RIGHT, BELOW], [30, 30, 32]),
    "Y": (
        drawn(bar(ROOT, JUNCTION), bar(JUNCTION, (8, 15, 8)), bar(JUNCTION, (32, 15, 8))),
        [(8, 15, 8), (32, 15, 8)],
        [16 + 12 * np.sqrt(2)] * 2,
    ),
    "thick line": (drawn(bar(ROOT, BELOW, 2)), [BELOW], [32]),
    "thick T": (drawn(bar(ROOT, JUNCTION, 2), bar(LEFT, RIGHT, 2)), [LEFT, RIGHT], [30, 30]),
    "thick cross": (drawn(bar(ROOT, BELOW, 2), bar(LEFT, RIGHT, 2)), [LEFT, RIGHT, BELOW], [30, 30, 32]),
    "ball on a stick": (drawn(ball((20, 15, 30), 6), bar(ROOT, BELOW, 1)), [BELOW], [32]),
    "stick in a ball": (drawn(ball((20, 15, 8), 6), bar(ROOT, BELOW, 1)), [BELOW], [32]),
}
# A node cuts corners, and an end node lies a voxel behind the tip or the surface.
TOLERANCE = 5.0


def bodies(count=3) -> list[np.ndarray]:
    """Lumpy random bodies around the cross, each with some voxels that are not connected to it."""
    rng = np.random.default_rng(11)
    return [
        drawn(SHAPES_CELLS, *[ball(rng.integers((12, 10, 10), (28, 20, 34)), 3 + 3 * rng.random()) for _ in range(6)])
        for _ in range(count)
    ]


SHAPES_CELLS = np.argwhere(SHAPES["thick cross"][0])


def equal(one: SkeletalGraph, other: SkeletalGraph) -> None:
    np.testing.assert_array_equal(one.positions, other.positions)
    np.testing.assert_array_equal(one.parents, other.parents)
    np.testing.assert_array_equal(one.radii, other.radii)
