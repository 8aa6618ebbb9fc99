"""What each hypothesis costs, term by term."""

import jax
import numpy as np
from jaxtyping import Array, Float

from .._runtime.batching import on_device, padded, single_precision
from .._runtime.compile_cache import cached_jit
from ..body import Pose, Skeleton
from ..refinement.terms import Objective, Observed, place


def costs_by_term(
    objective: Objective, skeleton: Skeleton, poses: Pose, observed: Observed
) -> dict[str, Float[np.ndarray, "frames hypotheses"]]:
    """Weighted costs of hypotheses by name of the term: why one of them won.

    Args:
        objective: Any objective of this subject, such as that of the search: ``objective.of_body(body)``.
        skeleton: The subject's skeleton (m).
        poses: Hypotheses with axes ``frames hypotheses`` (m, in a world with z up), see `Hypotheses`.
        observed: What the frames show.
    """
    stack = on_device(observed)
    count, length = len(poses.root), len(stack.inner)
    found = _costs(single_precision(objective), single_precision(skeleton), padded(poses, length), stack)
    return {name: np.asarray(costs)[:count] for name, costs in found.items()}


@cached_jit
def _costs(
    objective: Objective, skeleton: Skeleton, poses: Pose, stack: Observed
) -> dict[str, Float[Array, "frames hypotheses"]]:
    def of_frame(each: tuple[Pose, Observed]) -> dict[str, Float[Array, " hypotheses"]]:
        return jax.lax.map(lambda pose: objective.costs(place(skeleton, pose), each[1]), each[0])

    return jax.lax.map(of_frame, (poses, stack))
