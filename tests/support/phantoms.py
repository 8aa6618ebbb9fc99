"""Drawings that the tests share: a ring of cameras, bodies made of balls, template graphs. Not the package's own
scene, so that the two cannot be wrong together."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.spatial.transform import Rotation

from jaxskel.body import (
    JOINT_NAMES,
    JOINT_PARENTS,
    SEGMENT_NAMES,
    SEGMENT_OF_PIVOT,
    SEGMENT_PARENTS,
    TIP_NAMES,
    TIP_PARENTS,
    Body,
    Pose,
    Skeleton,
    default_adult,
    forward_kinematics,
    rest_origins,
)
from jaxskel.cameras import Cameras, make_cameras, rays
from jaxskel.graph import SkeletalGraph
from jaxskel.matching import END_NODE_REACH
from jaxskel.refinement.terms import AbstractTerm, Observed, PlacedBody

NODE_NAMES = JOINT_NAMES + TIP_NAMES
"""Nodes of a template graph: the joints, then the tips."""


def looking_at(centre: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and t of a level camera in a world with z up."""
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(forward, right), forward])
    return R, -R @ centre


def ring(
    count: int, size: tuple[int, int] = (160, 120), focal: float = 90.0, radius: float = 4.0, height: float = 1.0
) -> Cameras:
    """Cameras around the z axis, alternately high and low, that look at a point over the origin."""
    R, t = [], []
    for i, angle in enumerate(2 * np.pi * np.arange(count) / count + 0.1):
        centre = np.array([radius * np.cos(angle), radius * np.sin(angle), 1.2 + 1.3 * (i % 2)])
        for stack, value in zip((R, t), looking_at(centre, np.array([0.0, 0.0, height])), strict=True):
            stack.append(value)
    K = np.array([[focal, 0.0, (size[0] - 1) / 2], [0.0, focal, (size[1] - 1) / 2], [0.0, 0.0, 1.0]])
    return make_cameras(np.tile(K, (count, 1, 1)), R, t, size)


def film(cameras: Cameras, bodies: list[np.ndarray]) -> np.ndarray:
    """Packed silhouettes of bodies made of balls, one body (balls 4: centre and radius, m) a frame.

    A pixel shows the body where the ray through its centre meets a ball.
    """
    width, height = (int(n) for n in cameras.size.max(0))
    masks = np.zeros((len(bodies), len(cameras), height, width), bool)
    for c, centre in enumerate(cameras.centres):
        u, v = np.meshgrid(np.arange(width), np.arange(height))
        directions = rays(cameras, c, np.stack([u.ravel(), v.ravel()], -1).astype(float))
        for f, balls in enumerate(bodies):
            towards = balls[:, :3] - centre
            # The ray's squared distance from a ball's centre is that of the camera less the square of the way along it.
            tangent = np.sqrt((towards**2).sum(-1) - balls[:, 3] ** 2)
            masks[f, c] = (directions @ towards.T > tangent).any(-1).reshape(height, width)
    return np.packbits(masks, -1)


def chain(start, end, radius: float, count: int = 20) -> np.ndarray:
    """Balls along a line: a capsule."""
    centres = np.linspace(start, end, count)
    return np.column_stack([centres, np.full(count, radius)])


def walk_down(tree: dict[int, list[int]], root: int) -> tuple[list[int], list[int]]:
    """Nodes of an undirected tree from the root outwards, and the place of each one's parent among them."""
    order, parents = [root], [-1]
    for place, node in enumerate(order):
        for neighbour in tree[node]:
            if neighbour not in order:
                order.append(neighbour)
                parents.append(place)
    return order, parents


def template_graph(skeleton: Skeleton, spurs: list[tuple[str, float]] = ()) -> tuple[SkeletalGraph, list[str]]:
    """The template as a skeletal graph rooted at the top of the head, with spurs (where, length in m) to the front.

    Returns:
        The graph and the name of each node.
    """
    names, edges = list(NODE_NAMES), list(zip(range(1, 20), (JOINT_PARENTS + TIP_PARENTS)[1:], strict=True))
    positions = [*np.asarray(skeleton.rest_joints), *np.asarray(skeleton.rest_tips)]
    for where, length in spurs:
        edges.append((len(names), names.index(where)))
        positions.append(positions[names.index(where)] + np.array([length, 0.0, 0.0]))
        names.append(f"spur at {where}")
    tree = {node: [] for node in range(len(names))}
    for a, b in edges:
        tree[a].append(b)
        tree[b].append(a)
    order, parents = walk_down(tree, names.index("head_top"))
    graph = SkeletalGraph(np.array(positions)[order], np.array(parents), np.full(len(order), 0.05))
    return graph, [names[node] for node in order]


def pose_of(seed, spread=0.5) -> Pose:
    """A standing person somewhere, segments turned at random by about `spread` (rad), hands and feet as their bones."""
    rng = np.random.default_rng(seed)
    rotations = Rotation.from_rotvec(rng.normal(0, spread / np.sqrt(3), (13, 3))).as_matrix()
    rotations = np.concatenate([rotations, rotations[[SEGMENT_PARENTS[segment] for segment in SEGMENT_OF_PIVOT]]])
    return Pose(np.array([0.3, -0.2, 0.9]) + rng.normal(0, 0.1, 3), rotations)


# The joints on the way to each limb's end node; the head's own path is drawn from the neck.
TRUNK = ("head", "neck", "pelvis")
WAYS = (
    ("neck", "head"),
    (*TRUNK[:2], "l_shoulder", "l_elbow", "l_hand"),
    (*TRUNK[:2], "r_shoulder", "r_elbow", "r_hand"),
    (*TRUNK, "l_hip", "l_knee", "l_foot"),
    (*TRUNK, "r_hip", "r_knee", "r_foot"),
)


def drawn_body(balls: list[tuple[str, tuple, float]], links: list[tuple[int, int]]) -> Body:
    """A body of the default adult: balls by segment, place at rest and radius."""
    adult = default_adult()
    segments = np.array([SEGMENT_NAMES.index(name) for name, _, _ in balls], np.int32)
    offsets = np.array([place for _, place, _ in balls]) - np.asarray(rest_origins(adult))[segments]
    return Body(adult, segments, offsets, np.array([radius for _, _, radius in balls]), np.array(links, np.int32))


def shifted(body: PlacedBody, **segments) -> PlacedBody:
    """The placed body with segments moved apart (m), so that depths are easily computed."""
    origins = np.array(body.origins)
    for name, by in segments.items():
        origins[SEGMENT_NAMES.index(name)] += by
    return eqx.tree_at(lambda b: b.origins, body, jnp.asarray(origins))


def ideal_graph(skeleton: Skeleton, pose: Pose) -> Observed:
    """The labelled graph of a body made of bones only: paths run through the joints to the end nodes."""
    joints, tips = (np.asarray(a, np.float64) for a in forward_kinematics(skeleton, pose))
    base = joints[list(TIP_PARENTS)]
    ends = base + END_NODE_REACH * (tips - base)
    paths = np.empty((5, 9, 3))
    for label, names in enumerate(WAYS):
        way = [*(ends[:1] if label else []), *(joints[JOINT_NAMES.index(name)] for name in names), ends[label]]
        paths[label] = way + way[-1:] * (9 - len(way))
    return Observed(*(jnp.asarray(a) for a in (paths, np.ones(5, bool), joints[:2])))


class HandsTogether(AbstractTerm):
    """A user's term: the hands hold a stick."""

    weight: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=1.0)
    length: Float[Array, ""] = eqx.field(converter=jnp.asarray, default=0.4)

    def residual(self, body: PlacedBody, observed: Observed, fixed: None) -> Float[Array, ""]:
        return jnp.sqrt(((body.joints[5] - body.joints[8]) ** 2).sum() + 1e-12) - self.length
