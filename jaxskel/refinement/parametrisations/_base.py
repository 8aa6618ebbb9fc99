"""What a parametrisation is: how the refinement writes the skeleton of one frame as unknowns."""

from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...body import Pose, Skeleton
from ..terms import PlacedBody, place


@runtime_checkable
class Parametrisation(Protocol):
    """Writes the skeleton of one frame relative to a base, which may be any tree of arrays."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> Any:
        """The base that stands for a pose."""
        ...

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns of any base: zeros."""
        ...

    def retract(self, unknowns: Float[Array, " unknowns"], base: Any, skeleton: Skeleton) -> Any:
        """The base that the unknowns lead to."""
        ...

    def placed(self, base: Any, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world."""
        ...

    def reached(self, unknowns: Float[Array, " unknowns"], base: Any, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world that the unknowns lead to: `placed` after `moved`, for solvers to differentiate."""
        ...

    def constraint_residuals(self, base: Any, skeleton: Skeleton) -> dict[str, Float[Array, "..."]]:
        """Weighted residuals of what is not exact by itself, by name; they join those of the objective."""
        ...

    def settled(self, base: Any, skeleton: Skeleton) -> Any:
        """The base for the next round, after a solve."""
        ...

    def pose(self, base: Any, skeleton: Skeleton) -> Pose:
        """The pose; with lengths that are not the template's, it places only nearly the same joints."""
        ...


class JointRotations(eqx.Module):
    """What parametrisations have in common whose base is the pose itself: lengths are exact, nothing else is held."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> Pose:
        """The pose."""
        return pose

    def unknowns(self) -> Float[Array, " unknowns"]:
        """The unknowns of the base pose: zeros."""
        raise NotImplementedError

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose that the unknowns stand for."""
        raise NotImplementedError

    def placed(self, base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world."""
        return place(skeleton, base)

    def reached(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world that the unknowns lead to."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: Pose, skeleton: Skeleton) -> dict[str, Float[Array, "..."]]:
        """Nothing."""
        return {}

    def settled(self, base: Pose, skeleton: Skeleton) -> Pose:
        """The same pose."""
        return base

    def pose(self, base: Pose, skeleton: Skeleton) -> Pose:
        """The pose."""
        return base


def perpendicular(direction: Float[Array, "n 3"]) -> tuple[Float[Array, "n 3"], Float[Array, "n 3"]]:
    """Two unit vectors across each unit vector (Duff et al. 2017, without the branch)."""
    x, y, z = direction.T
    sign = jnp.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        jnp.stack([1.0 + sign * x * x * a, sign * b, -sign * x], -1),
        jnp.stack([b, sign + y * y * a, -y], -1),
    )
