"""Logs the cameras in the scene, and the silhouette and projected skeleton on the image of each."""

import cv2
import numpy as np
from jaxtyping import Int, UInt8

from ...cameras import Cameras, project
from ...recording import unpack_view
from .. import draw_silhouette, drawn_bones
from ._figures import Figure
from ._rerun import rr

LONG_SIDE = 640
"""Longer side of a view, at most (px), so that minutes of silhouettes fit into the viewer's memory."""

# Distance of an image from its camera (m): well away from the people, who stand some metres off.
_IMAGE_DISTANCE = 0.4
# Width of a line over an image (screen px, independent of the displayed size).
_LINE = rr.Radius.ui_points(1.5)


def camera_path(name: str) -> str:
    """The viewer's path of a camera."""
    return "world/cameras/" + rr.escape_entity_path_part(name)


def log_cameras(stream: rr.RecordingStream, cameras: Cameras) -> None:
    """Log the pose of every camera in the world (m), constant over time.

    The viewer's pinhole model knows neither skew nor lens distortion, so a fisheye camera is only right near its
    centre; what is drawn over its image is right everywhere. Integer coordinates are pixel corners in the viewer, not
    pixel centres.
    """
    for i, (name, size) in enumerate(zip(cameras.names, cameras.size, strict=True)):
        factors = display_size(size) / size
        K = np.array(cameras.K[i], np.float64)
        K[0, 1] = 0
        K[:2, 2] += 0.5
        K[:2] *= factors[:, None]
        placed = rr.Transform3D(translation=cameras.centres[i], mat3x3=np.asarray(cameras.R[i]).T)
        seen = rr.Pinhole(
            image_from_camera=K, resolution=display_size(size), image_plane_distance=_IMAGE_DISTANCE,
            camera_xyz=rr.ViewCoordinates.RDF,
        )  # fmt: skip
        stream.log(camera_path(name), placed, seen, static=True)


def log_silhouettes(stream: rr.RecordingStream, cameras: Cameras, packed: UInt8[np.ndarray, "cams h w8"]) -> None:
    """Log the silhouettes of one frame in every view, reduced, as PNG."""
    for name, size, bits in zip(cameras.names, cameras.size, packed, strict=True):
        image = _small(draw_silhouette(unpack_view(bits, size)), display_size(size))
        contents = cv2.imencode(".png", image)[1].tobytes()
        stream.log(f"{camera_path(name)}/silhouette", rr.EncodedImage(contents=contents, media_type="image/png"))


def log_projections(stream: rr.RecordingStream, cameras: Cameras, figure: Figure, frame: int) -> None:
    """Draw the bones of one frame of the poses into every view, with lens distortion, where the view sees them."""
    ends = drawn_bones(figure.poses.template)
    u, v, _ = project(cameras, figure.points(frame))
    factors = np.array([display_size(size) / size for size in cameras.size])
    uv = (np.stack([u, v], -1) + 0.5) * factors[:, None]
    for name, seen in zip(cameras.names, uv, strict=True):
        bones = seen[ends]
        drawn = np.isfinite(bones).all((1, 2))
        lines = rr.LineStrips2D(bones[drawn].astype(np.float32), colors=figure.colours[ends[drawn, 0]], radii=_LINE)
        stream.log(figure.under(f"{camera_path(name)}/skeleton"), lines)


def display_size(size: Int[np.ndarray, "2"]) -> Int[np.ndarray, "2"]:
    """Width and height at which a view is shown (px); images are never enlarged."""
    return np.maximum(1, np.round(size * min(1.0, LONG_SIDE / int(size.max())))).astype(np.int64)


def _small(image: UInt8[np.ndarray, "h w 3"], size: Int[np.ndarray, "2"]) -> UInt8[np.ndarray, "h2 w2 3"]:
    width, height = size.tolist()
    if (height, width) == image.shape[:2]:
        return image
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
