"""What nouns show in a notebook: the pictures are theirs, the HTML is self-contained (oracle: decoded by Pillow and json)."""

from __future__ import annotations

import base64
import html
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import dlama
from dlama.geometry.cloud import concatenate
from dlama.geometry.figures import show
from dlama.geometry.figures.html import GAP, LARGEST_SIDE, figure, strip
from dlama.geometry.figures.points import MOST_POINTS, point_viewer
from dlama.perception.resampling import shrink_rgbd

NOWHERE_ELSE = ("http://", "https://", "file://", "@import")


def pictures(content: str) -> list[Image.Image]:
    """The JPEG pictures that HTML holds."""
    return [
        Image.open(io.BytesIO(base64.b64decode(code))) for code in re.findall(r"image/jpeg;base64,([^\"]+)", content)
    ]


def street() -> dlama.RGBD:
    folder = dlama.example()
    return shrink_rgbd(dlama.read_rgbd(folder / "street.jpg", folder / "depth.png", fov=90), (128, 128))


def test_a_figure_shows_the_pictures_and_escapes_words() -> None:
    red, blue = np.full((20, 30, 3), (200, 0, 0), np.uint8), np.full((900, 300, 3), (0, 0, 200), np.uint8)
    content = figure("<b> & more", [("a < b", red), ('say "c"', blue)])
    first, second = pictures(content)
    assert first.size == (30, 20) and second.size == (100, LARGEST_SIDE)  # never enlarged, averaged down
    assert np.abs(np.asarray(first, int) - (200, 0, 0)).max() <= 4
    assert np.abs(np.asarray(second, int) - (0, 0, 200)).max() <= 4
    assert "<b>" not in content and "a &lt; b" in content and 'alt="say &quot;c&quot;"' in content


def test_a_strip_is_one_png_with_the_pictures_side_by_side() -> None:
    red, blue = np.full((20, 30, 3), (200, 0, 0), np.uint8), np.full((10, 5, 3), (0, 0, 200), np.uint8)
    sheet = np.asarray(Image.open(io.BytesIO(strip([("", red), ("", blue)]))))
    assert sheet.shape == (20, 30 + GAP + 5, 3)
    assert (sheet[:, :30] == red).all() and (sheet[:10, 30 + GAP :] == blue).all() and (sheet[10:, 30:] == 255).all()


def test_every_noun_shows_itself_and_loads_nothing() -> None:
    rgbd = street()
    done = dlama.view(rgbd, yaw=10)
    for noun, count in ((rgbd, 2), (done.view, 3), (done, 5)):
        content = noun._repr_html_()
        assert len(pictures(content)) == count
        assert not any(address in content for address in NOWHERE_ELSE)
        assert len(content) < 300_000
        assert Image.open(io.BytesIO(noun._repr_png_())).format == "PNG"
    assert done.scene._repr_png_() == done.scene.layers[0]._repr_png_()
    small = np.asarray(pictures(rgbd._repr_html_())[0].resize((8, 8)), float)
    truth = np.asarray(Image.fromarray(np.asarray(rgbd.color)).resize((8, 8), Image.Resampling.BOX), float)
    assert np.abs(small - truth).mean() < 12  # the picture itself, not the depth


def packed(content: str) -> dict[str, np.ndarray]:
    """The arrays that a page of points holds."""
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', content).group(1))  # type: ignore[union-attr]
    assert not any(address in page for address in NOWHERE_ELSE)
    data = json.loads(re.search(r"const data = (\{.*?\})", page).group(1))  # type: ignore[union-attr]
    return {
        name: np.frombuffer(base64.b64decode(code), "<u2" if name == "steps" else np.uint8)
        for name, code in data.items()
    }


def test_points_keep_their_places_and_colours() -> None:
    """Oracle: places go back to metres up to half a step of the grid, and one scale for all axes."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(500, 3)) * (3, 1, 0.5) + (10, 0, 4)
    color = rng.integers(0, 256, (500, 3)).astype(np.uint8)
    cloud = dlama.PointCloud(points, color, np.ones(500, np.uint8), np.ones(500, np.float32))
    found = packed(point_viewer("p", cloud))
    places = found["steps"].reshape(-1, 3).astype(float)
    kept = [int(np.flatnonzero((color == c).all(1))[0]) for c in found["color"].reshape(-1, 3)]
    assert len(kept) == 490  # the nearest 98 % to the middle
    spread = np.ptp(points[kept], axis=0) / np.ptp(places, axis=0)
    assert np.allclose(spread, spread[0], rtol=1e-3)
    assert np.allclose(np.diff(places, axis=0) * spread[0], np.diff(points[kept], axis=0), atol=spread[0] * 1.01)


def test_points_are_seen_from_the_camera_and_a_sample_of_many_is_drawn() -> None:
    points = np.random.default_rng(0).normal(size=(MOST_POINTS + 7, 3))
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    count = len(points)
    cloud = dlama.PointCloud(
        points, np.zeros((count, 3), np.uint8), np.ones(count, np.uint8), np.ones(count, np.float32)
    )
    content = point_viewer("many", cloud)
    other = packed(point_viewer("many", cloud, turned))["steps"].reshape(-1, 3).astype(int)
    steps = packed(content)["steps"].reshape(-1, 3).astype(int)
    assert f"{MOST_POINTS} points of {len(points)} shown" in content
    assert len(steps) <= MOST_POINTS
    assert np.abs(steps[:, :2] + other[:, :2] - 65535).max() <= 1 and np.abs(steps[:, 2] - other[:, 2]).max() <= 1


def test_no_points_say_so() -> None:
    empty = point_viewer("cloud", concatenate([]))
    assert "no points" in empty and "iframe" not in empty


def test_show_opens_a_page_outside_notebooks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    opened: list[str] = []
    monkeypatch.setattr(show.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(show.webbrowser, "open", opened.append)
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    done = dlama.view(street(), yaw=5)
    done.show()
    page = next(tmp_path.iterdir())
    assert opened == [page.as_uri()]
    assert done._repr_html_() in page.read_text("utf-8") and "<iframe" in page.read_text("utf-8")
