"""Small files that claim, or unpack to, more data than fits into memory."""

import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from support.readers import READERS, film
from support.recording_folders import write_folder

MANY = 10**9
SIDE = 20_000  # px: OpenCV itself refuses more than 32 768


def _text(name: str, content: str | bytes) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
        return folder / name

    return write


def _npy(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    """A header that claims numbers, without any data."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": dtype, "fortran_order": False, "shape": shape})
    return file.getvalue()


def _claiming(reader: str, key: str, shape: tuple[int, ...], dtype: str = "<f8", zeros: int | None = None):
    """An archive in which one array claims a shape but holds only a given number of zero bytes, compressed."""

    def write(folder: Path) -> Path:
        path = READERS[reader].write(folder)
        archive = path / "masks.npz" if path.is_dir() else path
        with zipfile.ZipFile(archive) as old:
            members = {name: old.read(name) for name in old.namelist() if name != f"{key}.npy"}
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as new:
            for name, member in members.items():
                new.writestr(name, member)
            with new.open(f"{key}.npy", "w", force_zip64=True) as member:
                member.write(_npy(shape, dtype))
                for _ in range((zeros or 0) >> 20):
                    member.write(bytes(1 << 20))
        return path

    return write


def _long_header(folder: Path) -> Path:
    """An array whose header is as long as it may be."""
    with zipfile.ZipFile(folder / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        with file.open("joints.npy", "w", force_zip64=True) as member:
            member.write(b"\x93NUMPY\x02\x00" + struct.pack("<I", 400 << 20))
            for _ in range(400):
                member.write(b" " * (1 << 20))
    return folder / "a.npz"


def _chunk(kind: bytes, content: bytes, claimed: int | None = None) -> bytes:
    length = len(content) if claimed is None else claimed
    return struct.pack(">I", length) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(side: int, claimed: int | None = None) -> bytes:
    """A complete black image."""
    packer = zlib.compressobj(1)
    rows = b"".join(packer.compress(bytes(side + 1)) for _ in range(side)) + packer.flush()
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", header) + _chunk(b"IDAT", rows, claimed) + _chunk(b"IEND", b"")


def bmp(side: int) -> bytes:
    return (
        b"BM" + struct.pack("<IHHIIiiHHIIiiII", 1000, 0, 0, 54, 40, side, -side, 1, 24, 0, 0, 0, 0, 0, 0) + bytes(900)
    )


def jpeg(side: int) -> bytes:
    whole = bytearray(cv2.imencode(".jpg", np.zeros((16, 16), np.uint8))[1].tobytes())
    place = whole.index(b"\xff\xc0")
    whole[place + 5 : place + 9] = struct.pack(">HH", side, side)
    return bytes(whole)


def tiff(side: int, tile: int = 0) -> bytes:
    tags = [(256, side), (257, side), (258, 8), (259, 1), (262, 1), (277, 1)]
    tags += [(322, tile), (323, tile), (324, 8), (325, 8)] if tile else [(273, 8), (278, side), (279, 8)]
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags)
    return b"II*\0" + struct.pack("<I", 16) + bytes(8) + struct.pack("<H", len(tags)) + entries + bytes(4)


def webp(side: int) -> bytes:
    whole = bytearray(cv2.imencode(".webp", np.zeros((16, 16, 3), np.uint8), [cv2.IMWRITE_WEBP_QUALITY, 101])[1])
    place = whole.index(b"VP8L") + 9
    whole[place : place + 4] = struct.pack("<I", (side - 1) | (side - 1) << 14)
    return bytes(whole)


def gif(side: int) -> bytes:
    """A small image on a large screen."""
    return (
        b"GIF89a"
        + struct.pack("<HHBBB", side, side, 0, 0, 0)
        + b","
        + struct.pack("<HHHHB", 0, 0, 4, 4, 0)
        + b"\x02\0;"
    )


def large_frame(side: int) -> bytes:
    """A large image on a small screen."""
    header = b"GIF89a" + struct.pack("<HHBBB", 4, 4, 0x80, 0, 0) + bytes(6)
    return header + b"," + struct.pack("<HHHHB", 0, 0, side, side, 0) + b"\x02\x02\x4c\x01\0;"


def with_palette(side: int) -> bytes:
    whole = png(side)
    header = struct.pack(">IIBBBBB", side, side, 8, 3, 0, 0, 0)
    return whole[:8] + _chunk(b"IHDR", header) + _chunk(b"PLTE", bytes(6)) + whole[33:]


def _pictures(suffix: str, content: Callable[[], bytes]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / f"0{suffix}").write_bytes(content())
        return folder

    return write


def _numbered_far(folder: Path) -> Path:
    """Two images in each view, so far apart that there would be a thousand million frames."""
    write_folder(folder)
    for view in (folder / "masks").iterdir():
        (view / "000005.png").rename(view / "999999999.png")
    return folder


def _still(folder: Path) -> Path:
    write_folder(folder, "plate")
    (folder / "empty.png").write_bytes(png(SIDE))
    path = folder / "recording.toml"
    path.write_text(path.read_text().replace("empty/left.avi", "empty.png"))
    return folder


def _colmap(folder: Path) -> Path:
    (READERS["colmap"].write(folder) / "images.txt").write_text("11 " * 5_300_000)
    return folder


def _box(kind: bytes, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack(">I4s", 8 + len(content), kind) + content


def _fragments(folder: Path) -> Path:
    """An MP4 with a fragment of very many frames, each of one missing byte."""
    path = READERS["mp4"].write(folder)
    content, boxes = path.read_bytes(), b""
    while content:
        size, kind = struct.unpack(">I4s", content[:8])
        body, content = content[8:size], content[size:]
        if kind == b"moov":
            body += _box(b"mvex", _box(b"trex", struct.pack(">6I", 0, 1, 1, 512, 1, 0)))
        boxes += _box(kind, body)
    run = _box(b"tfhd", struct.pack(">II", 0x20000, 1)) + _box(b"trun", struct.pack(">II", 0, 20_000_000))
    path.write_bytes(boxes + _box(b"moof", _box(b"mfhd", struct.pack(">II", 0, 1)), _box(b"traf", run)))
    return path


def _large_film(codec: str) -> Callable[[Path], Path]:
    """An AVI whose header claims very large images, and very many of them."""

    def write(folder: Path) -> Path:
        path = film(folder, "a.avi", codec)
        content = bytearray(path.read_bytes())
        main, stream = content.index(b"avih") + 8, content.index(b"strf") + 8
        content[main + 16 : main + 20] = struct.pack("<I", MANY)
        content[main + 32 : main + 40] = content[stream + 4 : stream + 12] = struct.pack("<II", 16_000, 16_000)
        path.write_bytes(content)
        return path

    return write


ENTITIES = '<!DOCTYPE a [<!ENTITY a "' + "ha" * 50 + '">' + "".join(
    f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9)
) + "]><Cameras>&j;</Cameras>"  # fmt: skip
ALIASES = "a0: &a0 [ha, ha]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
MARKERS = 20_000
TRC = "\n".join([
    "PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumMarkers\tUnits", f"100\t{MARKERS}\tm",
    "Frame#\tTime\t" + "\t".join(f"m{i}" for i in range(MARKERS)), "", *["1\t0"] * 40_000,
])  # fmt: skip
BVH = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xposition\n}\nMOTION\nFrames: 999999999\nFrame Time: 0.01\n0\n"
LISTS = '{"cameras": [' + "[]," * 600_000 + "[]]}"

# The reader of each, by its name, and what writes it.
BOMBS: dict[str, tuple[str, Callable[[Path], Path]]] = {
    "npz that claims frames": ("sequence", _claiming("sequence", "silhouettes", (MANY, 3, 12, 3), "|u1")),
    "npz that claims cameras": ("sequence", _claiming("sequence", "K", (MANY, 3, 3))),
    "npz that unpacks to cameras": ("sequence", _claiming("sequence", "K", (7 << 20, 3, 3), zeros=504 << 20)),
    "npz that unpacks to text": ("sequence", _claiming("sequence", "up", (1,), "<U134217728", zeros=512 << 20)),
    "npz that unpacks to truth": ("truth", _claiming("truth", "joints", (1 << 20, 15, 3), zeros=360 << 20)),
    "npz that unpacks to poses": ("poses", _claiming("poses", "joints", (1 << 20, 15, 3), zeros=360 << 20)),
    "npz that unpacks to a rig": ("rig", _claiming("rig", "dist", (3, 1 << 24), zeros=384 << 20)),
    "npz that unpacks to matrices": ("projections", _claiming("projections", "cam_1", (3, 1 << 24), zeros=384 << 20)),
    "npz with a long header": ("truth", _long_header),
    "masks that claim frames": ("archive", _claiming("archive", "left", (MANY, 30, 40), "|b1")),
    "npy that claims cameras": ("projections .npy", _text("P.npy", _npy((MANY, 3, 4)))),
    "images numbered far apart": ("folders", _numbered_far),
    "png that claims pixels": ("png", _pictures(".png", partial(png, SIDE))),
    "png that claims bytes": ("png", _pictures(".png", partial(png, 16, 2**31 - 1))),
    "still plate that claims pixels": ("plate", _still),
    "bmp that claims pixels": ("bmp", _pictures(".bmp", partial(bmp, SIDE))),
    "jpeg that claims pixels": ("jpeg", _pictures(".jpg", partial(jpeg, SIDE))),
    "tiff that claims pixels": ("tiff", _pictures(".tif", partial(tiff, SIDE))),
    "tiff that claims a tile": ("tiff", _pictures(".tif", partial(tiff, 16, 1 << 15))),
    "png with a palette that claims pixels": ("png", _pictures(".png", partial(with_palette, SIDE))),
    "webp that claims pixels": ("png", _pictures(".webp", partial(webp, 16_000))),
    "gif that claims a screen": ("png", _pictures(".gif", partial(gif, SIDE))),
    "gif that claims a frame": ("png", _pictures(".gif", partial(large_frame, SIDE))),
    "pbm that claims pixels": ("png", _pictures(".pbm", lambda: b"P4 20000 20000\n" + bytes(900))),
    "pgm of text that claims pixels": ("png", _pictures(".pgm", lambda: b"P2\n# a\n20000\n20000 255\n" + b"0 " * 900)),
    "png as a board": ("film of a board", _text("0.png", png(SIDE))),
    "avi that claims pixels": ("avi", _large_film("FFV1")),
    "mp4 that claims frames": ("mp4", _fragments),
    "toml of one key": ("subject", _text("a.toml", "a." * 45_000 + "b = 1")),
    "toml of many tables": ("pose2sim", _text("a.toml", "".join(f"[a.b{i}]\n" for i in range(200_000))[:1_999_000])),
    "toml of deep lists": ("folders", _text("recording.toml", "a = " + "[" * 90_000)),
    "xml of entities": ("vicon", _text("a.xcp", ENTITIES)),
    "xml of elements": ("vicon", _text("a.xcp", "<Cameras>" + "<a/>" * 490_000 + "</Cameras>")),
    "yaml of aliases": ("opencv", _text("a.yml", ALIASES)),
    "yaml that claims numbers": (
        "opencv",
        _text("a.yml", "K: !!opencv-matrix\n rows: 9999999\n cols: 9999999\n data: [ 1 ]"),
    ),
    "yaml of numbers": ("opencv", _text("a.yml", "K: [" + "11 " * 5_300_000 + "]")),
    "json of deep lists": ("panoptic", _text("a.json", "[" * 1_000_000)),
    "json of lists": ("panoptic", _text("a.json", LISTS)),
    "txt of numbers": ("projections .txt", _text("P.txt", "11 " * 5_300_000)),
    "colmap of one line": ("colmap", _colmap),
    "trc of empty rows": ("trc", _text("a.trc", TRC)),
    "bvh that claims frames": ("bvh", _text("a.bvh", BVH)),
}
