"""Scores of several people: who is whom over the whole recording, each one's joints, and exchanged identities."""

from collections.abc import Mapping

import equinox as eqx
import numpy as np
import scipy  # imports its parts when they are first used
from jaxtyping import Float

from ..body import HUMAN_15, SkeletonTemplate
from ._poses import Poses
from .metrics import Score, score_poses

# Poses farther from somebody's root joint are of somebody else, or of nobody (m).
_SAME = 0.5


class PeopleScore(eqx.Module):
    """Scores of several people. Made by [`score_people`][].

    Attributes:
        scores: Score of each true person, by name; of those who are nobody's, all joints are wrong.
        found_as: Name of the poses that are each true person's; None if there are none left.
        exchanged: Number of times that poses began to follow somebody else than before.
        missed: Frames times people in which a true person has no pose near.
        false: Frames times poses that are near no true person.
        total: Frames times people whose truth is known.
    """

    scores: dict[str, Score]
    found_as: dict[str, str | None] = eqx.field(static=True)
    exchanged: int
    missed: int
    false: int
    total: int

    @property
    def accuracy(self) -> float:
        """Multiple object tracking accuracy (MOTA, Bernardin and Stiefelhagen 2008): 1 if nothing is wrong."""
        return 1 - (self.missed + self.false + self.exchanged) / self.total


def score_people(
    people: Mapping[str, Poses],
    truths: Mapping[str, Float[np.ndarray, "frames joints 3"]],
    truth_template: SkeletonTemplate = HUMAN_15,
    threshold: float = 0.1,
) -> PeopleScore:
    """Score the poses of several people against the truth of the same frames in the same world.

    Names need not agree: over the whole recording, each true person is given the poses with which most joints are near.

    Args:
        people: The poses of each person, by name.
        truths: True joints of each person (m), by name; NaN where unknown.
        truth_template: What these joints are of.
        threshold: A joint farther than this from the truth is wrong (m).

    Raises:
        ValueError: There is nobody, or frames or joints do not fit, as for `score_poses`.
    """
    if not people or not truths:
        raise ValueError("score: there is nobody; give the poses and the truth of one person or more")
    every = {
        (name, truth): score_poses(poses, joints, truth_template, threshold)
        for name, poses in people.items() for truth, joints in truths.items()
    }  # fmt: skip
    right = np.array([[(every[name, truth].distances <= threshold).mean() for truth in truths] for name in people])
    found_as: dict[str, str | None] = dict.fromkeys(truths)
    for own, true in zip(*scipy.optimize.linear_sum_assignment(-right), strict=True):
        found_as[list(truths)[true]] = list(people)[own]
    scores = {}
    for truth in truths:
        own = found_as[truth]
        some = every[own or next(iter(people)), truth]
        scores[truth] = some if own is not None else _without_pose(some)
    return PeopleScore(scores, found_as, *_identities(people, truths))


def _without_pose(score: Score) -> Score:
    none = np.full_like(score.distances, np.inf)
    return eqx.tree_at(
        lambda s: (s.distances, s.forgiven, s.has_pose), score, (none, none, np.zeros_like(score.has_pose))
    )


def _identities(
    people: Mapping[str, Poses], truths: Mapping[str, Float[np.ndarray, "frames joints 3"]]
) -> tuple[int, int, int, int]:
    """Exchanged identities, missed people, false poses, and true people, over all frames, by the root joints."""
    roots = np.stack([poses.joints[:, 0] for poses in people.values()])
    true = np.stack([joints[:, 0] for joints in truths.values()])
    away = np.linalg.norm(roots[:, None] - true[None], axis=-1)  # NaN where either is not known
    exchanged = missed = false = 0
    before: dict[int, int] = {}
    for frame in range(true.shape[1]):
        known, posed = np.isfinite(true[:, frame]).all(-1), np.isfinite(roots[:, frame]).all(-1)
        # Far more than any distance between two people.
        costs = np.where(away[..., frame] <= _SAME, away[..., frame], 1e6)
        pairs = [
            (int(own), int(one))
            for own, one in zip(*scipy.optimize.linear_sum_assignment(costs), strict=True) if costs[own, one] <= _SAME
        ]  # fmt: skip
        exchanged += sum(before.get(one, own) != own for own, one in pairs)
        before |= {one: own for own, one in pairs}
        missed += int(known.sum()) - len(pairs)
        false += int(posed.sum()) - len(pairs)
    return exchanged, missed, false, int(np.isfinite(true).all(-1).sum())
