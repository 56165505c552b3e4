"""The page of `dlama show` in a real browser (oracles: pixels that change when dragged, files that come down and read back)."""

from __future__ import annotations

import io
import json
import shutil
import socket
import time
from collections.abc import Callable, Iterator
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
PATIENCE = 600_000
"""Milliseconds; no measure of speed."""

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
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    viewer = Viewer(contents_of(out), "127.0.0.1", port, 1_000_000)
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        page = browser.new_page(viewport={"width": 800, "height": 600})
        page.elsewhere = []
        page.on("request", lambda request: page.elsewhere.append(request.url))
        page.goto(viewer.address)
        page.get_by_text("Save a picture from here").wait_for(timeout=PATIENCE)
        yield page
        browser.close()
    viewer.stop()


def shot(page: Any) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), int)[:, :450]


def shown(page: Any, wanted: Callable[[np.ndarray], bool]) -> np.ndarray:
    """The first picture of the page of which that is true, however long drawing takes."""
    end = time.monotonic() + PATIENCE / 1000
    while not wanted(seen := shot(page)):
        assert time.monotonic() < end
        page.wait_for_timeout(100)
    return seen


def test_points_are_seen_and_turn(page: Any) -> None:
    """Not an empty canvas, and another picture once it was turned."""
    last = [shot(page)]

    def at_rest(seen: np.ndarray) -> bool:
        before, last[0] = last[0], seen
        return bool(seen.std() > 5 and (seen == before).all())

    page.wait_for_timeout(1000)
    before = shown(page, at_rest)
    page.mouse.move(250, 350)
    page.mouse.down()
    page.mouse.move(330, 330, steps=4)
    page.mouse.up()
    shown(page, lambda seen: np.abs(seen - before).mean() > 1)


def test_nothing_is_loaded_from_elsewhere(page: Any) -> None:
    near = ("http://localhost", "http://127.0.0.1", "data:", "blob:", "ws:")
    assert [url for url in page.elsewhere if not url.startswith(near)] == []


def test_a_picture_and_a_path_come_down(page: Any, tmp_path: Path) -> None:
    """The picture is our renderer's at the camera that the path holds."""
    page.get_by_text("Add this view").click()
    for button, name in (("Save a picture from here", "picture.png"), ("Save as CAMERAS", "cameras.json")):
        with page.expect_download(timeout=PATIENCE) as download:
            page.get_by_text(button).click()
        download.value.save_as(tmp_path / name)
    picture = np.asarray(Image.open(tmp_path / "picture.png"))
    (listed,) = json.loads((tmp_path / "cameras.json").read_text("utf-8"))
    assert picture.shape == (listed["height"], listed["width"], 3) and picture.std() > 5
