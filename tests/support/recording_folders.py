"""A recording as a folder of images, videos and tables."""

from pathlib import Path

import cv2
import numpy as np

from jaxskel import Recording, make_cameras, unpack_silhouettes
from jaxskel.io.calibrations import write_pose2sim_calibration
from jaxskel.synthetic import camera_ring
from support.phantoms import chain, film

SIZE = (40, 30)


FRAMES = 6


def a_recording() -> Recording:
    """Three cameras, and in each a leaning capsule that walks."""
    cameras = camera_ring(count=3, size=SIZE)
    cameras = make_cameras(cameras.K, cameras.R, cameras.t, cameras.size, names=["left", "front", "right"])
    places = np.linspace(-0.3, 0.3, FRAMES)
    bodies = [chain([place, 0.1, 0.5], [place + 0.4, -place, 1.4], 0.25) for place in places]
    return Recording(cameras, film(cameras, bodies), 25.0, "+Z", np.arange(FRAMES))


def masks_of(recording: Recording, camera: int) -> np.ndarray:
    return unpack_silhouettes(np.asarray(recording.silhouettes)[:, camera], SIZE[0]).astype(np.uint8) * 255


def write_views(folder: Path, recording: Recording, kind: str) -> dict[str, str]:
    """Write the masks, or pictures before a green backdrop; returns what a `recording.toml` calls them."""
    sources = {}
    for camera, name in enumerate(recording.cameras.names):
        masks = masks_of(recording, camera)
        if kind == "folders":
            (folder / "masks" / name).mkdir(parents=True)
            for frame, mask in enumerate(masks):
                cv2.imwrite(str(folder / "masks" / name / f"{frame:06d}.png"), mask)
            sources[name] = f'masks = "masks/{name}"'
        elif kind == "archive":
            every = {n: masks_of(recording, c) for c, n in enumerate(recording.cameras.names)}
            np.savez(folder / "masks.npz", **every)
            sources[name] = f'masks = "masks.npz:{name}"'
        else:
            pictures = np.where(masks[..., None] > 0, np.uint8([60, 70, 200]), np.uint8([40, 180, 50]))
            if kind == "video":
                pictures = np.repeat(masks[..., None], 3, axis=-1)
            write_video(folder / f"{name}.avi", pictures)
            sources[name] = f'masks = "{name}.avi"' if kind == "video" else f'images = "{name}.avi"\nbackdrop = true'
            if kind == "plate":
                write_video(folder / "empty" / f"{name}.avi", np.full_like(pictures[:3], (40, 180, 50)))
                sources[name] = f'images = "{name}.avi"\nplate = "empty/{name}.avi"'
    return sources


def write_video(path: Path, pictures: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), 25.0, SIZE)
    for picture in pictures:
        writer.write(np.ascontiguousarray(picture))
    writer.release()


def write_folder(folder: Path, kind: str = "folders", top: str = "", **views: str) -> Path:
    """A folder with a recording; `views` are lines in addition to a view's own."""
    recording = a_recording()
    write_pose2sim_calibration(folder / "calibration.toml", recording.cameras)
    lines = ["fps = 25", 'calibration = "calibration.toml"', top]
    for name, source in write_views(folder, recording, kind).items():
        lines += [f"[views.{name}]", source, views.get(name, "")]
    lines += ["[cleaning]", "smooth = false", "fill = false"]
    (folder / "recording.toml").write_text("\n".join(lines))
    return folder
