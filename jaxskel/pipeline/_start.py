"""Start poses of the refinement of a batch: from the labelled graph, or the best ones of a search."""

from contextlib import nullcontext
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from .._runtime.batching import length_of, on_device, padded, single_precision, take
from .._runtime.steps import Steps
from ..body import HUMAN_15, Body, Pose, Skeleton
from ..graph import SkeletalGraph, forest_of
from ..hull import FRAMES_PER_WORD, Seen, Stopwatch, middles_of_people
from ..matching import L_FOOT, R_FOOT, Limbs, template_ends
from ..recording import Recording
from ..refinement.terms import Objective, Observed
from ..search import (
    NOT_THE_SUBJECT,
    Fork,
    Hypotheses,
    Model,
    Proposed,
    Search,
    Searched,
    Track,
    begun,
    decide,
    doubt_arises,
    follow_frame,
    graphless_poses,
    initial_poses,
    lost,
    must_be_found,
    search_in_doubt,
    search_is_due,
    solve_frames,
    solving,
    start_poses,
    target_poses,
    track_frames,
    unexplained_shares,
)
from ._evidence import observed_graph
from ._observe_batch import Labelled, Observation, draw_graphs, label_graphs, look_at_outlines, observe_batch
from ._prepare import model_of
from ._prepared import Prepared
from ._settings import Settings
from ._uncertainties import TrustInGraph, TrustInSearch, trust_in_search

# A body whose path lengths from head to feet differ from the template's by more than this share is not this person, or
# only a part of a person.
_LEG_TOLERANCE = 0.3
# The highest voxel may be a raised hand, which is at most 1.5 times as far from the feet as the head is.
_FARTHEST = 1.6


class Start(NamedTuple):
    """Start poses of the refinement, and what is known before it.

    Attributes:
        observed: On the device, padded by `on_device`.
        hypotheses: All that the search found; None without a search.
        fork: Two tracks, between which later frames may decide again, see `track_frames`.
    """

    poses: Pose
    observed: Observed
    plausible: Bool[np.ndarray, " frames"]
    sides: Float[np.ndarray, " frames"]
    uncertainty: TrustInGraph | TrustInSearch
    hypotheses: Hypotheses | None = None
    fork: Fork | None = None


def start_of(
    part: Recording,
    prepared: Prepared,
    settings: Settings,
    objective: Objective,
    track: Track | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    at_once: int = FRAMES_PER_WORD,
) -> tuple[Seen, Start | None, Track | None]:
    """Observe a batch, and find the start poses of its people according to the settings.

    Returns:
        The people seen, the start (None if nobody is seen), and the tracking state for the next batch.
    """
    search, tracking = settings.search, settings.tracking
    model = None if search is None else prepared.model or model_of(prepared, settings)
    needs_graph = objective.needs_graph or (model is not None and model.objective.needs_graph)
    if at_once == 1 and track is not None and model is not None and not needs_graph:
        followed = None
        if not must_be_found(track):
            followed = _by_following(part, prepared, model, settings, track, stopwatch)
        if followed is not None:
            return followed
        track = lost(track)
    # With tracking, only frames with a full search need graphs, unless the objective uses them.
    found = observe_batch(
        part, prepared, settings, label=tracking is None or needs_graph, outlines=search is not None,
        stopwatch=stopwatch, at_once=at_once,
    )  # fmt: skip
    if len(found.seen.frames) == 0:
        return found.seen, None, track
    if model is None:
        assert found.labelled is not None
        return found.seen, start_by_graph(found.labelled, at_once, found.data), track
    start, track = _by_search(found, model, part.fps, prepared, settings, track, stopwatch, at_once)
    return found.seen, start, track


def start_by_graph(labelled: Labelled, at_once: int, data: dict[str, Float[Array | np.ndarray, "people ..."]]) -> Start:
    """Start from the poses of the labelled graphs (Sect. 3.3)."""
    graphs, skeleton, limbs, facing, sides = labelled

    human = skeleton.template == HUMAN_15
    poses = initial_poses(limbs, facing, skeleton) if human else target_poses(limbs, skeleton)
    observed = on_device(observed_graph(limbs, data), at_once)
    return Start(poses, observed, _plausible(graphs, limbs, skeleton), sides, TrustInGraph(limbs, skeleton))


def _by_search(
    found: Observation,
    model: Model,
    fps: float,
    prepared: Prepared,
    settings: Settings,
    track: Track | None,
    stopwatch: Stopwatch,
    at_once: int,
) -> tuple[Start, Track | None]:
    """Start from the best poses of a search: graphs propose poses, silhouettes decide between them."""
    seen, labelled, outlines = found.seen, found.labelled, found.outlines
    assert outlines is not None

    def propose(chosen: Int[np.ndarray, " some"]) -> Proposed:
        if labelled is None:
            graphs = draw_graphs(seen, chosen, prepared, settings, stopwatch)
            limbs, facing, sides = label_graphs(graphs, prepared.skeleton, settings, stopwatch)[2:]
        else:
            limbs, facing, sides = take(labelled[2:], chosen)
        return Proposed(start_poses(limbs, facing, prepared.skeleton), sides)

    observed = on_device(outlines.observed, at_once)
    fallback = graphless_poses(outlines.middles, prepared.skeleton)
    search = _search_of(settings, prepared)
    with stopwatch("search"):
        if settings.tracking is None:
            starts, sides = propose(np.arange(len(seen.frames)))
            hypotheses = solve_frames(model, search, starts, fallback, observed)
            return start_from(hypotheses, observed, sides, prepared), track
        tracking = settings.tracking.for_subject(prepared.clothes, fps)
        followed = track_frames(model, search, tracking, fps, track, propose, fallback, observed)
        start = start_from(followed.found, observed, followed.sides, prepared)
        return start._replace(fork=followed.fork), followed.track


def _by_following(
    frame: Recording,
    prepared: Prepared,
    model: Model,
    settings: Settings,
    track: Track,
    stopwatch: Stopwatch,
) -> tuple[Seen, Start | None, Track] | None:
    """Start from the pose of the frame before; None where the frame must be searched in.

    Where a search is due, the frame is carved, and the search begins; it goes on, step by step, in the next frames.
    """
    assert settings.tracking is not None
    tracking, skeleton = settings.tracking.for_subject(prepared.clothes, frame.fps), prepared.skeleton
    due = search_is_due(tracking, frame.fps, track)
    found = observe_batch(
        frame, prepared, settings, label=False, outlines=False, carved=due, stopwatch=stopwatch, at_once=1
    )  # fmt: skip
    if len(found.seen.frames) == 0:
        return found.seen, None, track
    found = look_at_outlines(found, prepared, stopwatch, np.asarray(track.last.root)[None])
    assert found.outlines is not None
    observed, seen = on_device(found.outlines.observed, 1), found.seen

    def steps() -> Steps[Searched]:
        graphs = draw_graphs(found.seen, np.arange(1), prepared, settings, stopwatch)
        yield
        limbs, facing, sides = label_graphs(graphs, skeleton, settings, stopwatch)[2:]
        yield
        middles = middles_of_people(found.seen, found.silhouettes, prepared.cameras)
        starts, fallback = start_poses(limbs, facing, skeleton), graphless_poses(middles, skeleton)
        best = yield from solving(model, _search_of(settings, prepared), starts, fallback, observed)
        return Searched(jax.tree.map(lambda a: a[0], best.poses), best.cost[0], float(sides[0]))

    with stopwatch("search"):
        followed = follow_frame(model, tracking, frame.fps, track, observed)
        if followed is None:
            return None
        if due:
            followed = followed._replace(track=begun(followed.track, followed.found, steps()))
        elif not track.hurried and doubt_arises(tracking, frame.fps, followed.track):
            found = observe_batch(
                frame, prepared, settings, label=False, outlines=False, stopwatch=stopwatch, at_once=1
            )  # fmt: skip
            if len(found.seen.frames):
                followed = search_in_doubt(model, tracking, frame.fps, track, followed, steps(), observed)
        return seen, start_from(followed.found, observed, followed.sides, prepared), followed.track


def _search_of(settings: Settings, prepared: Prepared) -> Search:
    """Breadth and depth of the search, relative to what this subject's poses cost."""
    assert settings.search is not None
    costs = prepared.costs
    return settings.search if costs is None else settings.search.relative_to(costs.low, costs.typical)


def start_from(found: Hypotheses, observed: Observed, sides: Float[np.ndarray, " frames"], prepared: Prepared) -> Start:
    """Start from the cheapest hypotheses; `observed` is on the device."""
    unexplained = _unexplained(found.best, observed, prepared.body)
    trust = trust_in_search(found, observed, unexplained, prepared)
    return Start(found.best, observed, unexplained < NOT_THE_SUBJECT, sides, trust, found)


def start_other_way(start: Start, prepared: Prepared) -> Start:
    """Start from the other of two tracks in each frame."""
    assert start.fork is not None
    decided = decide([start.fork])
    found = start.fork.hypotheses(1 - decided.path, decided.through)
    return start_from(found, start.observed, start.sides, prepared)


def _unexplained(poses: Pose, observed: Observed, body: Body) -> Float[np.ndarray, " frames"]:
    """Share of the outlines that lie outside the body and not near it."""
    assert observed.contours is not None
    shares = unexplained_shares(single_precision(body), padded(poses, length_of(observed)), observed.contours)
    return np.asarray(shares)[: len(poses.root)]


def _plausible(graphs: list[SkeletalGraph], limbs: Limbs, skeleton: Skeleton) -> Bool[np.ndarray, " frames"]:
    """Whether at least one leg has about the template's length, and no node is much farther from the head.

    Of another template, most limbs must have their lengths.
    """
    if skeleton.template != HUMAN_15:
        ways = template_ends(skeleton)[0, 1:]
        return (limbs.found[:, 1:] & (np.abs(limbs.chords[:, 1:] / ways - 1) < _LEG_TOLERANCE)).mean(1) > 0.5
    way = template_ends(skeleton)[0, [L_FOOT, R_FOOT]]
    legs = np.abs(limbs.chords[:, [L_FOOT, R_FOOT]] / way - 1) < _LEG_TOLERANCE
    farthest = forest_of(graphs).depths.max(1)
    return (legs & limbs.found[:, [L_FOOT, R_FOOT]]).any(1) & (farthest < _FARTHEST * way.max())
