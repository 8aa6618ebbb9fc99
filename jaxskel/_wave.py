"""Which cells of a batch of frames a wave of clusters has not reached yet."""

import numpy as np
from jaxtyping import Int

from ._cells import WAYS, Cells
from ._connected import connected

# Cells whose neighbours are looked at at once: these can be numbered by 16 bits, and stay in the processor's cache.
_AT_ONCE = 2048
# Their numbers, upwards and downwards.
_UP = np.arange(_AT_ONCE * WAYS, dtype=np.uint16)
_DOWN = _UP[::-1].copy()


class Wave:
    """All cells with a voxel are open at first."""

    def __init__(self, cells: Cells):
        self._beside = cells.beside
        self._open = cells.codes != 0
        self._mention = np.empty(len(self._open), np.uint16)
        self._number = np.zeros(len(self._open), np.int64)

    def close(self, cells: Int[np.ndarray, " n"]) -> None:
        """The wave has reached them."""
        self._open[cells] = False

    def reopen(self, cells: Int[np.ndarray, " n"]) -> None:
        """The wave has seen them, but left them to whoever comes next."""
        self._open[cells] = True

    def step(
        self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " reached"], Int[np.ndarray, " reached"]]:
        """Close the open neighbours of some cells; each goes to the owner of the first of these that it touches."""
        if len(cells) > _AT_ONCE:
            # Who comes later does not even see what the first have closed.
            starts = range(0, len(cells), _AT_ONCE)
            parts = [self.step(cells[at : at + _AT_ONCE], owners[at : at + _AT_ONCE]) for at in starts]
            reached, whose = zip(*parts, strict=True)
            return np.concatenate(reached), np.concatenate(whose)
        around = self._beside.take(cells, 0).reshape(-1)
        hit = self._open.take(around).nonzero()[0]
        around = around.take(hit)
        first = self._first(around)
        reached = around.take(first)
        self.close(reached)
        return reached, owners.take(hit.take(first) // WAYS)

    def close_first(
        self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " open"], Int[np.ndarray, " open"]]:
        """Close those of some cells that are open, by owner; of several mentions of a cell the first counts."""
        order = stable_order(owners)
        cells, owners = cells.take(order), owners.take(order)
        kept = [order[:0]]
        for start in range(0, len(cells), len(_UP)):
            some = cells[start : start + len(_UP)]
            still = self._open.take(some).nonzero()[0]
            still = still.take(self._first(some.take(still)))
            self.close(some.take(still))
            kept.append(start + still)
        index = np.concatenate(kept)
        return cells.take(index), owners.take(index)

    def components(self, cells: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Label what is connected among some cells of the same owner, from 0."""
        self._number[cells] = np.arange(1, len(cells) + 1)
        ahead = WAYS // 2  # of each pair of opposite ways one
        other = self._number.take(self._beside.take(cells, 0)[:, :ahead].reshape(-1))
        self._number[cells] = 0
        hit = (other != 0).nonzero()[0]
        source, target = hit // ahead, other.take(hit) - 1
        met = (owners.take(source) == owners.take(target)).nonzero()[0]
        return connected(source.take(met), target.take(met), len(cells))

    def _first(self, cells: Int[np.ndarray, " n"]) -> Int[np.ndarray, " first"]:
        """The first mention of every cell, by index."""
        # The last write, which is the first mention, stays. Copies turned round are faster than views.
        self._mention[cells[::-1].copy()] = _DOWN[len(_DOWN) - len(cells) :]
        return (self._mention.take(cells) == _UP[: len(cells)]).nonzero()[0]


def stable_order(numbers: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """What sorts small numbers without exchanging equal ones. Short integers are sorted in a fraction of the time."""
    short = len(numbers) == 0 or numbers.max() < 2**16
    return np.argsort(numbers.astype(np.uint16) if short else numbers, kind="stable")
