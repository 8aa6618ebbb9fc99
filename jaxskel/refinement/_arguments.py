"""Checks the arguments of a refinement: what is compiled would fail far away from the mistake, or not at all."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Bool

from .._runtime.kinds import check_count, check_kind
from ..body import Body, Pose, Skeleton
from .parametrisations import Parametrisation
from .solvers import BandedEquations, NormalEquationsLM
from .terms import FunctionCoupling, FunctionTerm, Objective, Observed, check_objective


def check_frames(objective: Any, parametrisation: Any, solver: Any, *others: Any, **named: Any) -> None:
    """Refuse arguments of `refine_frames` that make no sense.

    Raises:
        ValueError: One line that names the argument.
    """
    check_sequence(objective, parametrisation, solver, *others, **named)
    if isinstance(solver, NormalEquationsLM) and solver.equations is BandedEquations:
        raise ValueError("solver: sequence_solver() couples frames; give default_solver(), or call refine_sequence")


def check_choices(parametrisation: Any, solver: Any, rounds: Any, max_steps: Any) -> None:
    """Refuse a parametrisation, a solver or numbers that no refinement can work with.

    Raises:
        ValueError: One line that names the argument.
    """
    check_kind("parametrisation", parametrisation, Parametrisation, "one, such as HingedLimbs()")
    if isinstance(solver, optx.NelderMead):
        raise ValueError(
            "solver: NelderMead ends where it starts, in a simplex of a quarter of a millimetre; give BFGS"
        )
    some = "a least-squares solver or minimiser of Optimistix, such as default_solver()"
    check_kind("solver", solver, optx.AbstractLeastSquaresSolver | optx.AbstractMinimiser, some)
    check_count("rounds", rounds)
    check_count("max_steps", max_steps)


def check_sequence(
    objective: Any,
    parametrisation: Any,
    solver: Any,
    skeleton: Any,
    initial: Any,
    observed: Any,
    rounds: Any = 1,
    max_steps: Any = 1,
) -> None:
    """Refuse arguments of `refine_sequence` that make no sense.

    Raises:
        ValueError: One line that names the argument.
    """
    check_objective(objective)
    check_choices(parametrisation, solver, rounds, max_steps)
    if isinstance(skeleton, Body):
        raise ValueError("skeleton: is a Body; give its skeleton, body.skeleton")
    check_kind("skeleton", skeleton, Skeleton, "a Skeleton")
    check_kind("initial", initial, Pose, "a Pose with a frames axis")
    check_kind("observed", observed, Observed, "the Observed of the same frames")
    if initial.root.ndim != 2:
        raise ValueError(f"initial: has roots of shape {initial.root.shape}; give one row for each frame, (frames, 3)")
    frames = len(initial.root)
    for name, tree in (("initial", initial), ("observed", observed)):
        for leaf in jax.tree.leaves(tree):
            if leaf.ndim == 0 or len(leaf) != frames:
                raise ValueError(
                    f"{name}: holds an array of shape {leaf.shape}, but initial has {frames} poses; give the same "
                    "frames in both"
                )
    if isinstance(objective, Objective):
        for name, term in objective.terms.items():
            if isinstance(term, FunctionTerm | FunctionCoupling):
                _check_parameters(name, term, parametrisation, skeleton, initial, observed)


def check_follows(follows: Any, frames: int) -> Bool[np.ndarray, " frames"]:
    """Which frames follow the one before them, as an array; refuse what says it of other frames.

    Raises:
        ValueError: One line that names the argument.
    """
    found = np.asarray(follows)
    if found.dtype != np.bool_ or found.shape != (frames,):
        raise ValueError(
            f"follows: is {found.dtype} of shape {found.shape}; give a boolean for each of the {frames} frames, such "
            "as np.diff(problem.frames, prepend=-1) == 1"
        )
    return found


def _check_parameters(
    name: str,
    term: FunctionTerm | FunctionCoupling,
    parametrisation: Parametrisation,
    skeleton: Skeleton,
    initial: Pose,
    observed: Observed,
) -> None:
    """Refuse a parameter with a row for each frame: each frame would be pulled to all rows at once."""
    frames, leaves = len(initial.root), jax.tree.leaves(term.parameters)
    if frames == 1 or all(leaf.ndim == 0 or len(leaf) != frames for leaf in leaves):
        return

    def size(rows: bool) -> int:
        """Number of residuals of one frame, with the whole parameters or with one row of each."""

        def of_one_row(leaf: Any) -> Any:
            return leaf[0] if rows and leaf.ndim and len(leaf) == frames else leaf

        def residual(initial: Pose, observed: Observed) -> Any:
            pose, frame = jax.tree.map(lambda a: a[0], initial), observed.of(jnp.int32(0))
            body = parametrisation.placed(parametrisation.begin(pose, skeleton), skeleton)
            sees = (body, frame) if isinstance(term, FunctionTerm) else (body, body, body)
            return term.function(*sees, *jax.tree.map(of_one_row, term.parameters))

        return sum(leaf.size for leaf in jax.tree.leaves(jax.eval_shape(residual, initial, observed)))

    try:
        with jax.numpy_rank_promotion("allow"):
            whole, by_row = size(rows=False), size(rows=True)
    except Exception:  # it cannot take rows, so it means the whole array; or it fails anyhow, and the solve says why
        return
    if whole == frames * by_row:
        shapes = ", ".join(str(leaf.shape) for leaf in leaves if leaf.ndim and len(leaf) == frames)
        remedy = (
            "a term sees one frame; give it with the frames, observed.with_data(name=array), and read "
            "observed.data['name']"
            if isinstance(term, FunctionTerm)
            else "a coupling is the same for all frames; give what holds for all, and what does not to a term of frames"
        )
        raise ValueError(
            f"objective: a parameter of its term {name!r} has one row for each of the {frames} frames ({shapes}), but "
            + remedy
        )
