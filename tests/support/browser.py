"""A real browser, headless, and a page of the report in it. Skips where there is no Chromium."""

import base64
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium: pip install selenium")
from selenium.webdriver.chrome.service import Service  # noqa: E402
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.support.wait import WebDriverWait  # noqa: E402

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
JOINT = {"light": (0x1D, 0x21, 0x27), "dark": (0xF2, 0xF4, 0xF7)}
PANEL = {"light": (0xF5, 0xF6, 0xF8), "dark": (0x1D, 0x21, 0x28)}


def browser(folder: Path) -> Iterator:
    """Chromium, whose own files go to a folder, until it is no longer needed."""
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    for flag in (
        "headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "disable-background-networking",
        "disable-component-update", "disable-sync", "disable-dev-shm-usage", "window-size=1400,1000",
        f"user-data-dir={folder}",
    ):  # fmt: skip
        options.add_argument(f"--{flag}")
    started = webdriver.Chrome(options, Service(DRIVER))
    yield started
    started.quit()


class Page:
    """A page that was opened at a frame."""

    def __init__(self, driver, file: Path, frame: int = 0):
        self.driver = driver
        driver.get("about:blank")
        for log in ("browser", "performance"):
            driver.get_log(log)  # drop earlier messages
        driver.get(f"{file.as_uri()}#{frame}")

    def find(self, selector: str):
        return self.driver.find_element("css selector", selector)

    @property
    def frame(self) -> int:
        return int(self.find("html").get_attribute("data-frame"))

    def data(self, selector: str) -> dict:
        return self.driver.execute_script("return {...document.querySelector(arguments[0]).dataset}", selector)

    def picture(self, selector: str, theme: str = "light") -> np.ndarray:
        """Pixels of a canvas, red first; where nothing is drawn, those of its panel."""
        script = "return document.querySelector(arguments[0]).toDataURL()"
        url = self.driver.execute_script(script, selector)
        image = cv2.imdecode(np.frombuffer(base64.b64decode(url.split(",")[1]), np.uint8), cv2.IMREAD_UNCHANGED)
        alpha = image[..., 3:] / 255.0
        return (alpha * image[..., 2::-1] + (1 - alpha) * np.array(PANEL[theme])).round().astype(np.uint8)

    def act(self, build) -> None:
        build(ActionChains(self.driver)).perform()

    def drag(self, right: int, down: int, key: str | None = None) -> None:
        scene = self.find("#scene")
        chain = ActionChains(self.driver).move_to_element(scene)
        chain = chain.key_down(key) if key else chain
        chain = chain.click_and_hold().move_by_offset(right, down).release()
        (chain.key_up(key) if key else chain).perform()

    def wait(self, until) -> None:
        WebDriverWait(self.driver, 60, 0.02).until(lambda _: until())

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser")]


def of_colour(picture: np.ndarray, points: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Number of points whose pixel has a given colour."""
    columns, rows = np.floor(points).astype(int).T
    inside = (columns >= 0) & (rows >= 0) & (columns < picture.shape[1]) & (rows < picture.shape[0])
    pixels = picture[rows[inside], columns[inside]].astype(int)
    return int((np.abs(pixels - np.array(colour)).max(axis=1) < 40).sum())


def in_scene(page: Page, joints: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Where the page's own camera sees joints (pixels of the canvas), by its angles only."""
    shown = page.data("#scene")
    azimuth, elevation, distance = (float(shown[key]) for key in ("azimuth", "elevation", "distance"))
    toward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0])
    up = np.cross(toward, right)
    offset = joints - json.loads(shown["target"])
    scale = 1.6 * min(shape[:2]) / (distance - offset @ toward)
    return np.stack([shape[1] / 2 + scale * (offset @ right), shape[0] / 2 - scale * (offset @ up)], -1)
