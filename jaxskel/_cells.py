"""What is connected among voxels, by cells of 2 x 2 x 2: any two voxels of a cell are neighbours.

A cell is a byte, one bit a voxel. Two cells beside each other are connected if both have voxels where they touch:
over a face any of four meet any of four, over an edge any of two any of two, over a corner one meets one. So cells are
connected exactly as their voxels are, and there are a third as many of them in a thin layer.
"""

import numpy as np
from jaxtyping import Int

# Of each pair of opposite ways one.
_BESIDE = np.array([way for way in np.ndindex(3, 3, 3) if way > (1, 1, 1)]) - 1
_CORNERS = np.array(list(np.ndindex(2, 2, 2)))


def _touching(way: np.ndarray) -> int:
    """The voxels of a cell that touch the cell on a way, as bits."""
    beside = ((way <= 0) | (_CORNERS == 1)) & ((way >= 0) | (_CORNERS == 0))
    return int((beside.all(1) << np.arange(8)).sum())


_HERE = np.array([_touching(way) for way in _BESIDE], np.uint8)
_BITS = np.left_shift(1, np.arange(8)).astype(np.uint8)
_THERE = np.array([_touching(-way) for way in _BESIDE], np.uint8)


class Cells:
    """Cells of boxes of the same shape, one for each frame."""

    def __init__(self, frames: int, shape: tuple[int, ...]):
        self._shape = tuple(n // 2 for n in shape)
        strides = np.array([self._shape[1] * self._shape[2], self._shape[2], 1])
        self._beside = _BESIDE @ strides
        # From 1, as 0 stands for none.
        self._number = np.zeros(frames * int(np.prod(self._shape)), np.int32)

    def components(
        self, cells: Int[np.ndarray, " n"], corners: Int[np.ndarray, " n"], owners: Int[np.ndarray, " n"]
    ) -> Int[np.ndarray, " n"]:
        """Label what is connected among some voxels of the same owner, from 0.

        Args:
            cells: The cell of each voxel: as the cells of all frames stand one after the other.
            corners: Which of the cell's eight corners, the last axis fastest.
            owners: Whose the voxels are.
        """
        number = np.empty(len(cells), np.int64)
        firsts: list[np.ndarray] = []  # of each cell one voxel
        count, left, place, owner = 0, np.arange(len(cells)), cells, owners
        # Owners may share a place: each then has a cell of its own there.
        while len(left):
            index = np.arange(len(left), dtype=np.int32)
            self._number[place] = index
            chosen = self._number.take(place, mode="clip")
            heads = np.flatnonzero(chosen == index)
            self._number[place.take(heads)] = np.arange(count, count + len(heads))
            number[left] = self._number.take(place, mode="clip")
            firsts.append(left.take(heads))
            count += len(heads)
            others = np.flatnonzero(owner.take(chosen) != owner)
            left, place, owner = left.take(others), place.take(others), owner.take(others)
        self._number[cells] = 0
        first = np.concatenate(firsts)
        codes = np.bincount(number, _BITS.take(corners), count).astype(np.uint8)
        labels = self._connected(cells.take(first), owners.take(first), codes, [len(part) for part in firsts])
        return labels.take(number)

    def _connected(
        self, place: np.ndarray, owners: np.ndarray, codes: np.ndarray, layers: list[int]
    ) -> Int[np.ndarray, " cells"]:
        """Label connected cells of the same owner. Cells of a layer, which follow one another, share no place."""
        around = place.repeat(len(_BESIDE)) + np.tile(self._beside, len(place))
        sources, targets = [], []
        start = 0
        for size in layers:
            layer = place[start : start + size]
            self._number[layer] = np.arange(start + 1, start + size + 1)
            other = self._number.take(around, mode="clip")
            self._number[layer] = 0
            start += size
            hit = np.flatnonzero(other != 0)
            source = hit // len(_BESIDE)
            way, target = hit - source * len(_BESIDE), other.take(hit) - 1
            here, there = codes.take(source) & _HERE.take(way), codes.take(target) & _THERE.take(way)
            met = np.flatnonzero((here != 0) & (there != 0) & (owners.take(source) == owners.take(target)))
            sources.append(source.take(met))
            targets.append(target.take(met))
        return connected(np.concatenate(sources), np.concatenate(targets), len(place))


def connected(
    one: Int[np.ndarray, " pairs"], other: Int[np.ndarray, " pairs"], count: int
) -> Int[np.ndarray, " count"]:
    """Label what pairs of numbers below `count` connect, from 0.

    Each number points to a larger one that it is paired with, then to where that one points, and so on to a largest;
    the pairs whose ends arrive at different ones are gone through again. For many small components this takes a tenth
    of the time of SciPy's search along a matrix.
    """
    root = np.arange(count)
    while len(one):
        root[np.minimum(one, other)] = np.maximum(one, other)
        while True:
            farther = root.take(root)
            if (farther == root).all():
                break
            root = farther
        one, other = root.take(one), root.take(other)
        apart = np.flatnonzero(one != other)
        one, other = one.take(apart), other.take(apart)
    return (np.cumsum(root == np.arange(count)) - 1).take(root)
