"""`jaxskel live`: poses while the person moves, from cameras or from a recording that is played."""

import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, TextColumn

from ..body import HUMAN_15
from ..io.poses import JOURNAL_FILE, PosesJournal, read_poses, write_poses
from ..io.recordings import has_cameras, read_recording, read_rig
from ..io.subjects import read_body
from ..live import (
    VMC_PORT,
    Captures,
    Moment,
    OscSender,
    Playback,
    PoseServer,
    Sink,
    Source,
    Tally,
    WallClock,
    check_avatar,
    play,
)
from ..pipeline import HullSettings, Stream, check_apart, warm_up
from ..poses import STATUS_NAMES, Poses
from ..recording import Recording
from ..search import Tracking
from ._objective import ObjectiveOption, with_objective
from ._outputs import check_output, files_of
from ._poseless import end_without_pose
from ._progress import progress_bar, summary
from ._ranges import check_number
from ._run import POSES_FILES, MaxMisses, Preset, PresetOption, Recorded, Subject, make_settings
from ._say import say, warn
from ._template import TemplateOption, files_of_template, template_of

_INTERRUPTED = 130  # exit code
_LONGEST = 1e6  # s
_FASTEST = 1e4  # frames per second
_PORTS = 65535
_TELL_EVERY = 0.5  # s between two lines of progress
_OTHER_RATE = 0.05  # share by which the frame rate may be another than the stated one
_AT_ONCE = 32  # frames whose silhouettes are made at once


def live(
    source: Recorded,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write to.")],
    subject: Subject = None,
    max_misses: MaxMisses = None,
    preset: PresetOption = Preset.DEFAULT,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second at which a recording is played, if not its own.")
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Play a recording again and again.")] = False,
    seconds: Annotated[float | None, typer.Option(help="End after this time (s).")] = None,
    port: Annotated[int, typer.Option(help="Port of the page that shows the skeleton; 0 for any free one.")] = 0,
    no_page: Annotated[bool, typer.Option("--no-page", help="Do not show the skeleton in a browser.")] = False,
    osc: Annotated[
        str | None, typer.Option(metavar="HOST[:PORT]", help="Send poses to a program with an avatar, by VMC.")
    ] = None,
    objective: ObjectiveOption = None,
    template: TemplateOption = None,
) -> None:
    """Reconstruct frames as they come; show them in a browser, send them on, write poses.npz and poses.csv.

    Ctrl-C ends it, with everything written.
    """
    settings = make_settings(preset, HullSettings.spacing, max_misses, None, template=template_of(template))
    settings = settings if preset is Preset.PAPER else replace(settings, tracking=Tracking())
    settings = with_objective(settings, objective)
    check_apart(settings, "and a live session has one at a time; leave it out, or use `jaxskel run` afterwards")
    check_number("--fps", fps, 1e-3, _FASTEST, "frames per second")
    check_number("--seconds", seconds, 1e-3, _LONGEST, "a time in seconds")
    check_number("--port", port, 0, _PORTS, "a port, or 0 for a free one")
    target = None if osc is None else _host_and_port(osc)
    _check_new(output)
    others = [path for path in (subject, objective) if path is not None] + files_of_template(template)
    check_output(output, [*POSES_FILES, JOURNAL_FILE], [*files_of(source), *others])
    body = None if subject is None else read_body(subject)
    if has_cameras(source):
        if fps is not None or loop:
            raise ValueError(f"{source}: is of cameras, which run as they do; leave out --fps and --loop")
        frames: Source = Captures(read_rig(source), warn, seconds)
    else:
        frames = _playback(read_recording(source), fps, loop, seconds)
    rig = frames.rig
    known = rig.skeleton if body is None else body
    shown = HUMAN_15 if settings.template is None else settings.template.template
    if target is not None:
        check_avatar(shown)
    clock, tally = WallClock(), Tally(rig.fps)
    failed: Exception | None = None
    with ExitStack() as stack:
        sinks: list[Sink] = []
        try:
            if target is not None:
                sinks.append(stack.enter_context(OscSender(*target)))
            server = None if no_page else stack.enter_context(PoseServer(rig, port, settings.template))
            if server is not None:
                sinks.append(server)
        except ImportError as error:
            raise ValueError(str(error)) from None
        with Console(stderr=True).status("compiling"):
            warm_up(rig.cameras, settings, known)
        stream = stack.enter_context(Stream(rig.cameras, settings, known, rig.up, rig.fps))
        journal = PosesJournal(output / JOURNAL_FILE, rig.fps, rig.up, shown)
        stack.callback(journal.close)
        stack.enter_context(_stopped_by_signals(clock))
        if server is not None:
            say(f"{server.address} shows the skeleton; Ctrl-C ends the session")
        sinks.append(stack.enter_context(_progress()))
        try:
            play(frames, stream.push, [lambda poses, moment: journal.append(poses), *sinks], clock, tally)
        except (ValueError, OSError) as error:  # what came before it is written all the same
            failed = error
    _write(output, tally)
    if tally.rate is not None and abs(tally.rate / rig.fps - 1) > _OTHER_RATE:
        warn(f"{source}: gave {tally.rate:.1f} frames per second, but fps is {rig.fps:g}: times are wrong; correct fps")
    if failed is not None:
        raise failed
    if clock.stopped():
        raise typer.Exit(_INTERRUPTED)


def _check_new(folder: Path) -> None:
    """Refuse a folder that holds poses: those of a live session cannot be computed again."""
    journal = folder / JOURNAL_FILE
    if os.path.lexists(journal):
        raise ValueError(
            f"{journal}: is left from a session that was killed; `jaxskel export {journal} {folder / POSES_FILES[0]}` "
            "makes poses of it; then remove it, or choose another output"
        )
    for name in POSES_FILES:
        if os.path.lexists(folder / name):
            raise ValueError(f"{folder / name}: exists already; choose another output for a new session")


def _host_and_port(osc: str) -> tuple[str, int]:
    host, colon, port = osc.rpartition(":") if ":" in osc else (osc, "", str(VMC_PORT))
    if not host or not (port.isdecimal() and port.isascii()) or not 0 < int(port[:9]) <= _PORTS:
        raise ValueError(f"--osc {osc}: give HOST or HOST:PORT, such as 127.0.0.1:{VMC_PORT}")
    return host, int(port)


def _playback(recording: Recording, fps: float | None, loop: bool, seconds: float | None) -> Playback:
    """A recording to be played; silhouettes that must be made of images are made before."""
    if not isinstance(recording.silhouettes, np.ndarray):
        progress, task = progress_bar("reading silhouettes", len(recording))
        with progress:
            for start in range(0, len(recording), _AT_ONCE):
                progress.advance(task, len(recording.silhouettes[start : start + _AT_ONCE]))
    return Playback(recording, fps, loop, seconds)


@contextmanager
def _stopped_by_signals(clock: WallClock) -> Iterator[None]:
    """Ctrl-C, and SIGTERM, end the session after the frame at work; a second one ends the process."""

    def stop(number: int, frame: FrameType | None) -> None:
        if clock.stopped():
            raise KeyboardInterrupt
        clock.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _progress() -> Iterator[Sink]:
    """A line on a terminal that says how the session stands."""
    progress = Progress(TextColumn("{task.description}", markup=False), console=Console(stderr=True))
    task = progress.add_task("waiting for the first frame")
    told = -_TELL_EVERY

    def show(poses: Poses, moment: Moment) -> None:
        nonlocal told
        if moment.time - told < _TELL_EVERY:
            return
        told = moment.time
        progress.update(task, description=f"{moment}, {STATUS_NAMES[poses.status[0]]}")

    with progress:
        yield show


def _write(folder: Path, tally: Tally) -> None:
    """Write what the journal holds as `run` writes poses, remove the journal, and say so."""
    journal = folder / JOURNAL_FILE
    if not tally.frames:
        journal.unlink()
        warn(f"{folder}: nothing is written, because no frame came")
        raise typer.Exit(1)
    poses = read_poses(journal)
    archive, table = write_poses(folder, poses)
    journal.unlink()
    say(f"{archive}, {table}: {summary(poses, str(tally))}")
    end_without_pose(archive, poses)
