"""Synthetic scenes of several people: each is seen as far as the others do not stand before them."""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Bool, Float

from ..body import Pose, Skeleton, place_body, place_joints
from ..cameras import Cameras
from ..recording import Recording, Truth, pack_silhouettes
from ._anatomy import detailed_body
from ._render import View, make_view, render_view
from ._scene import camera_ring


def make_people(
    people: Mapping[str, tuple[Skeleton, Pose]],
    fps: float = 5.0,
    cameras: Cameras | None = None,
    on_frame: Callable[[int], None] | None = None,
) -> dict[str, Recording]:
    """Render instance masks of several people made of tapered capsules.

    Args:
        people: Skeleton and poses of each person, by name; the same number of poses for all.
        fps: Frames per second.
        cameras: The rig, in a world with z up and the floor at z = 0; by default a ring of eight around 3 x 3 m.
        on_frame: Called with the number of frames done after each frame, to show progress.

    Returns:
        A recording for each person with known dimensions and ground truth, whose silhouettes are what is seen of this
        person. See `jaxskel.people.hide_others` and `jaxskel.people.everybody`.

    Raises:
        ValueError: There is nobody, or the numbers of poses differ.
    """
    counts = {len(pose.root) for _, pose in people.values()}
    if len(counts) != 1:
        raise ValueError(f"people: have {sorted(counts)} poses; give the same number of poses for one person or more")
    cameras = camera_ring(radius=4.5, volume=(4.0, 2.1)) if cameras is None else cameras
    frames = counts.pop()
    placed = [place_body(detailed_body(skeleton), pose) for skeleton, pose in people.values()]
    views = [make_view(cameras, view) for view in range(len(cameras))]
    width, height = cameras.size.max(0)
    packed = np.zeros((len(people), frames, len(cameras), height, -(-width // 8)), np.uint8)
    for frame in range(frames):
        bodies = [(ends[frame], radii) for ends, radii in placed]
        for index, view in enumerate(views):
            seen = _seen(view, bodies)
            masks = np.zeros((len(people), 1, height, width), bool)
            masks[:, 0, : seen.shape[1], : seen.shape[2]] = seen
            packed[:, frame, index] = pack_silhouettes(masks)[:, 0]
        if on_frame is not None:
            on_frame(frame + 1)
    return {
        name: Recording(
            cameras=cameras, silhouettes=silhouettes, fps=float(fps), up="+Z", frame_index=np.arange(frames),
            skeleton=skeleton, truth=_truth(skeleton, pose), name=name,
        )
        for (name, (skeleton, pose)), silhouettes in zip(people.items(), packed, strict=True)
    }  # fmt: skip


def _truth(skeleton: Skeleton, pose: Pose) -> Truth:
    joints, tips = place_joints(skeleton, pose)
    return Truth(np.asarray(joints, np.float64), np.asarray(tips, np.float64), skeleton.template)


def _seen(view: View, bodies: list[tuple[np.ndarray, np.ndarray]]) -> Bool[np.ndarray, "people h w"]:
    """What is seen of each body: of several on a ray, the nearest one."""
    masks = np.stack([render_view(view, ends, radii) for ends, radii in bodies])
    rows, columns = np.nonzero(masks.sum(0) > 1)
    if len(rows):
        directions = view.directions[:, rows, columns].T
        ways = np.stack([_ways(directions, ends - view.centre, radii) for ends, radii in bodies])
        nearest = np.argmin(np.where(masks[:, rows, columns], ways, np.inf), axis=0)
        masks[:, rows, columns] = np.arange(len(bodies))[:, None] == nearest
    return masks


def _ways(
    directions: Float[np.ndarray, "rays 3"],
    ends: Float[np.ndarray, "capsules 2 3"],
    radii: Float[np.ndarray, "capsules 2"],
) -> Float[np.ndarray, " rays"]:
    """Way along each ray from the origin (m) to the first capsule, to a few millimetres; infinite if it meets none.

    Taken at the point of the capsule's axis that is nearest to the ray.
    """
    start, axis = ends[:, 0], ends[:, 1] - ends[:, 0]
    ahead, advance = directions @ start.T, directions @ axis.T
    aa, ab = (axis * axis).sum(1), (start * axis).sum(1)
    share = np.clip((ahead * advance - ab) / np.maximum(aa - advance**2, 1e-12), 0, 1)
    along = ahead + share * advance
    points = start + share[..., None] * axis
    squared = np.maximum((points**2).sum(-1) - along**2, 0)
    inside = (radii[:, 0] + share * (radii[:, 1] - radii[:, 0])) ** 2 - squared
    return np.where(inside >= 0, along - np.sqrt(np.maximum(inside, 0)), np.inf).min(1)
