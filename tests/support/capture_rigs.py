"""Films of a coloured block that moves in front of a plate, as if cameras were running."""

from pathlib import Path

import cv2
import numpy as np

from jaxskel.io.calibrations import write_pose2sim_calibration
from jaxskel.synthetic import camera_ring

FPS = 25.0
CAMERAS = camera_ring(3, size=(64, 48))


def mask_of(camera: int, frame: int) -> np.ndarray:
    """Where the block is."""
    mask = np.zeros((48, 64), bool)
    mask[10:40, 4 + 2 * frame + camera : 14 + 2 * frame + camera] = True
    return mask


def plate() -> np.ndarray:
    rows, columns = np.mgrid[:48, :64]
    return np.stack([90 + rows, 100 + columns // 2, 120 - rows // 2], -1).astype(np.uint8)


def write_rig(folder: Path, frames: int | tuple[int, ...] = 12, background: str = 'plate = "empty.png"') -> Path:
    """A `recording.toml` of three films: the first is a camera by its address, so the others run beside it."""
    folder.mkdir()
    counts = (frames,) * 3 if isinstance(frames, int) else frames
    write_pose2sim_calibration(folder / "Calib.toml", CAMERAS)
    cv2.imwrite(str(folder / "empty.png"), plate())
    lines = [f'fps = {FPS}\nup = "+Z"\ncalibration = "Calib.toml"']
    for camera, (name, count) in enumerate(zip(CAMERAS.names, counts, strict=True)):
        film = folder / f"{name}.avi"
        writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"FFV1"), FPS, (64, 48))
        for frame in range(count):
            image = plate()
            image[mask_of(camera, frame)] = (30, 30, 220)
            writer.write(image)
        writer.release()
        images = film.as_uri() if camera == 0 else film.name
        lines.append(f'[views.{name}]\nimages = "{images}"\n{background}')
    (folder / "recording.toml").write_text("\n".join(lines))
    return folder
