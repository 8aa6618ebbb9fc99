"""Shells of equal geodesic distance, by hand and against the rule written out cell by cell."""

import numpy as np
import pytest
from support.reference_shells import shells_one_by_one
from support.voxel_bodies import ROOT, SPACING, bar, crumbled, drawn, skeletons, voxels_from_root

from jaxskel.graph import GeodesicShells, _wavefront
from jaxskel.graph._skeletal_graph import SkeletalGraph


def shells_of(occupancies, roots=None) -> list[SkeletalGraph]:
    return skeletons(occupancies, roots, skeletoniser=GeodesicShells())


def test_a_thin_line_by_hand():
    # The root's cell has no other voxel, all further ones have two, whose middles lie 1.5, 3.5, ... below the root. A
    # node lies half-way between the middles of its own cell and the one before.
    graph = shells_of([drawn(bar(ROOT, (20, 15, 26)))])[0]
    np.testing.assert_array_equal(graph.parents, np.arange(6) - 1)
    heights = [0.0, -0.75, -2.5, -4.5, -6.5, -9.5]  # the last node lies in the middle of its two
    np.testing.assert_allclose(voxels_from_root(graph, np.arange(6)), np.outer(heights, [0, 0, 1]), atol=1e-12)
    np.testing.assert_allclose(graph.positions[0], (np.array(ROOT) + 0.5) * SPACING)
    np.testing.assert_allclose(graph.radii, np.sqrt([3] + [6] * 5) * SPACING / 2)


def test_where_two_ways_meet_the_thicker_one_goes_on():
    # A thick and a thin bar go down from a plate to another one: most of its cells are reached from the thick one.
    x, y, z = ROOT
    above, below = (bar((x - 6, y, height), (x + 6, y, height), 1) for height in (z - 2, z - 18))
    thick, thin = bar((x - 5, y, z - 2), (x - 5, y, z - 18), 2), bar((x + 6, y, z - 2), (x + 6, y, z - 18))
    tail = bar((x + 2, y, z - 18), (x + 2, y, z - 30))
    graph = shells_of([drawn(bar(ROOT, (x, y, z - 2)), above, below, thick, thin, tail)])[0]
    node = int(np.argmin(voxels_from_root(graph, np.arange(len(graph)))[:, 2]))
    path = []
    while node >= 0:
        path.append(node)
        node = int(graph.parents[node])
    on_path = voxels_from_root(graph, path)
    half_way = on_path[np.abs(on_path[:, 2] + 10) < 3]
    assert len(half_way)
    np.testing.assert_allclose(half_way[:, 0], -5, atol=0.5)


@pytest.mark.parametrize("at_once", [3, 2048])
def test_the_rule_cell_by_cell(at_once, monkeypatch):
    monkeypatch.setattr(_wavefront, "_AT_ONCE", at_once)
    occupancies, roots = crumbled()
    for graph, occupancy, root in zip(shells_of(occupancies, roots), occupancies, roots, strict=True):
        positions, parents = shells_one_by_one(occupancy, root)
        np.testing.assert_array_equal(graph.parents, parents)
        inner = np.unique(graph.parents[1:])  # end nodes move to the end of their limb, as in voxel scooping
        np.testing.assert_allclose(graph.positions[inner] / SPACING - 0.5, positions[inner], atol=1e-9)
        assert len(parents) > 5
