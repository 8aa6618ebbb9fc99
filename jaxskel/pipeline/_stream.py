"""Poses of frames that come one by one, without waiting for later ones."""

from dataclasses import replace
from types import TracebackType
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float, UInt8

from .._runtime.batching import single_precision
from .._runtime.kinds import check_count, check_kind
from ..body import Body, Skeleton
from ..cameras import Cameras
from ..hull import body_middles
from ..poses import Poses, Status
from ..recording import MIN_VIEWS, Recording, find_empty_views, rotation_to_z_up, silhouette_areas
from ..search import Track, Tracking, before_next, hurried, lost, over_gap, search_is_due
from ._ahead import compile_ahead
from ._better_subject import BetterSubject
from ._coupled_batches import check_apart
from ._guess_subject import guess_subject
from ._moving_grid import MovingGrid, grid_around
from ._prepare import place, scale_for, with_grid, with_model, with_subject
from ._prepared import Prepared
from ._reconstruct import reconstruct_batch
from ._settings import Settings

# Edge of the voxels (m) where the silhouettes decide between the poses that the graph proposes: finer ones do not make
# them better, see `HullSettings.spacing`, but take longer.
_COARSE = 0.03
# After this many successive frames that do not show the subject that was found, it is found again: the first frame may
# have shown a part of a person, or somebody else has come.
_SOMEBODY_ELSE = 5


def streaming(settings: Settings | None) -> Settings:
    """Settings as a stream uses them: tracking by default, and no finer voxels than a search needs."""
    settings = settings or Settings(tracking=Tracking())
    if settings.search is None:
        return settings
    return replace(settings, hull=replace(settings.hull, spacing=max(settings.hull.spacing, _COARSE)))


class Stream:
    """Reconstructs a person from frames that come one by one, each by what was seen before it.

    It does what `reconstruct` does, with stacks of one frame. A grid of a fixed size goes with the person. With
    tracking, the default, hulls are carved only where the person must be found: at the start, at intervals, and in
    frames that cost more than is usual. Between those, a second person or a person partly outside shows only by a pose
    that explains the silhouettes badly.

    A frame without a person, or with one who cannot be reconstructed, has a status that says why, and the next one is
    searched in.

    If the subject's body is not given, it is guessed from the first frame that shows the person, and again if that is
    not who comes then. Another process looks for it thoroughly, at first in that frame, and again when more different
    ones have been seen. That process is spawned: a script that makes such a stream needs
    ``if __name__ == "__main__":``, and should close it, or use it in a ``with`` statement.

    Args:
        cameras: The rig, three cameras or more.
        settings: How to reconstruct; by default ``Settings(tracking=Tracking())``. With a search, voxels are 30 mm or
            larger. With a `box`, the grid stays there.
        subject: The subject's body, or its skeleton, if one is known.
        up: World axis that points up, such as ``"+Z"``, see `UP_AXES`.
        fps: Frames per second.

    Raises:
        ValueError: Fewer than three cameras, or `up` or `fps` makes no sense; or the objective couples frames; or the
            subject is to be found, and the settings hold functions that another process does not know.
    """

    def __init__(
        self,
        cameras: Cameras,
        settings: Settings | None = None,
        subject: Body | Skeleton | None = None,
        up: str = "+Z",
        fps: float = 30.0,
    ):
        check_kind("cameras", cameras, Cameras, "Cameras, as a recording has them")
        check_kind("settings", settings, Settings | None, "Settings(...) or None")
        check_kind("subject", subject, Body | Skeleton | None, "a Body, as read_body(path) reads it, or a Skeleton")
        if len(cameras) < MIN_VIEWS:
            raise ValueError(f"a stream of {len(cameras)} cameras: give {MIN_VIEWS} or more")
        if isinstance(fps, str) or not 0 < fps < np.inf:
            raise ValueError(f"fps: a stream of {fps!r} frames per second; give a positive number")
        rotation_to_z_up(up)  # refuses what is no axis
        settings = streaming(settings)
        check_apart(settings, "and a stream has one at a time; leave it out, or reconstruct a recording")
        if isinstance(subject, Body):
            settings, subject = replace(settings, body=subject), subject.skeleton
        width, height = cameras.size.max(0).tolist()
        none = np.zeros((0, len(cameras), height, -(-width // 8)), np.uint8)
        self._empty = Recording(cameras, none, float(fps), up, np.arange(0), subject, name="stream")
        self._settings = settings
        self._prepared: Prepared | None = None
        self._track: Track | None = None
        self._middle: np.ndarray | None = None  # of the person in the frame before (m, z up)
        self._moving = MovingGrid(settings)
        self._count = 0
        self._put_off = 0  # successive frames in which searches were put off
        self._for_body: tuple[Body, Settings] | None = None
        self._to_find = subject is None or (settings.search is not None and settings.body is None)
        self._found = not self._to_find
        self._strangers = 0  # successive frames of somebody else
        self._better = BetterSubject(settings) if self._to_find else None

    def push(
        self,
        masks: Bool[np.ndarray, "cams h w"] | UInt8[np.ndarray, "cams h columns"],
        skipped: int = 0,
        hurry: bool = False,
        data: dict[str, Any] | None = None,
    ) -> Poses:
        """Reconstruct the next frame.

        Args:
            masks: Silhouettes of all views, as large as the largest image: true, or not zero, is the person. Or packed
                bits, as from `numpy.packbits` over the width.
            skipped: Number of frames before this one that were left out; a person who is followed moved on in them.
            hurry: Whether other frames wait. Searches that are not needed to find the person are then put off, for a
                second at most.
            data: Numbers of this frame for terms of your own, by name: what `Recording.with_data` takes, without the
                frames axis. What the first frame has and this one lacks is NaN.

        Returns:
            Poses of one frame, in the cameras' world (m). Its `frame_index` counts the calls.

        Raises:
            ValueError: The masks are not those of the cameras, or the data have other names or shapes than before.
        """
        check_count("skipped", skipped, 0)
        frame = self._frame(_packed(np.asarray(masks), self._empty), data or {})
        prepared = self._prepared_for(frame)
        settings = self._settings_for(prepared.body)
        self._put_off = self._put_off + 1 if hurry and self._put_off < self._empty.fps else 0
        track = self._track
        if track is not None and skipped:
            track = before_next(track, skipped)
        if track is not None and self._put_off:
            track = hurried(track)
        poses, track = reconstruct_batch(frame, prepared, settings, track=track, at_once=1)
        if self._track is not None and track is not None and skipped:
            track = over_gap(self._track, track, skipped)
        with_pose = bool(poses.has_pose[0])
        # Poses of single frames may jump; those of a track do not.
        tracked = with_pose and track is not None
        self._middle = prepared.scale * poses.joints[0, 0] @ prepared.to_z_up.T if tracked else None
        self._track = track if track is None or with_pose else lost(track)
        self._strangers = self._strangers + 1 if poses.status[0] == Status.NO_MATCH else 0
        if self._to_find and self._strangers >= _SOMEBODY_ELSE:
            self._found, self._strangers = False, 0
        if self._better is not None:
            self._better.see(frame, poses)
        self._count += 1
        return poses

    def close(self) -> None:
        """End the process that makes the body better, if there is one."""
        if self._better is not None:
            self._better.close()
            self._better = None

    def __enter__(self) -> "Stream":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def _frame(self, silhouettes: UInt8[np.ndarray, "frames=1 cams h w8"], data: dict[str, Any]) -> Recording:
        """A recording of one frame."""
        index = np.array([self._count])
        frame = replace(self._empty, silhouettes=silhouettes, frame_index=index, data={})
        if not data and not self._empty.data:
            return frame
        frame = frame.with_data(**{name: np.asarray(array)[None] for name, array in data.items()})
        if self._count == 0:
            self._empty = frame[:0]
        shapes = {name: array.shape[1:] for name, array in self._empty.data.items()}
        for name, array in frame.data.items():
            if shapes.get(name) != array.shape[1:]:
                known = ", ".join(f"{key} of shape {shape}" for key, shape in shapes.items()) or "none"
                raise ValueError(
                    f"data: {name!r} has shape {array.shape[1:]}, but the first frame had {known}; give the same in "
                    "every frame, NaN where nothing is known"
                )
        missing = {name: np.full((1, *shape), np.nan) for name, shape in shapes.items() if name not in frame.data}
        return frame.with_data(**missing)

    def _settings_for(self, body: Body) -> Settings:
        """The settings with the objective for a body, which is made once, not for each frame."""
        if self._for_body is None or self._for_body[0] is not body:
            refinement = self._settings.refinement
            objective = jax.device_put(single_precision(refinement.objective_for(body)))
            refinement = replace(refinement, objective=objective)
            self._for_body = body, replace(self._settings, refinement=refinement)
        return self._for_body[1]

    def _prepared_for(self, frame: Recording) -> Prepared:
        """What is known for a frame: a grid where the person is, and the subject."""
        silhouettes = np.asarray(frame.silhouettes)
        if self._prepared is None:
            scale = scale_for(self._empty.skeleton or self._settings.average)
            cameras = self._empty.cameras.rotated(rotation_to_z_up(self._empty.up)).scaled(scale)
            middle = _middle(silhouettes, cameras)
            if middle is None:
                return place(frame, self._settings, at_once=1)
            if not self._found:
                compile_ahead(cameras, self._settings, frame.data, at_once=1)
            grid = None if self._settings.hull.box is not None else grid_around(middle, self._settings.hull.spacing)
            self._prepared = with_model(place(frame, self._settings, grid, at_once=1), self._settings)
        self._follow(silhouettes)
        if self._better is not None:
            self._improve(self._better.found())
        if not self._found:
            found = with_subject(self._prepared, frame, self._settings, calibrate=True, find=guess_subject, at_once=1)
            if found is not self._prepared:
                self._prepared, self._found = with_model(found, self._settings), True
        return self._prepared

    def _follow(self, silhouettes: UInt8[np.ndarray, "frames=1 cams h w8"]) -> None:
        """Move the grid if the person leaves its middle."""
        prepared = self._prepared
        if self._settings.hull.box is not None or prepared is None or prepared.table is None:
            return
        middle = _middle(silhouettes, prepared.cameras) if self._middle is None else self._middle
        if middle is not None:
            track, tracking = self._track, self._settings.tracking
            carved = track is None or tracking is None or search_is_due(tracking, self._empty.fps, track)
            self._prepared = self._moving.followed(prepared, middle, carved)

    def _improve(self, better: Prepared | None) -> None:
        """Take a better subject, with the grid of before; costs of the other body tell nothing about it."""
        before = self._prepared
        if better is None or before is None or before.table is None:
            return
        table = before.table
        self._prepared = with_model(replace(better, table=table, edge=before.edge), self._settings)
        if better.max_misses != before.max_misses:
            self._moving.stay()
            self._prepared = with_grid(self._prepared, table.grid, table.size, self._settings)
        self._found = True
        if self._track is not None:
            self._track = eqx.tree_at(lambda t: t.costs, lost(self._track), np.zeros(0))


def _middle(silhouettes: UInt8[np.ndarray, "frames=1 cams h w8"], cameras: Cameras) -> Float[np.ndarray, "3"] | None:
    """The middle of the person (m, in the cameras' world) by the silhouettes alone; None if too few show somebody."""
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    if (~empty_views).sum() < MIN_VIEWS:
        return None
    return body_middles(cameras, silhouettes, empty_views)[0]


def _packed(masks: np.ndarray, empty: Recording) -> UInt8[np.ndarray, "frames=1 cams h w8"]:
    """Packed bits of one frame, as a recording holds them."""
    width, height = empty.cameras.size.max(0).tolist()
    views, fits = len(empty.cameras), masks.shape[:2] == (len(empty.cameras), height)
    if fits and masks.ndim == 3 and masks.dtype in (np.bool_, np.uint8):
        if masks.shape[2] == width:
            return np.packbits(masks, axis=-1)[None]
        if masks.shape[2] == -(-width // 8) and masks.dtype == np.uint8:
            return np.ascontiguousarray(masks)[None]
    raise ValueError(
        f"masks of shape {masks.shape}, {masks.dtype}: give ({views}, {height}, {width}) booleans, bytes or, packed, "
        f"({views}, {height}, {-(-width // 8)}) bytes"
    )
