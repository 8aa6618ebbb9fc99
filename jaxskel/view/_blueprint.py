"""How the viewer's window is laid out: the scene large, the views beside it, confidence and status below."""

import numpy as np

from .._recording import Recording
from ._rerun import rrb
from ._views import camera_path


def blueprint(recording: Recording, with_poses: bool) -> rrb.Blueprint:
    """Lay out the window for a recording; there is confidence to plot only with poses."""
    views = [rrb.Spatial2DView(origin=camera_path(name), name=name) for name in recording.cameras.names]
    above = rrb.Horizontal(
        rrb.Spatial3DView(origin="world", name="scene"), rrb.Grid(*views, name="views"), column_shares=[3, 2]
    )
    below: list[rrb.View] = [rrb.TextLogView(origin="status", name="status")]
    if with_poses:
        confidence = rrb.TimeSeriesView(
            origin="confidence", name="confidence", axis_y=rrb.ScalarAxis(range=(0.0, 1.0), zoom_lock=True)
        )
        below.insert(0, confidence)
    # Numbers of frames go up by more than one where only some of the material's frames were taken.
    index = recording.frame_index
    step = float(np.median(np.diff(index))) if len(index) > 1 else 1.0
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Horizontal(*below), row_shares=[4, 1]),
        rrb.TimePanel(timeline="frame", fps=max(1.0, step) * recording.fps),
        rrb.SelectionPanel(state="collapsed"),
    )
