"""Signed distances to the surface of a voxel shape, on a regular grid coarser than the voxels.

Euclidean distance transform by axes (Saito and Toriwaki 1994): squared distances are minimised along one axis after
the other. Each pass keeps only the places asked for, and near the surface it looks only as far as distances shall be
exact, so that little is computed that is not used.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int, UInt16

# Squared distances are counted in 16 bits, as it is memory that takes time. What stands for "no voxel on this line" is
# more than any distance, and leaves room to add one: 180^2 < _NONE and _NONE + 180^2 < 2^16.
_LONGEST = 180
_NONE = np.uint16(2**15)
_UNKNOWN = 1e6  # voxels: more than any distance, still finite, so that it can be interpolated


def signed_distances(
    occupied: Bool[np.ndarray, "x y z"],
    boundary: Int[np.ndarray, "voxels 3"],
    first: Int[np.ndarray, "3"],
    step: float,
    count: int,
    exact: float,
) -> Float[np.ndarray, "count count count"]:
    """Distances to the surface that runs half-way between occupied and empty voxels, negative inside.

    They are exact to half a voxel inside, and outside up to ``exact``; places between voxels are interpolated. Farther
    out they come from blocks of voxels and from places two steps apart, and are right to about a tenth.

    Args:
        occupied: The shape, in its bounding box.
        boundary: Its voxels with an empty neighbour, as indices into that box.
        first: Voxel where the grid of places starts.
        step: Distance of places (voxels), not necessarily whole.
        count: Number of places along each axis.
        exact: Distance outside (voxels) up to which the nearest voxel is looked for.

    Returns:
        Distances (voxels).
    """
    cells = first[:, None] + step * np.arange(count)
    stride = max(int(step + 1e-6), 1)
    # Where places are not voxels, their interpolation needs voxels beyond the last exact place.
    more = 0 if abs(step - stride) < 1e-6 else 2 * stride
    while True:
        reach = exact + more
        lines = [_between(line, stride, -reach, n - 1 + reach) for line, n in zip(cells, occupied.shape, strict=True)]
        distances = _nearest(_targets(boundary), lines, reach)
        box = tuple(slice(*np.searchsorted(line, [0, n])) for line, n in zip(lines, occupied.shape, strict=True))
        inner = [line[part] for line, part in zip(lines, box, strict=True)]
        inside = occupied[np.ix_(*inner)]
        deepest = float(distances[box].max(where=inside, initial=0))
        if deepest <= reach:
            break
        exact *= 2  # so thick a shape that its middle is farther than that from its surface
    near = np.where(distances <= reach, distances - np.float32(0.5), np.float32(_UNKNOWN))
    if inside.any():
        # A boundary voxel has an empty neighbour, so that what is empty is at most one voxel farther off.
        empty = _nearest(_empty_targets(occupied), [line + 1 for line in inner], deepest + 1)
        near[box] = np.where(inside, np.float32(0.5) - empty, near[box])

    starts, places = [], []
    for cell, line in zip(cells, lines, strict=True):
        covered = np.flatnonzero((cell >= line[0]) & (cell <= line[-1]))
        starts.append(covered[0])
        places.append((cell[covered] - line[0]) / stride)
    near = _interpolate(near, places)
    result = _far_distances(boundary, cells, step, exact - 0.5)
    part = result[tuple(slice(at, at + n) for at, n in zip(starts, near.shape, strict=True))]
    np.copyto(part, near, where=near <= exact - 0.5)
    return result


def _far_distances(
    boundary: Int[np.ndarray, "voxels 3"], cells: Float[np.ndarray, "3 count"], step: float, least: float
) -> Float[np.ndarray, "count count count"]:
    """Distances to blocks of boundary voxels as wide as a step, at every other place, interpolated."""
    count = cells.shape[1]
    block = max(round(step), 1)
    ends = cells[:, :1] + 2 * step * np.arange(count // 2 + 1)
    values = block * _nearest(_targets(boundary // block), list((ends - (block - 1) / 2) / block), np.inf)
    # Rough distances must not fall behind the exact ones where these end.
    values = np.maximum(values - np.float32(0.5), np.float32(least))
    for axis in (2, 1, 0):  # the axis that is slowest to work on while there is least of it
        finer = np.empty((*values.shape[:axis], count, *values.shape[axis + 1 :]), np.float32)
        old, new = np.moveaxis(values, axis, 0), np.moveaxis(finer, axis, 0)
        new[::2] = old[: len(new[::2])]
        np.add(old[:-1], old[1:], out=new[1::2])
        new[1::2] *= np.float32(0.5)
        values = finer
    return values


def _filled(shape: np.ndarray, value: int | np.uint16) -> UInt16[np.ndarray, "x y z"]:
    """An array that has its longest axis outermost in memory: the first to work on."""
    axis = int(np.argmax(shape))
    return np.moveaxis(np.full((shape[axis], *np.delete(shape, axis)), value, np.uint16), 0, axis)


def _targets(voxels: Int[np.ndarray, "voxels 3"]) -> UInt16[np.ndarray, "x y z"]:
    """Zero at voxels, `_NONE` elsewhere."""
    targets = _filled(voxels.max(0) + 1, _NONE)
    targets[tuple(voxels.T)] = 0
    return targets


def _empty_targets(occupied: Bool[np.ndarray, "x y z"]) -> UInt16[np.ndarray, "x2 y2 z2"]:
    """Zero at empty voxels, those around the box included, `_NONE` elsewhere."""
    targets = _filled(np.array(occupied.shape) + 2, 0)
    np.multiply(occupied, _NONE, out=targets[1:-1, 1:-1, 1:-1])
    return targets


def _nearest(
    squares: UInt16[np.ndarray, "x y z"], places: Sequence[np.ndarray], reach: float
) -> Float[np.ndarray, "a b c"]:
    """Distances from places on a grid to the nearest target; beyond ``reach`` they may come out too long."""
    shape = np.array(squares.shape)
    spans = [max(line[-1], n - 1) - min(line[0], 0) for line, n in zip(places, shape, strict=True)]
    unit = max(min(reach, float(np.linalg.norm(spans))) / _LONGEST, 1.0)
    # The longest axis first: it is the one that gains most from keeping only some places.
    for axis in np.argsort(-shape, kind="stable"):
        lines = np.ascontiguousarray(np.moveaxis(squares, axis, 0))
        squares = np.moveaxis(_pass(lines, places[axis], reach, unit), 0, axis)
    return np.sqrt(squares, dtype=np.float32) * np.float32(unit)


def _pass(
    squares: UInt16[np.ndarray, "n a b"], places: np.ndarray, reach: float, unit: float
) -> UInt16[np.ndarray, "p a b"]:
    """Least sum of a squared distance along the first axis and what stands there, within reach of each place."""
    n = len(squares)
    way = places[:, None] - np.arange(n)
    steps = np.minimum(np.rint((way / unit) ** 2), _LONGEST**2).astype(np.uint16)
    lows = np.clip(np.ceil(places - reach), 0, n - 1).astype(int)
    highs = np.clip(np.floor(places + reach), 0, n - 1).astype(int) + 1
    rows = squares.reshape(n, -1)
    result = np.empty((len(places), rows.shape[1]), np.uint16)
    sums = np.empty_like(rows)
    for out, low, high, ways in zip(result, lows, highs, steps, strict=True):
        np.add(rows[low:high], ways[low:high, None], out=sums[: high - low])
        np.minimum.reduce(sums[: high - low], axis=0, out=out)
    np.minimum(result, _NONE, out=result)
    return result.reshape(len(places), *squares.shape[1:])


def _between(line: np.ndarray, stride: int, low: float, high: float) -> Int[np.ndarray, " n"]:
    """Voxels a stride apart, from the first place of a line to its last and within bounds."""
    count = int(np.ceil((line[-1] - line[0]) / stride - 1e-6)) + 1
    voxels = int(line[0]) + stride * np.arange(count)
    return voxels[(voxels >= low) & (voxels <= high)]


def _interpolate(values: Float[np.ndarray, "x y z"], places: Sequence[np.ndarray]) -> Float[np.ndarray, "a b c"]:
    """Values of a grid between its places, trilinear."""
    for axis in (2, 1, 0):
        at = places[axis]
        if np.array_equal(at, np.arange(values.shape[axis])):
            continue
        low = np.clip(at.astype(int), 0, values.shape[axis] - 2)
        part = (at - low).astype(np.float32).reshape([-1 if k == axis else 1 for k in range(3)])
        before = values.take(low, axis)
        values = values.take(low + 1, axis)
        values -= before
        values *= part
        values += before
    return values
