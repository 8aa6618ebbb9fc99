"""Term that keeps forearms and hands out of head, trunk and legs."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...body import SEGMENT_NAMES, Body, all_distances, ball_centres, nearest_capsule, toward_capsule
from ._base import AbstractTerm, Observed, PlacedBody, number

_ARM = np.array([name[2:] in ("clavicle", "upper_arm", "forearm", "hand") for name in SEGMENT_NAMES])
_FOREARM = np.array([name[2:] in ("forearm", "hand") for name in SEGMENT_NAMES])


class Contacts(eqx.Module):
    """Nearest capsule of trunk, head and legs to each ball of forearms and hands.

    Attributes:
        relative: Coefficients of all balls' displacements in the motion of a forearm ball relative to its nearest
            capsule.
        depth: Penetration of the ball beyond what is allowed (m).
    """

    relative: Float[Array, "forearms balls"]
    normal: Float[Array, "forearms 3"]
    centres: Float[Array, "balls 3"]
    depth: Float[Array, " forearms"]


class ArmCollision(AbstractTerm):
    """Depth by which the balls of forearms and hands penetrate any capsule that is not of an arm.

    Attributes:
        share: Share of an arm's radius that must stay outside; below one, because flesh is soft.
        limit: Depth (m) beyond which the cost does not grow.
    """

    needs_graph = False

    body: Body
    weight: Float[Array, ""] = eqx.field(converter=number, default=1.0)
    share: Float[Array, ""] = eqx.field(converter=number, default=0.6)
    limit: Float[Array, ""] = eqx.field(converter=number, default=0.1)

    def correspond(self, body: PlacedBody, observed: Observed) -> Contacts:
        """Nearest capsule, normal and depth of each ball."""
        links, radii = self.body.links, jnp.asarray(self.body.radii)
        forearms = np.flatnonzero(_FOREARM[self.body.segments]).astype(np.int32)
        links = links[~_ARM[self.body.segments][links].any(1)]
        centres = jnp.asarray(ball_centres(self.body, body.origins, body.rotations))
        balls, ends, capsule_radii = centres[forearms], centres[links], radii[links]
        which = jnp.argmin(all_distances(balls, ends, capsule_radii), 1).astype(jnp.int32)
        distance, part, normal = toward_capsule(balls, ends[which], capsule_radii[which])
        numbers = np.arange(len(radii), dtype=np.int32)[None]
        first, last = ((jnp.asarray(links)[which, end][:, None] == numbers).astype(part.dtype) for end in (0, 1))
        own = (forearms[:, None] == numbers).astype(np.float32)
        relative = own - (1 - part)[:, None] * first - part[:, None] * last
        return Contacts(relative, normal, centres, self.share * radii[forearms] - distance)

    def residual(self, body: PlacedBody, observed: Observed, fixed: Contacts) -> Float[Array, " forearms"]:
        """Depths of penetration (m), zero outside."""
        moved = jnp.asarray(ball_centres(self.body, body.origins, body.rotations)) - fixed.centres
        return jnp.maximum(fixed.depth - (fixed.normal * (fixed.relative @ moved)).sum(-1), 0.0)

    def cost(self, body: PlacedBody, observed: Observed) -> Float[Array, ""]:
        """Sum of squared depths (m^2), each constant beyond `limit`."""
        depth = jnp.maximum(self.correspond(body, observed).depth, 0.0)
        return jnp.minimum(depth**2, self.limit**2).sum()

    def collision_costs(
        self,
        points: Float[Array, "balls 3"],
        radii: Float[Array, " balls"],
        ends: Float[Array, "capsules 2 3"],
        capsule_radii: Float[Array, "capsules 2"],
    ) -> Float[Array, " balls"]:
        """Squared depths (m^2), each constant beyond `limit`."""
        _, distance = nearest_capsule(points, ends, capsule_radii)
        return jnp.minimum(jnp.maximum(self.share * radii - distance, 0.0) ** 2, self.limit**2)
