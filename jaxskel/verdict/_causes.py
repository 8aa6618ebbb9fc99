"""Faults of single views that contradict the others: tests which repair makes the view agree."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from ..cameras import Cameras
from ..recording import Silhouettes
from ._culprits import Culprits
from ._frames import MOST_STEPS
from ._repairs import DISCRETE, Masks
from ._scene import Scene
from ._similarity import fit_similarity
from ._views import reduced_silhouettes

# A repair is accepted if it removes this share of the misfit that the culprit adds. Correct repairs remove 0.9 and
# more on all shared recordings with faults added on purpose.
_MENDED = 0.7
# A repair that keeps a smaller share of the silhouettes than this removes the person instead of mending the view.
_KEPT = 0.7
MOST_PERSON = 0.5
"""Masks that cover a larger share of the image are taken for inverted: nobody filmed whole covers this much."""


class Cause(NamedTuple):
    """A fault that explains why views contradict each other.

    Attributes:
        told: The fault, as a predicate whose subject is the views.
        misfit: Misfit that remains once the fault is mended (half heights).
    """

    views: tuple[int, ...]
    told: str
    misfit: float


class Material(NamedTuple):
    """Source of a scene's silhouettes, from which other frames can be read.

    Attributes:
        chosen: Frame numbers of the scene.
    """

    cameras: Cameras
    silhouettes: Silhouettes
    chosen: Int[np.ndarray, " frames"]


def simple_cause(scene: Scene, culprits: Culprits, material: Material) -> Cause | None:
    """The discrete fault that explains most of the contradiction; None if no fault explains enough of it.

    Discrete faults have no continuous parameter: flips, quarter turns, inverted masks, whole frames, exchanged views.

    Args:
        scene: Scene with the contradiction.
        culprits: Views that may be at fault.
        material: Source of silhouettes of other frames.
    """
    found = [cause for view in culprits.likely for cause in _of_one_view(scene, view, material)]
    found += _exchanged(scene, culprits)
    best = min(found, key=lambda cause: cause.misfit, default=None)
    return best if best and best.misfit <= culprits.before - _MENDED * culprits.excess else None


def exchanged_views(scene: Scene, culprits: Culprits) -> Cause | None:
    """Two views with exchanged images; with few views, the remaining ones do not agree without such a pair."""
    best = min(_exchanged(scene, culprits), key=lambda cause: cause.misfit, default=None)
    return best if best and best.misfit <= (1 - _MENDED) * culprits.before else None


def moved_cause(scene: Scene, culprits: Culprits, steps: Sequence[int], most: float) -> Cause | None:
    """The view whose images are shifted, resized or rolled, if that explains enough of the contradiction.

    Args:
        scene: Scene with the contradiction.
        culprits: Views that may be at fault.
        steps: For each view, the side length in image pixels of one reduced pixel.
        most: Largest misfit that may remain (half heights).
    """
    best = None
    for view in culprits.likely if len(culprits.views) == 1 else ():
        similarity = fit_similarity(scene, view, culprits.after)
        mended = scene.with_masks(view, similarity.apply(scene.masks[:, view])).misfit()
        if mended <= min(most, culprits.before - _MENDED * culprits.excess, best.misfit if best else np.inf):
            focal = float(np.asarray(scene.cameras.K)[view, 0, 0])
            best = Cause((view,), similarity.told(int(steps[view]), focal), mended)
    return best


def out_of_step(scene: Scene, view: int, material: Material, most: int = MOST_STEPS) -> Cause | None:
    """The time shift of a view, up to `most` frames, that fits best; None if no shift does."""
    length = len(material.silhouettes)
    if length < 3 or not scene.masks[:, view].any():
        return None
    steps = np.arange(-most, most + 1)
    wanted = np.clip(material.chosen + steps[:, None], 0, length - 1)
    frames, which = np.unique(wanted, return_inverse=True)
    masks = reduced_silhouettes(material.cameras, view, np.asarray(material.silhouettes[frames, view]))
    best: tuple[float, int] = scene.misfit(), 0
    for step, row in sorted(
        zip(steps.tolist(), which.reshape(wanted.shape), strict=True), key=lambda each: abs(each[0])
    ):
        if step and _is_kept(scene, view, masks[row]):
            best = min(best, (scene.with_masks(view, masks[row]).misfit(), step))
    if best[1] == 0:
        return None
    late = "late" if best[1] > 0 else "early"
    told = (
        f"is out of step: its images are {abs(best[1])} frames too {late} (add {best[1]} to its offset in "
        "recording.toml)"
    )
    return Cause((view,), told, best[0])


def _of_one_view(scene: Scene, view: int, material: Material) -> Iterator[Cause]:
    masks = scene.masks[:, view]
    for repair in DISCRETE:
        mended = np.zeros_like(masks)
        width, height = scene.cameras.size[view]
        mended[:, :height, :width] = repair.apply(masks[:, :height, :width])
        if _is_kept(scene, view, mended, repair.keeps_size):
            yield Cause((view,), repair.told, scene.with_masks(view, mended).misfit())
    late = out_of_step(scene, view, material)
    if late is not None:
        yield late


def _exchanged(scene: Scene, culprits: Culprits) -> Iterator[Cause]:
    """The faults of exchanged images, one for each pair of suspects."""
    for a, b in combinations(sorted(culprits.suspects), 2):
        if (scene.cameras.size[a] == scene.cameras.size[b]).all():
            mended = scene.with_masks(a, scene.masks[:, b]).with_masks(b, scene.masks[:, a])
            yield Cause((a, b), "are exchanged: each has the other's images, or the other's camera", mended.misfit())


def _is_kept(scene: Scene, view: int, masks: Masks, keeps_size: bool = True) -> bool:
    """Whether the person is still visible after a repair."""
    before, after = (m.sum((1, 2)).astype(float) for m in (scene.masks[:, view], masks))
    if not keeps_size:
        pixels = scene.cameras.size[view].prod()
        return bool(((after > 0) & (after < MOST_PERSON * pixels))[before > 0].all())
    return bool((after >= _KEPT * before).all())
