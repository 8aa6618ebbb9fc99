import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from jaxskel.graph import SkeletalGraph, prune
from jaxskel.graph._skeletal_graph import limit_ends


def graph(parents, positions):
    return SkeletalGraph(np.array(positions, float), np.array(parents), np.full(len(parents), 0.02))


# A person of sticks (m), drawn in the plane y = 0 with x to the side:
#
#       0         z = 1.7
#   2---1---3     z = 1.4, the hands 0.7 m to the left and 0.6 m to the right
#       |
#       4         z = 0.9
#      / \
#     5   6       0.3 m to the side and 0.4 m down: legs of 0.5 m
#
PERSON = graph(
    [-1, 0, 1, 1, 1, 4, 4],
    [(0, 0, 1.7), (0, 0, 1.4), (-0.7, 0, 1.4), (0.6, 0, 1.4), (0, 0, 0.9), (-0.3, 0, 0.5), (0.3, 0, 0.5)],
)


def test_lengths_by_hand():
    np.testing.assert_allclose(PERSON.edge_lengths, [0, 0.3, 0.7, 0.6, 0.5, 0.5, 0.5])
    np.testing.assert_allclose(PERSON.depths, [0, 0.3, 1.0, 0.9, 0.8, 1.3, 1.3])
    np.testing.assert_allclose(PERSON.geodesics(np.array([2, 6]))[[0, 1, 2, 3, 5]].T,
                               [[1.0, 0.7, 0, 1.3, 1.7], [1.3, 1.0, 1.7, 1.6, 1.0]])  # fmt: skip


def test_end_nodes_ascend_from_the_root():
    # The right hand is nearer than the left one; of two equally far feet the first one comes first.
    np.testing.assert_array_equal(PERSON.end_nodes, [0, 3, 2, 5, 6])
    np.testing.assert_array_equal(graph([-1], [(0, 0, 0)]).end_nodes, [0])
    np.testing.assert_array_equal(graph([-1, 0], [(0, 0, 0), (1, 0, 0)]).end_nodes, [0, 1])


@st.composite
def trees(draw, least=1, most=30):
    parents = [-1] + [draw(st.integers(0, i - 1)) for i in range(1, draw(st.integers(least, most)))]
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return graph(parents, rng.uniform(-1, 1, (len(parents), 3)))


@settings(deadline=None)
@given(trees())
def test_geodesics_are_dijkstras(tree):
    n = len(tree)
    places = np.arange(1, n, dtype=np.int32), tree.parents[1:].astype(np.int32)
    edges = csr_array((tree.edge_lengths[1:], places), shape=(n, n))
    expected = dijkstra(edges, directed=False)
    np.testing.assert_allclose(tree.geodesics(np.arange(n)), expected, atol=1e-12)
    np.testing.assert_allclose(tree.depths, expected[0], atol=1e-12)
    assert (np.diag(tree.geodesics(np.arange(n))) >= 0).all()


@settings(deadline=None)
@given(trees(least=2))
def test_end_nodes_are_the_root_and_the_leaves(tree):
    ends = tree.end_nodes
    leaves = set(range(1, len(tree))) - set(tree.parents.tolist())
    assert ends[0] == 0
    assert set(ends[1:].tolist()) == leaves
    assert (np.diff(tree.depths[ends]) >= 0).all()


def test_prune_removes_short_branches_and_keeps_long_ones():
    # A bone of four nodes 0.1 m apart, with a spur of 0.08 m at node 1, one of 0.15 m at node 2 that has itself a
    # spur of 0.04 m before its end, and an end that forks into 0.06 m and 0.05 m.
    tree = graph(
        [-1, 0, 1, 1, 2, 2, 5, 5, 4, 4],
        [(0, 0, 0), (0, 0, 0.1), (0, 0, 0.2), (0.08, 0, 0.1), (0, 0, 0.3), (0.1, 0, 0.2), (0.15, 0, 0.2),
         (0.1, 0.04, 0.2), (0, 0, 0.36), (0, 0.05, 0.3)],
    )  # fmt: skip

    def left(length):
        kept = prune(tree, length)
        return [int(np.flatnonzero((tree.positions == x).all(1))[0]) for x in kept.positions]

    assert left(0.01) == list(range(10))
    # The last fork loses its shorter end only: the bone itself goes on, however short its last piece.
    assert left(0.07) == [0, 1, 2, 3, 4, 5, 6, 8]
    assert left(0.1) == [0, 1, 2, 4, 5, 6, 8]
    # At node 2 the bone reaches 0.16 m on, the branch 0.15 m.
    assert left(0.2) == [0, 1, 2, 4, 8]
    assert left(9.0) == [0, 1, 2, 4, 8]
    kept = prune(tree, 0.1)
    np.testing.assert_array_equal(kept.parents, [-1, 0, 1, 2, 2, 4, 3])
    np.testing.assert_allclose(kept.depths, [0, 0.1, 0.2, 0.3, 0.3, 0.35, 0.36])


def test_a_short_branch_takes_along_what_hangs_on_it():
    tree = graph([-1, 0, 1, 2, 2], [(0, 0, 0), (0, 0, 1), (0.04, 0, 1), (0.04, 0.03, 1), (0.04, -0.02, 1)])
    # Node 1 is no fork: it has one child only. At node 2 the shorter of two branches is removed.
    np.testing.assert_array_equal(prune(tree, 0.1).parents, [-1, 0, 1, 2])
    np.testing.assert_allclose(prune(tree, 0.1).positions[-1], (0.04, 0.03, 1))
    longer = graph([-1, 0, 1, 2, 2, 1], [*tree.positions, (0, 0, 2)])
    np.testing.assert_array_equal(prune(longer, 0.1).positions, [(0, 0, 0), (0, 0, 1), (0, 0, 2)])


@settings(deadline=None)
@given(trees(least=2), st.floats(0.01, 3.0))
def test_laws_of_pruning(tree, length):
    kept = prune(tree, length)
    # The root and the deepest leaf stay, with the way between them.
    assert (kept.positions[0] == tree.positions[0]).all()
    assert kept.depths.max() == tree.depths.max()
    # What stays is a part of the tree: same depths, parents before children.
    where = [int(np.flatnonzero((tree.positions == x).all(1))[0]) for x in kept.positions]
    np.testing.assert_array_equal(kept.depths, tree.depths[where])
    assert (kept.parents[1:] < np.arange(1, len(kept))).all()
    # There is nothing more to prune, and pruning less keeps at least as much.
    np.testing.assert_array_equal(prune(kept, length).positions, kept.positions)
    assert len(prune(tree, length / 2)) >= len(kept)
    # Every leaf but the deepest one lies on a branch of at least that length.
    leaves = kept.end_nodes[1:]
    if len(leaves) > 1:
        between = kept.geodesics(leaves)[leaves]
        assert between[np.triu_indices(len(leaves), 1)].min() >= length - 1e-12


@settings(deadline=None)
@given(trees(least=2), st.integers(2, 8))
def test_limit_ends(tree, most):
    limited = limit_ends(tree, most)
    assert 2 <= len(limited.end_nodes) <= most
    assert limited.depths.max() == tree.depths.max()
    if len(tree.end_nodes) <= most:
        np.testing.assert_array_equal(limited.positions, tree.positions)


def test_limit_ends_removes_the_shortest_branches_first():
    spurs = [(0.1 * (i + 1), 0, -float(i)) for i in range(4)]
    bone = [(0, 0, -float(i)) for i in range(5)]
    tree = graph([-1, 0, 1, 2, 3, 0, 1, 2, 3], bone + spurs)
    for most in (6, 5, 4, 3, 2):
        ends = limit_ends(tree, most).end_nodes
        assert len(ends) == most
        reached = limit_ends(tree, most).positions[:, 0].max()
        np.testing.assert_allclose(reached, 0.4 if most > 2 else 0.0)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_graph_twice_as_large_has_lengths_twice_as_long(factor):
    scaled = SkeletalGraph(factor * PERSON.positions, PERSON.parents, factor * PERSON.radii)
    ends = PERSON.end_nodes
    np.testing.assert_array_equal(scaled.geodesics(ends), factor * PERSON.geodesics(ends))
    np.testing.assert_array_equal(scaled.end_nodes, ends)
    np.testing.assert_array_equal(prune(scaled, 0.55 * factor).parents, prune(PERSON, 0.55).parents)
