"""Interface of a parametrisation: how the refinement writes the skeleton of one frame as unknowns."""

from typing import Any, Protocol, runtime_checkable

import equinox as eqx
from jaxtyping import Array, Float

from ...body import Pose, Skeleton
from ..terms import PlacedBody, place


@runtime_checkable
class Parametrisation(Protocol):
    """Writes the skeleton of one frame relative to a base, which may be any tree of arrays. World coordinates (m)."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> Any:
        """The base for a pose."""
        ...

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at any base: zeros."""
        ...

    def retract(self, unknowns: Float[Array, " unknowns"], base: Any, skeleton: Skeleton) -> Any:
        """The new base after a change by the unknowns."""
        ...

    def placed(self, base: Any, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m)."""
        ...

    def reached(self, unknowns: Float[Array, " unknowns"], base: Any, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world after `retract` by the unknowns; solvers differentiate this function."""
        ...

    def constraint_residuals(self, base: Any, skeleton: Skeleton) -> dict[str, Float[Array, "..."]]:
        """Weighted residuals of constraints that hold only approximately, by name; added to those of the objective."""
        ...

    def settled(self, base: Any, skeleton: Skeleton) -> Any:
        """The base for the next round, computed after a solve."""
        ...

    def pose(self, base: Any, skeleton: Skeleton) -> Pose:
        """The pose of the base; if bone lengths differ from the template's, it reproduces the joints approximately."""
        ...


class JointRotations(eqx.Module):
    """Common part of parametrisations whose base is the pose itself: bone lengths are exact, with no constraints."""

    def begin(self, pose: Pose, skeleton: Skeleton) -> Pose:
        """The pose itself."""
        return pose

    def unknowns(self, skeleton: Skeleton) -> Float[Array, " unknowns"]:
        """The unknowns at the base pose: zeros."""
        raise NotImplementedError

    def retract(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> Pose:
        """The pose after a change by the unknowns."""
        raise NotImplementedError

    def placed(self, base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m)."""
        return place(skeleton, base)

    def reached(self, unknowns: Float[Array, " unknowns"], base: Pose, skeleton: Skeleton) -> PlacedBody:
        """The skeleton in the world (m) after a change by the unknowns."""
        return self.placed(self.retract(unknowns, base, skeleton), skeleton)

    def constraint_residuals(self, base: Pose, skeleton: Skeleton) -> dict[str, Float[Array, "..."]]:
        """None: bone lengths are exact."""
        return {}

    def settled(self, base: Pose, skeleton: Skeleton) -> Pose:
        """The same pose."""
        return base

    def pose(self, base: Pose, skeleton: Skeleton) -> Pose:
        """The pose."""
        return base
