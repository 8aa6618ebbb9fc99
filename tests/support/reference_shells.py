"""Shells of equal geodesic distance, cell by cell: the reference for the batched implementation."""

from collections import Counter

import numpy as np

from support.reference_scooping import cells_in, connected_parts, neighbours


def shells_one_by_one(occupancy, root):
    """The rule cell by cell, in voxels: positions and parents, before end nodes move."""
    voxels = cells_in(occupancy)
    beside = neighbours(voxels)
    first = tuple((np.array(root) // 2).tolist())
    before, levels, queue = {first: first}, {first: 0}, [first]
    for cell in queue:
        for other in beside[cell]:
            if other not in levels:
                levels[other], before[other] = levels[cell] + 1, cell
                queue.append(other)
    node, middles, positions, parents = {first: 0}, [np.array(root, float)], [np.array(root, float)], [-1]
    for level in range(1, max(levels.values()) + 1):
        for part in connected_parts([cell for cell in sorted(levels) if levels[cell] == level], beside):
            votes = Counter(node[before[cell]] for cell in part)
            parent = min(votes, key=lambda one: (-votes[one], one))
            node.update(dict.fromkeys(part, len(parents)))
            parents.append(parent)
            middles.append(np.concatenate([voxels[cell] for cell in part]).mean(0))
            positions.append((middles[-1] + middles[parent]) / 2)
    return np.array(positions), np.array(parents)
