"""The wavefront of voxel scooping: which cells of a batch of frames are still unvisited."""

import numpy as np
from jaxtyping import Int

from .._math.components import connected
from ._cells import HERE, THERE, WAYS, Cells

# Cells whose neighbours are examined at once: their positions fit into 16 bits, and the arrays into the cache.
_AT_ONCE = 2048
# Positions of these neighbours, ascending and descending.
_UP = np.arange(_AT_ONCE * WAYS, dtype=np.uint16)
_DOWN = _UP[::-1].copy()
# Tiled, because one long array is faster than many short ones.
_THERE = np.tile(THERE, _AT_ONCE)


class Wave:
    """The open (unvisited) cells of a batch of frames. At first all cells are open."""

    def __init__(self, cells: Cells):
        self._codes = cells.codes
        self._open = cells.codes.copy()  # 0 where visited
        self._steps = np.tile(cells.steps, min(_AT_ONCE, len(cells.codes)))
        self._mention = np.empty(len(self._open), np.uint16)
        self._number = np.zeros(len(self._open), np.int32)

    def mark_visited(self, cells: Int[np.ndarray, " n"]) -> None:
        """Mark cells as visited."""
        self._open[cells] = 0

    def seen(
        self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " seen"], Int[np.ndarray, " seen"]]:
        """The open neighbours of some cells; each gets the owner of the first of these cells that it touches."""
        if len(cells) > _AT_ONCE:
            return self._seen_in_parts(cells, owners)
        around = cells.repeat(WAYS)
        around += self._steps[: len(around)]
        there = self._open.take(around)
        there &= _THERE[: len(around)]
        here = self._codes.take(cells)[:, None] & HERE
        hit = np.logical_and(here.reshape(-1), there).nonzero()[0]
        around = around.take(hit)
        first = self._first(around)
        return around.take(first), owners.take(hit.take(first) // WAYS)

    def _seen_in_parts(
        self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " seen"], Int[np.ndarray, " seen"]]:
        found = []
        for start in range(0, len(cells), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            found.append(self.seen(cells[part], owners[part]))
            self.mark_visited(found[-1][0])  # later parts must not find them again
        seen, whose = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
        self._open[seen] = self._codes.take(seen)
        return seen, whose

    def mark_visited_first(
        self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " open"], Int[np.ndarray, " open"]]:
        """Visit the open ones of some cells, ordered by owner; of several entries of a cell the first counts."""
        order = stable_order(owners)
        cells, owners = cells.take(order), owners.take(order)
        kept = [order[:0]]
        for start in range(0, len(cells), len(_UP)):
            some = cells[start : start + len(_UP)]
            still = (self._open.take(some) != 0).nonzero()[0]
            still = still.take(self._first(some.take(still)))
            self.mark_visited(some.take(still))
            kept.append(start + still)
        index = np.concatenate(kept)
        return cells.take(index), owners.take(index)

    def components(self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Label the connected components of cells with the same owner, from 0."""
        ahead = WAYS // 2  # one of each pair of opposite directions
        self._number[cells] = np.arange(1, len(cells) + 1)
        other = self._number.take((cells[:, None] + self._steps[:ahead]).reshape(-1))
        self._number[cells] = 0
        hit = (other != 0).nonzero()[0]
        source, target = hit // ahead, other.take(hit) - 1
        way, codes = hit - source * ahead, self._codes.take(cells)
        touch = np.logical_and(codes.take(source) & HERE.take(way), codes.take(target) & THERE.take(way))
        met = (touch & (owners.take(source) == owners.take(target))).nonzero()[0]
        return connected(source.take(met), target.take(met), len(cells))

    def _first(self, cells: Int[np.ndarray, " n"]) -> Int[np.ndarray, " first"]:
        """Index of the first entry of every cell."""
        # Written in reverse, so that the first entry wins. Reversed copies are faster than reversed views.
        self._mention[cells[::-1].copy()] = _DOWN[len(_DOWN) - len(cells) :]
        return (self._mention.take(cells) == _UP[: len(cells)]).nonzero()[0]


def stable_order(numbers: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Indices that sort small numbers stably."""
    if len(numbers) > _AT_ONCE and numbers.max() < 2**16:
        numbers = numbers.astype(np.uint16)  # many 16-bit integers are sorted in a fraction of the time
    return numbers.argsort(kind="stable")
