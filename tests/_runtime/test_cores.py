"""Threads of this process's own, and of the libraries that it loads."""

import os
import subprocess
import sys

CODE = """
import numpy as np
from threadpoolctl import threadpool_info
from jaxskel._runtime.cores import one_solver_thread
one_solver_thread()
import scipy.linalg  # a library of its own, loaded later
np.linalg.solve(np.eye(300), np.ones(300))
print(sorted({each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}))
"""


def test_numpy_and_scipy_solve_in_one_thread():
    known = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", CODE], env=known, capture_output=True, text=True)
    assert done.stdout.strip() == "[1]", done.stderr
