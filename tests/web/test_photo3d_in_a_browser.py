"""photo3d.html in a real browser at a phone's size, from disk (oracles: what is shown, and `dlama.render` of the same camera)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from chromium import BROWSER_MARKS, PHONE, open_browser

import dlama
from dlama.completion.photo3d import Photo3D
from dlama.geometry.layers.subsampling import subsample
from dlama.geometry.rgbd import RGBD
from dlama.geometry.view import View

pytestmark = BROWSER_MARKS


@pytest.fixture(scope="module")
def photo() -> Photo3D:
    """The bundled street at a quarter of its size."""
    street = dlama.example()
    given = dlama.read_rgbd(street / "street.jpg", street / "depth.png", fov=90)
    small = subsample(View.from_rgbd(given), 4)
    return dlama.photo3d(RGBD(small.color, small.depth, small.camera), filler="telea")


@pytest.fixture(scope="module")
def page(photo: Photo3D, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The file, opened; nothing but it is asked for, and nothing goes wrong."""
    out = dlama.write_photo3d(photo, tmp_path_factory.mktemp("page") / "out", only=("page",))
    asked: list[str] = []
    errors: list[str] = []
    with open_browser() as browser:
        opened = browser.new_context(**PHONE).new_page()
        opened.on("request", lambda request: asked.append(request.url))
        opened.on("pageerror", lambda error: errors.append(str(error)))
        opened.goto(f"file://{out / 'photo3d.html'}")
        opened.wait_for_selector("body[data-ready]")
        yield opened
    assert asked == [f"file://{out / 'photo3d.html'}"] and errors == []


def shown(page: Any) -> np.ndarray:
    """H x W x 3 RGB on the canvas."""
    page.wait_for_timeout(200)
    picture = cv2.imdecode(np.frombuffer(page.locator("#photo").screenshot(), np.uint8), cv2.IMREAD_COLOR)
    return np.asarray(picture[..., ::-1])


def go(page: Any, place: tuple[float, float, float]) -> None:
    """The camera at a place of the box, at once."""
    page.evaluate("(place) => { photo.at = [...place]; photo.aim = [...place]; photo.place(); }", list(place))


@pytest.mark.parametrize("place", [(0, 0, 0), (1, 0, 0), (-1, 1, -1), (1, -1, 1), (0.4, -0.3, 0.2)])
def test_it_shows_what_the_renderer_shows(page: Any, photo: Photo3D, place: tuple[float, float, float]) -> None:
    """The same picture as `dlama.render`, up to how edges are drawn: no cracks, nothing out of place."""
    go(page, place)
    seen = shown(page)
    view = dlama.render(photo.scene, photo.box.at(*place).resized(seen.shape[1], seen.shape[0]), types=False)
    off = np.abs(cv2.blur(seen, (3, 3)).astype(int) - cv2.blur(view.color, (3, 3))).mean(2)
    assert off.mean() < 6 and np.quantile(off, 0.99) < 60


def test_a_finger_turns_it(page: Any) -> None:
    """A drag to the left moves the camera to its right, within the box, and the picture changes."""
    go(page, (0, 0, 0))
    before, box = shown(page), page.locator("#photo").bounding_box()
    touch = page.context.new_cdp_session(page)
    y = box["y"] + box["height"] / 2
    points = [[{"x": box["x"] + x, "y": y}] for x in (300, 250, 200, 100)]
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points[0]})
    for one in points[1:]:
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": one})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_function("photo.at[0] > 0.3")
    assert all(abs(value) <= 1 for value in page.evaluate("photo.aim"))
    assert (np.abs(shown(page).astype(int) - before).max(2) > 10).mean() > 0.05


def test_tilt_and_keys_turn_it(page: Any) -> None:
    """Readings of the device's tilt, and arrow keys, move the aim; Home takes it back."""
    go(page, (0, 0, 0))
    page.evaluate("photo.level = undefined; photo.tilt({ beta: 40, gamma: 0 }); photo.tilt({ beta: 40, gamma: 9 });")
    assert page.evaluate("photo.aim[0]") > 0.4
    page.locator("#photo").focus()
    page.keyboard.press("Home")
    assert page.evaluate("photo.aim") == [0, 0, 0]
    page.keyboard.press("ArrowUp")
    assert page.evaluate("photo.aim[1]") != 0


def test_it_fits_a_phone(page: Any) -> None:
    """The whole picture, in its own shape, and no bar to scroll."""
    box = page.locator("#photo").bounding_box()
    assert box["width"] == pytest.approx(390, abs=1) and box["height"] == pytest.approx(390, abs=1)
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")


@pytest.mark.parametrize("device", [PHONE, {}])
def test_tilting_is_offered_where_a_hand_holds_it(device: dict[str, Any], page: Any) -> None:
    """On a phone whose browser asks first, and not on a desk (oracle: the button)."""
    context = page.context.browser.new_context(**device)
    opened = context.new_page()
    opened.add_init_script("DeviceOrientationEvent.requestPermission = async () => 'granted'")
    opened.goto(page.url)
    opened.wait_for_selector("body[data-ready]")
    assert opened.locator("#tilt").is_visible() == bool(device)
    context.close()
