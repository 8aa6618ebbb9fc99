"""The report of several people as a file: everybody's numbers and names; of one person it is as ever."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from support.command_line import jaxskel
from support.report_page import FRAMES, LOST, numbers_in, two_people, unpacked

from jaxskel import Poses
from jaxskel.io.poses import write_people_poses
from jaxskel.io.recordings import write_people, write_recording
from jaxskel.poses import STATUS_NAMES
from jaxskel.visualization import PEOPLE
from jaxskel.visualization.report import write_report


@pytest.fixture(scope="module")
def people(recording) -> dict[str, Poses]:
    return two_people(recording)


def written(path, *arguments) -> str:
    assert write_report(path, *arguments) == path.stat().st_size
    return path.read_text("utf-8")


def test_the_numbers_of_the_page_are_those_of_everybody(recording, people, tmp_path):
    page = written(tmp_path / "two.html", recording, people)
    numbers = numbers_in(page)
    assert [person["name"] for person in numbers["people"]] == ["anna", "ben"]
    for person, poses in zip(numbers["people"], people.values(), strict=True):
        steps = unpacked(person["points"], "<i2", FRAMES, 20, 3)
        shown = np.where(steps == numbers["unseen"], np.nan, np.array(numbers["origin"]) + numbers["step"] * steps)
        given = np.concatenate([poses.joints, poses.tips], axis=1)
        np.testing.assert_allclose(shown, given, atol=numbers["step"] / 2 + 1e-6)
        np.testing.assert_array_equal(unpacked(person["status"], "u1", FRAMES), poses.status)
        assert (person["spread"] is None) == (poses.covariance is None)
    assert f"11 (10 ok, 1 not_converged, 1 {STATUS_NAMES[people['anna'].status[LOST]]})" in page
    assert "<dt>ben</dt><dd>with a pose 12 (12 ok), stature 1.71 m ± 0.02 m, found</dd>" in page
    assert [page.count(f"<h3>{name}</h3>") for name in people] == [1, 1]


def test_the_tree_of_everybody_is_that_of_each(recording, people, tmp_path):
    numbers = numbers_in(written(tmp_path / "two.html", recording, people))
    template = people["anna"].template
    names = [*numbers["joints"], *numbers["tips"]]
    assert len(names) == len(numbers["parents"]) == 40
    assert numbers["parents"].count(-1) == 2
    for place, parent in enumerate(numbers["parents"]):
        whose, point = (place // 15, place % 15) if place < 30 else ((place - 30) // 5, 15 + (place - 30) % 5)
        assert names[place] == template.point_names[point]
        assert parent == (-1 if point == 0 else 15 * whose + template.point_parents[point])


def test_views_show_everybody_each_as_on_a_page_of_their_own(recording, people, tmp_path):
    together = numbers_in(written(tmp_path / "two.html", recording, people))
    for person, (name, poses) in zip(together["people"], people.items(), strict=True):
        alone = numbers_in(written(tmp_path / f"{name}.html", recording, poses))
        assert person["skeletons"] == alone["skeletons"]
        assert person["side_confidence"] == alone["side_confidence"]
        assert [together[key] for key in ("steps", "starts", "views")] == [
            alone[key] for key in ("steps", "starts", "views")
        ]


def test_the_page_of_one_person_has_nothing_of_several(recording, people, tmp_path):
    page = written(tmp_path / "one.html", recording, people["anna"])
    assert "people" not in numbers_in(page)
    assert "--body-0" not in page
    assert "class Band" not in page


def test_the_page_keeps_within_its_limit(recording, people, tmp_path):
    whole = len(written(tmp_path / "whole.html", recording, people).encode())
    assert write_report(tmp_path / "thin.html", recording, people, limit=whole - 1000) <= whole - 1000
    assert numbers_in((tmp_path / "thin.html").read_text("utf-8"))["stride"] == 2


def test_a_name_that_is_a_script_is_a_name(recording, people, tmp_path):
    name = "</script><script>alert(1)</script>"
    page = written(tmp_path / "named.html", recording, {name: people["anna"], "b": people["ben"]})
    assert numbers_in(page)["people"][0]["name"] == name
    assert page.count("<script") == page.count("</script>") == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [({"fps": 7.0}, "ben: has other frames"), ({"frame_index": np.arange(FRAMES)}, "ben: has other frames")],
)
def test_people_of_other_frames_are_refused(recording, people, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        write_report(tmp_path / "no.html", recording, people | {"ben": replace(people["ben"], **change)})
    with pytest.raises(ValueError, match="nobody"):
        write_report(tmp_path / "no.html", recording, {})
    assert list(tmp_path.iterdir()) == []


def test_the_page_has_the_colours_of_the_viewer():
    style = files("jaxskel.visualization.report").joinpath("people.css").read_text(encoding="utf-8")
    for place, colour in enumerate(PEOPLE):
        assert f"--body-{place}: #{bytes(colour).hex()};" in style


def test_the_command_takes_masks_of_everybody_and_of_each(recording, people, tmp_path):
    masks = np.array(recording.silhouettes)
    upper, lower = masks.copy(), masks.copy()
    upper[:, :, 80:], lower[:, :, :80] = 0, 0
    write_people(tmp_path / "each.npz", {
        "anna": replace(recording, silhouettes=upper), "ben": replace(recording, silhouettes=lower)
    })  # fmt: skip
    write_recording(tmp_path / "all.npz", recording)
    write_people_poses(tmp_path, {name: replace(poses, covariance=None) for name, poses in people.items()})
    pages = {}
    for name in ("each", "all"):
        done = jaxskel("report", f"{name}.npz", "poses.npz", "-o", f"{name}.html", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"{name}.html: 2 people, 12 frames, 4 views, 0.1 MB")
        pages[name] = (tmp_path / f"{name}.html").read_text("utf-8")
    each, everybody = map(numbers_in, pages.values())
    assert (each.pop("name"), everybody.pop("name")) == ("each", "all")
    assert each == everybody
