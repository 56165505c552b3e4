"""The page in a real browser: every step a visitor takes (oracles: what is shown, the pixels of the canvas, the downloaded zip).

Runs where playwright is installed and a Chromium is found; elsewhere it is skipped and says so.
"""

from __future__ import annotations

import base64
import itertools
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from chromium import BROWSER_MARKS, PHONE, open_browser, playwright
from servers import answering

import dlama
from dlama.web.answers import Limits
from dlama.web.completions.runs import ONE_AT_A_TIME
from dlama.web.inputs import ROLES
from dlama.web.server import Server

pytestmark = BROWSER_MARKS
PATIENCE = 600_000
"""Milliseconds: kernels may have to be compiled first."""
playwright.expect.set_options(timeout=60_000)


@pytest.fixture(scope="module")
def serve() -> Iterator[Server]:
    """A server for all tests of this file."""
    with answering(Limits(megabytes=8, visits=40)) as opened:
        yield opened


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """One browser; each page gets a profile of its own."""
    with open_browser() as opened:
        yield opened


class Pages:
    """Opens pages, and notes what they ask elsewhere and what goes wrong in them."""

    def __init__(self, browser: Any, address: str) -> None:
        self.browser, self.address = browser, address
        self.contexts: list[Any] = []
        self.elsewhere: list[str] = []
        self.errors: list[str] = []

    def open(self, width: int = 1280, height: int = 860, **options: Any) -> Any:
        """A page of its own profile, ready."""
        context = self.browser.new_context(viewport={"width": width, "height": height}, **options)
        context.set_default_timeout(PATIENCE)
        self.contexts.append(context)
        page = context.new_page()
        page.on("request", lambda request: self.note(request.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.goto(self.address)
        page.locator("[data-example=street]").wait_for()
        return page

    def note(self, url: str) -> None:
        """An address that was asked for."""
        if not url.startswith((self.address, "blob:", "data:")):
            self.elsewhere.append(url)


@pytest.fixture
def pages(browser: Any, serve: Server) -> Iterator[Pages]:
    """Pages that, at the end, asked nobody else for anything and threw nothing."""
    opened = Pages(browser, f"http://127.0.0.1:{serve.port}/")
    yield opened
    for context in opened.contexts:
        context.close()
    assert opened.elsewhere == [] and opened.errors == []


def hand_in(page: Any, frame: Path, fov: str = "60") -> None:
    """The small frame's picture and depth; the lens is asked for, next to its field, and given."""
    page.set_input_files("#files", [frame / "image.png", frame / "depth.png"])
    complaint = page.locator('[data-error="camera"]')
    playwright.expect(complaint).to_contain_text("how wide the camera sees is not known")
    page.fill("#fov", fov)
    page.get_by_role("button", name="Read again").click()
    page.locator("#marker").wait_for()
    playwright.expect(complaint).to_be_hidden()


def click(page: Any, x: float, y: float, wh: tuple[int, int] = (64, 48)) -> None:
    """A click on a pixel of a picture of that size, once the page has come to rest."""
    box, before = page.locator("#canvas").bounding_box(), None
    while box != before:
        page.wait_for_timeout(100)
        box, before = page.locator("#canvas").bounding_box(), box
    page.mouse.click(box["x"] + box["width"] * (x + 0.5) / wh[0], box["y"] + box["height"] * (y + 0.5) / wh[1])


def slide(page: Any, name: str, value: str) -> None:
    """A slider moved."""
    page.locator(f"#{name}").fill(value)


def choose(page: Any, name: str, value: str) -> None:
    """One of several, as the keyboard or a click on its words chooses it."""
    page.locator(f'input[name="{name}"][value="{value}"]').check(force=True)


def complete(page: Any) -> None:
    """Complete, and wait for the result."""
    page.locator("#complete").click()
    page.locator("#after[src]").wait_for()
    page.locator("#pane-result").wait_for()


def pixels(page: Any, selector: str) -> np.ndarray:
    """What is on the screen there."""
    return cv2.imdecode(np.frombuffer(page.locator(selector).screenshot(), np.uint8), cv2.IMREAD_COLOR)


def test_a_refused_click_goes_and_its_message_is_seen(pages: Pages, frame: Path) -> None:
    """Law: what comes next is as if it had not been; the message does not lie below what sticks to the lower edge."""
    page = pages.open()
    hand_in(page, frame)
    click(page, 5, 40)
    complaint = page.locator('[data-error="marks"]')
    playwright.expect(complaint).to_contain_text("a click holds 5,40, which lies on a plain surface")
    message, bar = complaint.bounding_box(), page.locator("#card-do").bounding_box()
    assert message["y"] + message["height"] <= bar["y"] or message["y"] >= bar["y"] + bar["height"]
    playwright.expect(page.locator("#undo")).to_be_disabled()
    click(page, 30, 24)
    playwright.expect(page.locator("#mask-fact")).to_contain_text("% of the picture")
    playwright.expect(complaint).to_be_hidden()
    complete(page)
    playwright.expect(page.locator("#command")).to_contain_text("--click 30,24 -o")


def test_the_whole_way(pages: Pages, frame: Path, tmp_path: Path) -> None:
    """Hand in, click, preview, complete, compare, read a pixel, turn in 3-D, take the zip home."""
    page = pages.open(accept_downloads=True)
    hand_in(page, frame)
    before = pixels(page, "#canvas")
    click(page, 30, 24)
    playwright.expect(page.locator("#mask-fact")).to_contain_text("% of the picture")
    changed = np.abs(pixels(page, "#canvas").astype(int) - before).max(2) > 10
    assert 0.05 < changed.mean() < 0.5
    slide(page, "yaw", "12")
    playwright.expect(page.locator("#preview-legend")).to_contain_text("object")
    playwright.expect(page.locator('output[for="yaw"]')).to_have_text("12°")
    page.locator("#method summary").click()
    page.select_option("#filler", "telea")
    complete(page)
    playwright.expect(page.locator("#run-words")).to_contain_text("telea, ")
    playwright.expect(page.locator("#before-name")).to_have_text("known from here")
    playwright.expect(page.locator("#single")).to_have_value("image.png")
    page.locator("#compare").click(position={"x": 20, "y": 200})
    playwright.expect(page.locator("#readout")).to_contain_text("confidence")
    for kind in ("depth", "hole_type", "origin", "confidence"):
        choose(page, "kind", kind)
        playwright.expect(page.locator("#after-name")).to_contain_text(kind.split("_")[0])
    page.get_by_role("tab", name="3-D").click()
    playwright.expect(page.locator("#scene-fact")).to_contain_text("points")
    shown = pixels(page, "#scene")
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 50
    box = page.locator("#scene").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 380, box["y"] + 220, steps=4)
    page.mouse.up()
    page.wait_for_timeout(1500)
    turned = pixels(page, "#scene")
    assert (turned != shown).any(2).mean() > 0.05
    choose(page, "scene-color", "1")
    assert (pixels(page, "#scene") != turned).any(2).mean() > 0.05
    with page.expect_download() as download:
        page.get_by_role("button", name="3-D photo").click()
    download.value.save_as(tmp_path / "photo3d.html")
    assert (tmp_path / "photo3d.html").read_text("utf-8").startswith("<!doctype html>")
    with page.expect_download() as download:
        page.get_by_role("button", name="Results as zip").click()
    download.value.save_as(tmp_path / "home.zip")
    with zipfile.ZipFile(tmp_path / "home.zip") as archive:
        assert archive.testzip() is None and "out/scene.glb" in archive.namelist()
    playwright.expect(page.locator("#command")).to_contain_text("--click 30,24 --yaw 12")


def test_filling_from_all_sides_is_cancelled(pages: Pages, frame: Path) -> None:
    """The 3-D tab says so, the result stays, and the tab opened again fills and shows the scene."""
    page = pages.open()
    hand_in(page, frame)
    page.locator("#method summary").click()
    page.select_option("#filler", "telea")
    complete(page)
    with ONE_AT_A_TIME:  # it cannot be done before the click
        page.get_by_role("button", name="3-D photo").click()
        playwright.expect(page.locator("#home-words")).to_have_text("filling what is hidden from all sides, 0 %")
        page.get_by_role("tab", name="3-D").click()
        page.locator("#scene-cancel").click()
        playwright.expect(page.locator("#scene-fact")).to_contain_text("cancelled")
    playwright.expect(page.locator("#scene-progress")).to_be_hidden()
    page.get_by_role("tab", name="Result").click()
    playwright.expect(page.locator("#after")).to_be_visible()
    page.get_by_role("tab", name="3-D").click()
    playwright.expect(page.locator("#scene-fact")).to_contain_text("points", timeout=PATIENCE)


@pytest.mark.filterwarnings("ignore:the (field of view|scale)")  # of a photo alone, assumed
def test_five_minutes_of_a_newcomer(pages: Pages, browser: Any, tmp_path: Path) -> None:
    """A photo alone is dropped on the page, an object clicked, gone, the 3-D photo saved and opened from disk on a phone.

    Oracles: the barrel's orange is gone, little else has changed, nothing else is asked for (test_photo3d_in_a_browser turns it).
    """
    page = pages.open(accept_downloads=True)
    photo = cv2.resize(cv2.imread(str(dlama.example() / "street.jpg")), (128, 128), interpolation=cv2.INTER_AREA)
    drop(page, "street.jpg", cv2.imencode(".jpg", photo)[1].tobytes())
    page.locator("#marker").wait_for()
    click(page, 64, 86, (128, 128))
    playwright.expect(page.locator("#mask-fact")).to_contain_text("% of the picture")
    complete(page)
    with page.expect_download() as download:
        page.get_by_role("button", name="3-D photo").click()
    download.value.save_as(tmp_path / "photo3d.html")
    phone = browser.new_context(**PHONE)
    opened, asked = phone.new_page(), list[str]()
    opened.on("request", lambda request: asked.append(request.url))
    opened.goto(f"file://{tmp_path / 'photo3d.html'}")
    opened.wait_for_selector("body[data-ready]")
    shown = pixels(opened, "#photo")
    given = cv2.resize(photo, shown.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    high, wide = given.shape[:2]
    barrel = np.s_[high * 56 // 100 : high * 79 // 100, wide * 45 // 100 : wide * 56 // 100]
    assert orange(given[barrel]).mean() > 0.2
    assert orange(shown[barrel]).mean() < 0.1 * orange(given[barrel]).mean()
    off = np.abs(cv2.blur(shown, (5, 5)).astype(int) - cv2.blur(given, (5, 5))).mean(2)
    assert np.median(off) < 6
    assert len(asked) == 1
    phone.close()


def orange(bgr: np.ndarray) -> np.ndarray:
    """Where a picture is orange."""
    blue, green, red = (bgr[..., channel].astype(int) for channel in range(3))
    return (red > 140) & (red > green + 50) & (green > blue)


def drop(page: Any, name: str, data: bytes) -> None:
    """A file dropped on the page."""
    script = """([name, text]) => {
        const carried = new DataTransfer();
        carried.items.add(new File([Uint8Array.from(atob(text), (one) => one.charCodeAt(0))], name, { type: 'image/jpeg' }));
        return carried;
    }"""
    carried = page.evaluate_handle(script, [name, base64.b64encode(data).decode()])
    page.dispatch_event("body", "drop", {"dataTransfer": carried})


def test_marks_are_undone_and_painted(pages: Pages, frame: Path) -> None:
    """Undo takes the last mark back; a box, a stroke and the eraser each change the mask; the keyboard marks too."""
    page = pages.open()
    hand_in(page, frame)
    fact = page.locator("#mask-fact")
    click(page, 30, 24)
    playwright.expect(fact).not_to_be_empty()
    page.get_by_role("button", name="Undo").click()
    playwright.expect(fact).to_be_empty()
    choose(page, "tool", "add")
    slide(page, "brush", "4")
    click(page, 12, 12)
    playwright.expect(fact).to_contain_text("%")
    share = fact.inner_text()
    slide(page, "grow", "3")
    page.locator("#grow").dispatch_event("change")
    playwright.expect(fact).not_to_have_text(share)
    choose(page, "tool", "erase")
    slide(page, "brush", "60")
    click(page, 12, 12)
    playwright.expect(page.locator('[data-error="marks"]')).to_contain_text("nothing is left of the mask")
    page.get_by_role("button", name="Clear").click()
    playwright.expect(page.locator('[data-error="marks"]')).to_be_hidden()
    choose(page, "tool", "click")
    page.locator("#canvas").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    playwright.expect(fact).to_contain_text("%")
    page.keyboard.press("Backspace")
    playwright.expect(fact).to_be_empty()


@pytest.mark.parametrize("how", ["start over", "example", "file"])
def test_a_new_picture_begins_anew(pages: Pages, frame: Path, how: str) -> None:
    """Law: no turn, growth or shadow that was meant for the picture before is left; the next one was turned unseen."""
    page = pages.open()
    hand_in(page, frame)
    click(page, 30, 24)
    playwright.expect(page.locator("#mask-fact")).to_contain_text("%")
    page.locator("#shadow").check()
    slide(page, "yaw", "12")
    slide(page, "grow", "3")
    {
        "start over": lambda: page.get_by_role("button", name="Start over").click(),
        "example": lambda: page.locator("[data-example=street]").click(),
        "file": lambda: page.set_input_files("#files", frame / "image.png"),
    }[how]()
    playwright.expect(page.locator("#mask-fact")).to_be_empty()
    for name in ("yaw", "grow"):
        playwright.expect(page.locator(f"#{name}")).to_have_value("0")
    playwright.expect(page.locator("#shadow")).not_to_be_checked()
    playwright.expect(page.locator('output[for="yaw"]')).to_have_text("0°")


def test_slow_answers_change_no_order(pages: Pages, frame: Path) -> None:
    """Files handed in while starting over is under way stay (oracle: the list of files), and a mark that is taken back while its
    mask is under way stays away (oracle: no mask is reported)."""
    page, held = pages.open(), []
    hand_in(page, frame)
    page.route("**/api/mask", lambda route: held.append(route))
    click(page, 30, 24)
    waiting(page, held)
    page.get_by_role("button", name="Undo").click()
    held.pop().continue_()
    playwright.expect(page.locator("#busy")).to_be_hidden()
    page.wait_for_timeout(300)
    playwright.expect(page.locator("#mask-fact")).to_be_empty()
    page.unroute("**/api/mask")
    page.route("**/api/start_over", lambda route: held.append(route))
    page.get_by_role("button", name="Start over").click()
    waiting(page, held)
    page.set_input_files("#files", [frame / "image.png", frame / "depth.png"])
    page.wait_for_timeout(300)
    held.pop().continue_()
    playwright.expect(page.locator('[data-error="camera"]')).to_be_visible()
    playwright.expect(page.locator("#uploads li")).to_have_count(2)


def waiting(page: Any, held: list[Any]) -> None:
    """Until a request is held back."""
    while not held:
        page.wait_for_timeout(50)


def test_what_takes_long_says_so(pages: Pages, frame: Path) -> None:
    """Reading, completing and drawing (oracle: what is shown while their answers are held back); a picture that is on the page is
    not asked for again."""
    page, held, asked = pages.open(), [], []
    page.route("**/api/read", lambda route: held.append(route))
    page.set_input_files("#files", [frame / "image.png", frame / "depth.png"])
    waiting(page, held)
    playwright.expect(page.get_by_text("reading …")).to_be_visible()
    held.pop().continue_()
    page.unroute("**/api/read")
    page.fill("#fov", "60")
    page.get_by_role("button", name="Read again").click()
    page.locator("#marker").wait_for()
    playwright.expect(page.get_by_text("reading …")).to_be_hidden()
    page.route(
        "**/api/run", lambda route: route.fulfill(json={"state": "running", "stage": "fill frame 0", "share": 0.5})
    )
    page.locator("#complete").click()
    playwright.expect(page.locator("#run-words")).to_have_text("filling")
    page.unroute("**/api/run")
    page.locator("#after[src]").wait_for()
    page.route("**/api/picture", lambda route: (asked.append(route.request.post_data_json["kind"]), held.append(route)))
    for kind in ("hole_type", "origin"):
        choose(page, "kind", kind)
        waiting(page, held)
        playwright.expect(page.locator("#readout")).to_have_text("drawing …")
        while held:
            held.pop().continue_()
            page.wait_for_timeout(50)
        playwright.expect(page.locator("#readout")).to_contain_text("Click a pixel")
    assert sorted(asked) == ["hole_type", "image", "origin"]


@pytest.mark.filterwarnings("ignore:the (field of view|scale)")  # of a photo alone, assumed
def test_the_brush_is_as_wide_in_a_large_picture(pages: Pages, tmp_path: Path) -> None:
    """Oracle: its share of the picture, as in one of half its size, within a rounding. Of a photo alone depth is estimated, which
    the page says."""
    page, photo, brush = pages.open(), cv2.imread(str(dlama.example() / "street.jpg")), []
    for size in (512, 1024):
        cv2.imwrite(str(tmp_path / "photo.jpg"), cv2.resize(photo, (size, size)))
        page.set_input_files("#files", tmp_path / "photo.jpg")
        playwright.expect(page.locator('.under [data-fact="picture"]')).to_contain_text(f"{size} x {size}")
        playwright.expect(page.locator('.under [data-fact="depth"]')).to_contain_text("estimated by")
        brush.append(page.evaluate("[Number(brush.value), Number(brush.max)]"))
    np.testing.assert_allclose(brush[1], 2 * np.array(brush[0]), rtol=0.01)


def test_bad_files_are_reported_next_to_their_field(pages: Pages, frame: Path, tmp_path: Path) -> None:
    """A damaged picture, an ending that is none, a file too large: each says so, and the page continues."""
    page = pages.open()
    (tmp_path / "broken.png").write_bytes(b"\x89PNG and nothing")
    page.set_input_files("#files", tmp_path / "broken.png")
    playwright.expect(page.locator('[data-error="picture"]')).to_contain_text("broken.png")
    assert str(tmp_path) not in page.inner_text("body") and ".dlama-draft" not in page.inner_text("body")
    (tmp_path / "a.exe").write_bytes(b"x")
    page.set_input_files("#files", tmp_path / "a.exe")
    playwright.expect(page.locator("#general")).to_contain_text("a.exe: is no file that this page takes (.png, ")
    playwright.expect(page.locator("#general")).to_contain_text(".avif, ")
    (tmp_path / "large.png").write_bytes(bytes(9 * 2**20))
    page.set_input_files("#files", tmp_path / "large.png")
    playwright.expect(page.get_by_text("has 9 MB; up to 8 MB are taken")).to_be_visible()
    page.get_by_role("button", name="Start over").click()
    (tmp_path / "camera.json").touch()  # its field is hidden, for no file is left
    page.set_input_files("#files", [tmp_path / "camera.json", frame / "image.png"])
    playwright.expect(page.get_by_text("camera.json: is empty (0 bytes)")).to_be_visible()
    playwright.expect(page.locator('#uploads [data-role="picture"]')).to_contain_text("image.png")
    page.get_by_role("button", name="Start over").click()
    (tmp_path / "calib.json").write_text('{"k": 3}')
    page.set_input_files("#files", [frame / "image.png", tmp_path / "calib.json"])
    playwright.expect(page.locator('[data-error="right"]')).to_contain_text(
        "the right picture of the stereo pair is expected"
    )
    page.set_input_files("#file-right", frame / "image.png")
    playwright.expect(page.locator('[data-error="calib"]')).to_contain_text("calib.json: field 'left_K' is missing")
    page.get_by_role("button", name="Start over").click()
    hand_in(page, frame)


def test_of_files_handed_in_together_the_good_ones_are_taken(pages: Pages, tmp_path: Path) -> None:
    """Oracle: the list of files. What is no picture, no calibration, damaged, too large or a mask is named."""
    page, street = pages.open(), dlama.example()
    bad = {
        "report.docx": b"x",
        "notes.txt": b"hello there\n",
        "right.png": b"\x89PNG and nothing",
        "b.exr": bytes(9 * 2**20),
        "mask.png": (street / "mask.png").read_bytes(),
    }
    for name, data in bad.items():
        (tmp_path / name).write_bytes(data)
    good = [street / name for name in ("street.jpg", "depth.png", "camera.json")]
    page.set_input_files("#files", [*(tmp_path / name for name in bad), *good])
    page.locator("#marker").wait_for()
    for name in bad:
        playwright.expect(page.locator("#general")).to_contain_text(f"{name}: ")
    listed = page.eval_on_selector_all("#uploads li", "all => all.map((one) => [one.dataset.role, one.title])")
    assert listed == [["picture", "street.jpg"], ["depth", "depth.png"], ["camera", "camera.json"]]
    playwright.expect(page.locator('.under [data-fact="depth"]')).to_contain_text("% missing")


def test_files_are_what_their_names_say(pages: Pages) -> None:
    """By hand: a photo whose name is like that of depth, a mask among others, a camera of ROS, a calibration and the camera of
    one picture, and which picture is the right one."""
    roles = {
        "display.png": "picture",
        "depths-of-the-sea.jpg": "picture",
        "rgb.png rgb_depth.png mask.png": "picture depth mask",
        "a.png info.yaml b.exr": "picture camera depth",
        "street.jpg calib.txt": "picture camera",
        "street.jpg calib.yaml": "picture camera",
        "left.png right.png left.yaml right.yaml": "picture right camera calib",
        "left.png right.png calib.txt": "picture right calib",
        "im0.png im1.png stereo.json": "picture right calib",
        "a.png 1305031102.160407.png": "picture right",
        "a.exe b.jpg": "left picture",
    }
    script = """async ([names, endings]) => {
        const { rolesOf } = await import("/files.js");
        const { found, left, masks } = rolesOf(names.map((name) => ({ name })), {}, endings);
        const role = (name) => Object.keys(found).find((one) => found[one].name === name);
        const isMask = (name) => masks.some((one) => one.name === name);
        return names.map((name) => role(name) ?? (isMask(name) ? "mask" : left.length ? "left" : "none")).join(" ");
    }"""
    page = pages.open()
    found = {names: page.evaluate(script, [names.split(), ROLES]) for names in roles}
    assert found == roles


def test_a_file_is_said_to_be_depth(pages: Pages, frame: Path) -> None:
    """Its name is long and does not say so: it is no longer the right picture (oracle: the list of files), and fits."""
    page, name = pages.open(), f"{'1305031102.' * 6}png"
    (frame / "depth.png").rename(frame / name)
    page.set_input_files("#files", [frame / "image.png", frame / name])
    playwright.expect(page.locator('[data-error="calib"]')).to_contain_text("where a picture is depth")
    page.set_input_files("#file-depth", frame / name)
    playwright.expect(page.locator('[data-error="camera"]')).to_be_visible()
    assert page.eval_on_selector_all("#uploads li", "all => all.map((one) => one.dataset.role)") == ["picture", "depth"]
    assert page.evaluate(
        "document.getElementById('card-open').scrollWidth <= document.getElementById('card-open').clientWidth"
    )


def test_a_completion_is_cancelled_and_a_broken_connection_loses_none(pages: Pages, frame: Path) -> None:
    """The page says so at once, and completes afterwards, though for two seconds nothing is answered (oracle: the result is
    shown)."""
    page = pages.open()
    hand_in(page, frame)
    slide(page, "yaw", "20")
    with ONE_AT_A_TIME:  # it cannot be done before the click
        page.locator("#complete").click()
        page.locator("#cancel").click()
        playwright.expect(page.locator("#run-words")).to_have_text("cancelled")
    playwright.expect(page.locator("#tab-result")).to_be_disabled()
    slide(page, "yaw", "2")
    with ONE_AT_A_TIME:  # nor before the connection is back
        page.locator("#complete").click()
        playwright.expect(page.locator("#run-words")).to_have_text("waiting for its turn")
        page.context.set_offline(True)
        page.wait_for_timeout(2000)
        page.context.set_offline(False)
    playwright.expect(page.locator("#after[src]")).to_be_visible(timeout=PATIENCE)
    playwright.expect(page.locator("#general")).to_be_hidden()


def test_loading_again_in_the_middle_loses_nothing(pages: Pages, frame: Path) -> None:
    """The picture, the marks and what was said of the mask, the camera, the method and the result are there again."""
    page = pages.open()
    hand_in(page, frame)
    click(page, 30, 24)
    found = page.locator("#mask-fact")
    playwright.expect(found).to_contain_text("% of the picture")
    before = found.inner_text()
    page.reload()
    playwright.expect(found).to_have_text(before)
    playwright.expect(page.locator("#undo")).to_be_enabled()
    playwright.expect(page.locator("#fov")).to_have_value("60")
    slide(page, "yaw", "12")
    slide(page, "grow", "2")
    page.locator("#method summary").click()
    page.select_option("#filler", "telea")
    with page.expect_response("**/api/complete"):
        page.locator("#complete").click()
    page.reload()
    page.locator("#pane-result").wait_for()
    playwright.expect(page.locator("#command")).to_contain_text("--filler telea")
    for name, value in (("yaw", "12"), ("grow", "2"), ("filler", "telea")):
        playwright.expect(page.locator(f"#{name}")).to_have_value(value)
    playwright.expect(page.locator('output[for="yaw"]')).to_have_text("12°")


def test_loading_again_while_it_completes_shows_so_at_once(pages: Pages, frame: Path) -> None:
    """Oracle: what is shown while the answer with the picture is held back."""
    page, held = pages.open(), []
    hand_in(page, frame)
    page.route("**/api/run", lambda route: route.fulfill(json={"state": "running", "stage": "render", "share": 0.5}))
    with page.expect_response("**/api/complete"):
        page.locator("#complete").click()
    page.route("**/api/source", lambda route: held.append(route))
    page.reload()
    waiting(page, held)
    playwright.expect(page.locator("#cancel")).to_be_visible()
    playwright.expect(page.locator("#complete")).to_be_disabled()
    playwright.expect(page.get_by_text("looking …")).to_be_visible()
    held.pop().continue_()
    playwright.expect(page.get_by_text("looking …")).to_be_hidden()
    page.unroute("**/api/run")
    page.locator("#pane-result").wait_for()


def test_a_copy_of_a_tab_is_another_visit(pages: Pages, frame: Path) -> None:
    """Browsers copy what a tab has stored (oracle: the numbers that both send); closing the copy leaves the first as it was."""
    page, sent = pages.open(), []
    hand_in(page, frame)
    page.context.on("request", lambda request: sent.append(request.headers.get("x-dlama-visit")))
    with page.context.expect_page() as opened:
        page.evaluate("window.open(location.href)")
    opened.value.locator("[data-example=street]").click()
    opened.value.locator("#marker").wait_for()
    of_copy = set(filter(None, sent))
    opened.value.close(run_before_unload=True)
    sent.clear()
    page.locator("#tab-preview").click()
    page.locator("#preview[src]").wait_for()
    assert len(of_copy) == 1 and set(filter(None, sent)).isdisjoint(of_copy)


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_it_fits_and_is_named(width: int, scheme: str, pages: Pages, frame: Path) -> None:
    """No sideways scrolling; every control has a name and every picture a text; the theme is the system's until changed."""
    page = pages.open(width, 844, color_scheme=scheme)
    hand_in(page, frame)
    complete(page)
    playwright.expect(page.locator("#after-name")).to_have_text("completed")
    page.wait_for_timeout(100)
    box = page.locator("#compare").bounding_box()
    assert box["y"] >= 0 and box["y"] + box["height"] <= 844
    steps = [pixels(page, f"#card-{name} .number") for name in ("open", "marks", "move", "do")]
    assert not any(np.array_equal(one, other) for one, other in itertools.combinations(steps, 2))
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    unnamed = page.evaluate(
        """[...document.querySelectorAll('input, select, button, canvas')].filter((one) => !one.closest('[hidden]') &&
           !(one.labels?.length || one.ariaLabel || one.textContent.trim())).map((one) => one.outerHTML)"""
    )
    assert unnamed == []
    assert page.evaluate("[...document.images].every((one) => one.hasAttribute('alt'))")
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 21, 26)"
    assert dark == (scheme == "dark")
    page.locator("#theme").click()
    assert (page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(18, 21, 26)") != dark
