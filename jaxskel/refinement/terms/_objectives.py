"""The objectives that the presets minimise."""

from ...body import LINKS, Body
from ._arm_collision import ArmCollision
from ._base import Objective
from ._contour_contact import ContourContact
from ._end_nodes import EndNodeAttraction
from ._graph_attraction import GraphAttraction
from ._hinges import HingeLimits
from ._inner_nodes import InnerNodeAttraction
from ._inside_silhouettes import InsideSilhouettes
from ._rest_prior import RestPrior, firmness


def paper_objective() -> Objective:
    """The paper's objective (Sect. 3.3): bones drawn to the graph and its labelled nodes, bone lengths kept.

    Weights are chosen for residuals of decimetres (100 per square metre), so that the cost of a good frame is near
    one: the damping of Optimistix' Levenberg-Marquardt is absolute.
    """
    return Objective(
        {
            "graph": GraphAttraction(weight=100.0),
            "end_nodes": EndNodeAttraction(weight=400.0),
            "inner_nodes": InnerNodeAttraction(weight=100.0),
            "rest": RestPrior(weight=2.0),
        }
    )


def volume_objective(body: Body) -> Objective:
    """Fit a body with volume to the silhouettes: it touches their outlines, stays inside, and bends as limbs can.

    Needs ``observed.contours`` and ``observed.silhouettes``; uses no labels of the graph, so it needs a pose to start
    from in which each limb is nearer to its own part of the outlines than to another. Weights as in `paper_objective`:
    the cost of a well explained frame is of the order of ten. A capsule counts the same in a body that lacks others.
    """
    share = len(body.links) / len(LINKS)
    return Objective(
        {
            "contours": ContourContact(body=body, weight=1.2e5),
            "inside": InsideSilhouettes(body=body, weight=7e4 * share),
            "collision": ArmCollision(body=body, weight=800.0),
            "hinges": HingeLimits(skeleton=body.skeleton, weight=40.0),
            "rest": RestPrior(
                weight=0.2,
                firmness=firmness(chest=8.0, head=5.0, clavicle=70.0, thigh=0.7, hand=6.0, foot=6.0),
            ),
        }
    )
