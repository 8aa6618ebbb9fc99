"""Root finders: the graph starts at the highest voxel, as in the paper (Sect. 3.1), or at the top of the head.

A root finder is an object with ``roots(hulls, skeleton)``; skeletonisers take its result.
"""

from typing import Protocol, runtime_checkable

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Int, Num, UInt8

from ..body import Skeleton
from ..hull import VisualHulls, bodies_among

_STATURE = 1.75  # stature for which the sizes below hold (m)


@runtime_checkable
class RootFinder(Protocol):
    """Finds the top of each person's head."""

    def roots(self, hulls: VisualHulls, skeleton: Skeleton) -> Int[np.ndarray, " frames"]:
        """Index into ``hulls.voxels`` of the root of each person's graph; 0 for an empty hull."""
        ...


class HighestVoxel(eqx.Module):
    """The paper's rule (Sect. 3.1): the highest voxel; of equally high ones, the one nearest to their mean.

    For a template whose graph begins elsewhere, the voxel that lies farthest in that direction.
    """

    def roots(self, hulls: VisualHulls, skeleton: Skeleton) -> Int[np.ndarray, " frames"]:
        """Index into ``hulls.voxels`` of the root of each person's graph; 0 for an empty hull."""
        roots = np.zeros(len(hulls), np.int64)
        begins = np.array(skeleton.template.begins)
        for f in np.flatnonzero(hulls.inside.any(1)):
            own = hulls.runs.of(f)
            # The farthest voxels upwards end runs, of which there are fewer.
            voxels = own.last if begins[2] > 0 else own.voxels
            roots[f] = _highest(hulls, voxels, hulls.voxels.take(voxels, axis=0) @ begins)
        return roots


class HeadBall(eqx.Module):
    """Finds the head by its thickness: a ball that fits into the head fits into neither neck nor arms.

    The voxels deep below the surface of a hull form separate cores of head, trunk and thighs. The core with the highest
    mean is the head's, even if a hand is raised above it or the head is bent below the shoulders. If that core is too
    large for a head, a thick neck joins it to the trunk's core, and the next depth is tried. If no depth separates the
    two, the first depth is used; if there is no core at all, the highest voxel is the root. Otherwise the root is the
    surface voxel straight above the highest voxel of the core, so paths along the graph start at the top of the head.

    All sizes hold for a body of 1.75 m; they are scaled with the skeleton's stature.

    Attributes:
        depths: Depths below the surface at which a core begins (m), ascending: below half the breadth of a head, about
            76 mm, above half the thickness of an arm; half a neck's lies in between. On 1200 hulls of two realistic
            bodies any depth after the first found every head; at 45 mm raised upper arms have cores of their own.
        least_core: Smaller cores are specks (m^3). Cores of heads measured 70e-6 to 390e-6 at 50 to 57 mm, on the same
            hulls.
        most_core: Larger cores contain more than the head (m^3).
        overtopped: If another core reaches this much higher (m), a thick neck joins the head to it, so it counts as the
            head's: the core of a head bent below the shoulders is not that far below theirs.
    """

    depths: tuple[float, ...] = (0.050, 0.055, 0.060)
    least_core: float = 20e-6
    most_core: float = 600e-6
    overtopped: float = 0.160

    def roots(self, hulls: VisualHulls, skeleton: Skeleton) -> Int[np.ndarray, " frames"]:
        """Index into ``hulls.voxels`` of the root of each person's graph; 0 for an empty hull."""
        scale = skeleton.stature / _STATURE
        least, most = (volume * scale**3 / hulls.grid.spacing**3 for volume in (self.least_core, self.most_core))
        lead = self.overtopped * scale / hulls.grid.spacing
        roots = np.full(len(hulls), -1)
        joined = np.flatnonzero(hulls.inside.any(1))
        for depth in self.depths:
            frames, joined = joined, np.zeros(0, np.int64)
            for f, deep in zip(frames, deep_voxels(hulls, frames, depth * scale), strict=True):
                core = _highest_core(hulls, np.flatnonzero(deep), least, lead)
                alone = 0 < len(core) <= most
                if len(core) and (alone or roots[f] < 0):
                    roots[f] = _straight_up(hulls, f, _highest(hulls, core, hulls.voxels[core, 2]))
                if not alone:
                    joined = np.append(joined, f)
        none = roots < 0
        roots[none] = HighestVoxel().roots(hulls[none], skeleton)
        return roots


def deep_voxels(hulls: VisualHulls, frames: Int[np.ndarray, " some"], depth: float) -> Bool[np.ndarray, "some voxels"]:
    """Mask of the voxels of some frames whose centre lies `depth` (m) or more below the surface of the hull.

    The surface is taken half a voxel before the centre of the nearest empty voxel, so that the result does not depend
    on the spacing. Everything outside the grid is empty.
    """
    radius = depth / hulls.grid.spacing + 0.5
    deep = np.zeros((len(frames), len(hulls.voxels)), bool)
    for start in range(0, len(frames), 8):  # eight frames at once, one bit each
        bits = np.zeros(len(hulls.voxels), np.uint8)
        for bit, frame in enumerate(frames[start : start + 8]):
            bits |= hulls.inside[frame].view(np.uint8) << np.uint8(bit)
        bits = _eroded(hulls.voxels, bits, radius)
        for bit, row in enumerate(deep[start : start + 8]):
            np.not_equal(bits & np.uint8(1 << bit), 0, out=row)
    return deep


def _eroded(
    voxels: Int[np.ndarray, "voxels 3"], bits: UInt8[np.ndarray, " voxels"], radius: float
) -> UInt8[np.ndarray, " voxels"]:
    """Clear the bits of voxels that have an empty voxel nearer than `radius` (voxels).

    The ball is a stack of columns along z: the erosion by each length of column is computed once for all voxels, then
    shifted along x and y.
    """
    used = np.flatnonzero(bits)
    eroded = np.zeros_like(bits)
    if len(used) == 0:
        return eroded
    reach = int(np.ceil(radius))
    axes = [axis.take(used) for axis in np.ascontiguousarray(voxels.T, np.int64)]
    low = np.array([axis.min() for axis in axes]) - reach
    shape = np.array([axis.max() for axis in axes]) + reach + 1 - low  # a margin, so that shifts do not wrap around
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    flat = sum((stride * axis for stride, axis in zip(strides, axes, strict=True)), -low @ strides)
    columns = [np.zeros(int(np.prod(shape)), np.uint8)]
    columns[0][flat] = bits[used]
    for half in range(1, reach):
        column = columns[-1].copy()
        column[half:] &= columns[0][:-half]
        column[:-half] &= columns[0][half:]
        columns.append(column)
    ball = columns[-1].copy()
    for x, y in np.ndindex(2 * reach + 1, 2 * reach + 1):
        square = radius**2 - (x - reach) ** 2 - (y - reach) ** 2
        if square <= 0 or x == y == reach:
            continue
        column = columns[int(np.ceil(np.sqrt(square))) - 1]
        shift = int((x - reach) * strides[0] + (y - reach) * strides[1])
        if shift > 0:
            ball[:-shift] &= column[shift:]
        else:
            ball[-shift:] &= column[:shift]
    eroded[used] = ball[flat]
    return eroded


def _highest(hulls: VisualHulls, own: Int[np.ndarray, " own"], heights: Num[np.ndarray, " own"]) -> int:
    """The highest of some voxels; of equally high ones, the one nearest to their mean."""
    top = own[heights == heights.max()]
    places = hulls.voxels[top]
    return int(top[np.argmin(((places - places.mean(0)) ** 2).sum(1))])


def _highest_core(
    hulls: VisualHulls, own: Int[np.ndarray, " own"], least: float, lead: float
) -> Int[np.ndarray, " core"]:
    """The connected body with the highest mean, or else one whose top is more than `lead` voxels higher.

    Bodies of fewer than `least` voxels are ignored; the result is empty if all are.
    """
    bodies = bodies_among(hulls.voxels[own], hulls.grid)
    body, sizes = bodies.voxels_of(0), bodies.sizes
    if len(sizes) == 0 or sizes.max() < least:
        return own[:0]
    heights = hulls.voxels[own, 2]
    middles = np.bincount(body, heights) / sizes
    tops = np.full(len(sizes), -1)
    np.maximum.at(tops, bodies.body, heights[bodies.runs.last])  # runs end at their highest voxel
    middles[sizes < least], tops[sizes < least] = -np.inf, -1
    core = int(np.argmax(middles))
    if tops.max() - tops[core] > lead:
        core = int(np.argmax(tops))
    return own[body == core]


def _straight_up(hulls: VisualHulls, frame: int | np.integer, voxel: int) -> int:
    """Go up from a voxel to the surface of the hull. The next voxel of a column is the next in grid order."""
    while (
        voxel + 1 < len(hulls.voxels)
        and hulls.inside[frame, voxel + 1]
        and (hulls.voxels[voxel + 1] - hulls.voxels[voxel] == (0, 0, 1)).all()
    ):
        voxel += 1
    return voxel
