"""Layout of the viewer's window: a large scene, the views beside it, confidence and status below."""

import numpy as np
from jaxtyping import Float

from ...cameras import Cameras
from ...recording import Recording, rotation_to_z_up
from ._rerun import rrb
from ._views import camera_path

# Initial distance and height of the viewpoint relative to the person (m), which shows a person with raised arms whole.
_FAR, _ABOVE = 3.5, 0.6


def blueprint(recording: Recording, with_poses: bool) -> rrb.Blueprint:
    """Lay out the window for a recording; confidence is plotted only with poses."""
    views = [rrb.Spatial2DView(origin=camera_path(name), name=name) for name in recording.cameras.names]
    above = rrb.Horizontal(
        rrb.Spatial3DView(origin="world", name="scene", eye_controls=_eye(recording)),
        rrb.Grid(*views, name="views"),
        column_shares=[3, 2],
    )
    below: list[rrb.View] = [rrb.TextLogView(origin="status", name="status")]
    if with_poses:
        confidence = rrb.TimeSeriesView(
            origin="confidence", name="confidence", axis_y=rrb.ScalarAxis(range=(0.0, 1.05), zoom_lock=True)
        )
        below.insert(0, confidence)
    # Frame numbers increase by more than one if the recording has only some of the material's frames.
    index = recording.frame_index
    step = float(np.median(np.diff(index))) if len(index) > 1 else 1.0
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Horizontal(*below), row_shares=[4, 1]),
        rrb.TimePanel(timeline="frame", fps=max(1.0, step) * recording.fps, state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _eye(recording: Recording) -> rrb.EyeControls3D:
    """Initial viewpoint: on the side of the first camera, but nearer to the person."""
    cameras = recording.cameras
    target, up = _looked_at(cameras), rotation_to_z_up(recording.up)[2]
    towards = cameras.centres[0] - target
    towards -= (towards @ up) * up
    length = float(np.linalg.norm(towards))
    # A camera straight above defines no side.
    towards = rotation_to_z_up(recording.up)[0] if length < 1e-6 else towards / length
    return rrb.EyeControls3D(position=target + _FAR * towards + _ABOVE * up, look_target=target)


def _looked_at(cameras: Cameras) -> Float[np.ndarray, "3"]:
    """The point nearest to the optical axes of all cameras (world, m)."""
    axes = np.asarray(cameras.R)[:, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    # Parallel axes have a line of such points; take the one nearest to the origin.
    point, *_ = np.linalg.lstsq(across.sum(0), np.einsum("cij,cj->i", across, cameras.centres), rcond=1e-6)
    return point
