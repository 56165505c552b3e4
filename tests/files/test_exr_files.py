"""EXR files of renderers and compositors, written by the OpenEXR library alone: windows, parts, deep pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from box_frame import pixels, small_frame
from dlama.errors import DepthError, FileError
from dlama.files.rasters.depth import read_depth
from dlama.files.rgbd import read_rgbd

WHOLE = 1 + np.arange(9 * 12, dtype=np.float32).reshape(9, 12) / 16
"""Depth of a picture of 12 x 9 px, another number in each."""


def window(left: int, top: int, right: int, bottom: int) -> tuple[np.ndarray, np.ndarray]:
    """Of an EXR; its corners belong to it."""
    return np.array([left, top], np.int32), np.array([right, bottom], np.int32)


def part(
    data: tuple[int, ...], display: tuple[int, ...], channels: dict[str, np.ndarray], name: str = "", **more: object
):
    """A part of an EXR; data and display: the corners of its windows."""
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **more}
    header |= {"dataWindow": window(*data), "displayWindow": window(*display)}
    return OpenEXR.Part(header, channels, name)


def write(path: Path, *parts: OpenEXR.Part) -> Path:
    OpenEXR.File(list(parts)).write(str(path))
    return path


@pytest.mark.parametrize("offset", [(0, 0), (100, 40), (-7, -3)])
@pytest.mark.parametrize("compression", ["ZIP_COMPRESSION", "NO_COMPRESSION"])
def test_a_cropped_render_lies_where_it_was_rendered(tmp_path: Path, offset: tuple[int, int], compression: str) -> None:
    """Oracle: a slice of the whole picture; all that was not rendered is missing, and a warning says how much was."""
    x, y = offset
    data, display, how = (x + 3, y + 2, x + 10, y + 6), (x, y, x + 11, y + 8), getattr(OpenEXR, compression)
    render = part(data, display, {"Z": WHOLE[2:7, 3:11].copy()}, compression=how)
    expected = np.zeros_like(WHOLE)
    expected[2:7, 3:11] = WHOLE[2:7, 3:11]
    with pytest.warns(UserWarning, match=r"d\.exr: was rendered in 37% of its display window .* counts as missing"):
        assert np.array_equal(read_depth(write(tmp_path / "d.exr", render)), expected)


def test_overscan_is_cut_off_without_a_word(tmp_path: Path) -> None:
    """Oracle: a slice of the whole picture, of the part with the depth; pytest makes a warning an error."""
    render = part((-2, -1, 9, 7), (0, 0, 7, 5), {"depth.Z": WHOLE}, "depth")
    colour = part((0, 0, 7, 5), (0, 0, 7, 5), dict.fromkeys("RGB", WHOLE[:6, :8].astype(np.float16)), "rgba")
    assert np.array_equal(read_depth(write(tmp_path / "d.exr", colour, render)), WHOLE[1:7, 2:10])


def test_overscan_on_one_side_and_a_crop_on_the_other(tmp_path: Path) -> None:
    """Oracle: slices of the whole picture; half floats, whose largest number is far, also here."""
    half = WHOLE.astype(np.float16)
    half[8, 11] = 65504
    expected = np.zeros((9, 12), np.float32)
    expected[:7, :10] = half[2:, 2:]
    expected[6, 9] = np.inf
    with pytest.warns(UserWarning, match="rendered in 65%"):
        found = read_depth(write(tmp_path / "d.exr", part((-2, -2, 9, 6), (0, 0, 11, 8), {"Z": half})))
    assert np.array_equal(found, expected)


def test_nothing_shown_and_too_large_a_display_are_refused(tmp_path: Path) -> None:
    apart = write(tmp_path / "apart.exr", part((20, 0, 31, 8), (0, 0, 11, 8), {"Z": WHOLE}))
    with pytest.raises(FileError, match=r"apart\.exr: its data window lies outside .*data 20,0 to 31,8, display 0,0"):
        read_depth(apart)
    large = write(tmp_path / "large.exr", part((0, 0, 11, 8), (0, 0, 99_999, 99_999), {"Z": WHOLE}))
    with pytest.raises(FileError, match=r"large\.exr: says it holds 100000x100000 pixels"):
        read_depth(large)


def test_parts_with_the_same_channel_are_asked_for(tmp_path: Path) -> None:
    """Two eyes in one file: the first part's depth was taken without a word."""
    whole = (0, 0, 11, 8)
    eyes = [part(whole, whole, {"Z": WHOLE + n, "A": WHOLE}, eye) for n, eye in enumerate(("left", "right"))]
    path = write(tmp_path / "eyes.exr", *eyes)
    with pytest.raises(FileError, match=r"depth may be any of left\.Z, right\.Z; choose one with channel"):
        read_depth(path)
    for n, eye in enumerate(("left", "right")):
        assert np.array_equal(read_depth(path, channel=f"{eye}.Z"), WHOLE + n)


def test_a_deep_file_is_named(tmp_path: Path) -> None:
    deep = np.empty((2, 3), object)
    deep[:] = [[np.array([1, 2], np.float32)] * 3] * 2
    header = {"type": OpenEXR.deepscanline, "compression": OpenEXR.ZIPS_COMPRESSION}
    OpenEXR.File(header, {"Z": deep}).write(str(tmp_path / "deep.exr"))
    with pytest.raises(FileError, match=r"deep\.exr: is a deep EXR"):
        read_depth(tmp_path / "deep.exr")


def test_a_cropped_depth_goes_with_a_whole_picture(tmp_path: Path) -> None:
    """Oracle: the frame's depth in millimetres; a file without any depth in its window still says so."""
    whole = pixels(small_frame(tmp_path) / "depth.png").astype(np.float32) / 1000
    height, width = whole.shape
    right, bottom = width - 1, height - 1
    write(tmp_path / "d.exr", part((0, 8, right, bottom), (0, 0, right, bottom), {"Z": whole[8:].copy()}))
    with pytest.warns(UserWarning, match="83%"):
        rgbd = read_rgbd(tmp_path / "image.png", tmp_path / "d.exr", fov=60)
    assert rgbd.missing[:8].all() and np.array_equal(rgbd.depth[8:], whole[8:])
    empty = write(tmp_path / "empty.exr", part((2, 2, 3, 3), (0, 0, 11, 8), {"Z": np.zeros((2, 2), np.float32)}))
    with pytest.warns(UserWarning, match="4%"), pytest.raises(DepthError, match="no pixel has a depth"):
        read_depth(empty)


def test_lossy_colours_are_no_depth_and_a_lossy_z_is_exact(tmp_path: Path) -> None:
    """Oracle: OpenEXR, whose DWA codes R, G and B with loss (missing depth becomes +-1e-5) and Z without; half floats."""
    missing = np.random.default_rng(0).random((64, 96)) < 0.1
    depth = np.where(missing, 0, 1 / np.linspace(0.5, 0.025, 96)).astype(np.float16)
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.DWAA_COMPRESSION}
    OpenEXR.File(header, {"Z": depth}).write(str(tmp_path / "z.exr"))
    assert np.array_equal(read_depth(tmp_path / "z.exr"), depth)
    OpenEXR.File(header, dict.fromkeys("RGB", depth)).write(str(tmp_path / "rgb.exr"))
    with pytest.raises(DepthError, match=r"negative .*lossy compression does that .*save it as ZIP"):
        read_depth(tmp_path / "rgb.exr")


def test_depth_is_found_among_the_passes_of_a_renderer(tmp_path: Path) -> None:
    """Oracle: the number that each channel is filled with. Normals and positions have a Z that is no depth."""

    def saved(*names: str) -> Path:
        planes = {name: np.full((2, 3), 1 + number, np.float32) for number, name in enumerate(names)}
        header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
        OpenEXR.File(header, planes).write(str(tmp_path / "passes.exr"))
        return tmp_path / "passes.exr"

    normals, places = ("View.Normal.X", "View.Normal.Y", "View.Normal.Z"), ("P.X", "P.Y", "P.Z")
    path = saved(*normals, "View.Depth.Z", *places, "View.Mist.Z")
    assert (read_depth(path) == 4).all() and (read_depth(path, channel="View.Mist.Z") == 8).all()
    assert (read_depth(saved("R", "G", "View.Mist.Z", *normals)) == 3).all()
    for names in ((*normals, "A"), ("X", "Y", "Z")):
        with pytest.raises(FileError, match="none of which is plainly depth; choose one with channel"):
            read_depth(saved(*names))
    assert (read_depth(saved("X", "Y", "Z"), channel="Z") == 3).all()


def test_anamorphic_pixels_are_warned_of(tmp_path: Path) -> None:
    """Oracle: the header's pixelAspectRatio; the file itself is read as it is."""
    squeezed = part((0, 0, 11, 8), (0, 0, 11, 8), {"Z": WHOLE}, pixelAspectRatio=2.0)
    with pytest.warns(UserWarning, match=r"d\.exr: its pixels are 2 times as wide as high .*, fx = fy / 2,"):
        assert np.array_equal(read_depth(write(tmp_path / "d.exr", squeezed)), WHOLE)


def test_a_part_that_cannot_be_decoded_is_damage(tmp_path: Path) -> None:
    """The library drops it with a remark: grey colours of the other part were taken for the depth, or no channel was left."""
    noise = np.random.default_rng(0).integers(1, 50, (64, 96)).astype(np.float32)
    whole = (0, 0, 95, 63)
    colour, depth = part(whole, whole, dict.fromkeys("RGB", noise), "rgba"), part(whole, whole, {"Z": noise}, "depth")
    for name, parts in (("two.exr", [colour, depth]), ("one.exr", [depth])):
        path = write(tmp_path / name, *parts)
        data = bytearray(path.read_bytes())
        data[-400:-300] = bytes(100)
        path.write_bytes(data)
        with pytest.raises(FileError, match=rf"{name}: is damaged"):
            read_depth(path)
