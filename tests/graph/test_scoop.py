"""Voxel scooping, by hand and against the rule written out cell by cell."""

import numpy as np
import pytest
from support.reference_scooping import scooped_one_by_one
from support.voxel_bodies import (
    ROOT,
    SHAPE,
    SPACING,
    bar,
    crumbled,
    drawn,
    skeletons,
    voxels_from_root,
)

from jaxskel.graph import _wavefront as _wave
from jaxskel.graph import prune


def test_a_thin_line_by_hand():
    # The root's cell has no other voxel, all further ones have two: boxes of 1 x 1 x 2, so s = 1 between them, and a
    # node goes half of the way from its parent to the middle of the next two voxels.
    graph = skeletons([drawn(bar(ROOT, (20, 15, 26)))])[0]
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
    graph = skeletons([drawn(bar(ROOT, ROOT), bar((20, 15, 34), (20, 15, 34), 1) * [1, 1, 0] + [0, 0, 35])])[0]
    # They are in four cells at similar distances, so that all of them count as outermost at the end.
    np.testing.assert_array_equal(graph.parents, [-1, 0])
    np.testing.assert_allclose(voxels_from_root(graph, 1), (0, 0, -1), atol=1e-12)
    np.testing.assert_allclose(graph.radii[1], np.sqrt(19) / 2 * SPACING)


def test_of_two_branches_the_larger_one_comes_first():
    # On one side of the root's cell a bar of two voxels, on the other one a plate of six, which stands later in the
    # grid. Both go on: ends with the same parent would lie at the same place.
    x, y, z = ROOT
    plate = np.concatenate([bar((x + i, y - 1, z), (x + i, y + 1, z)) for i in (2, 3)])
    graph = skeletons([drawn(bar((x - 4, y, z), (x + 1, y, z)), plate, bar((x + 4, y, z), (x + 5, y, z)))])[0]
    np.testing.assert_array_equal(graph.parents, [-1, 0, 0, 1, 2])
    assert graph.radii[1] > graph.radii[2]
    np.testing.assert_array_equal(np.sign(voxels_from_root(graph, [1, 2])), [[1, 0, 0], [-1, 0, 0]])


@pytest.mark.parametrize("radius", [1.5, 2.3, 3.2, 4.5])
@pytest.mark.parametrize("shift", [0, 1])
def test_an_end_is_found_wherever_clusters_happen_to_end(radius, shift):
    x, y, z = ROOT[0] + shift, ROOT[1] + shift, ROOT[2]
    dx, dy, height = np.argwhere(np.ones(SHAPE, bool)).T - [[x], [y], [0]]
    for bottom in range(4, 16):
        round_bar = np.stack([dx + x, dy + y, height], 1)[
            (dx**2 + dy**2 <= radius**2) & (bottom <= height) & (height <= z)
        ]
        graph = prune(skeletons([drawn(round_bar)], [(x, y, z)])[0], 8 * SPACING)
        assert len(graph.end_nodes) == 2
        end = voxels_from_root(graph, graph.end_nodes[-1])
        # The last two layers are 0 and 1 above the lowest one, but cells are two deep.
        assert -0.01 <= end[2] + z - bottom <= 1.5
        assert np.abs(end[:2]).max() < max(1, radius / 2)


@pytest.mark.parametrize("at_once", [3, 2048])
def test_the_rule_cell_by_cell(at_once, monkeypatch):
    # Random voxels in which clusters often meet, so that the order of the clusters decides.
    monkeypatch.setattr(_wave, "_AT_ONCE", at_once)
    occupancies, roots = crumbled()
    contested = 0
    for graph, occupancy, root in zip(skeletons(occupancies, roots), occupancies, roots, strict=True):
        positions, parents, meetings = scooped_one_by_one(occupancy, root)
        np.testing.assert_array_equal(graph.parents, parents)
        np.testing.assert_allclose(graph.positions / SPACING - 0.5, positions, atol=1e-9)
        contested += meetings
    assert contested > 50
