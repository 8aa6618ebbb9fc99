"""The report's page of other skeletons than the paper's human, in a real browser."""

from collections.abc import Iterator
from dataclasses import replace

import pytest
from support.browser import BROWSER, DRIVER, JOINT, Page, browser, in_scene, of_colour
from support.report_page import FRAMES, filmed
from support.templates import acting, animal, hand

from jaxskel import Truth
from jaxskel.visualization.report import write_report

pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="needs Chromium and its driver: apt-get install chromium chromium-driver"
)


@pytest.fixture(scope="module")
def driver(tmp_path_factory) -> Iterator:
    yield from browser(tmp_path_factory.mktemp("browser"))


@pytest.mark.parametrize("skeleton", [hand(), animal()], ids=["hand", "animal"])
def test_joints_are_drawn_where_they_are(driver, tmp_path, skeleton):
    recording, poses = filmed(), acting(skeleton, FRAMES)
    poses = replace(poses, fps=recording.fps, up=recording.up, frame_index=recording.frame_index)
    true = Truth(poses.joints + 0.02, None, poses.template)
    write_report(tmp_path / "report.html", replace(recording, truth=true), poses)
    page = Page(driver, tmp_path / "report.html", 3)
    assert page.errors() == []
    assert page.frame == 3
    scene = page.picture("#scene")
    places = in_scene(page, poses.joints[3], scene.shape)
    assert of_colour(scene, places, JOINT["light"]) == len(skeleton.template.joint_names)
    if skeleton.template.limb_pairs.size:
        # Left is red, right is blue.
        for side, colour in (("l", (0xD9, 0x34, 0x2B)), ("r", (0x2B, 0x6C, 0xD9))):
            ends = poses.joints[3, [skeleton.template.joint_names.index(f"{side}_{name}") for name in ("hip", "knee")]]
            middle = in_scene(page, ends.mean(0, keepdims=True), scene.shape)
            assert of_colour(scene, middle, colour) == 1
