"""Two tracks over a film: what is decided is the cheapest of all paths, however the film is cut into batches."""

from itertools import product

import jax
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jaxskel import Pose
from jaxskel.search import Fork, Hypotheses, decide
from jaxskel.search._fork import track_after


def fork_of(cost: np.ndarray, jumps: np.ndarray, first: np.ndarray, alike: int = 1) -> Fork:
    """A fork with these costs, in which the root of a pose says frame, track and which of the two hypotheses it is."""
    frames, tracks = np.meshgrid(np.arange(len(cost)), [0, 1], indexing="ij")

    def poses(which: int) -> Pose:
        roots = np.stack([frames, tracks, np.full_like(frames, which)], -1).astype(np.float32)
        return Pose(roots, np.zeros((*cost.shape, 17, 3, 3), np.float32))

    cost = cost.astype(np.float32)
    seconds = Hypotheses(poses(1), cost + 1)
    others = tuple(jax.tree.map(lambda a, i=i: a[:, i : i + 1], seconds) for i in (0, 1))
    return Fork(Hypotheses(poses(0), cost), (others[0], others[1]), jumps, first, alike)


def random_forks(seed: int, lengths: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, list[Fork]]:
    """Costs and jumps of a whole film, and its forks; nothing jumps between two forks."""
    draw = np.random.default_rng(seed)
    cost = draw.integers(0, 9, (sum(lengths), 2)).astype(float)
    jumps = np.zeros((sum(lengths), 2, 2))
    jumps[:, 0, 1], jumps[:, 1, 0] = draw.integers(1, 12, (2, sum(lengths)))
    ends = np.cumsum(lengths)
    jumps[ends - 1] = np.where(np.eye(2) > 0, 0, np.inf)
    forks, own, excess = [], np.array([0, 1]), 0.0
    for start, end in zip([0, *ends], ends, strict=False):
        # Each fork's first track goes on from the cheaper one so far.
        fork = fork_of(
            cost[start:end][:, own], jumps[start:end][:, own][:, :, own], np.array([0.0, excess if start else 0.0])
        )
        forks.append(fork)
        totals = [best_of(fork, lambda path, last=last: path[-1] == last)[0] for last in (0, 1)]
        own, excess = own[[track_after(fork), 1 - track_after(fork)]], abs(totals[0] - totals[1])
    return cost, jumps, forks


def cost_of(cost: np.ndarray, jumps: np.ndarray, first: np.ndarray, path: tuple[int, ...]) -> float:
    changes = sum(jumps[frame, path[frame], path[frame + 1]] for frame in range(len(path) - 1))
    return float(first[path[0]] + changes + sum(cost[frame, track] for frame, track in enumerate(path)))


def best_of(fork: Fork, allowed) -> tuple[float, tuple[int, ...]]:
    """The cheapest of all allowed paths through a fork, by trying all."""
    paths = [path for path in product((0, 1), repeat=len(fork.both.cost)) if allowed(path)]
    return min((cost_of(fork.both.cost, fork.jumps, fork.first, path), path) for path in paths)


def in_film(forks: list[Fork], path: np.ndarray) -> list[int]:
    """A path in the tracks of the first fork: those of a later one may be exchanged."""
    found, exchanged, first = [], 0, 0
    for fork in forks:
        count = len(fork.both.cost)
        found += [int(track) ^ exchanged for track in path[first : first + count]]
        exchanged, first = exchanged ^ track_after(fork), first + count
    return found


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 4), min_size=1, max_size=3))
def test_a_film_in_batches_is_decided_as_by_trying_all_paths(seed, lengths):
    cost, jumps, forks = random_forks(seed, tuple(lengths))
    whole = fork_of(cost, jumps, np.zeros(2))
    found = decide(forks)
    least = best_of(whole, lambda _: True)[0]
    assert cost_of(cost, jumps, whole.first, tuple(in_film(forks, found.path))) == pytest.approx(least)


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(1, 4), min_size=1, max_size=2))
def test_paths_through_a_track_cost_what_the_cheapest_of_them_does(seed, lengths):
    cost, jumps, forks = random_forks(seed, tuple(lengths))
    whole, found = fork_of(cost, jumps, np.zeros(2)), decide(forks)
    sides = in_film(forks, np.zeros(len(cost), int))
    for frame, side in enumerate(sides):
        for track in (0, 1):
            least = best_of(whole, lambda path, at=frame, on=track ^ side: path[at] == on)[0]
            assert found.through[frame, track] == pytest.approx(least)


@given(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_what_is_settled_is_so_whatever_comes_later(seed, later):
    forks = random_forks(seed, (4, 4))[2]
    settled = decide(forks[:1]).settled
    draw = np.random.default_rng(later)
    other = fork_of(draw.integers(0, 99, (3, 2)).astype(float), np.zeros((3, 2, 2)), forks[1].first)
    assert decide([forks[0], other]).path[:settled].tolist() == decide(forks).path[:settled].tolist()
    assert decide(forks).settled >= settled


def test_later_frames_turn_round_who_was_taken_to_face_the_other_way():
    """Frame 1 misleads; a jump costs 10, so that the first batch alone ends on the wrong track."""
    jumps = np.tile(np.array([[0.0, 10.0], [10.0, 0.0]]), (3, 1, 1))
    first = fork_of(np.array([[1, 2], [5, 1], [1, 1]]), jumps, np.zeros(2), alike=2)
    alone = decide([first])
    assert (alone.path.tolist(), alone.settled) == ([1, 1, 1], 0)
    # The first track of the second fork goes on from the second track of the first.
    second = fork_of(np.array([[9, 1], [9, 1], [9, 1]]), jumps, np.array([0.0, 3.0]))
    both = decide([first, second])
    assert both.path.tolist() == [0, 0, 0, 1, 1, 1]
    np.testing.assert_allclose(both.through[0], [1 + 5 + 1 + 3, 2 + 1 + 10 + 1 + 3])
    told = first.hypotheses(both.path[:3], both.through[:3])
    np.testing.assert_array_equal(told.poses.root[0], [[0, 0, 0], [0, 1, 0], [0, 0, 1]])
    excess = both.through[0, 1] - both.through[0, 0]
    np.testing.assert_allclose(told.cost[0], [1, 1 + excess / 2, 2])
