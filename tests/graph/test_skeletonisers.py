"""Laws that every skeletoniser keeps."""

from functools import partial

import numpy as np
import pytest
from support.voxel_bodies import (
    JUNCTION,
    ROOT,
    SHAPE,
    SHAPES,
    SPACING,
    TOLERANCE,
    ball,
    bar,
    bodies,
    drawn,
    equal,
    skeletons,
    voxels_from_root,
)

from jaxskel.graph import GeodesicShells, ThinnestPaths, VoxelScooping, prune
from jaxskel.hull import VoxelGrid, hulls_from_dense


@pytest.fixture(
    params=[GeodesicShells(), VoxelScooping(), ThinnestPaths()], ids=["shells", "scooping", "thinnest paths"]
)
def skeletoniser(request):
    return request.param


@pytest.mark.parametrize("shape", SHAPES)
def test_ends_and_lengths_of_drawn_shapes(skeletoniser, shape):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    occupancy, ends, lengths = SHAPES[shape]
    graph = prune(draw([occupancy])[0], 8 * SPACING)
    found = graph.end_nodes
    assert found[0] == 0
    assert len(found) == 1 + len(ends)
    for end, length in zip(ends, lengths, strict=True):
        apart = np.linalg.norm(voxels_from_root(graph, found[1:]) + ROOT - end, axis=1)
        assert apart.min() < TOLERANCE
        here = found[1 + np.argmin(apart)]
        np.testing.assert_allclose(graph.depths[here] / SPACING, length, atol=TOLERANCE)


@pytest.mark.parametrize("shape", [name for name, (_, ends, _) in SHAPES.items() if len(ends) > 1])
def test_branches_start_at_the_junction(skeletoniser, shape):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    graph = prune(draw([SHAPES[shape][0]])[0], 8 * SPACING)
    children = np.bincount(graph.parents[1:])
    forks = np.flatnonzero(children > 1)
    assert (children[forks] - 1).sum() == len(SHAPES[shape][1]) - 1
    apart = np.linalg.norm(voxels_from_root(graph, forks) + ROOT - JUNCTION, axis=1)
    assert apart.max() < TOLERANCE


def test_a_frame_does_not_depend_on_its_batch(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    occupancies = bodies()
    together = draw(occupancies)
    assert len({len(graph) for graph in together}) > 1
    for graph, occupancy in zip(together, occupancies, strict=True):
        equal(draw([occupancy])[0], graph)
    for graph, other in zip(together, draw(occupancies[::-1])[::-1], strict=True):
        equal(other, graph)


def test_the_same_voxels_give_the_same_graph(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    for one, other in zip(draw(bodies()), draw(bodies()), strict=True):
        equal(one, other)


def test_laws_of_every_graph(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    for graph, occupancy in zip(draw(bodies()), bodies(), strict=True):
        np.testing.assert_array_equal(graph.parents[0], -1)
        assert (graph.parents[1:] < np.arange(1, len(graph))).all()
        assert (graph.parents[1:] >= 0).all()
        places = (np.argwhere(occupancy) + 0.5) * SPACING
        assert (graph.positions >= places.min(0)).all()
        assert (graph.positions <= places.max(0)).all()
        assert (graph.radii >= np.sqrt(3) * SPACING / 2 - 1e-12).all()


def test_disconnected_voxels_have_no_part(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    plain = [SHAPES["thick T"][0], SHAPES["Y"][0]]
    littered = [shape | drawn(ball((6, 5, 35), 4), bar((2, 28, 2), (30, 28, 2))) for shape in plain]
    assert all((a != b).any() for a, b in zip(plain, littered, strict=True))
    for one, other in zip(draw(littered), draw(plain), strict=True):
        equal(one, other)


def test_voxels_twice_as_large_give_lengths_twice_as_long(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    for one, larger in zip(draw(bodies()), draw(bodies(), spacing=2 * SPACING), strict=True):
        np.testing.assert_array_equal(larger.parents, one.parents)
        np.testing.assert_array_equal(larger.depths, 2 * one.depths)
        np.testing.assert_array_equal(larger.radii, 2 * one.radii)


def test_a_translation_moves_the_graph(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    # The same places written with other indices: not a bit changes, if they stay in the same cells.
    padded = [np.pad(occupancy, ((4, 0), (2, 2), (0, 4))) for occupancy in bodies()]
    roots = [(ROOT[0] + 4, ROOT[1] + 2, ROOT[2])] * 3
    origin = (-4 * SPACING, -2 * SPACING, 0.0)
    for one, other in zip(draw(bodies()), draw(padded, roots, origin=origin), strict=True):
        equal(one, other)
    # Elsewhere in the world rounding may decide a tie differently, but no end node moves by a voxel.
    shift = np.array([2.5, -1.25, 0.75])
    for one, moved in zip(draw(bodies()), draw(bodies(), origin=shift), strict=True):
        one, moved = prune(one, 8 * SPACING), prune(moved, 8 * SPACING)
        np.testing.assert_allclose(moved.positions[moved.end_nodes] - shift, one.positions[one.end_nodes], atol=SPACING)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_mirrored_body_has_mirrored_end_nodes(skeletoniser, axis):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    for occupancy in (SHAPES["thick cross"][0], SHAPES["Y"][0], *bodies()):
        mirrored = np.flip(occupancy, axis)
        root = list(ROOT)
        root[axis] = SHAPE[axis] - 1 - ROOT[axis]
        one = prune(draw([occupancy])[0], 8 * SPACING)
        other = prune(draw([mirrored], [tuple(root)])[0], 8 * SPACING)
        ends, expected = (graph.positions[graph.end_nodes] for graph in (other, one))
        ends[:, axis] = SHAPE[axis] * SPACING - ends[:, axis]
        assert len(ends) == len(expected)
        apart = np.linalg.norm(ends[:, None] - expected, axis=-1)
        assert max(apart.min(0).max(), apart.min(1).max()) < 2 * SPACING


def test_a_single_voxel_is_a_single_node(skeletoniser):
    draw = partial(skeletons, skeletoniser=skeletoniser)
    graph = draw([drawn(bar(ROOT, ROOT))])[0]
    np.testing.assert_array_equal(graph.parents, [-1])
    nobody = hulls_from_dense(np.zeros((0, 2, 2, 2), bool), VoxelGrid(np.zeros(3), 0.1, (2, 2, 2)))
    assert skeletoniser.skeletonise(nobody, np.zeros(0, int)) == []
