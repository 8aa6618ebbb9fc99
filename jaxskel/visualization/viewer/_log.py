"""Sends a recording to the viewer: first everything that is constant over time, then frame by frame."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from ...pipeline import Settings, prepare
from ...poses import STATUS_NAMES, WITH_POSE, Poses
from ...recording import Recording, recording_rows
from .. import node_labels, thickness
from ._rerun import rr
from ._skeleton import body_points, log_skeleton
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
    poses: Poses | None = None,
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
        poses: Poses of all its frames, or of some; then only these frames are shown. Nothing is reconstructed.
        settings: Settings for hull and graph.
        frames: Frames of the recording to show, counted from 0.
        on_frame: Called with the number of frames logged and the total number.

    Returns:
        The number of frames logged.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
    """
    rows, places = shown_frames(recording, poses, frames)
    settings = settings or Settings()
    prepared = prepare(recording, settings, calibrate=False)
    stream.log("world", _up_axis(recording.up), static=True)
    log_cameras(stream, recording.cameras)
    if poses is not None:
        for name, title in (("joints", "joints, mean"), ("sides", "left and right")):
            stream.log(f"confidence/{name}", rr.SeriesLines(names=title), static=True)
    labels = node_labels(prepared.skeleton.template)
    thick = 1.0 if poses is None else thickness(poses.template, np.concatenate([poses.joints, poses.tips], 1))
    stages = stages_of_frames(recording, rows, prepared, settings)
    for done, (row, place, found) in enumerate(zip(rows.tolist(), places.tolist(), stages, strict=True), 1):
        stream.set_time("frame", sequence=int(recording.frame_index[row]))
        stream.set_time("time", duration=row / recording.fps)
        log_silhouettes(stream, recording.cameras, found.silhouettes)
        _log_stages(stream, found, labels, settings.hull.spacing / prepared.scale)
        status = found.status if poses is None else poses.status[place]
        _log_status(stream, int(recording.frame_index[row]), int(status))
        if poses is not None:
            _log_pose(stream, recording, poses, place, thick)
        if on_frame is not None:
            on_frame(done, len(rows))
    return len(rows)


def shown_frames(
    recording: Recording, poses: Poses | None, frames: slice
) -> tuple[Int[np.ndarray, " frames"], Int[np.ndarray, " frames"]]:
    """Frames of the recording to show, counted from 0, ascending, and the corresponding frames of the poses.

    Raises:
        ValueError: Poses of another recording, or no frame to show.
    """
    rows = np.arange(len(recording)) if poses is None else recording_rows(recording, poses)
    places = np.argsort(rows, kind="stable")
    chosen = np.isin(rows[places], np.arange(len(recording))[frames])
    if not chosen.any():
        what = "no frame" if poses is None else "no frame with an entry in the poses"
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


def _log_status(stream: rr.RecordingStream, number: int, status: int) -> None:
    level = rr.TextLogLevel.INFO if status in WITH_POSE else rr.TextLogLevel.WARN
    stream.log("status", rr.TextLog(f"frame {number}: {STATUS_NAMES[status]}", level=level))


def _log_pose(stream: rr.RecordingStream, recording: Recording, poses: Poses, place: int, thick: float) -> None:
    points = body_points(poses, place)
    log_skeleton(stream, poses.template, points, poses.confidence[place].astype(np.float64), thick)
    log_projections(stream, recording.cameras, poses.template, points)
    stream.log("confidence/joints", rr.Scalars(float(poses.confidence[place].mean())))
    stream.log("confidence/sides", rr.Scalars(float(poses.side_confidence[place])))


def _single(points: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    return points.astype(np.float32)
