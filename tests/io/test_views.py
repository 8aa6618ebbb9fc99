from pathlib import Path

import cv2
import numpy as np
import pytest

from jaxskel.io.views import ImageFolder, MaskArchive, Masks, Video, View, ViewSilhouettes

SIZE = (24, 16)  # width and height


def mask(number: int) -> np.ndarray:
    """A square whose position encodes the image's number."""
    drawn = np.zeros(SIZE[::-1], bool)
    drawn[4:12, number : number + 8] = True
    return drawn


def write_images(folder: Path, numbers, name="{:06d}.png", white=255) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        assert cv2.imwrite(str(folder / name.format(number)), mask(number).astype(np.uint8) * white)
    return folder


def write_video(path: Path, count: int, codec="FFV1", fps=25.0) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), fps, SIZE)
    for number in range(count):
        writer.write(np.repeat(mask(number).astype(np.uint8)[..., None] * 255, 3, axis=2))
    writer.release()
    return path


def write_archive(path: Path, count: int, packed: bool) -> Path:
    masks = np.array([mask(number) for number in range(count)])
    if packed:
        np.savez(path, cam1=np.packbits(masks, axis=2), cam1_shape=masks.shape)
    else:
        np.savez(path, cam1=masks)
    return path


def frames_of(tmp_path: Path, kind: str):
    if kind == "folder":
        return ImageFolder(write_images(tmp_path / "cam1", range(6)))
    if kind == "video":
        return Video(write_video(tmp_path / "cam1.avi", 6))
    return MaskArchive(write_archive(tmp_path / "masks.npz", 6, kind == "packed"), "cam1")


@pytest.mark.parametrize("kind", ["folder", "video", "packed", "plain"])
def test_every_source_gives_the_masks_that_went_in_in_any_order(tmp_path, kind):
    frames = frames_of(tmp_path, kind)
    assert frames.span == (0, 5)
    assert frames.size == SIZE
    assert frames.fps == (25.0 if kind == "video" else None)
    view = View("cam1", frames, Masks())
    for number in (0, 2, 5, 1):
        np.testing.assert_array_equal(view.silhouette(number), mask(number))
    assert not view.silhouette(6).any()
    assert not view.silhouette(-1).any()


@pytest.mark.parametrize("name", ["{:06d}.png", "cam1_{}.png", "walk2-{:03d}-mask.png"])
def test_images_that_are_missing_leave_gaps(tmp_path, name):
    folder = ImageFolder(write_images(tmp_path, (3, 4, 10), name))
    assert folder.span == (3, 10)
    assert list(folder.numbers) == [3, 4, 10]
    assert folder.read(10) is not None
    assert folder.read(5) is None


def test_what_lies_beside_the_images_is_left_alone(tmp_path):
    write_images(tmp_path, range(3))
    for name in ("Thumbs.db", ".DS_Store", "._000001.png", "masks.json", "000001.CR2", "meta.npy"):
        (tmp_path / name).write_bytes(b"")
    write_images(tmp_path, [0], "preview.png")
    folder = ImageFolder(tmp_path)
    assert folder.span == (0, 2)
    assert folder.notes == ("preview.png is left out: no number in the name",)


@pytest.mark.parametrize("beside", [(), (0, 1)])
def test_images_that_are_not_read_are_named_by_their_kind(tmp_path, beside):
    write_images(tmp_path, beside)
    for number in range(2, 4):
        (tmp_path / f"{number:06d}.HEIC").write_bytes(b"")
    with pytest.raises(ValueError, match=r"there are \.heic images, which are not read; convert them to PNG"):
        ImageFolder(tmp_path)


def test_a_codecs_noise_is_no_person():
    assert not Masks().foreground(np.eye(8, dtype=np.uint8)).any()


def test_wider_numbers_are_scaled():
    np.testing.assert_array_equal(Masks().foreground(mask(1).astype(np.uint16) * 65535), mask(1))


def test_a_picture_in_colour_is_no_mask(tmp_path):
    image = np.zeros((*SIZE[::-1], 3), np.uint8)
    image[..., 0] = 200
    cv2.imwrite(str(tmp_path / "7.png"), image)
    with pytest.raises(ValueError, match="7.png is a picture in colour"):
        View("a", ImageFolder(tmp_path), Masks()).silhouette(7)


@pytest.mark.parametrize(
    ("offset", "speed", "span"),
    [(0, 1.0, (0, 9)), (3, 1.0, (-3, 6)), (0, 2.0, (0, 4)), (0, 0.5, (-1, 18)), (1, 0.5, (-3, 16)), (-4, 2.0, (2, 6))],
)
def test_a_views_clock(tmp_path, offset, speed, span):
    view = View("a", ImageFolder(write_images(tmp_path, range(10))), Masks(), offset, speed)
    assert view.span == span
    inside = [frame for frame in range(-30, 30) if view.silhouette(frame).any()]
    assert (inside[0], inside[-1]) == span
    for frame in inside:
        image = int(np.argmax(view.silhouette(frame)[5]))
        assert abs(image - offset - frame * speed) <= 0.5


def test_a_dropped_image_leaves_its_view_black(tmp_path):
    views = [
        View("a", ImageFolder(write_images(tmp_path / "a", (0, 1, 3))), Masks()),
        View("b", ImageFolder(write_images(tmp_path / "b", (0, 1, 2, 3))), Masks()),
    ]
    silhouettes = ViewSilhouettes(views, np.arange(4), 10_000)
    assert silhouettes.shape == (4, 2, 16, 3)
    seen = np.bitwise_count(silhouettes[:]).sum((2, 3))
    assert (seen == [[64, 64], [64, 64], [0, 64], [64, 64]]).all()


def test_silhouettes_of_cameras_with_different_sizes_are_filled_up(tmp_path):
    small = write_images(tmp_path / "b", ())
    cv2.imwrite(str(small / "0.png"), np.full((8, 9), 255, np.uint8))
    views = [View("a", ImageFolder(write_images(tmp_path / "a", [0])), Masks()), View("b", ImageFolder(small), Masks())]
    silhouettes = ViewSilhouettes(views, np.arange(1), 10_000)[0]
    np.testing.assert_array_equal(np.unpackbits(silhouettes[0], axis=-1), mask(0))
    assert np.unpackbits(silhouettes[1], axis=-1)[:8, :9].all()
    assert np.bitwise_count(silhouettes[1]).sum() == 72


def test_frames_are_read_once_whatever_is_asked_for(tmp_path, monkeypatch):
    asked = []
    read = ImageFolder.read
    monkeypatch.setattr(ImageFolder, "read", lambda self, number: asked.append(number) or read(self, number))
    views = [View("a", ImageFolder(write_images(tmp_path, range(10))), Masks())] * 2
    silhouettes = ViewSilhouettes(views, np.arange(10), 10_000)
    for chosen in ([0, 7], [2], [9], range(10)):
        np.testing.assert_array_equal(
            np.unpackbits(silhouettes[np.array(chosen)][:, 1], axis=-1), [mask(number) for number in chosen]
        )
    assert asked == [number for number in range(10) for _ in views]


def test_long_recordings_do_not_stay_in_memory(tmp_path):
    views = [View("a", ImageFolder(write_images(tmp_path, range(10))), Masks())]
    silhouettes = ViewSilhouettes(views, np.arange(10), 100)
    assert isinstance(silhouettes._packed, np.memmap)
    np.testing.assert_array_equal(np.unpackbits(silhouettes[:][:, 0], axis=-1), [mask(n) for n in range(10)])


def broken(tmp_path: Path, what: str) -> None:
    """Open and read a faulty view."""
    if what == "no folder":
        ImageFolder(tmp_path / "none")
    elif what == "no images":
        ImageFolder(tmp_path)
    elif what == "no number":
        ImageFolder(write_images(tmp_path, [0], "mask.png"))
    elif what == "number twice":
        ImageFolder(write_images(write_images(tmp_path, [1], "{}.png"), [1], "0{}.png"))
    elif what == "damaged image":
        (write_images(tmp_path, [0]) / "1.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(20))
        ImageFolder(tmp_path).read(1)
    elif what == "image of another size":
        cv2.imwrite(str(write_images(tmp_path, [0]) / "000001.png"), np.zeros((3, 3), np.uint8))
        ImageFolder(tmp_path).read(1)
    elif what == "no video":
        Video(tmp_path / "none.avi")
    elif what == "not a video":
        (tmp_path / "cam.avi").write_text("nothing to see")
        Video(tmp_path / "cam.avi")
    elif what == "no such key":
        MaskArchive(write_archive(tmp_path / "masks.npz", 2, packed=False), "cam9")
    else:
        np.savez(tmp_path / "masks.npz", cam1=np.zeros((2, 16, 3), np.uint8), cam1_shape=(2, 16, 99))
        MaskArchive(tmp_path / "masks.npz", "cam1")


@pytest.mark.parametrize(
    ("what", "told"),
    [("no folder", "No such file"), ("no images", "holds no images"), ("no number", "no frame number"),
     ("number twice", "keep one of them"), ("damaged image", "1.png: is no image"),
     ("image of another size", "is 3 x 3 px, but 000000.png 24 x 16"), ("no video", "cannot be opened"),
     ("not a video", "is no video"), ("no such key", "'cam9': is missing"), ("wrong shape", "cam1_shape")],
)  # fmt: skip
def test_what_cannot_be_read_is_named_in_a_line(tmp_path, what, told):
    with pytest.raises(ValueError, match=told) as error:
        broken(tmp_path, what)
    assert str(tmp_path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_video_that_was_cut_short_has_the_frames_that_are_there(tmp_path):
    whole = write_video(tmp_path / "whole.avi", 16).read_bytes()
    (tmp_path / "cut.avi").write_bytes(whole[: len(whole) * 9 // 10])  # most of it is a header
    video = Video(tmp_path / "cut.avi")
    assert 0 < video.span[1] < 15
    assert video.read(video.span[1]) is not None
    assert video.read(video.span[1] + 1) is None
