"""A pytest plugin for the notebooks: their kernels talk over files (IPC), and not over TCP ports.

Jupyter looks for free ports and closes them again; the kernel opens them when it has started. On a busy machine that is
seconds later, and another process may hold one by then: "Kernel died before replying to kernel_info".
"""

import os
from tempfile import TemporaryDirectory

from jupyter_client.manager import KernelManager

# Sockets lie here as long as this process runs. Their paths have to be short, so they are not beside the notebooks.
_SOCKETS = TemporaryDirectory(prefix="kernels-")
_made = KernelManager.__init__


def _made_over_files(manager, *args, **settings):
    _made(manager, *args, transport="ipc", ip=os.path.join(_SOCKETS.name, "kernel"), **settings)


KernelManager.__init__ = _made_over_files
