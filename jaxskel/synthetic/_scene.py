"""A synthetic recording: a ring of cameras around a moving body, with ground truth."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ..body import HUMAN_15, Pose, Skeleton, default_adult, make_body, place_body, place_joints
from ..cameras import Cameras, make_cameras
from ..recording import Recording, Truth
from ._anatomy import detailed_body
from ._motion import demo_motion
from ._random_poses import random_poses
from ._render import render


def look_at(
    centre: Float[np.ndarray, "3"], target: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """R and t (world to camera, m) of a camera at `centre` that looks at `target` with its horizon level (z up).

    Raises:
        ValueError: The camera looks straight up or down, so that its horizon is not defined.
    """
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:
        raise ValueError("look_at: the camera looks straight up or down, so its horizon is not defined; move it aside")
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rotation, -rotation @ centre


def camera_ring(
    count: int = 8,
    radius: float = 4.0,
    size: tuple[int, int] = (640, 480),
    heights: tuple[float, ...] = (1.3, 2.5),
    volume: tuple[float, float] = (1.9, 2.2),
) -> Cameras:
    """Cameras at equal angles around the working volume, looking at its middle.

    Args:
        count: Number of cameras.
        radius: Distance of the cameras from the vertical axis through the origin (m).
        size: Width and height of the images (px).
        heights: Heights above the floor, assigned to the cameras in turn (m).
        volume: Diameter and height of an upright cylinder on the floor that is fully visible in every image (m). The
            focal length is the largest that achieves this.

    Raises:
        ValueError: The cameras would stand inside the volume.
    """
    half, height = volume[0] / 2, volume[1]
    if count < 1 or not heights or radius <= half:
        raise ValueError(
            f"camera_ring: {count} cameras at heights {heights}, {radius} m around a volume {volume[0]} m "
            f"wide: give one camera or more, outside of it (radius > {half:.2f} m)"
        )
    around = 2 * np.pi * np.arange(64) / 64
    rim = np.array([[half * np.cos(a), half * np.sin(a), z] for a in around for z in (0.0, height)])
    middle = np.array([0.0, 0.0, height / 2])
    angles = 2 * np.pi * np.arange(count) / count
    tall = np.resize(heights, count)
    centres = np.stack([radius * np.cos(angles), radius * np.sin(angles), tall], -1)
    R, t = (np.stack(parts) for parts in zip(*(look_at(centre, middle) for centre in centres), strict=True))
    seen = rim @ R.swapaxes(-1, -2) + t[:, None]
    slopes = np.abs(seen[..., :2] / seen[..., 2:]).max((0, 1))
    principal = (np.array(size) - 1) / 2
    # A margin of two pixels keeps the outlines off the edge of the image.
    focal = float(((principal - 2) / slopes).min())
    K = np.array([[focal, 0.0, principal[0]], [0.0, focal, principal[1]], [0.0, 0.0, 1.0]])
    return make_cameras(np.broadcast_to(K, (count, 3, 3)), R, t, size)


def make_scene(
    frames: int = 60,
    fps: float = 5.0,
    cameras: Cameras | None = None,
    skeleton: Skeleton | None = None,
    motion: Pose | None = None,
    on_frame: Callable[[int], None] | None = None,
) -> Recording:
    """Render silhouettes of a moving person made of tapered capsules.

    Args:
        frames: Number of frames of the built-in motion; unused if a motion is given.
        fps: Frames per second.
        cameras: The rig, in a world with z up and the floor at z = 0; a ring of eight by default.
        skeleton: The person's dimensions; an average adult by default. Or those of another template.
        motion: A stack of poses of this skeleton, such as `demo_motion` (the default) or `retarget` return. Of another
            template by default `random_poses`.
        on_frame: Called with the number of frames done after each frame, to show progress.

    Returns:
        A recording with known dimensions and ground truth.

    Raises:
        ValueError: The motion is no stack of poses.
    """
    cameras = camera_ring() if cameras is None else cameras
    skeleton = default_adult() if skeleton is None else skeleton
    human = skeleton.template == HUMAN_15
    if motion is None:
        motion = demo_motion(skeleton, frames, fps) if human else random_poses(skeleton, frames)
    if np.ndim(motion.root) != 2:
        raise ValueError(f"motion: root has shape {np.shape(motion.root)}: give a stack of poses, (frames, 3)")
    ends, radii = place_body(detailed_body(skeleton) if human else make_body(skeleton), motion)
    joints, tips = place_joints(skeleton, motion)
    return Recording(
        cameras=cameras,
        silhouettes=render(cameras, ends, radii, on_frame),
        fps=float(fps),
        up="+Z",
        frame_index=np.arange(len(ends)),
        skeleton=skeleton,
        truth=Truth(np.asarray(joints, np.float64), np.asarray(tips, np.float64), skeleton.template),
        name="synthetic",
    )
