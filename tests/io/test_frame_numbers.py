"""The frame's number in the names of images: the one that differs from image to image."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxskel.io.views._frame_numbers import number_images

HERE = Path("cam1")


def numbered(*names: str) -> dict[int, str]:
    """The numbers of the images, which must not depend on the order of the list."""
    found = number_images(HERE, [HERE / name for name in names]).files
    assert list(found) == sorted(found)
    assert found == number_images(HERE, [HERE / name for name in reversed(names)]).files
    return {number: file.name for number, file in found.items()}


CLOCK = ("Camera (5)_0001_2019-08-23_16-08-50.192.png", "Camera (5)_0002_2019-08-23_16-08-50.292.png",
         "Camera (5)_0003_2019-08-23_16-08-50.392.png")  # fmt: skip


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (("000000.png", "000001.png", "000004.png"), (0, 1, 4)),
        (("8.png", "9.png", "10.png"), (8, 9, 10)),
        (("cam1_0008.png", "cam1_9.png", "cam1_0010.png"), (8, 9, 10)),
        (("a-12.png", "a-13.png"), (12, 13)),
        (("0000000012.png", "0000000013.png"), (12, 13)),
        (CLOCK, (1, 2, 3)),
        (("000000_0.png", "000001_0.png", "000002_0.png"), (0, 1, 2)),
        (("000007_1.png", "000008_1.png"), (7, 8)),
        (("cam1_000012_640x480.png", "cam1_000013_640x480.png"), (12, 13)),
        (("2024-05-01_frame_12.png", "2024-05-01_frame_13.png"), (12, 13)),
        (("20190823_160850_0001.png", "20190823_160850_0002.png", "20190823_160850_0004.png"), (1, 2, 4)),
        (("frame_0001_jpg.rf.3f2a9b.png", "frame_0002_jpg.rf.77aa.png", "frame_0003_jpg.rf.a.png"), (1, 2, 3)),
        (("part0_000000.png", "part0_000001.png", "part1_000002.png"), (0, 1, 2)),
        (("0001_0.91.png", "0002_0.87.png", "0003_0.91.png"), (1, 2, 3)),
        (("0_0100.png", "10_0101.png", "20_0102.png"), (100, 101, 102)),
        (("0.png", "10.png", "20.png", "40.png"), (0, 10, 20, 40)),
        (("12.png", "57.png", "130.png", "401.png", "500.png"), (12, 57, 130, 401, 500)),
        (("000.000012.png", "000.000013.png"), (12, 13)),
    ],
)
def test_a_counter_is_its_own_number_and_the_rest_stays_what_it_is(names, wanted):
    assert numbered(*names) == dict(zip(wanted, names, strict=True))


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (("16058901234000000.png", "16058901234100000.png", "16058901234200000.png"), (0, 1, 2)),
        (("1605890123400000001.png", "1605890123433333334.png", "1605890123466666667.png"), (0, 1, 2)),
        (("1699999999.933.png", "1699999999.966.png", "1700000000.000.png"), (0, 1, 2)),
        (("1699999999.123456.png", "1699999999.156789.png", "1699999999.223456.png"), (0, 1, 3)),
        (("20190823_160859900.png", "20190823_160900000.png", "20190823_160900100.png"), (0, 1, 2)),
        (("2019-12-31T23-59-59.png", "2020-01-01T00-00-00.png", "2020-01-01T00-00-02.png"), (0, 1, 3)),
        (("cam2_20190823_160850.png", "cam2_20190823_160851.png"), (0, 1)),
        (("0.png", "33.png", "67.png", "100.png", "133.png", "167.png", "233.png"), (0, 1, 2, 3, 4, 5, 7)),
        (("0.900.png", "0.933.png", "0.966.png", "1.000.png", "1.033.png"), (0, 1, 2, 3, 4)),
    ],
)
def test_times_are_numbered_in_their_order_and_a_missing_tick_is_a_missing_image(names, wanted):
    assert numbered(*names) == dict(zip(wanted, names, strict=True))
    (note,) = number_images(HERE, [HERE / name for name in names]).notes
    assert f"in the order of their times, from {names[0]} = 0" in note
    assert ("missing" in note) == (max(wanted) >= len(names))


def test_uneven_times_are_in_their_order_and_it_is_said():
    names = [f"16058901234{digits}00000.png" for digits in ("000", "100", "250", "290")]
    found = number_images(HERE, [HERE / name for name in names])
    assert list(found.files) == [0, 1, 2, 3]
    assert found.notes[0].endswith("their steps are uneven: is an image missing?")


def test_a_counter_that_begins_again_goes_on():
    names = ("9998.png", "9999.png", "0000.png", "0001.png")
    assert numbered(*names) == dict(zip((9998, 9999, 10000, 10001), names, strict=True))
    assert "begin again at 0" in number_images(HERE, [HERE / name for name in names]).notes[0]


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("000012.png", 12),
        ("cam1_000012_640x480.png", 12),
        ("12_640x480.png", 480),
        ("16058901234000000.png", 0),
        ("20190823_160850_0007.png", 7),
    ],
)
def test_of_a_single_image_the_number_with_zeros_in_front_counts_or_else_the_last(name, wanted):
    assert numbered(name) == {wanted: name}


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("a.png", "b.png"), "a.png: has no frame number in its name; call it 000000.png"),
        (("1.png", "01.png"), "is frame 1, as 01.png is; keep one of them"),
        (("000000.png", "000000.jpg"), "is frame 0, as 000000.jpg is; keep one of them"),
        (("000000_0.png", "000000_1.png", "000001_0.png", "000001_1.png"), "is one a person's or a camera's?"),
        (("000000_0.png", "000001_0.png", "000002_1.png"), "is one a person's or a camera's?"),
        (("cam1_000.png", "cam1_001.png", "cam2_000.png", "cam2_001.png"), "is one a person's or a camera's?"),
        (("001_100.png", "002_099.png", "003_098.png"), "two numbers .* different orders, "),
        (("a1_left.png", "b2_right.png"), "are of several kinds, a1_left.png and b2_right.png"),
        (("9" * 300 + ".png", "1.png"), "has a number of 300 digits"),
    ],
)
def test_names_that_do_not_say_which_frame_are_refused_in_a_line(names, told):
    with pytest.raises(ValueError, match=told) as error:
        number_images(HERE, sorted(HERE / name for name in names))
    assert str(error.value).startswith(str(HERE))
    assert "\n" not in str(error.value)
    assert "remove" not in str(error.value)


@given(
    st.sampled_from(["{:06d}", "{}", "{:04d}", "{:010d}"]),
    st.lists(st.integers(0, 99_999), min_size=2, max_size=30, unique=True),
    st.sampled_from(["", "cam1_", "Camera (5)_", "2024-05-01_", "take3-cam2-", "p0001_"]),
    st.sampled_from(["", "_0", "_640x480", "_mask", "-v2_s1.5", "_2019-08-23"]),
)
def test_what_is_the_same_in_all_names_never_counts(form, numbers, before, after):
    numbers = sorted({0, 1, *numbers})  # a counter, not a clock
    names = [f"{before}{form.format(number)}{after}.png" for number in numbers]
    assert numbered(*names) == dict(zip(numbers, names, strict=True))


PIECES = st.sampled_from(["_", "-", ".", "a", "cam", "T", " ", "0", "1", "07", "12", "640x480", "20190823", "160850",
                          "1605890123400", "²", "٣", "9" * 40])  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(st.lists(st.lists(PIECES, min_size=1, max_size=6).map("".join), min_size=1, max_size=8, unique=True))
def test_any_names_are_numbered_or_refused(stems):
    files = sorted(HERE / f"{stem}.png" for stem in stems)
    refusal = None
    try:
        found = number_images(HERE, files)
    except ValueError as error:
        refusal = error
    else:
        assert set(found.files.values()) <= set(files)
        assert all(0 <= number < 2 * 10**9 for number in found.files)
    if refusal is not None:
        assert type(refusal) is ValueError
        assert str(refusal).startswith(str(HERE))
        assert "\n" not in str(refusal)
