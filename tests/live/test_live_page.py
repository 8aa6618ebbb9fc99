"""The page of a session in a real browser: the skeleton moves as the poses do."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from support.browser import BROWSER, DRIVER, JOINT, Page, browser, in_scene, of_colour
from support.live_sessions import StubStream, numbered

from jaxskel.live import Playback, PoseServer, Tally, WallClock, play

pytest.importorskip("websockets", reason='needs websockets: pip install "jaxskel[live]"')
pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="needs Chromium and its driver: apt-get install chromium chromium-driver"
)


@pytest.fixture(scope="module")
def driver(tmp_path_factory) -> Iterator:
    yield from browser(tmp_path_factory.mktemp("browser"))


class LivePage(Page):
    """A page that is served."""

    def __init__(self, driver, address: str):
        self.driver = driver
        driver.get("about:blank")
        driver.get_log("browser")
        driver.get(address)

    @property
    def frame(self) -> int:
        return int(self.find("html").get_attribute("data-frame") or -1)


def test_a_browser_sees_the_skeleton_move(driver):
    clock, stream = WallClock(), StubStream(None, fps=10.0)
    with PoseServer(numbered(1)[:0]) as server:
        source = Playback(numbered(5), fps=10.0, loop=True)
        session = threading.Thread(target=play, args=(source, stream.push, [server], clock, Tally(10.0)))
        session.start()
        try:
            page = LivePage(driver, server.address)
            page.wait(lambda: page.frame >= 0)
            start, first = page.picture("#scene"), page.frame
            page.wait(lambda: page.frame >= first + 10)
            assert (page.picture("#scene") != start).any()
        finally:
            clock.stop()
            session.join()
        # The last frame stays: its joints are where the poses say, those of other frames are not.
        page.wait(lambda: page.frame == stream.count - 1)
        page.driver.execute_async_script("requestAnimationFrame(arguments[0])")
        picture, walk = page.picture("#scene"), stream.walk
        places = [in_scene(page, joints.astype(float), picture.shape) for joints in walk.joints]
        found = [of_colour(picture, place, JOINT["light"]) for place in places]
        last = (stream.count - 1) % len(walk)
        assert found[last] == 15
        assert found[(last + len(walk) // 2) % len(walk)] < 15
        assert "fps, latency" in page.find("#readout").text
        assert page.find("#lost").text == ""
        assert page.errors() == []
    page.wait(lambda: page.find("#lost").text == "the session has ended")
    assert np.isfinite(float(page.data("#scene")["azimuth"]))
