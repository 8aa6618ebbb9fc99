"""An interactive 3D view of a recording over time, in the viewer of the package rerun, an extra."""

from ._log import log_recording as log_recording
from ._show import has_display as has_display
from ._show import save_view as save_view
from ._show import show_view as show_view
