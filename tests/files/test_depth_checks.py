"""Inverse depth, and sky at a far plane, are distinguished from depth (oracle: worlds of known depth, closed form 1 / z)."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from box_frame import CAMERA, WORLD, small_frame
from dlama.datasets.diagnosis import diagnose
from dlama.errors import DepthError, DlamaError
from dlama.files.rasters import depth_checks
from dlama.files.rasters.depth import read_depth, read_inverse_depth, write_depth_exr
from dlama.files.rgbd import read_rgbd
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import Float32Array
from dlama.perception.diagnosis.depth_code import looks_inverse
from dlama.worlds.dataset import world
from worlds import Plane, Sphere, World

STREET = World((Plane((0, 1.5, 0), (0, 1, 0)), Plane((0, 0, 9), (0, 0, 1)), Plane((-3, 0, 0), (1, 0, 0))))


def inverse_codes(depth: Float32Array) -> np.ndarray:
    """16-bit inverse depth: the nearest pixel is 60000, far and missing 0."""
    valid = (depth > 0) & (depth < np.inf)
    return np.where(valid, 60000 * depth[valid].min() / np.where(valid, depth, 1), 0).astype(np.uint16)


def test_a_file_is_looked_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A floor, a wall and a house: true depth without a word, and read again without another look, as frames are; its inverse,
    a changed file, gets one, and a word that says what is expected."""
    depth = STREET.rgbd(Camera.from_fov(256, 192, 80)).depth
    file, looks = tmp_path / "depth.png", list[bool]()
    monkeypatch.setattr(depth_checks, "looks_inverse", lambda values: looks.append(looks_inverse(values)) or looks[-1])
    cv2.imwrite(str(file), (depth * 1000).astype(np.uint16))
    read_depth(file), read_depth(file)
    assert looks == [False]
    cv2.imwrite(str(file), inverse_codes(depth))
    os.utime(file, ns=(1, 1))
    for _ in range(2):
        with pytest.warns(UserWarning, match=r"depth\.png: looks like inverse depth.*metric depth is expected"):
            read_depth(file)
    assert looks == [False, True, True]


@pytest.mark.filterwarnings("ignore:the scale of the estimated depth is assumed")
def test_depth_that_is_given_as_inverse_depth_is_named(tmp_path: Path) -> None:
    """Law: reading and `diagnose` name the option that is wrong, and neither asks for what is given; inverse depth of the same
    street goes without a word."""
    seen = STREET.rgbd(Camera.from_fov(256, 192, 80))
    files = tmp_path / "image.png", tmp_path / "depth.npy"
    Image.fromarray(seen.color).save(files[0])
    np.save(files[1], seen.depth)
    for units in (None, 1):
        with pytest.warns(UserWarning, match=r"depth\.npy: looks like depth, .*leave out `inverse_depth`"):
            read_rgbd(*files, fov=80, inverse_depth=True, depth_scale=units)
    found = diagnose(*files, fov=80, inverse_depth=True)[0]
    assert (found.check, found.mend) == ("inverse-depth", "leave out `inverse_depth`") and "holds depth" in found.what
    np.save(files[1], 1 / seen.depth)
    for units in (None, 1):
        read_rgbd(*files, fov=80, inverse_depth=True, depth_scale=units)


@pytest.mark.filterwarnings("ignore:.*looks like inverse depth")
def test_normalised_depth_is_warned_of(tmp_path: Path) -> None:
    """A ramp that a tool stretched to 0..65535 has lost its unit; with one, and unstretched, there is no word."""
    ramp = np.linspace(0, 1, 192 * 256).reshape(192, 256)
    cv2.imwrite(str(tmp_path / "depth.png"), np.uint16(1000 + 8000 * ramp))
    cv2.imwrite(str(tmp_path / "stretched.png"), np.uint16(65535 * ramp))
    with pytest.warns(UserWarning, match=r"values span 0\.\.65535 exactly.*`depth_scale`, or `inverse_depth`"):
        read_depth(tmp_path / "stretched.png")
    read_depth(tmp_path / "depth.png")
    read_depth(tmp_path / "stretched.png", depth_scale=7000)


def test_negative_inverse_depth_keeps_its_order(tmp_path: Path) -> None:
    """Closed form: the least of several negative numbers becomes 0; one alone is a code for what is far."""
    ramp = np.linspace(-0.5, 1.5, 60, dtype=np.float32).reshape(6, 10)
    np.save(tmp_path / "shifted.npy", ramp)
    with pytest.warns(UserWarning, match=r"25% of the values are negative; all are raised by 0\.5"):
        np.testing.assert_allclose(read_inverse_depth(tmp_path / "shifted.npy"), ramp + 0.5, atol=1e-6)
    np.save(tmp_path / "coded.npy", np.where(ramp < 0.5, -1, ramp))
    np.testing.assert_array_equal(read_inverse_depth(tmp_path / "coded.npy"), np.where(ramp < 0.5, 0, ramp))


def test_inverse_depth_in_whatever_a_tool_saves(tmp_path: Path) -> None:
    """One ramp as 16 bits, floats, 8 bits grey and in three channels alike: the same up to a factor (oracle: the ramp), in 8 bits
    to half a step. False colours, and numbers that are no depth, are refused."""
    ramp = np.tile(np.linspace(0.2, 1, 800), (40, 1))
    np.save(tmp_path / "floats.npy", np.where(np.arange(800) < 5, np.nan, ramp))
    cv2.imwrite(str(tmp_path / "fine.png"), np.uint16(np.round(65535 * ramp)))
    grey = np.uint8(np.round(255 * ramp))
    cv2.imwrite(str(tmp_path / "grey.png"), grey)
    cv2.imwrite(str(tmp_path / "three.png"), np.repeat(grey[..., None], 3, 2))
    floats = read_inverse_depth(tmp_path / "floats.npy")
    np.testing.assert_allclose(floats, np.where(np.arange(800) < 5, 0, ramp), rtol=1e-6)
    np.testing.assert_allclose(read_inverse_depth(tmp_path / "fine.png") / 65535, ramp, atol=1e-5)
    for name in ("grey", "three"):
        with pytest.warns(UserWarning, match="has 8 bits, 256 steps of inverse depth"):
            smooth = read_inverse_depth(tmp_path / f"{name}.png")
        assert abs(smooth - 255 * ramp).max() <= 1
        assert abs(smooth - 255 * ramp)[:, 10:-10].mean() < 0.5 * abs(grey - 255 * ramp)[:, 10:-10].mean()
    cv2.imwrite(str(tmp_path / "drawn.png"), cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO))
    with pytest.raises(DepthError, match=r"three channels that differ \(a picture of it in false colours"):
        read_inverse_depth(tmp_path / "drawn.png")
    np.save(tmp_path / "nothing.npy", np.full((4, 5), -1.0))
    with pytest.raises(DepthError, match="no pixel has an inverse depth above 0"):
        read_inverse_depth(tmp_path / "nothing.npy")


def test_millimetres_of_a_close_range_scanner_are_warned_of(tmp_path: Path) -> None:
    """A part on a table, 0.3 to 0.4 m away, in float millimetres; with its unit, in metres, and a landscape: no word."""
    table = Plane((0, 0, 350), (0.2, 0.3, -1))
    part = World((table, Sphere((20, 0, 330), 40))).rgbd(Camera.from_fov(64, 48, 60)).depth
    for name, depth in (("part", part), ("metres", part / 1000), ("landscape", np.geomspace(10, 400, part.size))):
        np.save(tmp_path / f"{name}.npy", depth.reshape(part.shape))
    with pytest.warns(UserWarning, match=r"part\.npy: nearly all of the depth is 2\d\d to 4\d\d m.*`depth_scale=1000`"):
        read_depth(tmp_path / "part.npy")
    assert read_depth(tmp_path / "part.npy", depth_scale=1000).max() == part.max() / 1000
    read_depth(tmp_path / "metres.npy")
    read_depth(tmp_path / "landscape.npy")
    Image.new("RGB", (64, 48)).save(tmp_path / "image.png")
    assert "1000 of a close-range scanner" in diagnose(tmp_path / "image.png", tmp_path / "part.npy", fov=60)[0].mend


def test_no_false_alarms_on_real_depth(data_dir: Path) -> None:
    """A Kinect's and a renderer's."""
    files = sorted((data_dir / "data").rglob("*depth*.png"))
    assert len(files) > 10
    for path in files[::4]:
        try:
            read_depth(path)
        except DlamaError as error:
            assert "depth_scale" in str(error) or "8-bit" in str(error)


@pytest.mark.parametrize(("kind", "unit"), [("room", 1), ("street", 100), ("street", 1000)])
def test_float_depth_in_another_unit_is_warned_of(tmp_path: Path, kind: str, unit: int) -> None:
    """Oracle: a world whose depth is known in metres, written in centimetres, as Maya and Unreal do, or millimetres; with the
    unit there is no word, nor for metres."""
    made = world(7, kind=kind)  # type: ignore[arg-type]
    frame = made.frame(made.camera(0, 192))
    Image.fromarray(frame.color).save(tmp_path / "plate.png")
    write_depth_exr(tmp_path / "Z.exr", frame.depth * np.float32(unit))
    read = partial(read_rgbd, tmp_path / "plate.png", tmp_path / "Z.exr", camera=frame.camera)
    for scale in (1, unit):
        read(depth_scale=scale)
    if unit == 100:
        words = "centimetres.*`depth_scale=100`.*; `depth_scale=1` says that they are metres"
        with pytest.warns(UserWarning, match=words):
            read()
    elif unit == 1000:  # the median is beyond 500 m
        with pytest.raises(DepthError, match="looks like millimetres"):
            read()
    else:
        read()


def test_a_lens_in_millimetres_is_no_unit_of_depth(tmp_path: Path) -> None:
    """Depth in metres with the focal length of a lens: the lens is warned of, its depth is not."""
    room = world(9, kind="room")
    frame = room.frame(Camera.from_fov(320, 180, 80, room.camera().world_from_cam))
    Image.fromarray(frame.color).save(tmp_path / "plate.png")
    write_depth_exr(tmp_path / "Z.exr", frame.depth)
    with pytest.warns(UserWarning, match="looks like a lens in millimetres") as reported:
        read_rgbd(tmp_path / "plate.png", tmp_path / "Z.exr", fx=6)
    words = [str(one.message) for one in reported]
    assert not any("`depth_scale=1` says" in one for one in words), words


@pytest.mark.parametrize("beyond", [False, True])
def test_rotated_bits_are_warned_of(tmp_path: Path, beyond: bool) -> None:
    """Oracle: SUN3D's own reader: millimetres are bitor(bitshift(d, -3), bitshift(d, 13)). Of the mends advised, the first is
    right where nothing is beyond 8.19 m, the second everywhere."""
    street = STREET.rgbd(Camera.from_fov(256, 192, 80))
    Image.fromarray(street.color).save(tmp_path / "image.png")
    millimetres = np.rint(1000 * street.depth * (1 if beyond else 0.5)).astype(np.uint16)
    millimetres[:, :9] = 0
    stored = (millimetres << 3) | (millimetres >> 13)
    Image.fromarray(stored).save(tmp_path / "sun.png")
    with pytest.warns(UserWarning, match=r"sun\.png: .*SUN RGB-D.*`depth_scale=8000`.*\(d >> 3\) \| \(d << 13\)"):
        read_depth(tmp_path / "sun.png")
    found = diagnose(tmp_path / "image.png", tmp_path / "sun.png", fov=80)
    assert [one.check for one in found if one.severity == "fault"] == ["rotated-depth"]
    scaled = read_depth(tmp_path / "sun.png", depth_scale=8000)
    assert beyond or np.array_equal(scaled, (millimetres / 1000).astype(np.float32))
    assert np.array_equal((stored >> 3) | (stored << 13), millimetres)


@pytest.mark.parametrize("far_plane", [100, 65504, 99999.9])
def test_sky_at_a_renderers_far_plane_is_warned_of(tmp_path: Path, far_plane: float) -> None:
    """Oracle: the option that is advised, taken literally, makes exactly the sky far. doctor says the same."""
    small_frame(tmp_path)
    depth = WORLD.rgbd(CAMERA).depth.copy()
    sky = np.zeros(depth.shape, bool)
    sky[:5] = True
    depth[sky] = far_plane
    write_depth_exr(tmp_path / "d.exr", depth)
    files = tmp_path / "image.png", tmp_path / "d.exr"
    with pytest.warns(UserWarning, match=r"d\.exr: 10\.4% of the depth is exactly .* `far=[\d.]+`$") as caught:
        assert not read_rgbd(*files, fov=60).far.any()
    advised = float(str(caught[0].message).rpartition("=")[2].strip("`"))
    assert np.array_equal(read_rgbd(*files, fov=60, far=advised).far, sky)
    assert [one.mend for one in diagnose(*files, fov=60) if one.check == "far-plane"] == [f"give `far={advised:.9g}`"]


@pytest.mark.parametrize("change", ["a wall at 90 m", "one pixel", "a hill behind", "far already", "ground"])
def test_what_is_no_far_plane_passes(tmp_path: Path, change: str) -> None:
    """pytest makes a warning an error. Ground 1.5 m below a level camera has one depth along each row, f * 1.5 / rows below the
    horizon: at the first row three times that of all else."""
    small_frame(tmp_path)
    depth = WORLD.rgbd(CAMERA).depth.copy()
    depth[:5] = {"a wall at 90 m": 90, "far already": np.inf}.get(change, 1000)
    if change == "a hill behind":
        depth[5, 0] = 501
    if change == "one pixel":
        depth[:5] = 4
        depth[0, :2] = 1000
    if change == "ground":
        below = np.arange(depth.shape[0]) + 0.5 - depth.shape[0] / 2
        depth[:] = np.where(below > 0, 1.5 * CAMERA.fy / np.maximum(below, 0.5), np.inf)[:, None]
        assert depth[np.isfinite(depth)].max() > 100
    write_depth_exr(tmp_path / "d.exr", depth)
    read_rgbd(tmp_path / "image.png", tmp_path / "d.exr", fov=60)


def test_missing_depth_with_the_code_of_the_sky_is_warned_of(tmp_path: Path) -> None:
    """Oracle: a wall 3 m away with patches of 65535, as files of 7-Scenes have them; a street 9 m deep with sky gets no word."""
    color = np.zeros((60, 80, 3), np.uint8)
    depth = np.full((60, 80), 3000, np.uint16)
    depth[20:30, 20:40] = 65535
    cv2.imwrite(str(tmp_path / "color.png"), color)
    for name, scale in (("room", 1), ("street", 3)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.where(depth < 65535, depth * scale, depth).astype(np.uint16))
    with pytest.warns(UserWarning, match=r"room\.png: 4\.2% of the depth is 65535.*ends at 3 m.*write 0 there"):
        read_rgbd(tmp_path / "color.png", tmp_path / "room.png", fov=60)
    read_rgbd(tmp_path / "color.png", tmp_path / "street.png", fov=60)
