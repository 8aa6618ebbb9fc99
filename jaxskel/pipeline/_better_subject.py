"""A subject that becomes better while its frames come: found again, in another process, once more has been seen."""

import os
from collections.abc import Callable
from dataclasses import replace
from threading import Thread
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Float

from .._runtime.worker_processes import WorkerProcess, pickled
from ..poses import Poses, Status
from ..recording import Recording
from ._prepare import SUBJECT_FRAMES, prepare
from ._prepared import Prepared
from ._settings import Settings

# Numbers of different frames at which the subject is found again. In the first frame it was only guessed. The first
# few make most of the difference.
_AGAIN = (1, 6, 12, SUBJECT_FRAMES)
# Priority of the process: on one core beside a stream that never waits, it gets a tenth of the time.
_NICE = 10
# Two frames differ if a joint lies this far elsewhere relative to the pelvis (m).
_ELSEWHERE = 0.2


class BetterSubject:
    """Collects different frames of a person, and has the subject found again in a process of its own.

    The process begins with the first task. If it dies, the subject stays as it is.

    Args:
        settings: How to reconstruct.
    """

    def __init__(self, settings: Settings):
        self._work = pickled(_FindSubject(settings), "settings", "give a subject")
        self._frames: list[Recording] = []
        self._postures: list[Float[np.ndarray, "joints 3"]] = []
        self._worker: WorkerProcess | None = None
        self._giving = Thread()
        self._busy = False
        # By the graph alone, nothing more would be found in the first frame.
        self._rounds = list(_AGAIN if settings.search is not None else _AGAIN[1:])

    def see(self, frame: Recording, poses: Poses) -> None:
        """Keep a frame if it shows the person well, and differently from all that are kept; or if it is the first."""
        if not self._rounds:
            return
        if poses.status[0] == Status.OK and len(self._frames) < SUBJECT_FRAMES:
            assert poses.rotations is not None
            posture = (poses.joints[0] - poses.joints[0, 0]) @ poses.rotations[0, 0]
            if all(np.linalg.norm(posture - other, axis=1).max() > _ELSEWHERE for other in self._postures):
                self._frames.append(frame)
                self._postures.append(posture)
        elif poses.status[0] == Status.NO_MATCH and not self._frames:
            self._frames.append(frame)  # the guess may be wrong
        if not self._busy and len(self._frames) >= self._rounds[0]:
            self._rounds = [count for count in self._rounds if count > len(self._frames)]
            # The last core: the stream itself begins at the first one.
            self._worker = self._worker or WorkerProcess(-1, self._work)
            # In a thread, because the process does not read before it has started.
            self._giving = Thread(target=self._worker.give, args=(_together(self._frames),), daemon=True)
            self._giving.start()
            self._busy = True

    def found(self) -> Prepared | None:
        """What has been found since the last call, without a grid; None if there is nothing new."""
        if self._worker is None or not self._busy or not self._worker.pipe.poll():
            return None
        try:
            message = self._worker.receive()
        except EOFError:
            message = None
        self._busy = False
        if not isinstance(message, Prepared):
            self.close()
            return None
        if not self._rounds:
            self.close()
        return message

    def close(self) -> None:
        """End the process; nothing more will be found."""
        self._rounds, self._busy = [], False
        if self._worker is not None:
            self._worker.process.kill()
            self._giving.join()  # a dead process ends it
            self._worker.end()
            self._worker = None


def _together(frames: list[Recording]) -> Recording:
    """One recording of several that have one frame each."""
    names = frames[0].data
    return replace(
        frames[0],
        silhouettes=np.concatenate([frame.silhouettes for frame in frames]),
        frame_index=np.concatenate([frame.frame_index for frame in frames]),
        data={name: np.concatenate([frame.data[name] for frame in frames]) for name in names},
    )


class _FindSubject(eqx.Module):
    """What the process does with the frames that are kept."""

    settings: Settings

    def __call__(self, recording: Recording, send: Callable[[Any], None]) -> None:
        """Find the subject and send it without the grid, which is large; or send the exception."""
        if hasattr(os, "setpriority"):  # the stream comes first
            os.setpriority(os.PRIO_PROCESS, 0, _NICE)
        try:
            found = prepare(recording, self.settings)
            send(eqx.tree_at(lambda p: (p.table, p.edge), found, (None, np.zeros((0, 0, 0), bool))))
        except Exception as error:
            send(error)
