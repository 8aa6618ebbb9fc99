"""The objectives that the presets minimise: the paper's, and one for a body with volume."""

from ...body import LINKS, Body
from ._arm_collision import ArmCollision
from ._arm_prior import usual_arms
from ._base import Objective
from ._contour_contact import ContourContact
from ._end_nodes import EndNodeAttraction
from ._graph_attraction import GraphAttraction
from ._hinges import HingeLimits
from ._hip_limits import HipLimits
from ._inner_nodes import InnerNodeAttraction
from ._inside_silhouettes import InsideSilhouettes
from ._rest_prior import RestPrior, firmness
from ._shoulder_limits import ShoulderLimits

# A difference of costs that makes a pose less likely by a factor of e, see `_RIVAL_COST` in `search/_uncertainty.py`.
_EVIDENCE = 0.7


def paper_objective() -> Objective:
    """The paper's objective (Sect. 3.3): bones are attracted to the graph and its labelled nodes; lengths are kept.

    A weight of 100 per square metre makes a residual of 0.1 m cost one, so that a good frame costs about one. This
    scale matters, because the damping of Optimistix' Levenberg-Marquardt is absolute.
    """
    return Objective(
        {
            "graph": GraphAttraction(weight=100.0),
            "end_nodes": EndNodeAttraction(weight=400.0),
            "inner_nodes": InnerNodeAttraction(weight=100.0),
            "rest": RestPrior(weight=2.0),
        }
    )


_OUTLINES = 1.2e5
INSIDE_OVER_OUTLINES = 7.16 / 12
"""Weight of staying inside the silhouettes, a mean over all capsules, over that of touching their outlines: 7 / 12 with
the 43 capsules of before hair was one."""


def volume_objective(body: Body) -> Objective:
    """Fit a body with volume to the silhouettes: touch their outlines, stay inside, respect the limits of joints.

    Needs ``observed.contours`` and ``observed.silhouettes`` but no labels of the graph, so each limb of the start pose
    must be nearer to its own part of the outlines than to another. Weights are scaled so that a well explained frame
    costs about ten. A capsule has the same weight in a body that lacks others.
    """
    share = len(body.links) / len(LINKS)
    return Objective(
        {
            "contours": ContourContact(body=body, weight=_OUTLINES),
            "inside": InsideSilhouettes(body=body, weight=_OUTLINES * INSIDE_OVER_OUTLINES * share),
            "collision": ArmCollision(body=body, weight=800.0),
            "hinges": HingeLimits(skeleton=body.skeleton, weight=40.0),
            "shoulders": ShoulderLimits(skeleton=body.skeleton, weight=300.0),
            "hips": HipLimits(weight=300.0),
            "rest": RestPrior(
                weight=0.2,
                firmness=firmness(chest=8.0, head=5.0, clavicle=70.0, thigh=0.7, hand=6.0, foot=6.0),
            ),
        }
    )


def search_objective(body: Body) -> Objective:
    """What decides between hypotheses: `volume_objective`, and how people hold their arms.

    The refinement does without that: it would pull hands that the silhouettes show but a little (two films with three
    and four cameras: by one to two centimetres).
    """
    return volume_objective(body).plus(arms=usual_arms(weight=_EVIDENCE))
