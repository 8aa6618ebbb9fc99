"""The verdict on a recording before any pose: can something come of it, and if not, why?"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Float

from ..recording import Recording
from ._causes import MOST_PERSON, Cause, Material, exchanged_views, moved_cause, out_of_step, simple_cause
from ._culprits import Culprits, find_culprits
from ._frames import telling_frames
from ._plausible import Plausibility, plausibility, wrong_unit, wrong_up
from ._rig_causes import RigCause, rig_cause
from ._scene import Scene, make_scene
from ._views import reduce_views

# Frames that are looked at.
_FRAMES = 8
# Misfits (half heights). Below the first nothing is looked for. Above the second, with as many views forgiven as
# carving forgives at its most tolerant, no hull is a person: dirty masks have up to 0.006, rigs with images turned or
# mirrored, or of another calibration, 0.01 to 0.12.
_QUIET, _HOPELESS = 0.002, 0.02
# What no view and no fault of the whole rig explains is told above this (half heights). The poorest masks of the real
# recordings have 0.003; six cameras that are all off by three degrees 0.004, with the calibration of another day 0.007.
_POOR = 0.004
# A repair without a size is believed unless one with a size leaves less of the contradiction by this share.
_SIMPLER = 0.05
# A fault of the whole rig does not leave so many views that agree; of five mirrored ones, four do.
_MANY = 6
# Where others change by less than this share of a silhouette between the frames looked at, one may well not change.
_MOVING = 0.05
# A view that is out of step by a few frames, of a person who hardly moves: the share of the misfit that goes with the
# right step, how large the misfit (half heights) must be to ask, and the most steps that are tried.
_STEPPED, _LEAST_STEPPED, _FEW_STEPS = 0.5, 0.0004, 4


class Severity(IntEnum):
    """What a finding means for the poses."""

    DOUBT = 1
    """Poses may suffer."""
    HOPELESS = 2
    """Nothing can come of it."""


@dataclass(frozen=True)
class Finding:
    """Something that is wrong with a recording."""

    severity: Severity
    views: tuple[str, ...]
    """The guilty views; empty where it is all of them, or none in particular."""
    told: str
    """A sentence: what, the likely cause, how to mend it."""


@dataclass(frozen=True)
class Verdict:
    """What is wrong with a recording, worst first, and the figures that tell."""

    findings: tuple[Finding, ...]
    misfit: Float[np.ndarray, " cams"] | None
    """By how much each view contradicts the others: the mean over its silhouettes, at the person's depth (m)."""
    figures: Plausibility | None
    frames: int
    """Frames that were looked at."""

    @property
    def is_hopeless(self) -> bool:
        """Whether nothing can come of it."""
        return any(finding.severity is Severity.HOPELESS for finding in self.findings)


def judge(recording: Recording, thorough: bool = False) -> Verdict:
    """Look whether the views of a recording agree, and whether what they agree on is a person in a room.

    Some frames are looked at. Unlike carving, nothing is tolerated here: one view that errs is found.

    Args:
        recording: The recording.
        thorough: Whether to look for clocks that are a frame or two apart too, which takes some seconds.
    """
    chosen = telling_frames(recording.silhouettes, _FRAMES)
    if len(chosen) == 0:
        return Verdict((), None, None, 0)  # each frame's status will say so
    cameras, masks, steps = reduce_views(recording.cameras, np.asarray(recording.silhouettes[chosen]))
    shown = masks.any((2, 3))
    if (shown.sum(1) < 2).all():
        return Verdict((), None, None, len(chosen))
    names = recording.cameras.names
    areas = masks.sum((2, 3)) / cameras.size.prod(1)
    if np.median(areas) > MOST_PERSON:
        told = "most of every image is person, so the masks are inverted: white is the person"
        return Verdict((Finding(Severity.HOPELESS, (), told),), None, None, len(chosen))
    scene = make_scene(cameras, masks)
    material = Material(recording.cameras, recording.silhouettes, chosen)
    findings = [*_contradictions(scene, material, steps.tolist(), names)]
    findings += _frozen(masks, names)
    if thorough and not findings:
        findings += _steps(scene, material, names)
    figures = plausibility(scene)
    if not any(finding.severity is Severity.HOPELESS for finding in findings):
        unit, up = wrong_unit(figures), wrong_up(scene, recording.up, recording.turns)
        findings += [Finding(Severity.HOPELESS, (), unit)] if unit else []
        findings += [Finding(Severity.DOUBT, (), up)] if up else []
    findings.sort(key=lambda finding: -finding.severity)
    misfit = scene.by_view() * figures.half
    return Verdict(tuple(findings), misfit, figures, len(chosen))


def _contradictions(scene: Scene, material: Material, steps: list[int], names: tuple[str, ...]) -> list[Finding]:
    misfit = scene.misfit()
    if misfit < _QUIET:
        return []
    culprits = find_culprits(scene)
    if culprits.views:
        cause = simple_cause(scene, culprits, material)
        explained = culprits.before if cause is None else cause.misfit
        # A fault without a size is preferred to one with, which fits better by chance; and where few views are left,
        # they may agree although the same is wrong with all of them.
        enough = culprits.after + _SIMPLER * culprits.excess
        few = len(culprits.views) > 1 or len(names) - 1 < _MANY
        whole = rig_cause(scene) if explained > enough and few else None
        if whole is not None and whole.misfit <= min(explained, culprits.after + 0.25 * culprits.excess):
            return [_of_rig(whole)]
        if explained > enough:
            cause = moved_cause(scene, culprits, steps, explained - _SIMPLER * culprits.excess) or cause
        return [_of_views(scene, culprits, cause, names)]
    cause, whole = exchanged_views(scene, culprits), rig_cause(scene)
    if whole is not None and (cause is None or whole.misfit < cause.misfit):
        return [_of_rig(whole)]
    if cause is not None:
        return [_of_views(scene, culprits, cause, names)]
    tolerant = scene.misfit(misses=scene.misses)
    if tolerant > _HOPELESS:
        told = (
            "the silhouettes contradict each other everywhere, whichever view is left out: is the calibration that of "
            "these views, and are they of one moment?"
        )
        return [Finding(Severity.HOPELESS, (), told)]
    if misfit > _POOR:
        told = (
            f"the views contradict each other by {_millimetres(scene, misfit):.1f} mm on average, and no single view "
            "explains it: masks with holes or blobs, several faults at once, or a poor calibration (jaxskel "
            "refine-cameras mends small errors)"
        )
        return [Finding(Severity.DOUBT, (), told)]
    return []


def _of_rig(cause: RigCause) -> Finding:
    return Finding(Severity.HOPELESS, (), f"the silhouettes contradict each other because {cause.told}")


def _of_views(scene: Scene, culprits: Culprits, cause: Cause | None, names: tuple[str, ...]) -> Finding:
    rest = len(names) - len(cause.views if cause else culprits.views)
    before, after = _millimetres(scene, culprits.before), _millimetres(scene, culprits.after)
    without = "without it" if len(culprits.views) == 1 else "without them"
    figures = f"{without} the misfit falls from {before:.1f} to {after:.1f} mm"
    if cause is not None:
        guilty = tuple(names[view] for view in cause.views)
        told = f"{' and '.join(guilty)} {cause.told}; mended, the misfit falls from {before:.1f} to "
        told += f"{_millimetres(scene, cause.misfit):.1f} mm"
    else:
        guilty = tuple(names[view] for view in culprits.likely)
        joined = (" or " if culprits.alike > 1 else " and ").join(guilty)
        told = (
            f"{joined} contradict{'s' if len(guilty) == 1 or culprits.alike > 1 else ''} all others ({figures}): "
            "masks that miss a part of the person, another camera's images, or a camera that was moved"
        )
    excess = culprits.before - (culprits.after if culprits.views else cause.misfit if cause else 0.0)
    hopeless = rest < 3 and excess > _HOPELESS / 2
    return Finding(Severity.HOPELESS if hopeless else Severity.DOUBT, guilty, told)


def _millimetres(scene: Scene, misfit: float) -> float:
    """A misfit (half heights) at the person's depth."""
    return 1e3 * misfit * float(np.nanmedian(scene.samples.half))


def _frozen(masks: Bool[np.ndarray, "frames cams rows columns"], names: tuple[str, ...]) -> list[Finding]:
    """Views whose film stands still while the others go on."""
    area = np.maximum(masks.sum((0, 2, 3)), 1)
    changed = (masks != masks[:1]).sum((0, 2, 3)) / area
    still = [c for c in range(len(names)) if masks[:, c].any() and changed[c] == 0]
    if not still or len(still) == len(names) or np.median(np.delete(changed, still)) < _MOVING:
        return []
    guilty = tuple(names[c] for c in still)
    told = f"{' and '.join(guilty)} show{'s' if len(guilty) == 1 else ''} the same silhouette in all frames"
    return [Finding(Severity.DOUBT, guilty, f"{told}, while the person moves in the other views")]


def _steps(scene: Scene, material: Material, names: tuple[str, ...]) -> list[Finding]:
    misfit = scene.misfit()
    if misfit < _LEAST_STEPPED:
        return []
    found = [
        cause for view in range(len(names)) if (cause := out_of_step(scene, view, material, _FEW_STEPS)) is not None
    ]
    best = min(found, key=lambda cause: cause.misfit, default=None)
    if best is None or best.misfit > (1 - _STEPPED) * misfit or misfit - best.misfit < _LEAST_STEPPED:
        return []
    guilty = names[best.views[0]]
    return [Finding(Severity.DOUBT, (guilty,), f"{guilty} {best.told}")]
