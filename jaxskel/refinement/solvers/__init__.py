"""Levenberg-Marquardt solvers on the normal equations: dense for single frames, banded for sequences.

They are Optimistix solvers; any other Optimistix solver can take their place.
"""

from ._banded import BandedEquations as BandedEquations
from ._banded import Coupled as Coupled
from ._banded import for_sequences as for_sequences
from ._banded import sequence_solver as sequence_solver
from ._levenberg_marquardt import NormalEquations as NormalEquations
from ._levenberg_marquardt import NormalEquationsLM as NormalEquationsLM
from ._levenberg_marquardt import default_solver as default_solver
