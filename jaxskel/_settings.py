"""How to reconstruct: everything a user may choose, in one object."""

from collections.abc import Callable

import equinox as eqx
import numpy as np
from jaxtyping import Float

from ._body import Body
from ._head import HeadBall, HighestVoxel, RootFinder
from ._levenberg_marquardt import LevenbergMarquardt, default_solver
from ._limbs import HANDLESS_DESCRIPTOR, PAPER_DESCRIPTOR
from ._match import DtwMatcher, Matcher
from ._refine import Solver
from ._solve import Search
from ._track import Tracking
from .parametrisations import ExactBones, HingedLimbs, Parametrisation
from .terms import Objective, paper_objective, volume_objective


class Settings(eqx.Module):
    """How to reconstruct. By default the graph proposes poses and the volume of the hull decides, see `Search`."""

    spacing: float = 0.015
    """Edge length of a voxel (m)."""
    box: Float[np.ndarray, "2 3"] | None = None
    """Lower and upper corner of what to carve, in the recording's world (m); by default around the silhouettes."""
    min_views: int | None = None
    """Cameras that must see a voxel for it to be occupied; by default 3, with fewer than six cameras 2."""
    max_misses: int | None = None
    """k-of-n voting: so many cameras may see background at an occupied voxel; by default judged by the silhouettes."""
    root: RootFinder = HeadBall()
    """Where the graph starts: on the ball of the head, or, as in the paper, at the `HighestVoxel`."""
    min_branch: float = 0.24
    """Shorter branches of the graph are pruned (m)."""
    matcher: Matcher = DtwMatcher()
    descriptor: tuple[int, ...] = HANDLESS_DESCRIPTOR
    """Labels whose geodesics describe neck and pelvis (Eq. 5)."""
    search: Search | None = Search()
    """Poses to refine: searched for in the hull, or, where None, the one that the labelled graph gives."""
    tracking: Tracking | None = None
    """Follow the person from frame to frame instead of searching in every frame; needs a search."""
    body: Body | None = None
    """The subject's body, if it has been calibrated before; by default it is calibrated on the recording."""
    objective: Objective | Callable[[Body], Objective] = volume_objective
    """What the refinement minimises: an objective, or a function that makes one for the subject's body."""
    parametrisation: Parametrisation = HingedLimbs()
    solver: Solver = eqx.field(default_factory=default_solver)
    rounds: int = 2
    max_steps: int = 16

    def objective_for(self, body: Body) -> Objective:
        """The objective for a subject."""
        return self.objective if isinstance(self.objective, Objective) else self.objective(body)


def paper_settings() -> Settings:
    """The paper's method, faithful.

    The head is the highest voxel, Eq. 5 describes inner nodes by all end nodes, every view carves, and the pose of the
    labelled graph is refined against the graph, bone lengths kept. What the graph lies nearest to is looked up often:
    that says more than the last percent of the cost does.
    """
    return Settings(
        max_misses=0, root=HighestVoxel(), descriptor=PAPER_DESCRIPTOR, search=None, objective=paper_objective(),
        parametrisation=ExactBones(), solver=LevenbergMarquardt(rtol=1e-2, atol=3e-3, ftol=1e-2), rounds=5,
    )  # fmt: skip
