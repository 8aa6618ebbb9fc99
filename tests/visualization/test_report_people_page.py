"""The report of several people in a real browser: colours, names, and a legend that switches each off and on."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver.support.select import Select
from support.browser import BROWSER, DRIVER, JOINT, PANEL, Page, browser, in_scene, of_colour
from support.report_page import LOST, two_people

from jaxskel import JOINT_NAMES, Poses
from jaxskel.visualization import LEFT, PEOPLE, RIGHT
from jaxskel.visualization.report import write_report

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="needs Chromium and its driver: apt-get install chromium chromium-driver"
)
VIEW = "#views figure:nth-child(2) canvas"
SHIN = [JOINT_NAMES.index("l_knee"), JOINT_NAMES.index("l_foot")]


@pytest.fixture(scope="module")
def people(recording) -> dict[str, Poses]:
    return two_people(recording)


@pytest.fixture(scope="module")
def driver(tmp_path_factory) -> Iterator:
    yield from browser(tmp_path_factory.mktemp("browser"))


@pytest.fixture(scope="module")
def file(recording, people, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(path, recording, people)
    return path


def joints_shown(page: Page, poses: Poses, frame: int) -> int:
    scene = page.picture("#scene")
    return of_colour(scene, in_scene(page, poses.joints[frame], scene.shape), JOINT["light"])


def shin_is(page: Page, poses: Poses, frame: int, colour: tuple[int, int, int]) -> bool:
    """Whether the middle of the left shin has a colour, as a sure bone on the panel."""
    scene = page.picture("#scene")
    middle = in_scene(page, poses.joints[frame, SHIN].mean(0, keepdims=True), scene.shape)
    sure = 0.25 + 0.75 * poses.confidence[frame, SHIN[1]]
    faded = sure * np.array(colour) + (1 - sure) * np.array(PANEL["light"])
    return of_colour(scene, middle, tuple(faded)) == 1


def pixels_of(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(picture.astype(int) - np.array(colour)).max(-1) < 10).sum())


def test_everybody_is_drawn_in_a_colour_of_their_own(driver, file, people):
    page = Page(driver, file, 1)
    assert page.errors() == []
    page.find("#show-cameras").click()
    page.find("#show-spread").click()
    for poses, colour in zip(people.values(), PEOPLE, strict=False):
        assert joints_shown(page, poses, 1) == 15
        assert shin_is(page, poses, 1, colour)
        assert pixels_of(page.picture(VIEW), colour) > 50
    assert [key.text for key in driver.find_elements("css selector", ".who")] == ["anna", "ben"]


def test_switching_a_person_off_hides_them_and_nobody_else(driver, file, people):
    page = Page(driver, file, 1)
    page.find("#show-cameras").click()
    anna, ben = people.values()
    both = page.picture("#scene"), page.picture(VIEW)
    page.find(".who:nth-child(2)").click()
    assert (joints_shown(page, anna, 1), shin_is(page, anna, 1, PEOPLE[0])) == (15, True)
    assert joints_shown(page, ben, 1) <= 2
    assert [pixels_of(page.picture(VIEW), colour) > 50 for colour in PEOPLE[:2]] == [True, False]
    page.find(".who:nth-child(2)").click()
    assert all(map(np.array_equal, both, (page.picture("#scene"), page.picture(VIEW))))
    page.find(".who").click()
    assert joints_shown(page, anna, 1) <= 2
    assert joints_shown(page, ben, 1) == 15
    assert page.errors() == []


def test_the_page_says_who_has_no_pose_while_the_other_is_drawn(driver, file, people):
    page = Page(driver, file, LOST)
    assert page.find("#lost").text == "anna: no pose: several_people"
    assert joints_shown(page, people["ben"], LOST) == 15
    page.find(".who").click()
    assert page.find("#lost").text == ""
    assert page.errors() == []


def test_each_has_a_status_and_the_curves_of_one_are_shown(driver, file, people):
    page = Page(driver, file, LOST)
    bands = driver.find_elements("css selector", "svg.band")
    assert [len(band.find_elements("css selector", "rect")) for band in bands] == [5, 1]
    notes = driver.find_elements("css selector", ".row:has(svg.band) small")
    assert [note.text for note in notes] == ["several_people", "ok"]

    def means() -> list[str]:
        notes = driver.find_elements("css selector", ".label .mean")
        return [note.text for note in notes if note.is_displayed()]

    assert means() == ["mean –"]
    Select(page.find("#chosen")).select_by_visible_text("ben")
    # Confidence, and standard deviation, which only Ben has.
    assert means() == [f"mean {people['ben'].confidence[LOST].mean():.2f}", "mean 10.0 mm"]


def test_sides_have_their_colours_where_they_are_asked_for(driver, file, people):
    page = Page(driver, file, 1)
    page.find("#show-cameras").click()
    page.find("#show-spread").click()
    assert not page.find(".key.left").is_displayed()
    page.find("#by-side").click()
    assert page.find(".key.left").is_displayed()
    for poses in people.values():
        assert shin_is(page, poses, 1, LEFT)
    assert pixels_of(page.picture(VIEW), RIGHT) > 50
    page.find("#by-side").click()
    assert shin_is(page, people["anna"], 1, PEOPLE[0])


def test_following_looks_at_the_middle_of_those_who_are_shown(driver, file, people):
    page = Page(driver, file, 1)
    page.find("#follow").click()
    roots = np.array([poses.joints[1, 0] for poses in people.values()])
    np.testing.assert_allclose(np.array(_target(page)), roots.mean(0), atol=2e-4)
    page.find(".who").click()
    np.testing.assert_allclose(np.array(_target(page)), roots[1], atol=2e-4)


def _target(page: Page) -> list[float]:
    return page.driver.execute_script("return JSON.parse(document.querySelector('#scene').dataset.target)")
