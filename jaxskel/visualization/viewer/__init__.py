"""The viewer: an interactive 3D view of a recording over time.

In: a recording and its poses. Out: a window, or a file, of the optional package rerun.
"""

from ._log import log_recording as log_recording
from ._show import has_display as has_display
from ._show import save_view as save_view
from ._show import show_view as show_view
