"""Depth and disparity files: units, far and missing, there and back, against other libraries' files; bad and damaged ones."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import imageio.v3 as imageio
import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from dlama.errors import DepthError, FileError
from dlama.files.rasters.depth import (
    depth_from_mm,
    mm_from_depth,
    read_depth,
    read_disparity,
    read_pfm,
    write_depth_exr,
    write_depth_png,
    write_disparity_pfm,
    write_pfm,
)
from dlama.geometry.rgbd import check_depth

METRES = np.random.default_rng(3).uniform(0.4, 60, (21, 17)).astype(np.float32)
METRES[0, :3] = (0, np.inf, 1.5)


def exr(path: Path, kind: int | None = None, **channels: np.ndarray) -> Path:
    """An EXR written by the OpenEXR library alone."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION if kind is None else kind, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name.replace("__", "."): values for name, values in channels.items()}).write(str(path))
    return path


def tiff(path: Path, values: np.ndarray) -> Path:
    Image.fromarray(values).save(path)
    return path


def test_png_there_and_back(tmp_path: Path) -> None:
    """Oracle: half a millimetre, and the two codes; imageio sees the millimetres."""
    assert write_depth_png(tmp_path / "d.png", METRES) == 0
    back = read_depth(tmp_path / "d.png")
    finite = np.isfinite(METRES)
    assert np.array_equal(np.isposinf(back), ~finite) and back[0, 0] == 0
    assert np.abs(back[finite] - METRES[finite]).max() <= 0.0005 + 1e-5
    assert np.array_equal(imageio.imread(tmp_path / "d.png")[1:], np.rint(METRES[1:].astype(np.float64) * 1000))


@pytest.mark.filterwarnings("ignore:.*if these are millimetres")
@settings(max_examples=30, deadline=None)
@given(
    depth=hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=2, max_dims=2, max_side=9),
        elements=st.sampled_from([0, np.inf, 0.5, 3.25, 99]),
    )
)
def test_exr_and_npy_there_and_back_exactly(tmp_path_factory: pytest.TempPathFactory, depth: np.ndarray) -> None:
    depth[0, 0] = 2
    folder = tmp_path_factory.mktemp("d")
    write_depth_exr(folder / "d.exr", depth)
    np.save(folder / "d.npy", depth)
    assert np.array_equal(read_depth(folder / "d.exr"), depth)
    assert np.array_equal(read_depth(folder / "d.npy"), depth)
    with OpenEXR.File(str(folder / "d.exr"), separate_channels=True) as file:
        assert list(file.channels()) == ["Z"] and np.array_equal(file.channels()["Z"].pixels, depth)


@pytest.mark.parametrize(("scale", "name"), [(1000, "default"), (256, "KITTI")])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".npy"])
def test_depth_scale(tmp_path: Path, scale: float, name: str, suffix: str) -> None:
    """Oracle: metres = value / scale, written by OpenCV and numpy."""
    values = np.array([[0, scale, 2.5 * scale, 65535]], np.uint16)
    path = tmp_path / f"{name}{suffix}"
    np.save(path, values) if suffix == ".npy" else cv2.imwrite(str(path), values)
    assert read_depth(path, depth_scale=None if scale == 1000 else scale).tolist() == [[0, 1, 2.5, np.inf]]


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize("channel", ["Z", "R", "Y", "depth", "ViewLayer__Depth__Z", "V"])
def test_exr_channels(tmp_path: Path, dtype: type, channel: str) -> None:
    values = np.array([[1, 2.5, np.inf, np.nan]], dtype)
    assert read_depth(exr(tmp_path / "d.exr", **{channel: values})).tolist() == [[1, 2.5, np.inf, 0]]


def test_exr_channel_choice(tmp_path: Path) -> None:
    """Z before colour; R only where it is grey; a name chooses; what is unclear is asked."""
    one, two = np.full((2, 3), 1, np.float32), np.full((2, 3), 2, np.float32)
    both = exr(tmp_path / "zr.exr", R=one, G=two, B=one, Z=two)
    assert read_depth(both).max() == 2 and read_depth(both, channel="R").max() == 1
    grey = exr(tmp_path / "grey.exr", R=two, G=two, B=two, A=one)
    assert read_depth(grey).max() == 2
    for channels, words in (
        ({"R": one, "G": two, "B": one}, "colour picture"),
        ({"A__Z": one, "B__Z": two}, r"any of A\.Z, B\.Z"),
        ({"U": one, "V": two}, r"channels U, V.*channel"),
    ):
        with pytest.raises(FileError, match=words):
            read_depth(exr(tmp_path / "unclear.exr", **channels))
    with pytest.raises(FileError, match="no channel 'Q'; it has Z"):
        read_depth(exr(tmp_path / "z.exr", Z=one), channel="Q")


def test_exr_far(tmp_path: Path) -> None:
    """Blender's 1e10, half's largest number and EasySynth's 1.0 are far."""
    assert read_depth(exr(tmp_path / "b.exr", Z=np.array([[3, 1e10]], np.float32))).tolist() == [[3, np.inf]]
    assert read_depth(exr(tmp_path / "h.exr", Z=np.array([[3, 65504]], np.float16))).tolist() == [[3, np.inf]]
    easy = exr(tmp_path / "e.exr", R=np.array([[0, 0.25, 0.5, 1, 1]], np.float16))
    assert read_depth(easy, depth_range=10).tolist() == [[0, 2.5, 5, np.inf, np.inf]]
    with pytest.raises(DepthError, match=r"looks normalised.*depth_range"):
        read_depth(easy)
    assert read_depth(easy, depth_scale=1).tolist() == [[0, 0.25, 0.5, 1, 1]]


def test_far_limit(tmp_path: Path) -> None:
    path = tmp_path / "d.npy"
    np.save(path, np.array([[0, 3, 10, 12]], np.float32))
    assert read_depth(path, far=10).tolist() == [[0, 3, np.inf, np.inf]]
    with pytest.raises(DepthError, match="nearer than far, 2 m"):
        read_depth(path, far=2)


def test_npz_keys(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", depth=METRES, rgb=METRES[..., None])
    np.savez(tmp_path / "b.npz", anything=(np.nan_to_num(METRES[..., None], posinf=9) * 10).astype(np.uint16))
    np.savez(tmp_path / "c.npz", a=METRES, b=METRES)
    assert np.array_equal(read_depth(tmp_path / "a.npz"), METRES)
    assert read_depth(tmp_path / "b.npz", depth_scale=10)[0, 2] == 1.5
    with pytest.raises(FileError, match="holds a, b; an array called 'depth'"):
        read_depth(tmp_path / "c.npz")


@settings(max_examples=30, deadline=None)
@given(
    values=hnp.arrays(np.float32, hnp.array_shapes(min_dims=2, max_dims=2, max_side=8), elements=st.floats(width=32)),
    order=st.sampled_from("<>"),
)
def test_pfm_there_and_back(tmp_path_factory: pytest.TempPathFactory, values: np.ndarray, order: str) -> None:
    """Oracles: the round trip, a file made by hand from the format's text in both byte orders."""
    path = tmp_path_factory.mktemp("p") / "d.pfm"
    write_pfm(path, values)
    assert np.array_equal(read_pfm(path), values, equal_nan=True)
    by_hand = f"Pf\n{values.shape[1]} {values.shape[0]}\n{'-' if order == '<' else ''}1.0\n".encode()
    path.write_bytes(by_hand + np.flipud(values).astype(f"{order}f4").tobytes())
    assert np.array_equal(read_pfm(path), values, equal_nan=True)


def test_pfm_against_opencv(tmp_path: Path) -> None:
    """Oracle: OpenCV's PFM codec in both directions."""
    write_pfm(tmp_path / "ours.pfm", METRES)
    assert np.array_equal(cv2.imread(str(tmp_path / "ours.pfm"), cv2.IMREAD_UNCHANGED), METRES)
    cv2.imwrite(str(tmp_path / "theirs.pfm"), METRES)
    assert np.array_equal(read_depth(tmp_path / "theirs.pfm"), METRES)


def test_float_tiff(tmp_path: Path) -> None:
    imageio.imwrite(tmp_path / "d.tiff", METRES)
    assert np.array_equal(read_depth(tmp_path / "d.tiff"), METRES)
    assert np.allclose(read_depth(tiff(tmp_path / "mm.tif", METRES * 1000), depth_scale=1000), METRES)


@pytest.mark.parametrize("scale", [None, 1000.0])
def test_what_is_too_close_is_missing(tmp_path: Path, scale: float | None) -> None:
    """Oracle: REP 118 and the ZED SDK: -infinity is too close, +infinity too far, NaN not known."""
    np.save(tmp_path / "zed.npy", np.array([[2, -np.inf, np.nan, np.inf]], np.float32) * (scale or 1))
    assert read_depth(tmp_path / "zed.npy", depth_scale=scale).tolist() == [[2, 0, 0, np.inf]]
    assert check_depth(np.array([[2, -np.inf, np.nan, np.inf]]), (1, 4)).tolist() == [[2, 0, 0, np.inf]]
    np.save(tmp_path / "disparity.npy", np.array([[2, -np.inf, np.nan, np.inf]], np.float32))
    assert read_disparity(tmp_path / "disparity.npy").tolist() == [[2, 0, 0, 0]]


def test_disparity_there_and_back(tmp_path: Path) -> None:
    disparity = np.array([[0, 1.25, 63.5], [np.nan, 7, np.inf]], np.float32)
    write_disparity_pfm(tmp_path / "d.pfm", disparity)
    assert np.array_equal(np.isinf(cv2.imread(str(tmp_path / "d.pfm"), -1)), [[1, 0, 0], [1, 0, 1]])
    assert read_disparity(tmp_path / "d.pfm").tolist() == [[0, 1.25, 63.5], [0, 7, 0]]


def test_disparity_of_other_kinds(tmp_path: Path) -> None:
    """Oracle: KITTI's value / 256, Middlebury 2003's / 4, OpenCV's / 16; the rig knows what a negative one is."""
    cv2.imwrite(str(tmp_path / "kitti.png"), np.array([[0, 256, 640]], np.uint16))
    cv2.imwrite(str(tmp_path / "cones.png"), np.array([[0, 4, 10]], np.uint8))
    np.savez(tmp_path / "d.npz", disparity=np.array([[np.inf, 1, 2.5]], np.float32), other=np.zeros(1))
    assert read_disparity(tmp_path / "kitti.png").tolist() == [[0, 1, 2.5]]
    assert read_disparity(tmp_path / "cones.png", scale=4).tolist() == [[0, 1, 2.5]]
    assert read_disparity(tmp_path / "d.npz").tolist() == [[0, 1, 2.5]]
    with pytest.raises(DepthError, match=r"8-bit numbers.*disparity_scale"):
        read_disparity(tmp_path / "cones.png")
    np.save(tmp_path / "f.npy", np.array([[-1.0, 2]]))
    assert read_disparity(tmp_path / "f.npy").tolist() == [[-1, 2]]
    np.save(tmp_path / "n.npy", np.array([[-16, 32]], np.int16))
    np.save(tmp_path / "z.npy", np.array([[np.inf, 0]]))
    assert read_disparity(tmp_path / "n.npy", scale=16).tolist() == [[-1, 2]]
    with pytest.raises(DepthError, match=r"holds int16; .*disparity_scale, OpenCV's matchers: 16"):
        read_disparity(tmp_path / "n.npy")
    with pytest.raises(DepthError, match="every disparity is missing"):
        read_disparity(tmp_path / "z.npy")


def flat(value: float, kind: type = np.float32) -> np.ndarray:
    return np.full((3, 4), value, kind)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (flat(0), r"no pixel has a depth \(12 of 12 missing, 0 far"),
        (flat(np.inf), r"no pixel has a depth \(0 of 12 missing, 12 far"),
        (flat(5e9), r"every depth lies beyond 1e\+06 m with depth_scale=1 \(the nearest at 5e\+09 m\); is it"),
        (np.array([[1, -2, -0.5]], np.float32), r"2 of 3 depth values are negative \(smallest -2\)"),
        (flat(-np.inf), r"no pixel has a depth \(12 of 12 missing, 0 far"),
        (np.array([[5, -2]], np.int16), "negative"),
        (flat(1520), "1520 m.*millimetres read as metres: depth_scale=1000, or centimetres: depth_scale=100"),
        (flat(9e4), r"millimetres read as metres: depth_scale=1000; if these are metres: depth_scale=1$"),
        (np.array([[-1, -2, 0]], np.float32), "2 of 3 depth values are negative.*camera looks along -z, save -z"),
        (flat(3, np.uint16), "0.003 m.*metres read as millimetres: depth_scale=1$"),
        (flat(0.002), "depth_scale=0.001"),
        (flat(200, np.uint8), "8-bit numbers, too coarse"),
    ],
)
def test_bad_depth_is_refused(tmp_path: Path, values: np.ndarray, words: str) -> None:
    np.save(tmp_path / "d.npy", values)
    with pytest.raises(DepthError, match=words) as caught:
        read_depth(tmp_path / "d.npy")
    assert str(caught.value).startswith(str(tmp_path / "d.npy")) and "\n" not in str(caught.value)


@pytest.mark.parametrize("metres", [1520, 0.02])
def test_metres_that_are_stated_are_not_doubted(tmp_path: Path, metres: float) -> None:
    """Law: aerial and microscopic depth is read by `depth_scale=1`, which the refusal says."""
    np.save(tmp_path / "d.npy", flat(metres))
    with pytest.raises(DepthError, match=r"if these are metres: depth_scale=1$"):
        read_depth(tmp_path / "d.npy")
    assert (read_depth(tmp_path / "d.npy", depth_scale=1) == np.float32(metres)).all()


@pytest.mark.parametrize("scale", [1000.0, 5000.0])
def test_the_advised_scale_is_right(tmp_path: Path, scale: float) -> None:
    """Oracle: following the advice gives the depth that was meant."""
    np.save(tmp_path / "d.npy", np.full((2, 2), 20_000_000, np.int32))
    with pytest.raises(DepthError) as caught:
        read_depth(tmp_path / "d.npy", depth_scale=scale)
    for advised, units in zip(re.findall(r"depth_scale=([\d.e+]+)", str(caught.value)), (1000, 100), strict=True):
        found = read_depth(tmp_path / "d.npy", depth_scale=float(advised))[0, 0]
        assert found == pytest.approx(2e7 / scale / units)


def test_pictures_given_as_depth(tmp_path: Path) -> None:
    color = np.random.default_rng(0).integers(0, 256, (5, 6, 3)).astype(np.uint8)
    Image.fromarray(color).save(tmp_path / "c.png")
    Image.fromarray(color[..., 0]).save(tmp_path / "g.png")
    cv2.imwrite(str(tmp_path / "c16.png"), color.astype(np.uint16) * 9)
    cv2.imwrite(str(tmp_path / "g16.png"), np.repeat(color[..., :1].astype(np.uint16) * 9, 3, axis=2))
    for name, words in (
        ("c", r"8-bit colour picture.*wrong order"),
        ("g", "8-bit numbers, too coarse"),
        ("c16", "three channels that differ"),
    ):
        with pytest.raises(DepthError, match=words):
            read_depth(tmp_path / f"{name}.png")
    assert np.allclose(read_depth(tmp_path / "g16.png"), color[..., 0] * 0.009)


def test_contradictions_and_wrong_options(tmp_path: Path) -> None:
    np.save(tmp_path / "d.npy", METRES)
    np.save(tmp_path / "i.npy", np.full((2, 2), 2000, np.uint16))
    for options, words in (
        ({"depth_scale": 1.0, "depth_range": 1.0}, "contradict"),
        ({"depth_scale": 0.0}, "depth_scale is 0"),
        ({"depth_range": -3.0}, "depth_range is -3"),
        ({"far": float("nan")}, "far is nan"),
        ({"depth_scale": "1000"}, "depth_scale is '1000'; a number > 0"),
    ):
        with pytest.raises(DepthError, match=words):
            read_depth(tmp_path / "d.npy", **options)
    with pytest.raises(DepthError, match="whole numbers"):
        read_depth(tmp_path / "i.npy", depth_range=10)
    with pytest.raises(FileError, match="channel is for EXR"):
        read_depth(tmp_path / "d.npy", channel="Z")


def test_sixteen_bit_codes_there_and_back() -> None:
    """Closed form: 0 is missing, 65535 far, valid depth 1..65534; what is too deep is counted. All codes survive the way."""
    depth = np.array([[0, np.nan, np.inf, 1e-5, 1.2344, 65.534, 65.6, 900]], np.float32)
    codes, clipped = mm_from_depth(depth)
    assert codes.dtype == np.uint16 and codes.tolist() == [[0, 0, 65535, 1, 1234, 65534, 65534, 65534]]
    assert clipped == 2
    every = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    again, none = mm_from_depth(depth_from_mm(every))
    np.testing.assert_array_equal(again, every)
    assert none == 0 and depth_from_mm(every[-1:, -1:]) == np.inf
    wide = np.array([[65535, 65536]], np.int32)  # 65535 is the code where nothing is larger, as of 16 bits saved in 32
    assert depth_from_mm(wide[:, :1], 5000) == np.inf
    assert depth_from_mm(wide, 5000).tolist() == [[np.float32(65535 / 5000), np.float32(65536 / 5000)]]


@pytest.mark.parametrize("name", ["d.png", "d.exr", "piz.exr", "raw.exr", "d.pfm", "d.npy", "d.npz", "d.tif", "f.tif"])
def test_truncated_depth_raises_or_is_whole(tmp_path: Path, name: str) -> None:
    """Oracle: the whole file."""
    path, depth = tmp_path / name, np.random.default_rng(0).uniform(1, 9, (70, 50)).astype(np.float32)
    writers = {
        "d.png": lambda: write_depth_png(path, depth),
        "d.exr": lambda: write_depth_exr(path, depth),
        "piz.exr": lambda: exr(path, OpenEXR.PIZ_COMPRESSION, Z=depth),
        "raw.exr": lambda: exr(path, OpenEXR.NO_COMPRESSION, R=depth, G=depth, B=depth),
        "d.pfm": lambda: write_pfm(path, depth),
        "d.npy": lambda: np.save(path, depth),
        "d.npz": lambda: np.savez_compressed(path, depth=depth),
        "d.tif": lambda: tiff(path, (depth * 1000).astype(np.uint16)),
        "f.tif": lambda: tiff(path, depth),
    }
    writers[name]()
    data, whole = path.read_bytes(), read_depth(path)
    for kept in [*np.linspace(1, len(data) - 40, 15).astype(int), *range(len(data) - 20, len(data), 4)]:
        path.write_bytes(data[:kept])
        try:
            assert np.array_equal(read_depth(path), whole), f"{name} cut to {kept} of {len(data)} bytes"
        except FileError as error:
            assert str(path) in str(error) and "\n" not in str(error)
            continue
        assert kept > len(data) - 40
