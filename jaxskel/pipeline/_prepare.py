"""Preparation before the first frame: the grid, its projection, and the subject's template and body."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import numpy as np

from .._runtime.kinds import check_kind
from .._runtime.steps import Steps, finished
from ..body import (
    HUMAN_15,
    Prior,
    Skeleton,
    default_adult,
    flesh_prior,
    human_points,
    make_body,
    make_skeleton,
    people_prior,
)
from ..body_calibration import worn_around_joints
from ..cameras import Cameras
from ..graph import SkeletalGraph
from ..hull import (
    FRAMES_PER_WORD,
    VoxelGrid,
    judge_misses,
    make_grid,
    observed_edge,
    place_grid,
    projecting,
)
from ..matching import estimate_size, estimate_stature, size_of_limbs
from ..recording import Recording, find_empty_views, rotation_to_z_up, silhouette_areas
from ..search import Model, Search, make_model
from ._ahead import compile_ahead
from ._observe_batch import label_graphs, observe_batch
from ._prepared import Prepared
from ._settings import Settings, weight_of_priors
from ._settle_subject import Subject
from ._subject import STATURES, find_subject, other_sizes
from ._subject_frames import Sight, sight_of

FindSubject = Callable[[Skeleton, Callable[[float], Prior], Sight, Search, tuple[float, ...]], Subject]
"""`find_subject`, or `guess_subject` where nobody should wait."""
SUBJECT_FRAMES = 24
"""Largest number of frames that a subject is found in."""
# Bodies of other templates are made as large as this (m): lengths of the stages are those for a person.
_PERSON = 1.7
# How often the size of another template is found by labelled limbs.
_SIZE_ROUNDS = 2


def check_given(recording: Any, settings: Any) -> None:
    """Refuse what is no recording, and settings that are none."""
    check_kind("recording", recording, Recording, "a Recording, as read_recording(path) reads it")
    check_kind("settings", settings, Settings, "Settings(), or paper_settings()")


def prepare(recording: Recording, settings: Settings | None = None, *, calibrate: bool = True) -> Prepared:
    """Place the grid, project it into the cameras, choose the tolerance of carving, and find template and body.

    If the subject's dimensions are unknown, an average adult is scaled to the stature of the hulls. If no body is
    given, one is calibrated on up to 24 frames.

    Args:
        recording: Silhouettes and cameras.
        settings: Settings of all stages.
        calibrate: Whether to calibrate a body and prepare the search; hull and graph need neither.
    """
    settings = settings or Settings()
    check_given(recording, settings)
    if calibrate:
        compile_ahead(recording.cameras, settings, recording.data)
    prepared = with_subject(place(recording, settings), recording, settings, calibrate)
    return with_model(prepared, settings) if calibrate else prepared


def place(
    recording: Recording, settings: Settings, grid: VoxelGrid | None = None, at_once: int = FRAMES_PER_WORD
) -> Prepared:
    """Place the grid, project it into the cameras and choose the tolerance of carving: `prepare` without the subject.

    Template and body are those given, or average ones. A `grid` that is given, in a world with z up, is taken as it is.
    `at_once` is the number of frames that are carved at once, see `carve`.
    """
    to_z_up = rotation_to_z_up(recording.up)
    skeleton, known = _skeleton(recording, settings)
    scale = scale_for(skeleton)
    skeleton, cameras = skeleton.scaled(scale), recording.cameras.rotated(to_z_up).scaled(scale)
    silhouettes, hidden = recording.silhouettes, recording.hidden
    min_views = _min_views(settings, cameras)
    empty_views = find_empty_views(silhouette_areas(silhouettes), cameras)
    box = None if grid is None else np.stack([np.asarray(grid.origin), grid.upper])
    if settings.hull.box is not None:
        corners = scale * settings.hull.box @ to_z_up.T  # the rotation only exchanges axes
        box = np.stack([corners.min(0), corners.max(0)])
    max_misses = settings.hull.max_misses
    if max_misses is None:
        max_misses = judge_misses(cameras, silhouettes, empty_views, min_views, box, at_once, hidden)
    elif max_misses > len(cameras) - min_views:
        raise ValueError(
            f"{recording.name}: max_misses (--max-misses) {max_misses}: at least {min_views} of {len(cameras)} cameras "
            f"must see a person; give {len(cameras) - min_views} or less"
        )
    if box is not None and grid is None:
        grid = make_grid(box[0], box[1], settings.hull.spacing)
    elif grid is None:
        grid = place_grid(cameras, silhouettes, empty_views, settings.hull.spacing, min_views, max_misses, hidden)
    body = settings.body or make_body(skeleton)
    prepared = Prepared(
        to_z_up, cameras, None, np.zeros((0, 0, 0), bool), max_misses, skeleton, known, body, None, scale=scale
    )
    if grid is None:
        return prepared
    return with_grid(prepared, grid, (silhouettes.shape[2], 8 * silhouettes.shape[3]), settings)


def scale_for(skeleton: Skeleton) -> float:
    """Size of the world of all stages over that of a recording, for a skeleton in the latter (m)."""
    return 1.0 if skeleton.template.is_human else _PERSON / skeleton.size


def _skeleton(recording: Recording, settings: Settings) -> tuple[Skeleton, bool]:
    """The skeleton to begin with (m, in the recording's world), and whether it is the subject's."""
    average, given = settings.average, recording.skeleton
    if given is not None and given.template == average.template:
        return given, True
    if given is not None and average.template.is_human and given.template == HUMAN_15:
        points = human_points(given, average.template.meanings)
        joints = len(average.template.joint_names)
        return make_skeleton(points[:joints], points[joints:], average.template), True
    if given is not None and settings.template is None:
        raise ValueError(
            f"{recording.name}: its skeleton is of {given.template.name!r}; give that template in the settings"
        )
    return average, False


def with_grid(prepared: Prepared, grid: VoxelGrid, size: tuple[int, int], settings: Settings) -> Prepared:
    """The same with another grid, projected into the cameras; `size` is the silhouettes' height and width (px)."""
    return finished(changing_grid(prepared, grid, size, settings))


def changing_grid(prepared: Prepared, grid: VoxelGrid, size: tuple[int, int], settings: Settings) -> Steps[Prepared]:
    """As `with_grid`, in steps."""
    # Each camera that may miss a voxel is compensated by one more camera that must see it.
    views = _min_views(settings, prepared.cameras) + prepared.max_misses
    table = yield from projecting(prepared.cameras, grid, *size, views, prepared.table)
    return replace(prepared, table=table, edge=observed_edge(table.observed.reshape(grid.shape)))


def with_model(prepared: Prepared, settings: Settings) -> Prepared:
    """The same with the body prepared for the search, if there is one."""
    model = model_of(prepared, settings)
    return prepared if model is None else replace(prepared, model=model, worn=worn_around_joints(prepared.body))


def model_of(prepared: Prepared, settings: Settings) -> Model | None:
    """The body prepared for the search; None without one."""
    if settings.search is None:
        return None
    return make_model(prepared.body, settings.search.objective, weight_of_priors(settings, prepared.clothes))


def _min_views(settings: Settings, cameras: Cameras) -> int:
    """Cameras that must see an occupied voxel."""
    return settings.hull.min_views or (3 if len(cameras) >= 6 else 2)


def with_subject(
    prepared: Prepared,
    recording: Recording,
    settings: Settings,
    calibrate: bool,
    find: FindSubject = find_subject,
    at_once: int = FRAMES_PER_WORD,
) -> Prepared:
    """The same with the subject as some frames show it; unchanged if they show nobody, or nothing is to be found."""
    calibrating = calibrate and settings.search is not None and settings.body is None
    if prepared.table is None or (prepared.skeleton_is_known and not calibrating):
        return prepared
    chosen = np.unique(np.linspace(0, len(recording) - 1, SUBJECT_FRAMES).astype(int))
    assert len(chosen) <= FRAMES_PER_WORD
    found = observe_batch(
        recording[chosen], prepared, settings, outlines=calibrating, at_once=at_once,
        template=lambda graphs: (
            prepared.skeleton if prepared.skeleton_is_known else _of_graphs(graphs, prepared, settings)
        ),
    )  # fmt: skip
    if found.labelled is None:
        return prepared
    skeleton = found.labelled.skeleton
    if skeleton is not prepared.skeleton:
        prepared = eqx.tree_at(
            lambda p: (p.skeleton, p.body), prepared, (skeleton, settings.body or make_body(skeleton))
        )  # fmt: skip
    if settings.search is None or found.outlines is None:
        return prepared
    sight = sight_of(found.outlines, found.labelled)
    known = prepared.skeleton_is_known
    if known:
        flesh = flesh_prior(skeleton)
        subject = find(skeleton, lambda _: flesh, sight, settings.search, ())
        # Exactly as given, not rounded.
        body = eqx.tree_at(lambda b: b.skeleton, subject.body, skeleton)
        return replace(prepared, body=body, costs=subject.costs, clothes=subject.clothes)
    subject = find(skeleton, partial(people_prior, skeleton), sight, settings.search, other_sizes(skeleton.stature))
    return replace(
        prepared, skeleton=subject.body.skeleton, body=subject.body, costs=subject.costs,
        stature_deviation=subject.stature_deviation, clothes=subject.clothes,
    )  # fmt: skip


def _of_graphs(graphs: list[SkeletalGraph], prepared: Prepared, settings: Settings) -> Skeleton:
    """The template at the size of the graphs."""
    if prepared.skeleton.template == HUMAN_15:
        return template_of(graphs)
    found = prepared.skeleton.scaled(estimate_size(graphs, prepared.skeleton) or 1.0)
    # Spurs among the farthest end nodes make it too large; labels tell them apart, the better the nearer its size is.
    for _ in range(_SIZE_ROUNDS):
        limbs = label_graphs(graphs, found, settings).limbs
        found = found.scaled(size_of_limbs(limbs, found))
    return found


def template_of(graphs: list[SkeletalGraph]) -> Skeleton:
    """An average adult of the graphs' stature; of average stature where they show none that a person can have."""
    stature = estimate_stature(graphs)
    return default_adult(stature) if stature is not None and STATURES[0] < stature < STATURES[1] else default_adult()
