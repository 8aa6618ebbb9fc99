"""Refinement of poses by constrained least squares (Sect. 3.3), for one frame, a batch, or a whole sequence.

In: start poses, the observed graph and outlines, an objective (`terms`), unknowns (`parametrisations`) and a solver
(`solvers`). Out: `Refined` poses with the cost of each term.
"""

from . import parametrisations as parametrisations
from . import solvers as solvers
from . import terms as terms
from ._arguments import check_choices as check_choices
from ._arguments import check_objective as check_objective
from ._frames import Refined as Refined
from ._frames import Solver as Solver
from ._frames import refine_frame as refine_frame
from ._frames import refine_frames as refine_frames
from ._frames import refine_frames_ahead as refine_frames_ahead
from ._learn_weights import Learned as Learned
from ._learn_weights import learn_weights as learn_weights
from ._sequence import refine_sequence as refine_sequence
