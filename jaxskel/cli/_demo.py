"""`jaxskel demo`: runs the whole method on a synthetic scene."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from .._runtime.picture_files import write_image
from ..io.poses import write_poses
from ..io.recordings import write_recording
from ..pipeline import Settings, compile_ahead
from ..poses import Poses, score_poses, score_table
from ..recording import Recording, unpack_silhouettes
from ..synthetic import camera_ring, make_scene
from ..visualization import draw_silhouette, draw_skeleton, tile
from ._evaluate import SCORE_FILES, write_score
from ._outputs import check_output
from ._progress import StageTimes, progress_bar, reconstruct_with_progress, summary
from ._ranges import check_number
from ._run import POSES_FILES
from ._say import say

_FILES = ("scene.npz", *POSES_FILES, *SCORE_FILES, "views.png", "stages.png")


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    frames: Annotated[int, typer.Option(help="Length of the scene.")] = 64,
    cameras: Annotated[int, typer.Option(help="Cameras around the person.")] = 8,
) -> None:
    """Make a scene, reconstruct it, score it against its truth, and draw it."""
    check_number("--frames", frames, 1, 10_000, "a number of frames")
    check_number("--cameras", cameras, 3, 64, "a number of cameras")
    check_output(output, _FILES)
    rig = camera_ring(cameras)
    compile_ahead(rig, Settings())
    progress, task = progress_bar("filming", frames)
    with progress:
        recording = make_scene(frames, cameras=rig, on_frame=lambda done: progress.update(task, completed=done))
    write_recording(output / "scene.npz", recording, made_by="jaxskel demo")

    times = StageTimes()
    poses, prepared = reconstruct_with_progress(recording, Settings(), times)
    write_poses(output, poses)
    assert recording.truth is not None
    result = score_poses(poses, recording.truth.joints, recording.truth.template)
    write_score(output, result)
    write_image(output / "views.png", _views(recording, poses))
    from ..visualization.figures import plot_stages, telling_frame

    frame = telling_frame(poses) if poses.has_pose.any() else 0
    plot_stages(recording, prepared, Settings(), frame, output / "stages.png")

    console = Console()
    if times.later_frames:
        console.print(_speed(times))
    console.print(score_table({"demo": result}))
    say(summary(poses, times))
    say(f"{output}: {', '.join(_FILES)}")


def _speed(times: StageTimes) -> Table:
    table = Table(title=f"speed by stage, {times.later_frames} frames after start-up")
    table.add_column("stage")
    table.add_column("ms a frame", justify="right")
    table.add_column("fps", justify="right")
    stages = times.later | {"all": sum(times.later.values())}
    for stage, seconds in stages.items():
        per_frame = seconds / times.later_frames
        style = "bold" if stage == "all" else None
        table.add_row(stage, f"{1e3 * per_frame:.1f}", f"{1 / max(per_frame, 1e-9):.0f}", style=style)
    return table


def _views(recording: Recording, poses: Poses) -> np.ndarray:
    """Skeletons over the silhouettes: frames from left to right, two views of each."""
    chosen = np.unique(np.linspace(0, len(recording) - 1, 6).astype(int))
    images, labels = [], []
    for view in (0, min(3, len(recording.cameras) - 1)):
        for frame in chosen:
            w, h = recording.cameras.size[view]
            mask = unpack_silhouettes(recording.silhouettes[frame, view], 8 * recording.silhouettes.shape[3])
            image = draw_silhouette(mask)[:h, :w].copy()
            draw_skeleton(image, recording.cameras, view, poses.joints[frame], poses.template)
            images.append(image)
            labels.append(f"frame {frame}, {recording.cameras.names[view]}")
    return tile(images, labels, columns=len(chosen), width=320)
