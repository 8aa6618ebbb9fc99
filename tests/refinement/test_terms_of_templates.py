"""Forward kinematics, parametrisations and terms of templates other than the paper's."""

import jax
import numpy as np
import pytest

from jaxskel import Pose
from jaxskel.body import HUMAN_15, default_adult, make_body, place_body, place_joints
from jaxskel.io.templates import BUILT_IN, built_in
from jaxskel.refinement.parametrisations import ExactBones, HingedLimbs, SoftBones, SymmetricLengths
from jaxskel.refinement.parametrisations._free_joints import length_errors
from jaxskel.refinement.terms import HingeLimits, Observed, RestPrior, Symmetry, place
from jaxskel.synthetic import random_poses

NOTHING = Observed(np.zeros((5, 2, 3)), np.zeros(5, bool), np.zeros((2, 3)))


def one_of(name: str, seed: int = 0):
    skeleton = built_in(name)
    return skeleton, jax.tree.map(lambda a: np.float32(a[0]), random_poses(skeleton, 1, seed))


def lengths(skeleton, joints) -> np.ndarray:
    parents = list(skeleton.template.joint_parents[1:])
    return np.linalg.norm(joints[..., 1:, :] - joints[..., parents, :], axis=-1)


@pytest.mark.parametrize("name", BUILT_IN)
def test_bones_keep_their_lengths(name):
    skeleton = built_in(name)
    joints, tips = (np.asarray(a) for a in place_joints(skeleton, random_poses(skeleton, 9)))
    np.testing.assert_allclose(lengths(skeleton, joints), np.tile(skeleton.bone_lengths, (9, 1)), rtol=1e-5)
    reach = np.linalg.norm(tips - joints[:, list(skeleton.template.tip_parents)], axis=-1)
    np.testing.assert_allclose(reach, np.tile(skeleton.tip_lengths, (9, 1)), rtol=1e-5)


@pytest.mark.parametrize("name", BUILT_IN)
@pytest.mark.parametrize("parametrisation", [ExactBones(), HingedLimbs()], ids=lambda p: type(p).__name__)
def test_unknowns_move_the_joints_and_keep_the_lengths(name, parametrisation):
    skeleton, pose = one_of(name)
    zeros = parametrisation.unknowns(skeleton)
    assert not np.asarray(zeros).any()
    some = 0.2 * np.random.default_rng(0).normal(size=(1, len(zeros)))
    steps = np.concatenate([np.zeros((1, len(zeros))), some, 0.1 * np.eye(len(zeros))]).astype(np.float32)
    joints = np.asarray(jax.jit(jax.vmap(lambda u: parametrisation.reached(u, pose, skeleton).joints))(steps))
    np.testing.assert_allclose(lengths(skeleton, joints), np.tile(skeleton.bone_lengths, (len(steps), 1)), rtol=1e-4)
    np.testing.assert_allclose(joints[0], place(skeleton, pose).joints, atol=1e-5)
    # Every joint but the root is moved by an unknown other than the translation.
    assert (np.linalg.norm(joints[5:] - joints[0], axis=-1).max(0)[1:] > 1e-3 * skeleton.size).all()


@pytest.mark.parametrize("name", ["human-21", "hand"])
def test_the_derivative_in_closed_form_is_that_of_the_chain(name):
    skeleton, pose = one_of(name, 2)
    hinged = HingedLimbs()
    some = 0.3 * np.random.default_rng(1).normal(size=hinged.unknowns(skeleton).shape).astype(np.float32)
    found = jax.jit(jax.jacfwd(lambda u: hinged.reached(u, pose, skeleton)))(some)
    chain = jax.jit(jax.jacfwd(lambda u: place(skeleton, hinged.retract(u, pose, skeleton))))(some)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(chain), strict=True):
        np.testing.assert_allclose(one, other, atol=2e-4)


@pytest.mark.parametrize("name", BUILT_IN)
def test_free_joints_hold_the_lengths_of_bones_and_rigid_segments(name):
    skeleton, pose = one_of(name)
    joints = jax.jit(place)(skeleton, pose).joints
    np.testing.assert_allclose(length_errors(joints, skeleton), 0, atol=1e-5)
    assert np.abs(np.asarray(length_errors(1.1 * joints, skeleton))).min() > 1e-4
    template = skeleton.template
    carried = [template.segment_of_joint[1:].count(s) for s in range(len(template.segment_names))]
    pairs = sum(count * (count - 1) // 2 for count in carried)
    assert len(length_errors(joints, skeleton)) == len(template.joint_names) - 1 + pairs


@pytest.mark.parametrize("name", BUILT_IN)
def test_terms_are_zero_at_rest(name):
    skeleton = built_in(name)
    pose = jax.tree.map(lambda a: np.float32(a[0]), still(skeleton))
    terms = RestPrior(), Symmetry(), HingeLimits(skeleton)

    @jax.jit
    def residuals(pose):
        rest = place(skeleton, pose)
        return [term.residual(rest, NOTHING, None) for term in terms]

    resting, symmetric, bent = (np.asarray(a) for a in residuals(pose))
    np.testing.assert_allclose(resting, 0, atol=1e-6)
    np.testing.assert_allclose(symmetric, 0, atol=1e-6)
    assert bent.shape == (len(skeleton.template.hinges), 2)
    np.testing.assert_allclose(bent[:, 1], 0, atol=1e-5)


def still(skeleton) -> Pose:
    count = len(skeleton.template.segment_names)
    return Pose(np.zeros((1, 3)), np.tile(np.eye(3), (1, count, 1, 1)))


@pytest.mark.parametrize("name", BUILT_IN)
def test_random_poses_bend_hinges_within_their_limits(name):
    skeleton = built_in(name)
    poses = jax.tree.map(np.float32, random_poses(skeleton, 40, 5))
    beyond = jax.jit(jax.vmap(lambda pose: HingeLimits(skeleton).residual(place(skeleton, pose), NOTHING, None)))(poses)
    np.testing.assert_allclose(beyond, 0, atol=1e-3)


@pytest.mark.parametrize("name", ["hand", "quadruped"])
def test_capsules_end_at_the_tips(name):
    skeleton = built_in(name)
    body = make_body(skeleton)
    ends, radii = place_body(body, still(skeleton))
    tips = len(skeleton.template.tip_names)
    apart = np.linalg.norm(ends[0, -tips:, 1] - skeleton.rest_tips, axis=-1)
    np.testing.assert_allclose(apart, np.minimum(radii[-tips:, 1], skeleton.tip_lengths / 2), rtol=1e-5)


def test_the_human_template_has_the_layout_that_it_always_had():
    adult = default_adult()
    assert len(ExactBones().unknowns(adult)) == 31
    assert len(HingedLimbs().unknowns(adult)) == 42
    assert len(SoftBones().unknowns(adult)) == 45
    assert len(SymmetricLengths().unknowns(adult)) == 31 + 8
    assert HUMAN_15.origins.tolist() == [0, 0, 1, 1, 3, 4, 1, 6, 7, 9, 10, 12, 13, 15, 16, 17, 18]
