"""A scene: some frames of a recording, prepared to measure how well the views agree, also with some views changed."""

from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ..cameras import Cameras
from ..hull import most_misses
from ._misfit import FrameEvidence, frame_evidence, frame_misfits, outside, with_view
from ._views import POINTS, Samples, Sight, samples_around, sights_of

# Share of the frames that count, best first: other frames may show somebody else, as 1 of 8 of the real child's does.
_KEPT = 0.75


class Scene(eqx.Module):
    """Some frames of a recording at a reduced size, seen by all views.

    Attributes:
        misses: Number of views of a frame that the most tolerant carving lets err.
        hidden: Pixels where others may stand before the person, which say nothing; None if there are no others.
    """

    cameras: Cameras
    masks: Bool[np.ndarray, "frames cams rows columns"]
    samples: Samples
    sights: tuple[Sight, ...]
    frames: tuple[FrameEvidence, ...]
    misses: int
    hidden: Bool[np.ndarray, "frames cams rows columns"] | None = None

    @property
    def every(self) -> Bool[np.ndarray, " cams"]:
        """All views."""
        return np.ones(len(self.cameras), bool)

    def without(self, *views: int) -> Bool[np.ndarray, " cams"]:
        """All views but these."""
        chosen = self.every
        chosen[list(views)] = False
        return chosen

    def by_view(self) -> Float[np.ndarray, " cams"]:
        """Median misfit of each view over the frames (half heights); NaN if no frame gives one."""
        found = np.stack([frame_misfits(frame, self.every) for frame in self.frames])
        return np.array([np.median(each[np.isfinite(each)]) if np.isfinite(each).any() else np.nan for each in found.T])

    def misfit(self, chosen: Bool[np.ndarray, " cams"] | None = None, misses: int = 0) -> float:
        """Mean misfit over the views and the best frames (half heights); zero if no frame gives one.

        Args:
            chosen: Views that count; all of them by default.
            misses: Number of views that may err at any point.
        """
        each = self.every if chosen is None else chosen
        found = np.stack([frame_misfits(frame, each, misses) for frame in self.frames])
        there = np.isfinite(found)
        frames = np.where(there, found, 0).sum(1)[there.any(1)] / there.sum(1)[there.any(1)]
        kept = int(np.ceil(_KEPT * len(frames)))
        return float(np.sort(frames)[:kept].mean()) if kept else 0.0

    def at(self, frames: Int[np.ndarray, " some"]) -> "Scene":
        """The scene with only some of its frames."""
        samples = self.samples
        samples = Samples(samples.middle[frames], samples.half[frames], samples.points)
        sights = tuple(Sight(s.pixel[frames], s.breadth[frames], s.side[frames]) for s in self.sights)
        chosen = tuple(self.frames[f] for f in frames)
        hidden = None if self.hidden is None else self.hidden[frames]
        return replace(self, masks=self.masks[frames], samples=samples, sights=sights, frames=chosen, hidden=hidden)

    def with_masks(self, index: int, masks: Bool[np.ndarray, "frames rows columns"]) -> "Scene":
        """The scene with other silhouettes in one view; the sampled points stay the same."""
        every = self.masks.copy()
        every[:, index] = masks
        frames = tuple(
            with_view(frame, index, outside(masks[f], self.sights[index], f, frame.near))
            for f, frame in enumerate(self.frames)
        )
        return replace(self, masks=every, frames=frames)


def make_scene(
    cameras: Cameras,
    masks: Bool[np.ndarray, "frames cams rows columns"],
    points: int = POINTS,
    hidden: Bool[np.ndarray, "frames cams rows columns"] | None = None,
) -> Scene:
    """Make a scene of masks, which are as large as the cameras' images or padded at the right and bottom.

    The misfit is taken at `points` along each edge of a cube around the person. `hidden` as in `Scene`.
    """
    samples = samples_around(cameras, masks, points)
    sights = sights_of(cameras, masks.shape[3], samples, hidden)
    misses = most_misses(len(cameras))
    frames = tuple(
        frame_evidence([outside(mask, sight, f, slice(None)) for mask, sight in zip(view, sights, strict=True)], misses)
        for f, view in enumerate(masks)
    )
    return Scene(cameras, masks, samples, tuple(sights), frames, misses, hidden)
