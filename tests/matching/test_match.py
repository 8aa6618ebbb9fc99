from itertools import combinations, permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from support.phantoms import template_graph

from jaxskel.body import JOINT_NAMES, TIP_NAMES, default_adult
from jaxskel.graph import MAX_ENDS, SkeletalGraph
from jaxskel.matching import (
    DtwMatcher,
    EndNodes,
    ExactMatcher,
    cost_matrices,
    describe_ends,
    dtw,
    template_ends,
    template_geodesics,
)

ADULT = default_adult()
MATCHERS = {"dtw": DtwMatcher(), "exact": ExactMatcher()}
PAIRS = (slice(0, 1), slice(1, 3), slice(3, 5))  # head, hands, feet


def random_ends(counts, seed=0) -> EndNodes:
    """End nodes of random trees: stars whose rays are as long as limbs."""
    graphs = []
    rng = np.random.default_rng(seed)
    for n in counts:
        # The middle is the root's only child, so that the root is an end node too.
        rays = rng.normal(size=(n, 3))
        rays *= rng.uniform(0.3, 1.5, (n, 1)) / np.linalg.norm(rays, axis=1, keepdims=True)
        parents = [-1, 0] + [1] * (n - 1)
        graphs.append(
            SkeletalGraph(np.vstack([rays[:1], np.zeros((1, 3)), rays[1:]]), np.array(parents), np.ones(n + 1))
        )
    return describe_ends(graphs)


def shuffled(graph: SkeletalGraph, names: list[str], seed: int) -> tuple[SkeletalGraph, list[str]]:
    """The same tree with its nodes in another order, parents still before their children."""
    rng = np.random.default_rng(seed)
    order, waiting = [0], list(np.flatnonzero(graph.parents == 0))
    while waiting:
        order.append(waiting.pop(rng.integers(len(waiting))))
        waiting += list(np.flatnonzero(graph.parents == order[-1]))
    parents = np.array([order.index(graph.parents[node]) if node else -1 for node in order])
    return SkeletalGraph(graph.positions[order], parents, graph.radii), [names[node] for node in order]


def labelled(graph: SkeletalGraph, names: list[str], matcher) -> list[list[str]]:
    """The end nodes that the matcher labels as head, hands and feet."""
    ends = describe_ends([graph])
    found = [names[node] for node in ends.nodes[0, matcher.match(ends, ADULT).ends[0]]]
    return [sorted(found[pair]) for pair in PAIRS]


TRUTH = [["head_top"], ["l_fingertip", "r_fingertip"], ["l_toetip", "r_toetip"]]
SPURS = {
    "none": [],
    "one": [("l_knee", 0.06)],
    "some": [("pelvis", 0.08), ("l_elbow", 0.05), ("r_foot", 0.04), ("neck", 0.07)],
}


@pytest.mark.parametrize("spurs", SPURS)
@pytest.mark.parametrize("matcher", MATCHERS)
def test_matchers_undo_a_shuffle(matcher, spurs):
    graph, names = template_graph(ADULT, SPURS[spurs])
    assert len(graph.end_nodes) == 5 + len(SPURS[spurs])
    orders = set()
    for seed in range(4):
        other, other_names = shuffled(graph, names, seed)
        assert labelled(other, other_names, MATCHERS[matcher]) == TRUTH
        orders.add(tuple(other_names))
    assert len(orders) == 4


@pytest.mark.parametrize("matcher", MATCHERS)
def test_the_template_matches_itself_at_no_cost(matcher):
    ends = describe_ends([template_graph(ADULT)[0], template_graph(ADULT.scaled(1.1))[0]])
    cost = MATCHERS[matcher].match(ends, ADULT).cost
    np.testing.assert_allclose(cost[0], 0.0, atol=1e-6)
    # All distances are a tenth too long.
    off_diagonal = template_ends(ADULT)[~np.eye(5, dtype=bool)]
    np.testing.assert_allclose(cost[1], 0.1 * off_diagonal.mean(), rtol=1e-5)


def test_descriptors_of_the_template():
    skeleton = ADULT
    bones, tips = dict(zip(JOINT_NAMES[1:], skeleton.bone_lengths, strict=True)), skeleton.tip_lengths
    arm = bones["l_shoulder"] + bones["l_elbow"] + bones["l_hand"] + tips[1]
    leg = bones["l_hip"] + bones["l_knee"] + bones["l_foot"] + tips[3]
    head = bones["head"] + tips[0]
    rows = dict(zip(JOINT_NAMES + TIP_NAMES, template_geodesics(skeleton), strict=True))
    np.testing.assert_allclose(rows["neck"], [head, arm, arm, bones["neck"] + leg, bones["neck"] + leg], rtol=1e-6)
    np.testing.assert_allclose(rows["pelvis"][[0, 1, 3]], [bones["neck"] + head, bones["neck"] + arm, leg], rtol=1e-6)
    np.testing.assert_allclose(rows["l_fingertip"][[1, 2]], [0.0, 2 * arm], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(template_ends(skeleton), template_ends(skeleton).T, atol=1e-6)
    # The graph of the template has the same distances, whatever its root.
    graph, names = template_graph(skeleton)
    tips = np.array([names.index(name) for name in TIP_NAMES])
    np.testing.assert_allclose(graph.geodesics(tips)[tips], template_ends(skeleton), atol=1e-6)


def test_too_many_end_nodes_are_refused():
    assert random_ends([MAX_ENDS]).count[0] == MAX_ENDS
    with pytest.raises(ValueError, match="prune longer branches"):
        random_ends([MAX_ENDS + 1])


def test_cost_matrices():
    ends, template = random_ends([5, 9, 16]), template_ends(ADULT)
    costs = np.asarray(cost_matrices(ends.distances, ends.count, template))
    assert costs.shape == (3, MAX_ENDS, 5)
    for f, n in enumerate(ends.count):
        assert np.isfinite(costs[f, :n]).all()
        assert (costs[f, n:] == np.inf).all()
    one = jax.jit(dtw)
    for f, end, label in [(0, 4, 3), (1, 0, 0), (1, 8, 2), (2, 15, 4)]:
        expected = one(jnp.asarray(ends.distances[f, end]), jnp.asarray(ends.count[f]), jnp.asarray(template[label]))
        np.testing.assert_allclose(costs[f, end, label], expected, rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_assignment_is_the_cheapest_of_all(seed):
    ends, template = random_ends([5, 6, 7, 8], seed), template_ends(ADULT)
    costs = np.asarray(cost_matrices(ends.distances, ends.count, template))
    labels = DtwMatcher().match(ends, ADULT).ends
    for f, n in enumerate(ends.count):
        others = range(1, n)
        every = [sum(costs[f, q, 1 + i] for i, q in enumerate(choice)) for choice in permutations(others, 4)]
        ours = sum(costs[f, labels[f, label], label] for label in range(1, 5))
        np.testing.assert_allclose(ours, min(every), rtol=1e-6)
        rows, columns = linear_sum_assignment(costs[f, 1:n, 1:])
        np.testing.assert_allclose(ours, costs[f, 1:n, 1:][rows, columns].sum(), rtol=1e-6)


@pytest.mark.parametrize("matcher", MATCHERS)
@pytest.mark.parametrize("seed", range(3))
def test_labels_are_different_end_nodes_and_the_head_is_the_root(matcher, seed):
    ends = random_ends([5, 8, 16, 2, 4, 3], seed)
    labels = MATCHERS[matcher].match(ends, ADULT).ends
    assert (labels[:, 0] == 0).all()
    for f, n in enumerate(ends.count):
        found = labels[f][labels[f] >= 0]
        assert len(set(found)) == len(found) == min(n, 5)
        assert found.max() < n


@pytest.mark.parametrize("seed", range(3))
def test_exact_matcher_is_the_cheapest_of_all(seed):
    ends, template = random_ends([5, 7, 9], seed), template_ends(ADULT)
    matches = ExactMatcher().match(ends, ADULT)
    for f, n in enumerate(ends.count):

        def cost(q, f=f):
            return np.abs(ends.distances[f][np.ix_(q, q)] - template).sum()

        every = [
            cost((0, *hands, *feet))
            for hands in combinations(range(1, n), 2)
            for feet in combinations([i for i in range(1, n) if i not in hands], 2)
        ]
        np.testing.assert_allclose(cost(matches.ends[f]), min(every), rtol=1e-5)
        np.testing.assert_allclose(matches.cost[f], min(every) / 20, rtol=1e-5)  # 20 pairs of different end nodes


@pytest.mark.parametrize("matcher", MATCHERS)
def test_a_frame_does_not_depend_on_its_batch(matcher):
    ends = random_ends([6, 4, 12])
    together = MATCHERS[matcher].match(ends, ADULT).ends
    for f in range(3):
        alone = jax.tree.map(lambda a, f=f: a[f : f + 1], ends)
        np.testing.assert_array_equal(MATCHERS[matcher].match(alone, ADULT).ends[0], together[f])


@pytest.mark.parametrize("matcher", MATCHERS)
def test_a_missing_hand_leaves_one_label_free(matcher):
    graph, names = template_graph(ADULT)
    cut = graph.keep(~np.isin(names, ["r_elbow", "r_hand", "r_fingertip", "r_shoulder"]))
    left = [name for name in names if name not in ("r_elbow", "r_hand", "r_fingertip", "r_shoulder")]
    ends = describe_ends([cut])
    labels = MATCHERS[matcher].match(ends, ADULT).ends[0]
    assert sorted(labels >= 0) == [False, True, True, True, True]
    assert left[ends.nodes[0, 0]] == "head_top"
    assert labels[0] == 0
