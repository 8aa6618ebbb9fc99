"""Terms of the refinement objective: one residual a file, a few readable lines for one frame each.

A term is an `AbstractTerm`: a Module with a weight and a `residual`. What it needs to look up (closest points, say)
it looks up in `correspond`, once before each inner solve, so that the solver sees a smooth function.
"""

from ._base import AbstractTerm as AbstractTerm
from ._base import Objective as Objective
from ._base import Observed as Observed
from ._base import PlacedBody as PlacedBody
from ._base import place as place
from ._end_nodes import EndNodeAttraction as EndNodeAttraction
from ._graph_attraction import GraphAttraction as GraphAttraction
from ._inner_nodes import InnerNodeAttraction as InnerNodeAttraction
from ._rest_prior import RestPrior as RestPrior


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
