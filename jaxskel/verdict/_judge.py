"""Judges a recording before any pose: whether it can work, and if not, why."""

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

# Number of frames that are examined.
_FRAMES = 8
# Misfits (half heights). Below the first, no fault is searched. Above the second, with as many views forgiven as the
# most tolerant carving forgives, no hull is a person: dirty masks reach 0.006; rigs with turned or mirrored images, or
# with the calibration of another rig, 0.01 to 0.12.
_QUIET, _HOPELESS = 0.002, 0.02
# An unexplained misfit above this is reported (half heights). The poorest masks of the real recordings reach 0.003; six
# cameras that are all off by three degrees 0.004; the calibration of another day 0.007.
_POOR = 0.004
# A discrete fault is preferred unless a continuous one lowers the remaining misfit by this share of the excess.
_SIMPLER = 0.05
# From this many remaining views on, no fault of the whole rig is searched. Of five mirrored views, four still agree.
_MANY = 6
# A view counts as frozen only if the others change by at least this share of a silhouette between the frames. Somebody
# who waves changes six views out of eight by 0.06, and not at all those that the arms are hidden from; single frames of
# clips change all views by 0.2 or more.
_MOVING = 0.12
# A view that is a few frames out of step while the person hardly moves: the share of the misfit that the right shift
# must remove, the smallest misfit and improvement (half heights), and the largest shift tried (frames).
_STEPPED, _LEAST_STEPPED, _FEW_STEPS = 0.5, 0.0004, 4


class Severity(IntEnum):
    """What a finding means for the poses."""

    DOUBT = 1
    """Poses may suffer."""
    HOPELESS = 2
    """No poses can come of the recording."""


@dataclass(frozen=True)
class Finding:
    """One fault of a recording.

    Attributes:
        views: The views at fault; empty if it is all of them, or none in particular.
        told: A sentence: the fault, its likely cause and how to mend it.
    """

    severity: Severity
    views: tuple[str, ...]
    told: str


@dataclass(frozen=True)
class Verdict:
    """The faults of a recording, worst first, and the figures behind them.

    Attributes:
        misfit: How much each view contradicts the others: mean over its silhouettes, at the person's depth (m).
        frames: Number of frames examined.
    """

    findings: tuple[Finding, ...]
    misfit: Float[np.ndarray, " cams"] | None
    figures: Plausibility | None
    frames: int

    @property
    def is_hopeless(self) -> bool:
        """Whether no poses can come of the recording."""
        return any(finding.severity is Severity.HOPELESS for finding in self.findings)


def judge(recording: Recording, thorough: bool = False) -> Verdict:
    """Judge whether the views of a recording agree, and whether they show a person in a room.

    Only some frames are examined. Unlike carving, this tolerates no error: a single wrong view is found. Pixels where
    others may stand before the person say nothing.

    Args:
        recording: The recording.
        thorough: Whether to search for clocks that are only a few frames apart too, which takes some seconds.
    """
    chosen = telling_frames(recording.silhouettes, _FRAMES)
    if len(chosen) == 0:
        return Verdict((), None, None, 0)  # the status of each frame will say so
    cameras, masks, steps = reduce_views(recording.cameras, np.asarray(recording.silhouettes[chosen]))
    shown = masks.any((2, 3))
    if (shown.sum(1) < 2).all():
        return Verdict((), None, None, len(chosen))
    names = recording.cameras.names
    areas = masks.sum((2, 3)) / cameras.size.prod(1)
    if np.median(areas) > MOST_PERSON:
        told = "most of every image is person, so the masks are inverted: the person must be white"
        return Verdict((Finding(Severity.HOPELESS, (), told),), None, None, len(chosen))
    hidden = None if recording.hidden is None else reduce_views(recording.cameras, np.asarray(recording.hidden[chosen]))
    scene = make_scene(cameras, masks, hidden=None if hidden is None else hidden.masks)
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
        # Prefer a discrete fault, because a continuous one fits better by chance. If few views remain, they may agree
        # although all of them have the same fault.
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
            "the silhouettes contradict each other everywhere, whichever view is left out: is the calibration for "
            "these views, and are they synchronised?"
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
        told = f"{' and '.join(guilty)} {cause.told}; without this fault, the misfit falls from {before:.1f} to "
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
    """A misfit (half heights) in millimetres at the person's depth."""
    return 1e3 * misfit * float(np.nanmedian(scene.samples.half))


def _frozen(masks: Bool[np.ndarray, "frames cams rows columns"], names: tuple[str, ...]) -> list[Finding]:
    """Views whose images stand still while the others change."""
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
