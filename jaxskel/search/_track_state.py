"""Settings and state of tracking."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from .._runtime.kinds import check_count, check_number
from .._runtime.steps import Steps
from ..body import Pose
from ._alternatives import Alternatives
from ._uncertainty import variance_in_clothes

# Thickness of clothes (m) in which margins are twice those of naked people.
_CLOTHES = 0.015
# Frames per second below which a person may turn round between two frames.
_TURNING = 8.0
# Intervals between searches are this many times as long while a track is calm. Nine films of naked people, and six in
# clothes, had the same joints wrong with 1 and with 2; with 2, 86 frames of a walk took 0.9 times as long to search.
_CALM = 2


class Tracking(eqx.Module):
    """Settings of tracking.

    Attributes:
        interval: Time between two full searches (s), twice as long while the track agrees with what they find: for
            this time it can follow a pose that another one beats.
        steps: Steps of the fit that starts at the pose of the frame before.
        margin: Hysteresis: the cost of a jump to another pose. A single frame makes the track jump only if the other
            pose is cheaper by more than this, several frames if their sum is.
        turn_margin: The same for a pose that faces the other way: nobody turns round from one frame to the next, so
            either one of the two is wrong from its beginning on, or a frame misleads.
    """

    interval: float = 0.25
    steps: int = 6
    margin: float = 2.0
    turn_margin: float = 10.0

    def __check_init__(self):
        """Reject numbers that make no sense."""
        check_number("interval", self.interval, 0.0, np.inf, "a time in seconds, such as 0.25")
        check_count("steps", self.steps)
        for name in ("margin", "turn_margin"):
            check_number(name, getattr(self, name), 0.0, np.inf, "a cost, zero or more")

    def for_subject(self, clothes: float, fps: float) -> "Tracking":
        """The same with margins as this film needs them.

        Args:
            clothes: Root mean square thickness of what the subject wears (m); margins grow as costs tell less.
            fps: Frames per second; between frames that are far apart, a person may turn round.
        """
        wider = variance_in_clothes(clothes, _CLOTHES)
        margin = wider * self.margin
        turn = wider * self.turn_margin if fps >= _TURNING else margin
        return replace(self, margin=margin, turn_margin=max(turn, margin))

    def for_one_offer(self, fps: float) -> "Tracking":
        """The same with the margin of a pose that a search offers in a stream.

        It holds until the next search. In a stack, all frames until then pay for the jump together, so here the one
        that takes it pays its share. Of 30 films in clothes, 7.7 % of the hands were wrong, and 7.9 with the whole
        margin; of 15 naked ones 0.4 with either.
        """
        return replace(self, margin=self.margin / between_searches(self, fps))

    def with_turns(self, margin: float) -> "Tracking":
        """The same with another margin for poses that face the other way."""
        return replace(self, turn_margin=margin)


class Searched(NamedTuple):
    """What a full search found in one frame.

    Attributes:
        poses: Axis ``alternatives``, the cheapest first.
        cost: Cost of each; infinite where there is none.
        sides: Confidence that left and right are not exchanged (0.5..1).
    """

    poses: Pose
    cost: Float[np.ndarray, " alternatives"]
    sides: float


@dataclass(frozen=True, eq=False)
class Ongoing:
    """A search in one frame while later ones are followed. No tree of arrays: JAX does not look into it.

    Attributes:
        pose: Pose of the track in the frame that is searched in.
        cost: Its cost.
        in_doubt: Whether it began because the track cost more than is usual; it goes faster then.
        rested: Whether it rested in the last frame.
    """

    steps: Steps[Searched]
    pose: Pose
    cost: float
    in_doubt: bool = False
    rested: bool = True


class Rival(eqx.Module):
    """State of a second track, which faces the other way.

    Attributes:
        excess: How much more the cheapest path costs that ends on it than the one that was chosen.
    """

    last: Pose
    before: Pose
    excess: float


class Track(eqx.Module):
    """State of tracking after the last frame.

    Attributes:
        since: Frames since the last full search.
        costs: Costs of the most recent poses.
        sides: Confidence of the last full search that left and right are not exchanged (0.5..1).
        ongoing: A search that lasts over several frames of a stream.
        hurried: Whether searches are put off in the next frame of a stream, because other frames wait.
        rival: A track that faces the other way and costs little more; None where there is none.
        alternatives: What the latest search found besides; None before the first one.
        calm: Whether the latest searches found the track's own pose, or one that it took.
    """

    last: Pose
    before: Pose
    since: int
    costs: Float[np.ndarray, " recent"]
    sides: float = 0.5
    ongoing: Ongoing | None = None
    hurried: bool = eqx.field(static=True, default=False)
    rival: Rival | None = None
    alternatives: Alternatives | None = None
    calm: bool = False


def between_searches(tracking: Tracking, fps: float) -> int:
    """Frames from one full search to the next, unless the track is calm."""
    return max(1, round(tracking.interval * fps))


def until_search(tracking: Tracking, fps: float, track: Track | None) -> int:
    """Frames from the latest full search of a track to the next."""
    return between_searches(tracking, fps) * (_CALM if track is not None and track.calm else 1)


def last_two(poses: Pose) -> tuple[Pose, Pose]:
    """The last pose of successive frames and the one before, which is the same where there is only one."""
    last, before = (jax.tree.map(lambda a, i=i: a[max(len(a) - i, 0)], poses) for i in (1, 2))
    return last, before


def must_be_found(track: Track) -> bool:
    """Whether the next frame of a stream must be searched in before anything else, see `lost`."""
    return track.since < 0


def hurried(track: Track) -> Track:
    """The same track; in the next frame, a search neither begins nor goes on, unless the person is lost."""
    return replace(track, hurried=True)


def lost(track: Track) -> Track:
    """The same track, but the person must be found in the next frame."""
    return replace(track, since=-1, ongoing=None)
