"""Finds the views that contradict all others: without them the rest agrees."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ._scene import Scene

# Smallest decrease of the misfit (half heights of the person) for which views count as culprits. In good recordings,
# leaving out any one view lowers the misfit by at most half of this (the four real ones: 0.0005 to 0.0011; clean masks:
# 0.0002). A camera turned by three degrees, or three frames out of step, makes more than this (0.0025 and up).
CLEAR = 0.002
# Largest share of the misfit that may remain without a single culprit. In dirty masks, where all views have holes,
# leaving out any one view keeps 0.75 and more.
_LEFT = 0.45
# The same for several culprits. It is smaller because each view left out lowers the misfit, even of dirty masks.
_LEFT_BY_SEVERAL = 0.15
# Another view is also suspect if its effect comes this close, as a share of the largest effect.
_NEARLY = 0.25
# Number of suspects that are reported, most likely first.
_SUSPECTS = 4


class Culprits(NamedTuple):
    """Views that contradict the others.

    Attributes:
        views: The rest agrees without all of these; empty if there are no such views.
        suspects: Views in the order of the misfit without each, smallest first; a few even if `views` is empty.
        alike: Number of suspects with nearly the same effect, so that nothing tells them apart.
        before: Misfit of all views (half heights).
        after: Misfit of the remaining views (half heights).
    """

    views: tuple[int, ...]
    suspects: tuple[int, ...]
    alike: int
    before: float
    after: float

    @property
    def likely(self) -> tuple[int, ...]:
        """The culprits, or the suspects of whom one is the culprit."""
        return self.views if len(self.views) > 1 else self.suspects[: self.alike]

    @property
    def excess(self) -> float:
        """Misfit that the culprits add (half heights)."""
        return self.before - self.after


def find_culprits(scene: Scene) -> Culprits:
    """Leave out views greedily until the rest agrees; more views stay than are left out, and at least two stay."""
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
