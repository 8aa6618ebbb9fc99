"""Sets of views in folders, and the meaning of their names."""

from pathlib import Path

import pytest

from jaxskel.io.proposals._view_sets import ViewSet, find_view_sets, words_of


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("masks_rembg/*", ["masks", "rembg"]),
        ("emptyScene2/*.mp4", ["empty", "scene", "mp"]),
        ("cleanPlate-03", ["clean", "plate"]),
        ("RGBMask", ["rgb", "mask"]),
        ("calib01", ["calib"]),
        ("", []),
    ],
)
def test_words_are_whole(name, words):
    assert words_of(name) == words


@pytest.mark.parametrize(
    ("pattern", "masks", "background", "accessory"),
    [
        ("masks/*", True, False, False),
        ("masks_clean/*", True, False, False),
        ("masks_rembg/*", True, False, False),
        ("rembg/*", False, False, False),
        ("skateboard/*", False, False, False),
        ("keyboard_session/*.mp4", False, False, False),
        ("template/*", False, False, False),
        ("*/video.avi", False, False, False),
        ("bg/*", False, True, True),
        ("*/cleanPlate.avi", False, True, True),
        ("empty_room/*.mp4", False, True, True),
        ("Background1/*", False, True, True),
        ("calib/*", False, False, True),
        ("*/checkerboard.avi", False, False, True),
        ("board2/*", False, False, True),
    ],
)
def test_a_part_of_a_word_says_nothing(pattern, masks, background, accessory):
    found = ViewSet(pattern, {})
    assert (found.is_of_masks, found.is_background, found.is_accessory) == (masks, background, accessory)


def touch(folder: Path, *paths: str) -> Path:
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(b"")
    return folder


@pytest.mark.parametrize(
    ("place", "pattern"),
    [
        ("masks/{}/000000.png", "masks/*"),
        ("{}/masks/000000.png", "*/masks"),
        ("{}.mp4", "*.mp4"),
        ("{0}/{0}_mask.mp4", "*/*_mask.mp4"),
        ("session1/trial2/{}/frames/000000.jpg", "session1/trial2/*/frames"),
        ("a/b/c/{}/e/000000.jpg", "a/b/c/*/e"),
    ],
)
def test_views_are_found_in_the_layouts_that_people_have(tmp_path, place, pattern):
    touch(tmp_path, *(place.format(name) for name in ("cam1", "cam2", "cam10")))
    sets = {found.pattern: found for found in find_view_sets(tmp_path)}
    assert list(sets[pattern].sources) == ["cam1", "cam2", "cam10"]
    assert len([found for found in sets.values() if len(found.sources) == 3]) == 1


def test_links_to_parents_are_gone_through_once(tmp_path):
    touch(tmp_path, "cam1/0.png", "cam2/0.png")
    (tmp_path / "cam1" / "again").symlink_to(tmp_path)
    assert ["*"] == [found.pattern for found in find_view_sets(tmp_path) if "cam2" in found.sources]
