"""One table of every term, parametrisation and solver: the truth is a minimum, Jacobians are right, solves succeed."""

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
import pytest
from support.observed_person import ADULT, BODY, CAMERAS, HINGED, observe, standing, turned
from support.phantoms import HandsTogether

from jaxskel import Pose, refine_frames
from jaxskel.body import HALPE_26, JOINT_PARENTS, forward_kinematics
from jaxskel.cameras import project
from jaxskel.refinement.parametrisations import (
    AugmentedLagrangian,
    ExactBones,
    HingedLimbs,
    Parametrisation,
    SoftBones,
    SymmetricLengths,
)
from jaxskel.refinement.solvers import default_solver
from jaxskel.refinement.terms import (
    AbstractTerm,
    ArmCollision,
    ArmPrior,
    ContourContact,
    EndNodeAttraction,
    GemanMcClure,
    GraphAttraction,
    HingeLimits,
    HipLimits,
    InnerNodeAttraction,
    InsideSilhouettes,
    Objective,
    RestPrior,
    Robust,
    ShoulderLimits,
    Symmetry,
    arm_directions,
    arm_prior,
    from_function,
    keypoints_term,
    place,
    pose_prior,
)

pytestmark = pytest.mark.slow

TRUTH = standing()


def points_of(pose: Pose) -> np.ndarray:
    return np.concatenate(forward_kinematics(ADULT, pose))


def points(body, observed, goal):
    """Joints and tips at known positions, like markers."""
    return jnp.concatenate([body.joints, body.tips]) - goal


def keypoints_of(pose: Pose) -> np.ndarray:
    """Exact keypoints in all views; a few are missing."""
    body = place(ADULT, pose)
    means = HALPE_26.shares @ np.concatenate([body.joints, body.tips, body.origins[-4:]])
    u, v, _ = project(CAMERAS, means)
    seen = np.array(np.stack([u, v, np.linspace(0.2, 1, u.size).reshape(u.shape)], -1), np.float32)
    seen[3, 5:8] = np.nan
    return seen


def stacked(*poses: Pose) -> Pose:
    return jax.tree.map(lambda *leaves: np.stack(leaves).astype(np.float32), *poses)


def between(pose: Pose, other: Pose, share: float) -> Pose:
    """A pose between two poses."""
    blend = jax.tree.map(lambda a, b: (1 - share) * a + share * b, pose, other)
    left, _, right = np.linalg.svd(blend.rotations)
    return Pose(blend.root, (left @ right).astype(np.float32))


def truth_of(name: str) -> Pose:
    """A pose that minimises a term; for the rest prior there is only one."""
    return Pose(TRUTH.root, np.broadcast_to(TRUTH.rotations[:1], (17, 3, 3))) if name == "rest prior" else TRUTH


def arms_of(pose: Pose) -> ArmPrior:
    """A prior of the arms of one pose."""
    return arm_prior(np.asarray(jax.jit(lambda pose: arm_directions(place(ADULT, pose).joints))(pose)), np.ones(2))


RAISED, BENT = turned("l_upper_arm", "x", 40), turned("l_shank", "y", -60)
# Term; parametrisation and pose with a nonzero residual; bound of its residual at the truth. A voxel is 20 mm wide, a
# pixel 11 mm.
TERMS = {
    "graph attraction": (GraphAttraction(), HINGED, RAISED, 1e-5),
    "end nodes": (EndNodeAttraction(), HINGED, RAISED, 1e-5),
    "inner nodes": (InnerNodeAttraction(), HINGED, turned("pelvis", "x", 20), 1e-5),
    "inside silhouettes": (InsideSilhouettes(body=BODY), HINGED, RAISED, 0.003),
    "contour contact": (ContourContact(body=BODY, scale=1.0), HINGED, RAISED, 0.005),
    "arm collision": (ArmCollision(body=BODY), HINGED, turned("l_forearm", "x", -75), 0.001),
    "hinge limits": (HingeLimits(skeleton=ADULT), HINGED, BENT, 1e-6),
    "shoulder limits": (ShoulderLimits(skeleton=ADULT), HINGED, turned("l_upper_arm", "y", 70), 1e-6),
    "hip limits": (HipLimits(), HINGED, turned("l_thigh", "y", 60), 1e-6),
    "arm prior": (arms_of(TRUTH), HINGED, RAISED, 0.05),
    "rest prior": (RestPrior(), HINGED, RAISED, 1e-5),
    "pose prior": (pose_prior(stacked(TRUTH, TRUTH)), HINGED, RAISED, 1e-4),
    "symmetry": (Symmetry(), SoftBones(), RAISED, 1e-6),
    "function": (from_function(points, points_of(TRUTH)), HINGED, RAISED, 1e-6),
    "robust": (Robust(from_function(points, points_of(TRUTH)), GemanMcClure(0.3), group=3), HINGED, RAISED, 1e-6),
    # In metres, as the others, and not in standard deviations.
    "keypoints": (keypoints_term(CAMERAS, HALPE_26, noise=1.0, loss=GemanMcClure(1.0)), HINGED, RAISED, 5e-4),
    "custom module": (
        HandsTogether(length=float(np.linalg.norm(points_of(TRUTH)[5] - points_of(TRUTH)[8]))), HINGED, RAISED, 1e-6
    ),
}  # fmt: skip
PARAMETRISATIONS: dict[str, Parametrisation] = {
    "exact bones": ExactBones(),
    "hinged limbs": HingedLimbs(),
    "soft bones": SoftBones(),
    "augmented Lagrangian": AugmentedLagrangian(),
    "symmetric lengths": SymmetricLengths(),
    "symmetric lengths of hinged limbs": SymmetricLengths(rotations=HingedLimbs()),
}
SOLVERS = {
    "default": default_solver(),
    "LevenbergMarquardt": optx.LevenbergMarquardt(1e-3, 1e-4),
    "LevenbergMarquardt, QR": optx.LevenbergMarquardt(1e-3, 1e-4, linear_solver=lx.QR()),
    "GaussNewton": optx.GaussNewton(1e-3, 1e-4),
    "Dogleg": optx.Dogleg(1e-3, 1e-4),
    "BFGS": optx.BFGS(1e-7, 1e-7),
}


@pytest.fixture(scope="module")
def observed():
    return observe(TRUTH).with_data(keypoints=keypoints_of(TRUTH))


def test_the_table_has_all_terms_and_parametrisations():
    from jaxskel.refinement import parametrisations, terms

    def parts(module, kind):
        # Not in the table: abstract classes and helpers.
        abstract = (
            "AbstractTerm",
            "CapsuleTerm",
            "FunctionTerm",
            "JointRotations",
            "FreeJoints",
            "Parametrisation",
            "Motion",
        )
        found = (value for name, value in vars(module).items() if name not in abstract)
        return {value for value in found if isinstance(value, type) and issubclass(value, kind)}

    assert {type(row[0]) for row in TERMS.values()} >= parts(terms, AbstractTerm)
    found = parts(parametrisations, eqx.Module)
    assert {type(row) for row in PARAMETRISATIONS.values()} == found


@pytest.mark.parametrize("name", TERMS)
def test_a_term_is_content_with_the_truth(observed, name):
    term, _, wrong, bound = TERMS[name]

    @jax.jit
    def norm(pose):
        body = place(ADULT, pose)
        return jnp.linalg.norm(term.residual(body, observed, term.correspond(body, observed)))

    assert norm(truth_of(name)) < bound
    if name != "symmetry":  # zero for any pose with the template's lengths
        assert norm(wrong) > 2 * bound


def alike(parametrisation: Parametrisation) -> dict[str, AbstractTerm]:
    """All terms in the table for a kind of parametrisation, taken together so that they are compiled once."""
    return {name: row[0] for name, row in TERMS.items() if type(row[1]) is type(parametrisation)}


@eqx.filter_jit
def slopes(terms, parametrisation, base, skeleton, seen, here, along):
    """Directional derivative of each term's residual: automatic, and by finite differences."""
    fixed = {name: term.correspond(parametrisation.placed(base, skeleton), seen) for name, term in terms.items()}

    def residuals(unknowns):
        body = parametrisation.placed(parametrisation.retract(unknowns, base, skeleton), skeleton)
        return {name: term.residual(body, seen, fixed[name]) for name, term in terms.items()}

    ahead, behind = (residuals(here + sign * 1e-6 * along) for sign in (1, -1))
    divided = jax.tree.map(lambda a, b: (a - b) / 2e-6, ahead, behind)
    return jax.jvp(residuals, (here,), (along,))[1], divided


@pytest.mark.parametrize("name", TERMS)
def test_the_jacobian_of_a_term_is_finite_differences(observed, name):
    _, parametrisation, wrong, _ = TERMS[name]
    with jax.enable_x64(True):
        double = lambda a: a if np.asarray(a).dtype.kind in "bi" else jnp.asarray(a, jnp.float64)  # noqa: E731
        terms, parametrisation, seen, skeleton, wrong = jax.tree.map(
            double, (alike(parametrisation), parametrisation, observed, ADULT, wrong)
        )
        base = eqx.filter_jit(parametrisation.begin)(wrong, skeleton)
        count, rng = parametrisation.unknowns(ADULT).size, np.random.default_rng(0)
        here, along = (jnp.asarray(spread * rng.normal(size=count)) for spread in (0.01, 1.0))
        derived, divided = (found[name] for found in slopes(terms, parametrisation, base, skeleton, seen, here, along))
        assert np.abs(derived).max() > 1e-3
        np.testing.assert_allclose(derived, divided, atol=1e-6 * max(1.0, float(np.abs(derived).max())))


def started(parametrisation: Parametrisation, spread: float, count: int, seed: int = 0) -> Pose:
    """Poses around the truth; the last one is NaN."""
    unknowns = spread * np.random.default_rng(seed).normal(size=(count, parametrisation.unknowns(ADULT).size))

    def displaced(unknowns):
        base = parametrisation.begin(jax.tree.map(jnp.asarray, TRUTH), ADULT)
        return parametrisation.pose(parametrisation.retract(unknowns, base, ADULT), ADULT)

    poses = jax.jit(jax.vmap(displaced))(jnp.asarray(unknowns, jnp.float32))
    return eqx.tree_at(lambda p: p.root, poses, poses.root.at[-1].set(jnp.nan))


COUNT = 8


def solved(parametrisation, solver, observed, rounds=4, max_steps=400):
    """Solve for markers; return the errors of the points before and after (m)."""
    rest = RestPrior(weight=1e-7, firmness=np.ones(16, np.float32))
    objective = Objective({"points": from_function(points, points_of(TRUTH), weight=100.0), "rest": rest})
    start = started(parametrisation, 0.1, COUNT)
    seen = jax.tree.map(lambda a: jnp.broadcast_to(jnp.asarray(a), (COUNT, *a.shape)), observed)
    seen = eqx.tree_at(lambda o: (o.contours, o.silhouettes), seen, (None, None))
    result = refine_frames(objective, parametrisation, solver, ADULT, start, seen, rounds, max_steps)
    before = np.stack([points_of(jax.tree.map(lambda a, i=i: a[i], start)) for i in range(COUNT)])
    after = np.concatenate([result.joints, result.tips], 1)
    return result, *(np.linalg.norm(each - points_of(TRUTH), axis=-1).max(1) for each in (before, after))


def assert_recovered(result, before, after, bound=2e-3):
    whole = np.arange(COUNT - 1)
    assert before[whole].min() > 0.1
    # Failures are counted: only the frame without a pose may fail.
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(result.finite)), [COUNT - 1])
    assert not result.converged[-1]
    assert after[whole].max() < bound
    assert np.asarray(result.converged)[whole].all()


@pytest.mark.parametrize("name", PARAMETRISATIONS)
def test_a_solve_recovers_a_perturbed_pose_however_it_is_written(observed, name):
    result, before, after = solved(PARAMETRISATIONS[name], default_solver(), observed)
    assert_recovered(result, before, after)
    joints = np.asarray(result.joints)[:-1]
    lengths = np.linalg.norm(joints[:, 1:] - joints[:, list(JOINT_PARENTS[1:])], axis=-1)
    expected = np.linalg.norm(
        np.diff(points_of(TRUTH)[np.array([JOINT_PARENTS[1:], range(1, 15)])], axis=0)[0], axis=-1
    )
    np.testing.assert_allclose(lengths, np.tile(expected, (len(lengths), 1)), atol=1e-3)


@pytest.mark.parametrize("name", SOLVERS)
def test_a_solve_recovers_a_perturbed_pose_by_any_solver(observed, name):
    assert_recovered(*solved(ExactBones(), SOLVERS[name], observed))


@pytest.mark.parametrize("name", TERMS)
def test_a_solve_for_one_term_comes_near_its_content(observed, name):
    _, parametrisation, wrong, bound = TERMS[name]
    start = between(truth_of(name), wrong, 0.3)
    if name == "symmetry":
        parametrisation = SoftBones(weight=1e-3)
    # All terms of a parametrisation in one objective, so that it is compiled once; the other terms get zero weight.
    terms = alike(parametrisation)
    weights = {other: 1e4 if other == name else 0.0 for other in terms}
    # Unknowns that a term does not constrain stay about where they are.
    anchor = from_function(points, points_of(start), weight=10.0)
    objective = Objective(terms | {"anchor": anchor}).weighted(**weights)
    seen = jax.tree.map(lambda a: jnp.asarray(a)[None], observed)
    first = jax.tree.map(lambda a: jnp.asarray(a)[None], start)
    result = refine_frames(objective, parametrisation, default_solver(), ADULT, first, seen, 8, 16)
    before = float(eqx.filter_jit(objective.costs)(place(ADULT, start), observed)[name])
    assert result.finite.all()
    after = float(result.costs[name][0])
    assert after <= max(before / 3, 1e4 * bound**2)
