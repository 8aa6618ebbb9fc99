"""The report's page in a real browser: it plays, scrubs and orbits, and draws what the poses say."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin
from selenium.webdriver.common.keys import Keys
from support.browser import BROWSER, DRIVER, JOINT, PANEL, Page, browser, in_scene, of_colour
from support.report_page import FRAMES, LOST, filmed, numbers_in, poses_of
from support.shared_data import SHARED

from jaxskel import Poses, Recording, default_adult, read_recording, unpack_silhouettes
from jaxskel.cameras import project
from jaxskel.recording import rotation_to_z_up
from jaxskel.visualization.report import write_report

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="needs Chromium and its driver: apt-get install chromium chromium-driver"
)

REAL = SHARED / "real" / "vlasic_crane" / "vlasic_crane.npz"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return filmed()


@pytest.fixture(scope="module")
def poses(recording) -> Poses:
    return poses_of(recording)


@pytest.fixture(scope="module")
def driver(tmp_path_factory) -> Iterator:
    yield from browser(tmp_path_factory.mktemp("browser"))


@pytest.fixture(scope="module")
def file(recording, poses, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(path, recording, poses)
    return path


def in_view(page: Page, recording: Recording, view: int, joints: np.ndarray) -> np.ndarray:
    """Where a view's canvas shows joints, lens included."""
    shown = page.data(f"#views figure:nth-child({view + 1}) canvas")
    u, v, _ = project(recording.cameras, joints.astype(np.float64))
    centres = np.stack([np.asarray(u[view]), np.asarray(v[view])], -1) + 0.5
    return float(shown["scale"]) * centres + [float(shown["dx"]), float(shown["dy"])]


def assert_shows(page: Page, recording: Recording, poses: Poses, frame: int, theme: str = "light") -> None:
    """Scene and first view have the joints of this frame, and of no other."""
    scene, view = page.picture("#scene", theme), page.picture("#views figure:nth-child(1) canvas", theme)
    for picture, places in (
        (scene, lambda joints: in_scene(page, joints, scene.shape)),
        (view, lambda joints: in_view(page, recording, 0, joints)),
    ):
        found = [of_colour(picture, places(poses.joints[f]), JOINT[theme]) for f in range(FRAMES) if f != LOST]
        assert [f for f in range(FRAMES) if f != LOST and found[f - (f > LOST)] == 15] == [frame]


def test_the_page_opens_without_an_error_and_asks_for_nothing_else(driver, file, poses):
    page = Page(driver, file)
    requests = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    asked = [r["params"]["request"]["url"] for r in requests if r["method"] == "Network.requestWillBeSent"]
    assert asked == [f"{file.as_uri()}#0"] or asked == [file.as_uri()]
    assert page.errors() == []
    assert page.find("h1").text == "synthetic"
    assert "11 (10 ok, 1 not_converged, 1 several_people)" in page.find(".facts").text
    assert "1.71 m ± 0.02 m, found" in page.find(".facts").text
    assert page.find("#readout").text == f"frame 0 of {FRAMES} · 0.00 s · number 100 of the material"


def test_scrubbing_shows_the_frame_asked_for(driver, file, recording, poses):
    page = Page(driver, file)
    page.find("#views figure").click()  # enlarged
    slider = page.find("#scrub")
    # The thumb, 16 px wide, runs from one end of the slider to the other.
    across = (slider.size["width"] - 16) * (9 / (FRAMES - 1) - 0.5)
    page.act(lambda chain: chain.move_to_element_with_offset(slider, round(across), 0).click())
    assert page.frame == 9
    assert_shows(page, recording, poses, 9)
    slider.send_keys(Keys.ARROW_LEFT)
    assert page.frame == 8
    assert_shows(page, recording, poses, 8)
    assert page.errors() == []


def test_playing_runs_through_the_frames_until_it_is_paused(driver, file, recording, poses):
    page = Page(driver, file)
    start, seen = page.picture("#scene"), set()
    page.find("#play").click()
    page.wait(lambda: seen.add(page.frame) or len(seen) >= 4)
    page.find("#play").click()
    stopped = page.frame
    assert (page.picture("#scene") != start).any()
    assert page.find("#play").get_attribute("aria-label") == "play"
    page.driver.execute_async_script("setTimeout(arguments[0], 500)")  # two frames and a half, were it playing
    assert page.frame == stopped
    assert page.errors() == []


def test_the_keys(driver, file):
    page = Page(driver, file)
    body = page.find("body")
    for key, frame in (
        (Keys.ARROW_RIGHT, 1), (Keys.END, FRAMES - 1), (Keys.ARROW_RIGHT, FRAMES - 1), (Keys.ARROW_LEFT, FRAMES - 2),
        (Keys.SHIFT + Keys.ARROW_LEFT + Keys.NULL, 0), (Keys.END, FRAMES - 1), (Keys.HOME, 0),
    ):  # fmt: skip
        body.send_keys(key)
        assert page.frame == frame
    body.send_keys(" ")
    page.wait(lambda: page.frame > 0)
    body.send_keys(" ")
    assert page.find("#play").get_attribute("aria-label") == "play"
    # The button has the focus: a space is one click, not two.
    page.find("#play").send_keys(" ")
    assert page.find("#play").get_attribute("aria-label") == "pause"


def test_dragging_orbits_the_wheel_zooms_and_shift_moves(driver, file, recording, poses):
    page = Page(driver, file, 7)
    page.find("#views figure").click()
    assert_shows(page, recording, poses, 7)
    before, picture = page.data("#scene"), page.picture("#scene")
    page.drag(150, 40)
    turned = page.data("#scene")
    assert float(turned["azimuth"]) == pytest.approx(float(before["azimuth"]) - 1.2)
    assert float(turned["elevation"]) == pytest.approx(float(before["elevation"]) + 0.32)
    assert (page.picture("#scene") != picture).any()
    assert_shows(page, recording, poses, 7)

    scene = page.find("#scene")
    origin = ScrollOrigin.from_element(scene)
    page.act(lambda chain: chain.scroll_from_origin(origin, 0, -100))
    zoomed = page.data("#scene")
    assert float(zoomed["distance"]) < float(turned["distance"])
    assert_shows(page, recording, poses, 7)
    page.drag(60, 0, Keys.SHIFT)
    assert page.data("#scene")["target"] != zoomed["target"]
    assert page.data("#scene")["azimuth"] == zoomed["azimuth"]
    assert_shows(page, recording, poses, 7)
    page.find("#reset").click()
    assert {**page.data("#scene"), "frame": 0} == {**before, "frame": 0}


def test_a_frame_without_a_pose_says_why(driver, file):
    page = Page(driver, file, LOST)
    assert page.find("#lost").text == "no pose: several_people"
    page.find("body").send_keys(Keys.ARROW_RIGHT)
    assert page.find("#lost").text == ""


def test_silhouettes_are_drawn_as_they_are(driver, file, recording):
    # Without a pose, nothing lies over them.
    page = Page(driver, file, LOST)
    page.find("#views figure:nth-child(2)").click()
    picture = page.picture("#views figure:nth-child(2) canvas")
    drawn = np.abs(picture.astype(int) - np.array(PANEL["light"])).max(axis=2) > 20
    mask = unpack_silhouettes(recording.silhouettes[LOST, 1], 200)
    rows, columns = (
        np.floor((np.arange(n) + 0.5) / n * m).astype(int) for n, m in zip(drawn.shape, mask.shape, strict=True)
    )
    true = mask[rows][:, columns]
    assert (drawn & true).sum() / (drawn | true).sum() > 0.9  # an image of 200 px, three times enlarged


def test_a_click_on_a_curve_goes_there(driver, file):
    page = Page(driver, file)
    chart = page.find("svg.curves")
    page.act(
        lambda chain: chain.move_to_element_with_offset(chart, round(chart.size["width"] * (9.5 / 12 - 0.5)), 0).click()
    )
    assert page.frame == 9
    assert float(page.find("svg.curves line.cursor").get_attribute("x1")) == 9.5


def test_truth_is_a_second_skeleton(driver, file, recording, poses):
    page = Page(driver, file, 2)
    without = page.picture("#scene")
    page.find("#show-truth").click()
    assert (page.picture("#scene") != without).any()


def test_the_ellipsoids_have_two_standard_deviations(driver, file, recording, poses, tmp_path):
    """Spheres of 2 x 0.1 m around the joints are circles, on the canvas as large as 0.2 m are there."""
    assert not Page(driver, file).find(".with-spread").is_displayed()  # the poses have no covariances
    covariance = np.broadcast_to(0.01 * np.eye(3, dtype=np.float32), (FRAMES, 15, 3, 3))
    write_report(tmp_path / "spread.html", recording, replace(poses, covariance=covariance))
    page = Page(driver, tmp_path / "spread.html")
    shown = page.picture("#scene")
    page.find("#show-spread").click()
    rows, columns = np.nonzero((page.picture("#scene") != shown).any(-1))
    joints = poses.joints[0].astype(np.float64)
    up = rotation_to_z_up(poses.up).T @ [0, 0, 1.0]
    centres, above = (in_scene(page, at, shown.shape) for at in (joints, joints + 0.2 * up))
    away = np.linalg.norm(np.stack([columns, rows], -1)[:, None] - centres, axis=-1).min(1).max()
    assert away == pytest.approx(np.linalg.norm(above - centres, axis=-1).mean(), rel=0.1)


def test_the_page_follows_a_dark_theme(driver, file, recording, poses):
    page = Page(driver, file, 6)
    page.find("#views figure").click()
    try:
        themed = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", themed)
        places = in_scene(page, poses.joints[6], page.picture("#scene").shape)
        page.wait(lambda: of_colour(page.picture("#scene", "dark"), places, JOINT["dark"]) == 15)
        assert_shows(page, recording, poses, 6, "dark")
    finally:
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_a_name_that_is_a_script_is_a_name(driver, recording, poses, tmp_path):
    name = "</script><script>document.title = 'broken'</script><b>&amp;"
    named = eqx.tree_at(lambda r: r.name, recording, name)
    named = replace(named, cameras=replace(recording.cameras, names=(name, "b", "c", "d")))
    write_report(tmp_path / "named.html", named, poses)
    page = Page(driver, tmp_path / "named.html", 3)
    assert page.find("h1").text == page.find("#views figcaption").text == name
    assert driver.title == f"{name} – jaxskel"
    assert (page.frame, page.errors()) == (3, [])


def test_where_silhouettes_are_left_out_the_views_say_so(driver, recording, poses, tmp_path):
    whole = len(numbers_in(_written(tmp_path / "whole.html", recording, poses, 10**7))["steps"])
    assert whole > 0
    size = (tmp_path / "whole.html").stat().st_size
    stride = numbers_in(_written(tmp_path / "thin.html", recording, poses, size - whole // 2))["stride"]
    assert stride > 1
    page = Page(driver, tmp_path / "thin.html", FRAMES - 1)
    shown = (FRAMES - 1) // stride * stride
    assert int(page.data("#views canvas")["frame"]) == shown
    assert re.search(rf"one frame of {stride}: here frame {shown}\.", page.find("#thinned").text)
    page.find("#views figure").click()
    picture = page.picture("#views canvas")
    assert of_colour(picture, in_view(page, recording, 0, poses.joints[shown]), JOINT["light"]) == 15
    assert page.errors() == []


def test_a_page_without_a_pose_or_without_silhouettes_opens(driver, recording, poses, tmp_path):
    nothing = replace(poses, joints=poses.joints * np.nan, tips=poses.tips * np.nan, status=np.full(FRAMES, 5))
    write_report(tmp_path / "none.html", recording, nothing)
    page = Page(driver, tmp_path / "none.html", 1)
    assert page.find("#lost").text == "no pose: no_hull"
    assert page.errors() == []
    noise = np.random.default_rng(0).integers(0, 256, recording.silhouettes.shape).astype(np.uint8)
    limit = write_report(tmp_path / "clean.html", recording, poses)
    _written(tmp_path / "noise.html", replace(recording, silhouettes=noise), poses, limit)
    page = Page(driver, tmp_path / "noise.html", 1)
    assert page.find("#thinned").text == "The page has no room for silhouettes."
    assert page.errors() == []


def _written(path: Path, recording: Recording, poses: Poses, limit: int) -> str:
    write_report(path, recording, poses, limit=limit)
    return path.read_text("utf-8")


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="needs real/vlasic_crane/vlasic_crane.npz in ../shared/data")
def test_a_real_recording_of_eight_large_views_plays_from_a_small_page(driver, tmp_path):
    real = read_recording(REAL)
    # A person at rest replaces the poses, whose computation takes minutes; the silhouettes need most of the space.
    body, turn = default_adult(), rotation_to_z_up(real.up)
    joints, tips = ((np.array(p) + [0, 0, 1]) @ turn for p in (body.rest_joints, body.rest_tips))
    n = len(real)
    poses = Poses(
        joints=np.tile(joints.astype(np.float32), (n, 1, 1)), tips=np.tile(tips.astype(np.float32), (n, 1, 1)),
        rotations=np.tile(turn.T.astype(np.float32), (n, 17, 1, 1)), skeleton=body,
        confidence=np.ones((n, 15), np.float32), side_confidence=np.ones(n, np.float32), status=np.zeros(n, int),
        fps=real.fps, up=real.up, frame_index=real.frame_index,
    )  # fmt: skip
    assert write_report(tmp_path / "real.html", real, poses) < 15e6
    page, seen = Page(driver, tmp_path / "real.html"), set()
    assert not page.find("#thinned").is_displayed()  # every frame is there
    start = page.picture("#views canvas")
    page.find("#play").click()
    page.wait(lambda: seen.add(page.frame) or len(seen) >= 10)
    assert (page.picture("#views canvas") != start).any()
    assert page.errors() == []
