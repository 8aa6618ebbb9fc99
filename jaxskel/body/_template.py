"""The template as data: names, kinematic tree, rigid segments, end nodes and limits of a skeleton of any kind.

A template has *joints* in a tree and *tips*, the ends of its limbs, which are the end nodes of the skeletal graph. Each
of them is carried by a rigid *segment*, which turns about the point where its first bone begins. A *pivot* is a point
inside a bone at which its outer part may turn, such as the wrist in a bone from elbow to palm.

The dimensions are not part of it: they are those of a [`Skeleton`][jaxskel.body.Skeleton].
"""

import json
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ._template_check import check_template

FREE, ACROSS, HINGE = 3, 2, 1
"""Degrees of freedom of a segment: any rotation, no twist about its bone, or flexion alone."""


class Pivot(NamedTuple):
    """A point inside the bone that ends in a joint.

    Attributes:
        joint: Index of the joint.
        share: Of the way from the joint back to its parent, along each axis at rest.
        shift: From there, along each axis at rest, in standing heights.
    """

    name: str
    joint: int
    share: tuple[float, float, float]
    shift: tuple[float, float, float]


class Hinge(NamedTuple):
    """A joint that bends in one direction.

    Attributes:
        joint: Index of the joint.
        segment: The segment beyond the joint.
        end: Where the lower bone ends: an index into joints, then tips, then pivots.
        bends_to: Direction to which the lower bone moves when the joint bends, at rest (body frame).
        straight: Smallest flexion (rad).
        folded: Largest flexion (rad).
    """

    joint: int
    segment: int
    end: int
    bends_to: tuple[float, float, float]
    straight: float
    folded: float


class Attraction(NamedTuple):
    """A bone that lies on a path of the graph, and the part of it that does.

    Attributes:
        joint: Index of the joint at the end of the bone.
        tip: Index of the tip whose path from the root it is.
        first: Where the part begins, as a share of the bone.
        last: Where it ends.
    """

    joint: int
    tip: int
    first: float
    last: float


@dataclass(frozen=True)
class SkeletonTemplate:
    """What a skeleton consists of. All indices are those of the tuples of names.

    Attributes:
        name: Of the template, such as ``human-15``.
        joint_names: Joints, parents before children; the first is the root of the tree.
        joint_parents: Parent of each joint; -1 for the root.
        tip_names: Limb tips: the labels of the graph's end nodes. The first is where the graph begins.
        tip_parents: Joint that each tip hangs on.
        segment_names: Rigid parts, parents before children; the first turns about the root.
        segment_parents: Parent of each segment; -1 for the first.
        segment_of_joint: The segment that carries the bone ending in each joint; of a bone with a pivot, its inner
            part.
        segment_of_tip: The segment that carries each tip.
        freedoms: Degrees of freedom of each segment: `FREE`, `ACROSS` or `HINGE`.
        inner: Joints that are found in the graph by their geodesic distances to the end nodes (Eq. 5).
        described_by: Tips whose distances describe them; the paper takes all, where hands do not touch the trunk.
        attracted: Bones that are attracted to paths of the graph.
        firmness: Of each segment but the first: how firmly its rotation stays near that at rest, in fits to the graph.
        pivots: Points inside bones.
        segment_of_pivot: The segment beyond each pivot.
        hinges: Joints that bend in one direction.
        radii: Of the flesh around each joint, then each tip, as shares of the extent; None if not known.
        meanings: What each joint, then each tip, is on the human body: shares of its points, which sum up to one;
            empty if it is not on it. Searches place the points so.
        swings: How far each segment turns from its rest to its parent at most (rad); empty if not known.
        begins: Direction in which the first tip lies farthest, where the graph begins, in the world with z up.
    """

    name: str
    joint_names: tuple[str, ...]
    joint_parents: tuple[int, ...]
    tip_names: tuple[str, ...]
    tip_parents: tuple[int, ...]
    segment_names: tuple[str, ...]
    segment_parents: tuple[int, ...]
    segment_of_joint: tuple[int, ...]
    segment_of_tip: tuple[int, ...]
    freedoms: tuple[int, ...]
    inner: tuple[int, ...]
    described_by: tuple[int, ...]
    attracted: tuple[Attraction, ...]
    firmness: tuple[float, ...]
    pivots: tuple[Pivot, ...] = ()
    segment_of_pivot: tuple[int, ...] = ()
    hinges: tuple[Hinge, ...] = ()
    radii: tuple[float, ...] | None = None
    meanings: tuple[tuple[tuple[str, float], ...], ...] = ()
    swings: tuple[float, ...] = ()
    begins: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self):
        """Reject what is no tree, and indices that point nowhere."""
        check_template(self)

    def __hash__(self) -> int:
        """Computed once, because each call of a compiled function asks for it."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self.text)

    @cached_property
    def text(self) -> str:
        """The whole template as one line of JSON, see `template_of_text`."""
        return json.dumps(asdict(self), separators=(",", ":"))

    def __reduce__(self) -> tuple[Any, ...]:
        """By the text, so that equal templates have equal pickles: these name compiled programs on disk."""
        return template_of_text, (self.text,)

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of joints, then tips."""
        return self.joint_names + self.tip_names

    @property
    def is_human(self) -> bool:
        """Whether all points are on the human body, so that searches find them."""
        return all(self.meanings) and len(self.meanings) == len(self.point_names)

    @property
    def pivot_names(self) -> tuple[str, ...]:
        """Names of the pivots."""
        return tuple(pivot.name for pivot in self.pivots)

    @cached_property
    def point_parents(self) -> Int[np.ndarray, " points"]:
        """Joint at which the bone to each joint, then each tip, begins; -1 for the root."""
        return _indices(self.joint_parents + self.tip_parents)

    @cached_property
    def segments_of_points(self) -> Int[np.ndarray, " points"]:
        """The segment that carries each joint, then each tip, itself: beyond a pivot, the outer one."""
        carriers = list(self.segment_of_joint + self.segment_of_tip)
        for pivot, segment in zip(self.pivots, self.segment_of_pivot, strict=True):
            carriers[pivot.joint] = segment
        return _indices(carriers)

    @cached_property
    def mirror_joints(self) -> Int[np.ndarray, " joints"]:
        """Permutation that exchanges left and right joints, by the prefixes ``l_`` and ``r_`` of their names."""
        return _mirror(self.joint_names)

    @cached_property
    def mirror_tips(self) -> Int[np.ndarray, " tips"]:
        """Permutation that exchanges left and right tips."""
        return _mirror(self.tip_names)

    @cached_property
    def limb_pairs(self) -> Int[np.ndarray, "pairs 2"]:
        """Left and right joint where each pair of limbs begins: shoulders and hips of a human."""
        pairs = [
            (left, right)
            for left, right in enumerate(self.mirror_joints.tolist())
            if self.joint_names[left].startswith("l_") and left != right
            if self.joint_parents[left] == self.joint_parents[right]
        ]
        return _indices(pairs).reshape(-1, 2)

    @cached_property
    def origins(self) -> Int[np.ndarray, " segments"]:
        """The point that each segment turns about: an index into joints, then pivots."""
        found = np.full(len(self.segment_names), -1, np.int32)
        found[0] = 0
        for pivot, segment in enumerate(self.segment_of_pivot):
            found[segment] = len(self.joint_names) + pivot
        carriers = self.segment_of_joint + self.segment_of_tip
        for point, segment in enumerate(carriers):
            if found[segment] < 0:
                found[segment] = self.point_parents[point]
        return found

    @cached_property
    def parts(self) -> Int[np.ndarray, "parts 3"]:
        """Rigid parts between joints and pivots: start and end (joints, then pivots) and segment.

        A bone with a pivot has two parts.
        """
        at = {pivot.joint: number for number, pivot in enumerate(self.pivots)}
        rows = []
        for joint in range(1, len(self.joint_names)):
            start, segment = self.joint_parents[joint], self.segment_of_joint[joint]
            if joint in at:
                middle = len(self.joint_names) + at[joint]
                rows += [(start, middle, segment), (middle, joint, self.segment_of_pivot[at[joint]])]
            else:
                rows.append((start, joint, segment))
        return _indices(rows).reshape(-1, 3)

    @cached_property
    def parts_to(self) -> Float[np.ndarray, "places parts"]:
        """One for each part on the way from the root to each joint and pivot, else zero."""
        ways = np.zeros((len(self.joint_names) + len(self.pivots), len(self.parts)), np.float32)
        for number, (start, end, _) in enumerate(self.parts):
            ways[end] = ways[start]
            ways[end, number] = 1
        return ways

    @cached_property
    def bones_to(self) -> Float[np.ndarray, "joints bones"]:
        """One for each bone on the way from the root to each joint, else zero."""
        ways = np.zeros((len(self.joint_names), len(self.joint_names) - 1), np.float32)
        for joint in range(1, len(self.joint_names)):
            ways[joint] = ways[self.joint_parents[joint]]
            ways[joint, joint - 1] = 1
        return ways

    @cached_property
    def hangs_on(self) -> Float[np.ndarray, "segments segments"]:
        """One where a segment (row) equals or descends from another (column), else zero."""
        chain = np.eye(len(self.segment_names), dtype=np.float32)
        for segment, parent in enumerate(self.segment_parents[1:], 1):
            chain[segment] += chain[parent]
        return chain


def template_of_text(text: str) -> SkeletonTemplate:
    """The template that `SkeletonTemplate.text` describes.

    Raises:
        ValueError: The text is no template.
    """
    try:
        given = json.loads(text)
        known = {field.name: _tuples(given[field.name]) for field in fields(SkeletonTemplate)}
        for name, kind in (("pivots", Pivot), ("hinges", Hinge), ("attracted", Attraction)):
            known[name] = tuple(kind(*row) for row in known[name])
        return SkeletonTemplate(**known)
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError("the text describes no template of a skeleton: read a file that was not changed") from error


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _indices(values: Any) -> Int[np.ndarray, "..."]:
    """Indices of 32 bits, because JAX confuses wider ones if float64 is switched on after the first use."""
    return np.array(values, np.int32)


def _mirror(names: tuple[str, ...]) -> Int[np.ndarray, " names"]:
    other = {"l_": "r_", "r_": "l_"}
    mirrored = [other.get(name[:2], name[:2]) + name[2:] for name in names]
    return _indices([names.index(name) if name in names else i for i, name in enumerate(mirrored)])
