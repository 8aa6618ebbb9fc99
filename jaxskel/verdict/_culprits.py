"""Which views contradict all others: those without which the rest agrees."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ._scene import Scene

# Half heights of the person, on average over all pixels. Of good recordings no view that is left out makes the misfit
# smaller by more than half of this (the four real ones: 0.0005 to 0.0011; clean masks: 0.0002); a camera that is turned
# by three degrees or three frames out of step by more than this (0.0025 and up).
CLEAR = 0.002
# What is left of the misfit without the culprit, at most: with it gone the rest agrees. Of dirty masks, in which all
# views have holes, no view alone makes so large a difference (0.75 and up).
_LEFT = 0.45
# Of several culprits less is left: each view that is left out makes any misfit smaller, even of dirty masks.
_LEFT_BY_SEVERAL = 0.15
# Another view that makes nearly as large a difference may be the culprit too.
_NEARLY = 0.25
# As many are given as possible culprits, most likely first.
_SUSPECTS = 4


class Culprits(NamedTuple):
    """Views that contradict the others."""

    views: tuple[int, ...]
    """Without all of these the rest agrees; none, if there are no such views."""
    suspects: tuple[int, ...]
    """Views without which the misfit is smallest, in this order: a few even where `views` is empty."""
    alike: int
    """As many of the suspects make nearly the same difference, so that nothing tells them apart."""
    before: float
    """Misfit of all views (half heights)."""
    after: float
    """Misfit of the rest (half heights)."""

    @property
    def likely(self) -> tuple[int, ...]:
        """The culprits, or those of which one is the culprit."""
        return self.views if len(self.views) > 1 else self.suspects[: self.alike]

    @property
    def excess(self) -> float:
        """Misfit that the culprits make (half heights)."""
        return self.before - self.after


def find_culprits(scene: Scene) -> Culprits:
    """Leave views out, one after the other, until the rest agrees: more views must stay than go, and at least two."""
    before, count = scene.misfit(), len(scene.cameras)
    gone: list[int] = []
    suspects: tuple[int, ...] = ()
    after, alike = before, 0
    while count - len(gone) - 1 >= max(2, len(gone) + 2):
        left = _misfits_without(scene, gone)
        order = np.argsort(left, kind="stable")
        if not gone:
            suspects = tuple(order[:_SUSPECTS].tolist())
            alike = int((left[order[:_SUSPECTS]] <= left.min() + _NEARLY * max(before - left.min(), 0.0)).sum())
        gone.append(int(order[0]))
        after = float(left.min())
        if after <= (_LEFT if len(gone) == 1 else _LEFT_BY_SEVERAL) * before:
            break
    else:
        gone = []
    if not gone or before - after < CLEAR:
        return Culprits((), suspects, 0, before, before)
    return Culprits(tuple(gone), suspects, alike if len(gone) == 1 else 0, before, after)


def _misfits_without(scene: Scene, gone: list[int]) -> Float[np.ndarray, " cams"]:
    found = np.full(len(scene.cameras), np.inf)
    for c in range(len(found)):
        if c not in gone:
            found[c] = scene.misfit(scene.without(*gone, c))
    return found
