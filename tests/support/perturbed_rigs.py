"""Wrong rigs of cameras, people made of balls in front of them, and the misses of their outlines."""

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from jaxskel import Cameras, Recording, make_cameras
from jaxskel._runtime.batching import single_precision
from jaxskel.camera_calibration.from_silhouettes._coherence import NOTHING, coherence
from jaxskel.camera_calibration.from_silhouettes._contacts import Contacts, find_contacts
from jaxskel.camera_calibration.from_silhouettes._distance_images import DistanceImages, distance_images
from jaxskel.camera_calibration.from_silhouettes._sight_lines import SightLines, sight_lines
from jaxskel.cameras import ExtrinsicChange, no_change
from support.phantoms import chain, film, ring

# Few cameras, since work grows by the square of their number; the first and the third face each other, and so do the
# other two.
VIEWS, FRAMES = 4, 13
SIZE, FOCAL = (240, 200), 190.0
# A lens with all kinds of distortion, as wide as lenses are.
LENS = [-0.2, 0.06, 0.002, -0.003]


def body(seed: int) -> np.ndarray:
    """Trunk, head, and four limbs in random directions: balls (m)."""
    rng = np.random.default_rng(seed)
    middle = np.array([*rng.uniform(-0.4, 0.4, 2), 1.0])
    parts = [chain(middle - [0, 0, 0.25], middle + [0, 0, 0.3], 0.14, 6), np.array([[*(middle + [0, 0, 0.55]), 0.11]])]
    for height, side in ((0.25, 1), (0.25, -1), (-0.3, 1), (-0.3, -1)):
        start = middle + [0.0, 0.15 * side, height]
        way = rng.normal(size=3) + [0.0, 1.5 * side, 4 * height - 0.5]
        parts.append(chain(start, start + 0.65 * way / np.linalg.norm(way), 0.06, 9))
    return np.concatenate(parts)


def with_lens(cameras: Cameras) -> Cameras:
    return make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, np.tile(LENS, (len(cameras), 1)))


def perturbed(cameras: Cameras, seed: int, turn: float = np.radians(0.5), shift: float = 0.010) -> Cameras:
    """Each camera turned about, and moved along, an axis of its own (rad, m)."""
    axes, ways = np.random.default_rng(seed).normal(size=(2, len(cameras), 3))
    axes, ways = (a / np.linalg.norm(a, axis=1, keepdims=True) for a in (axes, ways))
    R = Rotation.from_rotvec(turn * axes).as_matrix() @ np.asarray(cameras.R)
    t = -np.einsum("cij,cj->ci", R, cameras.centres + shift * ways)
    return make_cameras(cameras.K, R, t, cameras.size, cameras.dist)


def moved(cameras: Cameras, seed: int, scale: float = 1.0) -> Cameras:
    """The rig in a world that is turned, shifted and scaled."""
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(random_state=seed).as_matrix(), rng.normal(size=3)
    R = np.asarray(cameras.R) @ turn.T
    t = -np.einsum("cij,cj->ci", R, scale * cameras.centres @ turn.T + shift)
    return make_cameras(cameras.K, R, t, cameras.size, cameras.dist)


def filmed_with_lenses() -> Recording:
    """Thirteen frames in four views with distortion."""
    cameras = with_lens(ring(VIEWS, SIZE, FOCAL))
    return Recording(cameras, film(cameras, [body(seed) for seed in range(FRAMES)]), 25.0, "+Z", np.arange(FRAMES))


def looked_up(recording: Recording, rig: Cameras) -> tuple[SightLines, DistanceImages, Contacts]:
    """Rays, distances and contacts of a rig on four frames; middles are those of `body`."""
    silhouettes = np.asarray(recording.silhouettes[:4])
    empty_views = ~silhouettes.any((2, 3))
    images = distance_images(silhouettes, rig, empty_views, 40)
    lines = sight_lines(silhouettes, rig, empty_views, images, 80)
    middles = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(silhouettes), 1))
    contacts = find_contacts(single_precision(rig), single_precision(lines), images, middles)
    double = jax.tree.map(lambda a: np.asarray(a, np.float64) if a.dtype.kind == "f" else np.asarray(a), contacts)
    return lines, images, double


def residuals(
    rig: Cameras, lines: SightLines, images: DistanceImages, contacts: Contacts, change: ExtrinsicChange | None = None
) -> np.ndarray:
    """By how much each ray of each frame misses (px), in double precision."""
    with jax.enable_x64(True):
        return np.asarray(coherence(change or no_change(rig), rig, lines, images, contacts))


def missed(recording: Recording, rig: Cameras) -> np.ndarray:
    """Residuals of the rays that give information (px)."""
    value = residuals(rig, *looked_up(recording, rig))
    return value[value > NOTHING]
