"""The page of `dlama show` in a real browser (oracles: pixels that change when dragged, files that come down and read back)."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import dlama

viser = pytest.importorskip("viser", reason="pip install 'dlama[view]'")
sync_api = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
BROWSER = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine"),
    pytest.mark.filterwarnings("ignore"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The page of a small removal, opened."""
    from dlama.apps.viewer.contents import contents_of
    from dlama.apps.viewer.server import Viewer

    rng = np.random.default_rng(0)
    color = rng.integers(60, 255, (96, 128, 3)).astype(np.uint8)
    depth = np.full((96, 128), 3, np.float32)
    depth[30:60, 40:70] = 1.5
    rgbd = dlama.RGBD(color, depth, dlama.Camera.from_fov(128, 96, 60))
    out = tmp_path_factory.mktemp("page") / "out"
    dlama.write(dlama.remove(rgbd, depth < 2, filler="telea"), out, only=("scene",))
    viewer = Viewer(contents_of(out), "127.0.0.1", 18470, 1_000_000)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        page = browser.new_page(viewport={"width": 800, "height": 600})
        page.elsewhere = []
        page.on("request", lambda request: page.elsewhere.append(request.url))
        page.goto(viewer.address)
        page.get_by_text("Save a picture from here").wait_for(timeout=60_000)
        page.wait_for_timeout(2000)
        yield page
        browser.close()
    viewer.stop()


def shot(page: Any) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), int)[:, :450]


def test_points_are_seen_and_turn(page: Any) -> None:
    before = shot(page)
    assert before.std() > 5  # not an empty canvas
    page.mouse.move(250, 350)
    page.mouse.down()
    page.mouse.move(330, 330, steps=4)
    page.mouse.up()
    page.wait_for_timeout(1500)
    assert np.abs(shot(page) - before).mean() > 1


def test_nothing_is_loaded_from_elsewhere(page: Any) -> None:
    near = ("http://localhost", "http://127.0.0.1", "data:", "blob:", "ws:")
    assert [url for url in page.elsewhere if not url.startswith(near)] == []


def test_a_picture_and_a_path_come_down(page: Any, tmp_path: Path) -> None:
    """The picture is our renderer's at the camera that the path holds."""
    page.get_by_text("Add this view").click()
    for button, name in (("Save a picture from here", "picture.png"), ("Save as CAMERAS", "cameras.json")):
        with page.expect_download(timeout=60_000) as download:
            page.get_by_text(button).click()
        download.value.save_as(tmp_path / name)
    picture = np.asarray(Image.open(tmp_path / "picture.png"))
    (listed,) = json.loads((tmp_path / "cameras.json").read_text("utf-8"))
    assert picture.shape == (listed["height"], listed["width"], 3) and picture.std() > 5
