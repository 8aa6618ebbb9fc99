"""Bodies of a room followed in time: who is who, also where people touch and their hulls are one body."""

from dataclasses import dataclass, field

import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Float, Int

from ._bodies import Voxels

# A person moves on where this share of the voxels, moved on with them, lies in a body or beside it.
_SHARE, _BESIDE = 0.2, 2.0
# Otherwise a body is theirs that is within this distance (m), and this speed (m/s) since they were seen.
_NEAR, _FASTEST = 0.4, 3.0
# A body that nobody has become is somebody new after this time (s).
_NEW = 1.0
# Somebody who was not seen for a shorter time (s) is still here, whatever the body looks like.
_HERE = 0.3
# The body of somebody who was not seen for a moment has at least this share of their volume.
_VOLUME_SHARE = 0.3
# Somebody has at least this share of the volume of the others, as a child of 1.05 m has a quarter of a man's.
_SMALLEST_SHARE = 0.15
_LEAST = 0.012  # and at least this volume (m^3)
# Somebody who comes back is as tall as before (m).
_AS_TALL = 0.12
# How much of a new velocity is taken, and how much of it is left in every frame in which people touch.
_FRESH, _SLOWED = 0.5, 0.7
# How often people who touch are moved to where they explain their common body best.
_ROUNDS = 4
# A part of a common body with less than this share of the person's volume says nothing about the person.
_TOO_LITTLE = 0.25


@dataclass
class _Person:
    """What is known of somebody: where they were last (voxels), how they move, and how large they are.

    Attributes:
        voxels: Where they were seen last.
        velocity: Voxels per frame.
        unseen: Number of frames since then.
        tall: Largest height so far (voxels).
        volume: Usual number of voxels.
        alone: Their voxels when they were last a body of their own, moved on to where they are now.
    """

    voxels: Voxels
    velocity: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    unseen: int = 0
    tall: float = 0.0
    volume: float = 0.0
    alone: Float[np.ndarray, "_ 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def ahead(self) -> Float[np.ndarray, "n 3"]:
        return self.voxels + self.velocity

    def moved(self, voxels: Voxels) -> None:
        """Take the body that they are now."""
        step = (voxels.mean(0) - self.voxels.mean(0)) / (self.unseen + 1)
        self.velocity = (1 - _FRESH) * self.velocity + _FRESH * step
        self.voxels, self.unseen, self.alone = voxels, 0, voxels.astype(np.float64)
        self.tall = max(self.tall, float(np.ptp(voxels[:, 2]) + 1))
        self.volume = len(voxels) if self.volume == 0 else 0.9 * self.volume + 0.1 * len(voxels)

    def moved_within(self, part: Voxels, step: Float[np.ndarray, "3"]) -> None:
        """Take the part that they are of a body in which others are, too."""
        self.velocity = _SLOWED * self.velocity
        self.voxels, self.unseen, self.alone = part, 0, self.alone + step


Whereabouts = list[dict[int, Voxels]]
"""The voxels of each person, by number, in every frame in which they are seen."""


def follow(
    bodies: list[list[Voxels]], spacing: float, fps: float, most: int, all_are_there: bool = False
) -> Whereabouts:
    """Follow people through all frames, forwards and backwards from one in which as many as possible are apart.

    Args:
        bodies: The voxels of each body in every frame, as from `bodies_of_frames`.
        spacing: Edge of a voxel (m).
        fps: Frames per second.
        most: Largest number of people.
        all_are_there: Whether there are so many, be they apart for a moment only.
    """
    counts = np.array([len(_people_among(frame, spacing)) for frame in bodies])
    if counts.max(initial=0) == 0:
        return [{} for _ in bodies]
    lasting = min(1.0 if all_are_there else _NEW * fps, len(bodies) / 2) / 2
    anchor = _anchor(counts, most, lasting)
    whereabouts: Whereabouts = [{} for _ in bodies]
    first = _people_among(bodies[anchor], spacing)[:most]
    names = 0
    for order in (range(anchor, len(bodies)), range(anchor - 1, -1, -1)):
        crowd = _Crowd(spacing, fps, most, {number: _Person(voxels) for number, voxels in enumerate(first)}, names)
        for person in crowd.people.values():
            person.moved(person.voxels)
            person.velocity = np.zeros(3)
        for frame in order:
            for back, found in crowd.step(bodies[frame]):
                whereabouts[frame - back * (1 if order.step > 0 else -1)] |= found
        names = max(names, crowd.next)
    longest = {number: _longest(whereabouts, number) for number in present(whereabouts).tolist()}
    least = min(lasting, max(longest.values(), default=0))
    ghosts = {number for number, frames in longest.items() if frames < least}
    return [{number: voxels for number, voxels in frame.items() if number not in ghosts} for frame in whereabouts]


def _people_among(bodies: list[Voxels], spacing: float) -> list[Voxels]:
    """The bodies as large as a person."""
    sizes = np.array([len(voxels) for voxels in bodies]) * spacing**3
    if len(sizes) == 0:
        return []
    least = max(_LEAST, _SMALLEST_SHARE * sizes[0])
    return [voxels for voxels, size in zip(bodies, sizes, strict=True) if size >= least]


def _anchor(counts: Int[np.ndarray, " frames"], most: int, lasting: float) -> int:
    """A frame in the middle of the longest time in which as many people as possible are apart.

    More bodies for a shorter time than `lasting` (frames) are ghosts.
    """
    for wanted in range(min(int(counts.max()), most), 0, -1):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (counts >= wanted).astype(int), [0]])))
        starts, ends = edges[::2], edges[1::2]
        longest = int(np.argmax(ends - starts))
        if ends[longest] - starts[longest] >= lasting:
            return int((starts[longest] + ends[longest] - 1) // 2)
    return int(np.argmax(counts))


def _longest(whereabouts: Whereabouts, number: int) -> int:
    """Number of frames of the longest time in which somebody is seen without a break."""
    longest = now = 0
    for frame in whereabouts:
        now = now + 1 if number in frame else 0
        longest = max(longest, now)
    return longest


class _Crowd:
    """The people of a room, from frame to frame in one direction of time."""

    def __init__(self, spacing: float, fps: float, most: int, people: dict[int, _Person], used: int):
        self.people = people
        self.next = max(used, len(people))
        self._spacing, self._fps, self._most = spacing, fps, most
        self._waiting: list[list[Voxels]] = []  # bodies of nobody, frame by frame, each followed since the first

    def step(self, bodies: list[Voxels]) -> list[tuple[int, dict[int, Voxels]]]:
        """Who is where in the next frame; with pairs for earlier frames (frames back) of somebody new."""
        claims = self._claims(bodies)
        found: dict[int, Voxels] = {}
        for body, voxels in enumerate(bodies):
            own = [number for number, claimed in claims.items() if claimed == body]
            if len(own) == 1:
                self.people[own[0]].moved(voxels)
                found[own[0]] = voxels
            elif own:
                found |= self._divided(voxels, own)
        for number, person in self.people.items():
            if number not in found:
                person.unseen += 1
        new = self._newcomers([voxels for body, voxels in enumerate(bodies) if body not in claims.values()])
        return [(0, found), *new]

    def _claims(self, bodies: list[Voxels]) -> dict[int, int]:
        """The body of each person, by number."""
        if not bodies:
            return {}
        body = np.repeat(np.arange(len(bodies)), [len(voxels) for voxels in bodies])
        tree = scipy.spatial.KDTree(np.concatenate(bodies))
        claims: dict[int, int] = {}
        middles = np.stack([voxels.mean(0) for voxels in bodies])
        for number, person in self.people.items():
            if person.unseen:
                continue
            near = np.asarray(tree.query(person.ahead, distance_upper_bound=_BESIDE)[1])
            there = near < len(body)
            shares = np.bincount(body[near[there]], minlength=len(bodies)) / len(near)
            if shares.max() >= _SHARE:
                claims[number] = int(np.argmax(shares))
        for number, person in self.people.items():
            free = [one for one in range(len(bodies)) if one not in claims.values()]
            if number in claims or not free:
                continue
            away = np.linalg.norm(middles[free] - person.voxels.mean(0), axis=1) * self._spacing
            reach = _NEAR + _FASTEST * (person.unseen + 1) / self._fps
            likely = [
                (far, one) for far, one in zip(away, free, strict=True)
                if far <= reach and len(bodies[one]) >= _VOLUME_SHARE * person.volume
                and (person.unseen <= _HERE * self._fps or self._as_tall(person, bodies[one]))
            ]  # fmt: skip
            if likely:
                claims[number] = min(likely)[1]
        return claims

    def _as_tall(self, person: _Person, voxels: Voxels) -> bool:
        return abs(float(np.ptp(voxels[:, 2]) + 1) - person.tall) * self._spacing <= _AS_TALL

    def _divided(self, voxels: Voxels, own: list[int]) -> dict[int, Voxels]:
        """A common body, each voxel given to the person whose body is nearest, as it was when they were alone.

        These bodies are moved to where they explain the common one best, by iterated closest points: what is common is
        near some of them, and they lie in what is common.
        """
        shapes = [self.people[number].alone for number in own]
        whose = np.repeat(np.arange(len(own)), [len(each) for each in shapes])
        steps = np.stack([self.people[number].velocity for number in own])
        common = scipy.spatial.KDTree(voxels)
        for _ in range(_ROUNDS):
            moved = np.concatenate(shapes) + steps[whose]
            near = np.asarray(scipy.spatial.KDTree(moved).query(voxels)[1])
            inside = voxels[np.asarray(common.query(moved)[1])] - moved
            for place in range(len(own)):
                covered = whose[near] == place
                pulls = [inside[whose == place]] + ([voxels[covered] - moved[near[covered]]] if covered.any() else [])
                steps[place] += np.mean([pull.mean(0) for pull in pulls], axis=0)
        near = np.asarray(scipy.spatial.KDTree(np.concatenate(shapes) + steps[whose]).query(voxels)[1])
        found = {}
        for place, number in enumerate(own):
            part, person = voxels[whose[near] == place], self.people[number]
            if len(part) >= _TOO_LITTLE * person.volume:
                person.moved_within(part, steps[place])
                found[number] = part
        return found

    def _newcomers(self, bodies: list[Voxels]) -> list[tuple[int, dict[int, Voxels]]]:
        """People who have been there for a while and are nobody known, in the frames since they came."""
        usual = np.median([person.volume for person in self.people.values()]) if self.people else 0.0
        least = max(_LEAST / self._spacing**3, _SMALLEST_SHARE * usual)
        waiting = []
        for voxels in bodies:
            if len(voxels) < least:
                continue
            before = min(
                self._waiting, key=lambda past: float(np.linalg.norm(past[-1].mean(0) - voxels.mean(0))), default=None
            )
            if before is not None:
                far = float(np.linalg.norm(before[-1].mean(0) - voxels.mean(0))) * self._spacing
                if far <= _NEAR + _FASTEST / self._fps:
                    waiting.append([*before, voxels])
                    continue
            waiting.append([voxels])
        self._waiting, found = [], []
        for past in waiting:
            if len(past) < max(2, _NEW * self._fps):
                self._waiting.append(past)
                continue
            number = self._number_of(past[-1])
            if number is None:
                continue
            person = self.people.setdefault(number, _Person(past[0]))
            person.unseen = 0
            for back, voxels in zip(range(len(past) - 1, -1, -1), past, strict=True):
                person.moved(voxels)
                found.append((back, {number: voxels}))
        return found

    def _number_of(self, voxels: Voxels) -> int | None:
        """Number of somebody who comes: of one who left and is as tall, else a new one; None if there are enough."""
        gone = [number for number, person in self.people.items() if person.unseen and self._as_tall(person, voxels)]
        if gone:
            return min(gone, key=lambda number: abs(self.people[number].tall - float(np.ptp(voxels[:, 2]) + 1)))
        if len(self.people) >= self._most:
            return None
        self.next += 1
        return self.next - 1


def present(whereabouts: Whereabouts) -> Int[np.ndarray, " people"]:
    """Numbers of all people, in the order of their first frame."""
    seen: dict[int, None] = {}
    for frame in whereabouts:
        seen |= dict.fromkeys(sorted(frame))
    return np.array(list(seen), int)
