"""The wavefront that runs from the roots through a batch of frames: which of their cells are still unvisited."""

import numpy as np
from jaxtyping import Int

from .._math.components import connected
from ._cells import TOUCHED, WAYS, Cells

# Cells whose neighbours are examined at once: their positions fit into 16 bits, and the arrays into the cache.
_AT_ONCE = 2048
# Positions of these neighbours, ascending and descending.
_UP = np.arange(_AT_ONCE * WAYS, dtype=np.uint16)
_DOWN = _UP[::-1].copy()
# One of each pair of opposite directions.
_AHEAD = WAYS // 2
_TOUCHED_AHEAD = TOUCHED[:, :_AHEAD].T.copy()


class Wave:
    """The open (unvisited) cells of a batch of frames. At first all cells are open."""

    def __init__(self, cells: Cells):
        self._codes = cells.codes
        self._open = cells.codes.copy()  # 0 where visited
        self._ahead = cells.steps[:_AHEAD, None]
        # Tiled, because one long array is faster than many short ones.
        self._steps = np.tile(cells.steps, min(_AT_ONCE, len(cells.codes)))
        self._mention = np.empty(len(self._open), np.uint16)
        self._number = np.empty(len(self._open), np.int32)
        self._group = np.full(len(self._open), -1, np.int32)

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
        there &= TOUCHED.take(self._codes.take(cells), 0).reshape(-1)
        hit = (there != 0).nonzero()[0]
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
        cells = cells.take(order)
        kept = [order[:0]]
        for start in range(0, len(cells), len(_UP)):
            some = cells[start : start + len(_UP)]
            still = self._open.take(some).nonzero()[0]
            still = still.take(self._first(some.take(still)))
            self.mark_visited(some.take(still))
            kept.append(start + still)
        index = kept[1] if len(kept) == 2 else np.concatenate(kept)
        return cells.take(index), owners.take(order.take(index))

    def components(self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Label the connected components of cells with the same owner, from 0, in the order of their last cells."""
        self._number[cells] = np.arange(len(cells))
        self._group[cells] = owners
        codes = self._codes.take(cells)
        pairs = []
        for start in range(0, len(cells), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            around = (self._ahead + cells[part]).reshape(-1)
            mine, touched = owners[part], _TOUCHED_AHEAD.take(codes[part], 1)
            hit = (self._group.take(around).reshape(touched.shape) == mine).reshape(-1).nonzero()[0]
            around = around.take(hit)
            met = (touched.reshape(-1).take(hit) & self._codes.take(around)).nonzero()[0]
            pairs.append((hit.take(met) % len(mine) + start, self._number.take(around.take(met))))
        self._group[cells] = -1
        one, other = pairs[0] if len(pairs) == 1 else (np.concatenate(ends) for ends in zip(*pairs, strict=True))
        return connected(one, other, len(cells))

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
