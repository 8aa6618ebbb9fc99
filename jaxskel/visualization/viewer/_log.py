"""Sends a recording to the viewer: first everything that is constant over time, then frame by frame."""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float, Int

from ...pipeline import Settings, prepare
from ...poses import STATUS_NAMES, WITH_POSE, Poses
from ...recording import Recording, recording_rows
from .. import node_labels
from ._figures import Figure, figures_of
from ._rerun import rr
from ._skeleton import log_skeleton
from ._stages import FrameStages, stages_of_frames
from ._views import log_cameras, log_projections, log_silhouettes

# Colour and radius of hull points: touching points would hide graph and skeleton inside, as the viewer draws them
# opaque.
_HULL, _DOT = (150, 150, 150), 0.15
_GRAPH = (224, 138, 0)
_NODE, _EDGE = 0.02, 0.004  # m


def log_recording(
    stream: rr.RecordingStream,
    recording: Recording,
    poses: Poses | Mapping[str, Poses] | None = None,
    settings: Settings | None = None,
    frames: slice = slice(None),
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Log cameras, silhouettes, hull, labelled skeletal graph, and, if there are poses, skeleton and confidence.

    Everything is in the recording's world (m). Frames have two timelines: ``frame``, their number in the source
    material, and ``time``, seconds from the first frame of the recording. Whatever a frame lacks is logged as empty, so
    that nothing of the previous frame remains visible. Silhouettes are read a batch at a time.

    Args:
        stream: Destination.
        recording: Silhouettes and cameras.
        poses: Poses of all its frames, or of some; then only these frames are shown. Nothing is reconstructed. Of
            several people, poses by name, of the same frames: each has a colour, and a place of their own in the tree.
        settings: Settings for hull and graph.
        frames: Frames of the recording to show, counted from 0.
        on_frame: Called with the number of frames logged and the total number.

    Returns:
        The number of frames logged.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
    """
    figures = figures_of(poses)
    rows, places = _shown(recording, figures, frames)
    settings = settings or Settings()
    prepared = prepare(recording, settings, calibrate=False)
    stream.log("world", _up_axis(recording.up), static=True)
    log_cameras(stream, recording.cameras)
    for figure in figures:
        of = "" if figure.name is None else f"{figure.name}: "
        for name, title in (("joints", "joints, mean"), ("sides", "left and right")):
            stream.log(figure.under("confidence") + f"/{name}", rr.SeriesLines(names=of + title), static=True)
    labels = node_labels(prepared.skeleton.template)
    stages = stages_of_frames(recording, rows, prepared, settings)
    for done, (row, place, found) in enumerate(zip(rows.tolist(), places.tolist(), stages, strict=True), 1):
        number = int(recording.frame_index[row])
        stream.set_time("frame", sequence=number)
        stream.set_time("time", duration=row / recording.fps)
        log_silhouettes(stream, recording.cameras, found.silhouettes)
        _log_stages(stream, found, labels, settings.hull.spacing / prepared.scale)
        if poses is None:
            _log_status(stream, "status", number, int(found.status))
        for figure in figures:
            _log_status(stream, figure.under("status"), number, int(figure.poses.status[place]))
            _log_pose(stream, recording, figure, place)
        if on_frame is not None:
            on_frame(done, len(rows))
    return len(rows)


def check_shown(recording: Recording, poses: Poses | Mapping[str, Poses] | None, frames: slice) -> None:
    """Check whether there is something to show, before anything is written or opened.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
    """
    _shown(recording, figures_of(poses), frames)


def _shown(
    recording: Recording, figures: list[Figure], frames: slice
) -> tuple[Int[np.ndarray, " frames"], Int[np.ndarray, " frames"]]:
    """Frames of the recording to show, counted from 0, ascending, and the corresponding frames of the poses."""
    rows = recording_rows(recording, figures[0].poses) if figures else np.arange(len(recording))
    places = np.argsort(rows, kind="stable")
    chosen = np.isin(rows[places], np.arange(len(recording))[frames])
    if not chosen.any():
        what = "no frame with an entry in the poses" if figures else "no frame"
        raise ValueError(f"{recording.name}: {what} is among those chosen; frames count from 0 to {len(recording) - 1}")
    places = places[chosen]
    return rows[places], places


def _up_axis(up: str) -> rr.components.ViewCoordinates:
    return getattr(rr.ViewCoordinates, f"RIGHT_HAND_{up[1]}_{'UP' if up[0] == '+' else 'DOWN'}")


def _log_stages(stream: rr.RecordingStream, found: FrameStages, names: tuple[str, ...], spacing: float) -> None:
    stream.log("world/hull", rr.Points3D(_single(found.surface), radii=_DOT * spacing, colors=_HULL))
    stream.log("world/graph", rr.LineStrips3D(_single(found.edges), radii=_EDGE, colors=_GRAPH))
    there = np.isfinite(found.named).all(1)
    labels = [names[i] for i in np.flatnonzero(there)]
    nodes = rr.Points3D(_single(found.named[there]), radii=_NODE, colors=_GRAPH, labels=labels, show_labels=True)
    stream.log("world/labels", nodes)


def _log_status(stream: rr.RecordingStream, path: str, number: int, status: int) -> None:
    level = rr.TextLogLevel.INFO if status in WITH_POSE else rr.TextLogLevel.WARN
    stream.log(path, rr.TextLog(f"frame {number}: {STATUS_NAMES[status]}", level=level))


def _log_pose(stream: rr.RecordingStream, recording: Recording, figure: Figure, place: int) -> None:
    log_skeleton(stream, figure, place)
    log_projections(stream, recording.cameras, figure, place)
    confidence, poses = figure.under("confidence"), figure.poses
    stream.log(f"{confidence}/joints", rr.Scalars(float(poses.confidence[place].mean())))
    stream.log(f"{confidence}/sides", rr.Scalars(float(poses.side_confidence[place])))


def _single(points: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    return points.astype(np.float32)
