"""Picture and depth together: sizes must agree, or depth is brought to the picture's size on request."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlama.errors import CameraError, InputError, ShapeError
from dlama.files.cameras import write_camera
from dlama.files.rasters.depth import read_depth, write_depth_png
from dlama.files.rasters.exr_files import write_exr
from dlama.files.rasters.pictures import write_color
from dlama.files.rgbd import read_rgbd
from dlama.geometry.camera import Camera
from dlama.perception.depth_networks import DepthPrediction
from dlama.perception.depth_scale import describe_depth_source
from dlama.perception.monocular import estimate_depth
from dlama.perception.resampling import upsample_depth

COLOR = np.random.default_rng(0).integers(0, 256, (6, 8, 3)).astype(np.uint8)


def pair(folder: Path, depth: np.ndarray) -> tuple[Path, Path]:
    write_color(folder / "c.png", COLOR)
    write_depth_png(folder / "d.png", depth.astype(np.float32))
    return folder / "c.png", folder / "d.png"


@pytest.mark.parametrize(
    "options", [{}, {"depth_scale": 500.0}, {"depth_scale": 500.0, "far": 8.5}, {"channel": "back"}]
)
def test_options_of_the_depth_file(tmp_path: Path, options: dict[str, Any]) -> None:
    """Oracle: the depth that `read_depth` gives with the same options."""
    color, depth = pair(tmp_path, np.linspace(2, 6, 48).reshape(6, 8))
    if "channel" in options:
        metres = read_depth(depth)
        depth = tmp_path / "both.exr"
        write_exr(depth, {"Z": metres, "back": metres + 1})
    rgbd = read_rgbd(color, depth, fov=90, **options)
    np.testing.assert_array_equal(rgbd.depth, read_depth(depth, **options))
    assert np.array_equal(rgbd.color, COLOR) and rgbd.camera.fx == pytest.approx(4)


def test_a_camera_itself_or_its_file(tmp_path: Path) -> None:
    """Law: a camera and the file it was written to give the same; one of another size, or a second source, is refused."""
    paths, camera = pair(tmp_path, np.full((6, 8), 2.0)), Camera(8, 6, 5.0, 6.0, 4.0, 2.5)
    write_camera(tmp_path / "camera.json", camera)
    assert read_rgbd(*paths, camera=camera).camera is camera
    assert read_rgbd(*paths, camera=tmp_path / "camera.json").camera.same_view_as(camera)
    with pytest.raises(ShapeError, match="camera is 4x3 and the picture 8x6"):
        read_rgbd(*paths, camera=camera.resized(4, 3))
    with pytest.raises(CameraError, match="contradict"):
        read_rgbd(*paths, camera=camera, fov=90)


def test_depth_that_was_enlarged_before(tmp_path: Path) -> None:
    """Law: a map enlarged by the nearest pixel is named, and guided as if it had come small; others are as they came."""
    small = (1 / (0.1 + np.arange(48)[:, None] / 100 + np.arange(64) / 500)).astype(np.float32)
    large = np.kron(small, np.ones((4, 4), np.float32))
    image, *maps = (tmp_path / name for name in ("c.png", "small.npy", "large.npy"))
    write_color(image, np.zeros((192, 256, 3), np.uint8))
    np.save(maps[0], small)
    np.save(maps[1], large)
    with pytest.warns(UserWarning, match="a map of 64x48 pixels that was enlarged .*`resize_depth=guided`"):
        np.testing.assert_array_equal(read_rgbd(image, maps[1], fov=60).depth, large)
    expected = upsample_depth(small, np.zeros((192, 256, 3), np.uint8))
    for each in maps:
        np.testing.assert_array_equal(read_rgbd(image, each, fov=60, resize_depth="guided").depth, expected)


def test_other_sizes(tmp_path: Path) -> None:
    """Oracle: every depth pixel of a half-size map covers 2 x 2 pixels; of 3 x 3 finer ones the middle one is nearest."""
    depth = np.arange(1, 13).reshape(3, 4)
    paths = pair(tmp_path, depth)
    with pytest.raises(ShapeError, match=r"d\.png is 4x3 and .*c\.png 8x6.*resize_depth=guided"):
        read_rgbd(*paths, fov=60)
    resized = read_rgbd(*paths, fov=60, resize_depth="nearest")
    assert np.array_equal(resized.depth, np.kron(depth, np.ones((2, 2))))
    finer = np.arange(1, 18 * 24 + 1).reshape(18, 24) / 100
    third = read_rgbd(*pair(tmp_path, finer), fov=60, resize_depth="nearest")
    np.testing.assert_allclose(third.depth, finer[1::3, 1::3], rtol=1e-6)
    paths = pair(tmp_path, depth)
    with pytest.raises(ShapeError, match="'linear'; 'guided' or 'nearest' is expected"):
        read_rgbd(*paths, fov=60, resize_depth="linear")  # type: ignore[arg-type]
    for how in ("nearest", None):  # an option that would be refused is not advised
        with pytest.raises(ShapeError, match=r"d\.png is 4x4 and .*crop one of them to what both show$"):
            read_rgbd(*pair(tmp_path, np.ones((4, 4))), fov=60, resize_depth=how)
    with pytest.raises(ShapeError, match=r"d\.png is 3x4 and .*turned by 90 degrees, turn it back$"):
        read_rgbd(*pair(tmp_path, depth.T), fov=60, resize_depth="guided")


def test_depth_along_the_ray(tmp_path: Path) -> None:
    """Closed form: of points at a constant distance depth is the cosine to the axis; missing and far stay."""
    distance = np.full(COLOR.shape[:2], 2.0, np.float32)
    distance[0, :2] = 0, np.inf
    image, depth = pair(tmp_path, distance)[0], tmp_path / "d.npy"
    np.save(depth, distance)
    rgbd = read_rgbd(image, depth, fov=90, radial_depth=True)
    v, u = np.indices(distance.shape)
    camera = rgbd.camera
    away = np.hypot((u + 0.5 - camera.cx) / camera.fx, (v + 0.5 - camera.cy) / camera.fy)
    np.testing.assert_allclose(rgbd.depth[rgbd.valid], (2 * np.cos(np.arctan(away)))[rgbd.valid], rtol=1e-6)
    assert rgbd.depth[0, 0] == 0 and rgbd.depth[0, 1] == np.inf
    with pytest.raises(InputError, match="radial_depth is given without a depth file"):
        read_rgbd(image, fov=90, radial_depth=True)


NETWORK_GAVE = (0.9 - 0.1 * np.arange(6)[:, None] + 0.02 * np.arange(8)).astype(np.float32)
"""Relative inverse depth of COLOR."""


@pytest.fixture
def inverse(tmp_path: Path) -> tuple[Path, Path]:
    """A picture, and a network's inverse depth of it."""
    write_color(tmp_path / "c.png", COLOR)
    np.save(tmp_path / "inverse.npy", NETWORK_GAVE)
    return tmp_path / "c.png", tmp_path / "inverse.npy"


@pytest.mark.filterwarnings("ignore:the (field of view|scale of the estimated depth) is assumed")
def test_inverse_depth_that_a_network_gave(inverse: tuple[Path, Path]) -> None:
    """Oracle: `estimate_depth` with a network that gives the numbers of the file."""
    words = "scale .* is assumed .*: give `metres_at` or `camera_height`$"  # no depth_model
    with pytest.warns(UserWarning, match=words):
        rgbd = read_rgbd(*inverse, inverse_depth=True)
    same = estimate_depth(COLOR, depth_model=lambda _: DepthPrediction(NETWORK_GAVE, "inverse depth", False))
    np.testing.assert_array_equal(rgbd.depth, same.depth)
    about = rgbd.estimate or {}
    assert about["file"] == "inverse.npy" and about["scale"]["rule"] == "assumed" and about["size"] == [8, 6]
    assert describe_depth_source(about) == "of inverse.npy, as a network gave it"


def test_known_depths_give_inverse_depth_its_metres(inverse: tuple[Path, Path]) -> None:
    """Closed form: 1 / z = factor * value + shift through three known pixels, and so everywhere."""
    truth = 1 / (0.5 * NETWORK_GAVE.astype(np.float64) + 0.1)
    known = [(x, y, float(truth[y, x])) for x, y in ((2, 2), (5, 3), (4, 2))]
    rgbd = read_rgbd(*inverse, fov=60, inverse_depth=True, metres_at=known, sharpen=False)
    np.testing.assert_allclose(rgbd.depth, truth, rtol=2e-5)


def test_inverse_depth_of_a_renderer_is_measured(tmp_path: Path) -> None:
    """Closed form: Nuke's 1 / z, 0 where nothing is; with its units a metre it is depth, and no estimate. NaN is missing."""
    depth = (2 + np.arange(48).reshape(6, 8) / 7).astype(np.float32)
    inverse = 1 / (100 * depth)
    inverse[0, :2] = 0, np.nan
    write_color(tmp_path / "c.png", COLOR)
    write_exr(tmp_path / "nuke.exr", {"depth.Z": inverse})
    rgbd = read_rgbd(tmp_path / "c.png", tmp_path / "nuke.exr", fov=60, inverse_depth=True, depth_scale=100)
    assert rgbd.estimate is None and rgbd.far[0, 0] and rgbd.missing[0, 1]
    np.testing.assert_allclose(rgbd.depth.ravel()[2:], depth.ravel()[2:], rtol=1e-6)


def test_what_contradicts_inverse_depth(inverse: tuple[Path, Path]) -> None:
    """Oracle: what the options mean; a map that shows something else has other proportions."""
    image, file = inverse
    for name, value in {"depth_range": 9.0, "resize_depth": "nearest", "depth_model": "x"}.items():
        with pytest.raises(InputError, match=f"{name} and inverse_depth contradict each other"):
            read_rgbd(image, file, fov=60, inverse_depth=True, **{name: value})  # type: ignore[arg-type]
    with pytest.raises(InputError, match="inverse_depth is given without a depth file"):
        read_rgbd(image, fov=60, inverse_depth=True)
    np.save(file, NETWORK_GAVE[:, :3])
    with pytest.raises(ShapeError, match=r"is 3x6 and .*c\.png 8x6; they cannot show the same"):
        read_rgbd(image, file, fov=60, inverse_depth=True)
