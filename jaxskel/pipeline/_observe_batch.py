"""The first half of the method: from the silhouettes of a batch to observations, before any pose.

The only file that knows the order of these stages: carve, find the person, extract the graph, label it, compute the
outlines (Sect. 3.1 and 3.2).
"""

from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float, Int, UInt8

from .._runtime.batching import take
from ..body import Skeleton
from ..graph import SkeletalGraph, person_graphs
from ..hull import FRAMES_PER_WORD, Seen, Stopwatch, VisualHulls, middles_of_people, see_people, trust_views
from ..matching import Limbs, labelled_limbs
from ..recording import Recording
from ..refinement.terms import Observed
from ._evidence import observed_volume
from ._prepared import Prepared
from ._settings import GraphSettings, Settings


class Labelled(NamedTuple):
    """The labelled skeletal graphs of some people.

    Attributes:
        skeleton: The template that the graphs were matched with.
        facing: Unit vector that each person faces, in the world with z up.
        sides: Confidence in left and right, from 0.5 to 1.
    """

    graphs: list[SkeletalGraph]
    skeleton: Skeleton
    limbs: Limbs
    facing: Float[np.ndarray, "people 3"]
    sides: Float[np.ndarray, " people"]


class Outlines(NamedTuple):
    """Observations of some people from the silhouettes themselves.

    Attributes:
        middles: The middle of each person (m).
    """

    middles: Float[np.ndarray, "people 3"]
    observed: Observed


class Observation(NamedTuple):
    """Observations from the silhouettes of a batch.

    Attributes:
        data: The recording's own data of the frames with a person.
        labelled: None if nobody is seen, or if it was not asked for.
        outlines: None in the same cases.
        hidden: As the recording has it.
    """

    silhouettes: UInt8[np.ndarray, "frames cams h w8"]
    seen: Seen
    data: dict[str, Float[Array | np.ndarray, "people ..."]]
    labelled: Labelled | None = None
    outlines: Outlines | None = None
    hidden: UInt8[np.ndarray, "frames cams h w8"] | None = None


def observe_batch(
    part: Recording,
    prepared: Prepared,
    settings: Settings,
    *,
    label: bool = True,
    outlines: bool = True,
    carved: bool = True,
    template: Callable[[list[SkeletalGraph]], Skeleton] | None = None,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    at_once: int = FRAMES_PER_WORD,
) -> Observation:
    """Observe a batch of at most 32 frames.

    Args:
        part: The frames.
        prepared: Result of `prepare` for this recording and these settings.
        settings: Settings of the stages.
        label: Whether to extract and label the graphs.
        outlines: Whether to compute the outlines of the silhouettes.
        carved: Whether to carve hulls; without them, enough views that show somebody are taken for the person.
        template: Function from the graphs to the template that labels them; by default the prepared template.
        stopwatch: Times the stages ``carve``, ``graph``, ``match`` and ``observe``.
        at_once: Frames that are carved at once, see `carve`.
    """
    silhouettes = np.asarray(part.silhouettes)
    hidden = None if part.hidden is None else np.asarray(part.hidden)
    if carved:
        seen = see_people(
            silhouettes, prepared.cameras, prepared.table, prepared.edge, prepared.max_misses, stopwatch, at_once,
            hidden,
        )  # fmt: skip
    else:
        seen = trust_views(silhouettes, prepared.cameras)
    observation = Observation(silhouettes, seen, take(part.data, seen.frames), hidden=hidden)
    if len(seen.frames) == 0:
        return observation
    if label:
        graphs = draw_graphs(seen, np.arange(len(seen.frames)), prepared, settings, stopwatch)
        skeleton = prepared.skeleton if template is None else template(graphs)
        observation = observation._replace(labelled=label_graphs(graphs, skeleton, settings, stopwatch))
    if outlines:
        observation = look_at_outlines(observation, prepared, stopwatch)
    return observation


def draw_graphs(
    seen: Seen, people: Int[np.ndarray, " some"], prepared: Prepared, settings: Settings, stopwatch: Stopwatch
) -> list[SkeletalGraph]:
    """Extract the graphs of some of the people in a batch."""
    assert seen.hulls is not None
    with stopwatch("graph"):
        return graphs_of(seen.hulls[people], prepared.skeleton, settings.graph)


def graphs_of(hulls: VisualHulls, skeleton: Skeleton, graph: GraphSettings) -> list[SkeletalGraph]:
    """Extract the graph of the person in each hull; `skeleton` is the template as far as it is known."""
    return person_graphs(hulls, skeleton, graph.root_finder, graph.min_branch, graph.skeletoniser)


def label_graphs(
    graphs: list[SkeletalGraph],
    skeleton: Skeleton,
    settings: Settings,
    stopwatch: Stopwatch = lambda _: nullcontext(),
) -> Labelled:
    """Match graphs with a template."""
    with stopwatch("match"):
        found = labelled_limbs(graphs, skeleton, settings.matching.matcher, settings.matching.descriptor)
    return Labelled(graphs, skeleton, *found)


def look_at_outlines(
    observation: Observation,
    prepared: Prepared,
    stopwatch: Stopwatch = lambda _: nullcontext(),
    middles: Float[np.ndarray, "people 3"] | None = None,
) -> Observation:
    """Add the outlines, and the labels if there are any, to an observation; `middles` (m) if they are known already."""
    silhouettes, seen, data, labelled, _, hidden = observation
    limbs = Limbs.none(len(seen.frames)) if labelled is None else labelled.limbs
    with stopwatch("observe"):
        if middles is None:
            middles = middles_of_people(seen, silhouettes, prepared.cameras)
        observed = observed_volume(
            limbs, seen, silhouettes, prepared.cameras, middles, prepared.max_misses, data, hidden
        )  # fmt: skip
    return observation._replace(outlines=Outlines(middles, observed))
