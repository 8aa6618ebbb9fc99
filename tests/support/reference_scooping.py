"""Plain voxel scooping, cell by cell: the reference for the batched implementation."""

import numpy as np


def cells_in(occupancy) -> dict[tuple, np.ndarray]:
    """The voxels of each cell, in the grid's order."""
    cells = {}
    for voxel in np.argwhere(occupancy):
        cells.setdefault(tuple((voxel // 2).tolist()), []).append(voxel)
    return {cell: np.array(cells[cell]) for cell in sorted(cells)}


def touch(some, others) -> bool:
    """Whether two of some voxels are neighbours."""
    return bool((np.abs(some[:, None] - others).max(-1) <= 1).any())


def neighbours(voxels) -> dict[tuple, list[tuple]]:
    """The cells that each cell touches, in the order of directions."""
    ways = [np.subtract(way, 1) for way in np.ndindex(3, 3, 3) if way != (1, 1, 1)]
    around = {cell: [tuple((cell + way).tolist()) for way in ways] for cell in voxels}
    return {
        cell: [other for other in around[cell] if other in voxels and touch(voxels[cell], voxels[other])]
        for cell in voxels
    }


def connected_parts(cells, beside):
    """Connected components of some cells: members in the order of the cells, components by their first cell."""
    left, parts = dict.fromkeys(cells), []
    while left:
        part, todo = set(), [next(iter(left))]
        while todo:
            cell = todo.pop()
            if cell in left:
                del left[cell]
                part.add(cell)
                todo += beside[cell]
        parts.append([cell for cell in cells if cell in part])
    return parts


def scooped_one_by_one(occupancy, root):
    """The rule cell by cell, in voxels: positions and parents."""
    voxels = cells_in(occupancy)
    beside = neighbours(voxels)
    free = set(voxels) - {tuple(np.array(root) // 2)}
    nodes, parents, extents, contested = [np.array(root, float)], [-1], [np.sqrt(3)], 0
    cluster = {}

    def looked_at(queue):
        seen = {}
        for cell, owner in queue:
            for other in beside[cell]:
                if other in free:
                    seen.setdefault(other, []).append(owner)
        return seen

    def away(cell, node):
        return np.linalg.norm(voxels[cell].mean(0) - node)

    wave = {0: list(looked_at([(tuple((np.array(root) // 2).tolist()), 0)]))}
    while any(wave.values()):
        free -= {cell for cells in wave.values() for cell in cells}
        radius = {}
        for owner in sorted(wave):
            for part in sorted(connected_parts(wave[owner], beside), key=len, reverse=True):  # stable
                held = np.concatenate([voxels[cell] for cell in part])
                extent = np.linalg.norm(np.ptp(held, axis=0) + 1)
                share = 0.5 ** (min(extent, extents[owner]) / max(extent, extents[owner]))
                node = nodes[owner] + share * (held.mean(0) - nodes[owner])
                cluster.update(dict.fromkeys(part, len(nodes)))
                radius[len(nodes)] = max(away(cell, node) for cell in part)
                nodes.append(node)
                parents.append(owner)
                extents.append(extent)
        queue = sorted(((cell, cluster[cell]) for cells in wave.values() for cell in cells), key=lambda one: one[1])
        later = {owner: [] for owner in radius}
        while queue:
            grown = []
            for cell, owners in looked_at(queue).items():
                contested += len(set(owners)) > 1
                if away(cell, nodes[owners[0]]) < radius[owners[0]]:
                    grown.append((cell, owners[0]))
                    cluster[cell] = owners[0]
                else:
                    later[owners[0]].append(cell)
            free -= {cell for cell, _ in grown}
            queue = grown
        taken, wave = set(), {}
        for owner in sorted(later):
            wave[owner] = [cell for cell in dict.fromkeys(later[owner]) if cell in free - taken]
            taken |= set(wave[owner])
    # Ends with the same parent lie among their voxels that are farthest from it.
    ends = set(range(1, len(nodes))) - set(parents)
    for start in {parents[end] for end in ends}:
        together = [end for end in ends if parents[end] == start]
        distance = {cell: away(cell, nodes[start]) for cell, node in cluster.items() if node in together}
        outer = [voxels[cell] for cell in distance if distance[cell] > max(distance.values()) - 2]
        for end in together:
            nodes[end] = np.concatenate(outer).mean(0)
    return np.array(nodes), np.array(parents), contested
