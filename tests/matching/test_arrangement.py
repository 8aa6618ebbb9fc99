"""Labels of other templates, by the arrangement of their limbs in space; joints' places on ideal graphs."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxskel.body import place_joints
from jaxskel.graph import SkeletalGraph
from jaxskel.io.templates import built_in
from jaxskel.matching import (
    DtwMatcher,
    ExactMatcher,
    estimate_size,
    joint_targets,
    labelled_limbs,
    rotations_onto,
    size_of_limbs,
)
from jaxskel.search import target_poses
from jaxskel.synthetic import random_poses

NAMES = "hand", "quadruped"


def ideal_graph(skeleton, pose, frame: int, spur: bool = False) -> SkeletalGraph:
    """The bones of a pose as a graph from the first tip, whose end nodes are the tips; a spur on the last limb."""
    joints, tips = (np.asarray(a, np.float64)[frame] for a in place_joints(skeleton, pose))
    points, parents = np.concatenate([joints, tips]), skeleton.template.point_parents.tolist()
    edges = [(point, parent) for point, parent in enumerate(parents) if parent >= 0]
    if spur:
        last = len(points) - 1
        points = np.concatenate([points, points[parents[last]][None] + 0.3 * (points[last] - points[0])])
        edges.append((len(points) - 1, parents[last]))
    order, above, waiting = [len(joints)], [-1], [len(joints)]
    while waiting:
        here = waiting.pop(0)
        for edge in edges:
            if here in edge and (other := edge[1 - edge.index(here)]) not in order:
                order.append(other)
                above.append(order.index(here))
                waiting.append(other)
    placed = points[order]
    depths = np.zeros(len(order))
    for node, parent in enumerate(above[1:], 1):
        depths[node] = depths[parent] + np.linalg.norm(placed[node] - placed[parent])
    return SkeletalGraph(placed, np.array(above), depths)


@pytest.mark.parametrize("spur", [False, True])
@pytest.mark.parametrize("matcher", [DtwMatcher(), ExactMatcher()])
@pytest.mark.parametrize("name", NAMES)
def test_labels_of_ideal_graphs(name, matcher, spur):
    skeleton = built_in(name)
    poses = random_poses(skeleton, 12, seed=3)
    tips = np.asarray(place_joints(skeleton, poses)[1], np.float64)
    graphs = [ideal_graph(skeleton, poses, frame, spur) for frame in range(12)]
    limbs, _, sides = labelled_limbs(graphs, skeleton, matcher, ())
    assert limbs.found.all()
    right = np.linalg.norm(limbs.ends - tips, axis=-1) < 1e-6
    assert right.mean() >= 0.97
    assert ((sides >= 0.5) & (sides <= 1)).all()


@pytest.mark.parametrize("name", NAMES)
def test_joints_on_ideal_graphs_and_poses_from_them(name):
    skeleton = built_in(name)
    poses = random_poses(skeleton, 8, seed=1)
    joints = np.asarray(place_joints(skeleton, poses)[0], np.float64)
    graphs = [ideal_graph(skeleton, poses, frame) for frame in range(8)]
    limbs, _, _ = labelled_limbs(graphs, skeleton, ExactMatcher(), ())
    targets = joint_targets(limbs, skeleton)
    there = np.isfinite(targets).all((0, 2))
    attracted = {bone.joint for bone in skeleton.template.attracted} | set(skeleton.template.inner)
    assert set(np.flatnonzero(there)) == attracted
    # Ideal paths end at the tips, and the method takes it that they end short of them.
    short = 0.3 * skeleton.tip_lengths.max() + 1e-6
    assert np.linalg.norm(targets - joints, axis=-1)[:, there].max() < 2 * short
    begun = target_poses(limbs, skeleton)
    placed = np.asarray(place_joints(skeleton, begun)[0])
    assert np.median(np.linalg.norm(placed - joints, axis=-1)) < 0.06 * skeleton.size


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [0.7, 1.6])
def test_size_is_that_of_the_limbs(name, factor):
    skeleton = built_in(name)
    larger = skeleton.scaled(factor)
    poses = random_poses(larger, 6, seed=2)
    graphs = [ideal_graph(larger, poses, frame) for frame in range(6)]
    # The ideal end nodes are the tips themselves, which lie beyond the usual ones.
    assert estimate_size(graphs, skeleton) == pytest.approx(factor, rel=0.12)
    limbs, _, _ = labelled_limbs(graphs, larger, ExactMatcher(), ())
    assert size_of_limbs(limbs, larger) == pytest.approx(1, rel=0.12)


def test_rotations_are_found_and_reflections_are_not():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(7, 3))
    turns = Rotation.random(5, rng).as_matrix()
    shifts = rng.normal(size=(5, 3))
    targets = points @ turns.swapaxes(1, 2) + shifts[:, None]
    targets[:, 3] = np.nan
    rotation, shift, misfit = rotations_onto(points, targets)
    np.testing.assert_allclose(rotation, turns, atol=1e-9)
    np.testing.assert_allclose(shift, shifts, atol=1e-9)
    np.testing.assert_allclose(misfit, 0, atol=1e-9)
    rotation, _, misfit = rotations_onto(points, targets * [1, 1, -1])
    np.testing.assert_allclose(np.linalg.det(rotation), 1)
    assert (misfit > 0.1).all()
