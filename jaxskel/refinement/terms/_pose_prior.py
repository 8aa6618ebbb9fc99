"""Prior from example poses: each segment's rotation relative to its parent stays near the examples' mean."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import HUMAN_15, Pose, SkeletonTemplate
from ._base import AbstractTerm, Observed, PlacedBody, number

# Lower bound of a segment's spread (rad), for segments that never turn in the examples.
_LEAST_SPREAD = 0.05


class PosePrior(AbstractTerm):
    """Relative rotation of each segment minus its mean, divided by its spread. See [`pose_prior`][].

    Attributes:
        usual: Mean rotation of each segment but the first, relative to its parent segment.
        spread: Deviation from the mean (rad, root mean square).
    """

    needs_graph = False

    usual: Float[Array, "segments 3 3"]
    spread: Float[Array, " segments"]
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, "segments 3 3"]:
        """Half the difference of the rotation matrices over the spread; its norm is about angle / (sqrt(2) spread)."""
        parents = np.array(body.template.segment_parents, np.int32)[1:]
        relative = jnp.einsum("ski,skj->sij", body.rotations[parents], body.rotations[1:])
        return (relative - self.usual) / (2 * self.spread[:, None, None])


def pose_prior(poses: Pose, weight: float = 1.0, template: SkeletonTemplate = HUMAN_15) -> PosePrior:
    """Make the prior from example poses, such as a few good frames of the same recording.

    Args:
        poses: With a leading axis ``frames``.
        weight: Weight of the term.
        template: That of the skeleton whose poses they are.
    """
    from scipy.spatial.transform import Rotation  # takes a third of a second to import, and is needed here only

    rotations = np.asarray(poses.rotations, np.float64)
    relative = rotations[:, list(template.segment_parents[1:])].swapaxes(-1, -2) @ rotations[:, 1:]
    seen = [Rotation.from_matrix(relative[:, segment]) for segment in range(relative.shape[1])]
    means = [each.mean() for each in seen]
    angles = np.array([(mean.inv() * each).magnitude() for mean, each in zip(means, seen, strict=True)])
    spread = np.maximum(np.sqrt((angles**2).mean(1)), _LEAST_SPREAD)
    usual = np.stack([mean.as_matrix() for mean in means])
    return PosePrior(jnp.asarray(usual, jnp.float32), jnp.asarray(spread, jnp.float32), jnp.asarray(weight))
