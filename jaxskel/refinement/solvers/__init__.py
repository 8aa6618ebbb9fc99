"""Levenberg-Marquardt on normal equations, dense for single frames and banded for sequences.

They are solvers of Optimistix; any other of its solvers will do.
"""

from ._banded import BandedEquations as BandedEquations
from ._banded import Coupled as Coupled
from ._banded import sequence_solver as sequence_solver
from ._levenberg_marquardt import NormalEquationsLM as NormalEquationsLM
from ._levenberg_marquardt import default_solver as default_solver
