"""Peers for DTW costs and for the constrained least squares: other libraries."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from scipy.optimize import least_squares

from jaxskel import Pose, Skeleton
from jaxskel.matching import EndNodes
from jaxskel.refinement.parametrisations import Parametrisation
from jaxskel.refinement.terms import Objective, Observed, place


def dtaidistance_matrices(ends: EndNodes, template: np.ndarray) -> Callable[[], list[np.ndarray]]:
    """The distance matrix of its C library, one call per frame: rows of D against rows of D'."""
    from dtaidistance import dtw

    frames = [
        [*(np.ascontiguousarray(row, float) for row in distances[:n, :n]), *template.astype(float)]
        for distances, n in zip(ends.distances, ends.count, strict=True)
    ]

    def run() -> list[np.ndarray]:
        found = []
        for series in frames:
            n = len(series) - len(template)
            block = ((0, n), (n, len(series)))
            matrix = dtw.distance_matrix(series, block=block, inner_dist="euclidean", use_c=True)
            found.append(np.asarray(matrix)[:n, n:])
        return found

    return run


def scipy_refinement(
    objective: Objective,
    parametrisation: Parametrisation,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
    rounds: int,
    ftol: float,
) -> Callable[[], np.ndarray]:
    """MINPACK's Levenberg-Marquardt, frame by frame, residual and Jacobian jitted; returns the cost of each frame."""

    def residual(unknowns: jax.Array, base: Pose, frame: Observed, fixed: dict) -> jax.Array:
        body = place(skeleton, parametrisation.retract(unknowns, base, skeleton))
        return ravel_pytree(objective.residuals(body, frame, fixed))[0]

    value, jacobian = jax.jit(residual), jax.jit(jax.jacfwd(residual))
    correspond = jax.jit(lambda pose, frame: objective.correspond(place(skeleton, pose), frame))
    moved = jax.jit(lambda unknowns, base: parametrisation.retract(unknowns, base, skeleton))
    cost = jax.jit(lambda pose, frame: sum(objective.costs(place(skeleton, pose), frame).values(), jnp.zeros(())))
    zeros = np.asarray(parametrisation.unknowns(skeleton))

    def one(pose: Pose, frame: Observed) -> float:
        for _ in range(rounds):
            args = pose, frame, correspond(pose, frame)
            # Tolerance in millimetres, and a cost tolerance not smaller than ours.
            solution = least_squares(
                lambda u, args=args: np.asarray(value(u.astype(np.float32), *args), float),
                zeros,
                lambda u, args=args: np.asarray(jacobian(u.astype(np.float32), *args), float),  # pyright: ignore
                method="lm",
                xtol=3e-3,
                ftol=ftol,
            )
            pose = moved(solution.x.astype(np.float32), pose)
        return float(cost(pose, frame))

    frames = [
        (jax.tree.map(lambda a, f=f: a[f], initial), jax.tree.map(lambda a, f=f: a[f], observed))
        for f in range(len(initial.root))
    ]
    return lambda: np.array([one(*frame) for frame in frames])
