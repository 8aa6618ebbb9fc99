import numpy as np
import pytest
from support.reference_scooping import scooped_one_by_one

from jaxskel.graph import SkeletalGraph, prune, scoop
from jaxskel.graph import _wavefront as _wave
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


def scooped(occupancies, roots=None, spacing=SPACING, origin=(0.0, 0.0, 0.0)) -> list[SkeletalGraph]:
    grid = VoxelGrid(np.array(origin), spacing, occupancies[0].shape)
    hulls = hulls_from_dense(np.stack(occupancies), grid)
    return scoop(hulls, root_indices(hulls, roots or [ROOT] * len(occupancies)))


def root_indices(hulls: VisualHulls, roots) -> np.ndarray:
    return np.array([np.flatnonzero((hulls.voxels == root).all(1))[0] for root in roots])


def voxels_from_root(graph, nodes) -> np.ndarray:
    """Positions in voxels, relative to the root."""
    return (graph.positions[nodes] - graph.positions[0]) / SPACING


def test_a_thin_line_by_hand():
    # The root's cell has no other voxel, all further ones have two: boxes of 1 x 1 x 2, so s = 1 between them, and a
    # node goes half of the way from its parent to the middle of the next two voxels.
    graph = scooped([drawn(bar(ROOT, (20, 15, 26)))])[0]
    np.testing.assert_array_equal(graph.parents, np.arange(6) - 1)
    heights = [0.0, 0.5 ** np.sqrt(3 / 6) * -1.5]
    for middle in (-3.5, -5.5, -7.5, -9.5):
        heights.append((heights[-1] + middle) / 2)
    heights[-1] = -9.5  # the last node lies in the middle of its two
    np.testing.assert_allclose(voxels_from_root(graph, np.arange(6)), np.outer(heights, [0, 0, 1]), atol=1e-12)
    np.testing.assert_allclose(graph.positions[0], (np.array(ROOT) + 0.5) * SPACING)
    np.testing.assert_allclose(graph.radii, np.sqrt([3] + [6] * 5) * SPACING / 2)


def test_a_first_node_between_clusters_of_different_size():
    # The root touches a plate of 3 x 3 voxels, all in one cluster: its box has the diagonal sqrt(9 + 9 + 1).
    graph = scooped([drawn(bar(ROOT, ROOT), bar((20, 15, 34), (20, 15, 34), 1) * [1, 1, 0] + [0, 0, 35])])[0]
    # They are in four cells, none of them so much farther away than another that it would be left out of the end.
    np.testing.assert_array_equal(graph.parents, [-1, 0])
    np.testing.assert_allclose(voxels_from_root(graph, 1), (0, 0, -1), atol=1e-12)
    np.testing.assert_allclose(graph.radii[1], np.sqrt(19) / 2 * SPACING)


def test_of_two_branches_the_larger_one_comes_first():
    # On one side of the root's cell a bar of two voxels, on the other one a plate of six, which stands later in the
    # grid. Both go on: ends with the same parent would lie at the same place.
    x, y, z = ROOT
    plate = np.concatenate([bar((x + i, y - 1, z), (x + i, y + 1, z)) for i in (2, 3)])
    graph = scooped([drawn(bar((x - 4, y, z), (x + 1, y, z)), plate, bar((x + 4, y, z), (x + 5, y, z)))])[0]
    np.testing.assert_array_equal(graph.parents, [-1, 0, 0, 1, 2])
    assert graph.radii[1] > graph.radii[2]
    np.testing.assert_array_equal(np.sign(voxels_from_root(graph, [1, 2])), [[1, 0, 0], [-1, 0, 0]])


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


@pytest.mark.parametrize("shape", SHAPES)
def test_ends_and_lengths_of_drawn_shapes(shape):
    occupancy, ends, lengths = SHAPES[shape]
    graph = prune(scooped([occupancy])[0], 8 * SPACING)
    found = graph.end_nodes
    assert found[0] == 0
    assert len(found) == 1 + len(ends)
    for end, length in zip(ends, lengths, strict=True):
        apart = np.linalg.norm(voxels_from_root(graph, found[1:]) + ROOT - end, axis=1)
        assert apart.min() < TOLERANCE
        here = found[1 + np.argmin(apart)]
        np.testing.assert_allclose(graph.depths[here] / SPACING, length, atol=TOLERANCE)


@pytest.mark.parametrize("radius", [1.5, 2.3, 3.2, 4.5])
@pytest.mark.parametrize("shift", [0, 1])
def test_an_end_is_found_wherever_clusters_happen_to_end(radius, shift):
    x, y, z = ROOT[0] + shift, ROOT[1] + shift, ROOT[2]
    dx, dy, height = np.argwhere(np.ones(SHAPE, bool)).T - [[x], [y], [0]]
    for bottom in range(4, 16):
        round_bar = np.stack([dx + x, dy + y, height], 1)[
            (dx**2 + dy**2 <= radius**2) & (bottom <= height) & (height <= z)
        ]
        graph = prune(scooped([drawn(round_bar)], [(x, y, z)])[0], 8 * SPACING)
        assert len(graph.end_nodes) == 2
        end = voxels_from_root(graph, graph.end_nodes[-1])
        # The last two layers are 0 and 1 above the lowest one, but cells are two deep.
        assert -0.01 <= end[2] + z - bottom <= 1.5
        assert np.abs(end[:2]).max() < max(1, radius / 2)


@pytest.mark.parametrize("shape", [name for name, (_, ends, _) in SHAPES.items() if len(ends) > 1])
def test_branches_start_at_the_junction(shape):
    graph = prune(scooped([SHAPES[shape][0]])[0], 8 * SPACING)
    children = np.bincount(graph.parents[1:])
    forks = np.flatnonzero(children > 1)
    assert (children[forks] - 1).sum() == len(SHAPES[shape][1]) - 1
    apart = np.linalg.norm(voxels_from_root(graph, forks) + ROOT - JUNCTION, axis=1)
    assert apart.max() < TOLERANCE


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


def test_a_frame_does_not_depend_on_its_batch():
    occupancies = bodies()
    together = scooped(occupancies)
    assert len({len(graph) for graph in together}) > 1
    for graph, occupancy in zip(together, occupancies, strict=True):
        equal(scooped([occupancy])[0], graph)
    for graph, other in zip(together, scooped(occupancies[::-1])[::-1], strict=True):
        equal(other, graph)


@pytest.mark.parametrize("at_once", [3, 2048])
def test_the_rule_cell_by_cell(at_once, monkeypatch):
    # Crumbs among which clusters meet all the time: who comes first, and in what order, decides.
    monkeypatch.setattr(_wave, "_AT_ONCE", at_once)
    rng = np.random.default_rng(5)
    occupancies = [np.pad(rng.random((17, 16, 19)) < density, 2) for density in (0.15, 0.25, 0.3, 0.4, 0.6, 0.9)]
    roots = [tuple(np.argwhere(occupancy)[-1].tolist()) for occupancy in occupancies]
    contested = 0
    for graph, occupancy, root in zip(scooped(occupancies, roots), occupancies, roots, strict=True):
        positions, parents, meetings = scooped_one_by_one(occupancy, root)
        np.testing.assert_array_equal(graph.parents, parents)
        np.testing.assert_allclose(graph.positions / SPACING - 0.5, positions, atol=1e-9)
        contested += meetings
    assert contested > 50


def test_the_same_voxels_give_the_same_graph():
    for one, other in zip(scooped(bodies()), scooped(bodies()), strict=True):
        equal(one, other)


def test_laws_of_every_graph():
    for graph, occupancy in zip(scooped(bodies()), bodies(), strict=True):
        np.testing.assert_array_equal(graph.parents[0], -1)
        assert (graph.parents[1:] < np.arange(1, len(graph))).all()
        assert (graph.parents[1:] >= 0).all()
        places = (np.argwhere(occupancy) + 0.5) * SPACING
        assert (graph.positions >= places.min(0)).all()
        assert (graph.positions <= places.max(0)).all()
        assert (graph.radii >= np.sqrt(3) * SPACING / 2 - 1e-12).all()


def test_disconnected_voxels_have_no_part():
    plain = [SHAPES["thick T"][0], SHAPES["Y"][0]]
    littered = [shape | drawn(ball((6, 5, 35), 4), bar((2, 28, 2), (30, 28, 2))) for shape in plain]
    assert all((a != b).any() for a, b in zip(plain, littered, strict=True))
    for one, other in zip(scooped(littered), scooped(plain), strict=True):
        equal(one, other)


def test_voxels_twice_as_large_give_lengths_twice_as_long():
    for one, larger in zip(scooped(bodies()), scooped(bodies(), spacing=2 * SPACING), strict=True):
        np.testing.assert_array_equal(larger.parents, one.parents)
        np.testing.assert_array_equal(larger.depths, 2 * one.depths)
        np.testing.assert_array_equal(larger.radii, 2 * one.radii)


def test_a_translation_moves_the_graph():
    # The same places written with other indices: not a bit changes, if they stay in the same cells.
    padded = [np.pad(occupancy, ((4, 0), (2, 2), (0, 4))) for occupancy in bodies()]
    roots = [(ROOT[0] + 4, ROOT[1] + 2, ROOT[2])] * 3
    origin = (-4 * SPACING, -2 * SPACING, 0.0)
    for one, other in zip(scooped(bodies()), scooped(padded, roots, origin=origin), strict=True):
        equal(one, other)
    # Elsewhere in the world rounding may decide a tie differently, but no end node moves by a voxel.
    shift = np.array([2.5, -1.25, 0.75])
    for one, moved in zip(scooped(bodies()), scooped(bodies(), origin=shift), strict=True):
        one, moved = prune(one, 8 * SPACING), prune(moved, 8 * SPACING)
        np.testing.assert_allclose(moved.positions[moved.end_nodes] - shift, one.positions[one.end_nodes], atol=SPACING)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_mirrored_body_has_mirrored_end_nodes(axis):
    for occupancy in (SHAPES["thick cross"][0], SHAPES["Y"][0], *bodies()):
        mirrored = np.flip(occupancy, axis)
        root = list(ROOT)
        root[axis] = SHAPE[axis] - 1 - ROOT[axis]
        one = prune(scooped([occupancy])[0], 8 * SPACING)
        other = prune(scooped([mirrored], [tuple(root)])[0], 8 * SPACING)
        ends, expected = (graph.positions[graph.end_nodes] for graph in (other, one))
        ends[:, axis] = SHAPE[axis] * SPACING - ends[:, axis]
        assert len(ends) == len(expected)
        apart = np.linalg.norm(ends[:, None] - expected, axis=-1)
        assert max(apart.min(0).max(), apart.min(1).max()) < 2 * SPACING


def test_a_single_voxel_is_a_single_node():
    graph = scooped([drawn(bar(ROOT, ROOT))])[0]
    np.testing.assert_array_equal(graph.parents, [-1])
    assert (
        scoop(hulls_from_dense(np.zeros((0, 2, 2, 2), bool), VoxelGrid(np.zeros(3), 0.1, (2, 2, 2))), np.zeros(0, int))
        == []
    )
