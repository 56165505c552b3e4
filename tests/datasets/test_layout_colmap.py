"""COLMAP folders: text and binary models, depth as PNG and of dense workspaces (oracles: the closed-form world, round trips)."""

from __future__ import annotations

import json
import re
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dlama.datasets.layouts import detect
from dlama.datasets.posed.colmap import read_model, write_model
from dlama.datasets.sequences.loading import open_frames
from dlama.errors import CameraError, FileError, InputError
from dlama.files.rasters.depth import write_depth_png
from dlama.files.rasters.pictures import write_color
from dlama.geometry.camera import Camera
from dlama.geometry.cloud import PointCloud
from dlama.geometry.projection import lift
from worlds import Plane, World, moved

LENS = Camera(48, 36, 40.0, 41.0, 24.5, 17.5)
WORLD = World((Plane((0, 0, 3), (0.2, 0.1, -1)),))
CAMERAS = {f"shot_{n}.png": moved(LENS, (3 * n, -7 * n, 2 * n), (0.2 * n, 0.1, 0)) for n in range(3)}
NO_POINTS = PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0, np.uint8), np.zeros(0, np.float32))


def folder_of(root: Path, binary: bool, dense: bool) -> Path:
    """The three frames as COLMAP has them."""
    for each in ("images", "depth", "sparse/0", "stereo/depth_maps"):
        (root / each).mkdir(parents=True)
    for name, camera in CAMERAS.items():
        rgbd = WORLD.rgbd(camera)
        write_color(root / "images" / name, rgbd.color)
        if dense:
            data = f"{LENS.width}&{LENS.height}&1&".encode() + rgbd.depth.astype("<f4").tobytes()
            (root / "stereo" / "depth_maps" / f"{name}.geometric.bin").write_bytes(data)
        else:
            write_depth_png(root / "depth" / name, rgbd.depth)
    write_model(root / "sparse" / "0", CAMERAS, NO_POINTS)
    if binary:
        images, name = root / "sparse/0/images.bin", b".png\0"
        two_points = struct.pack("<Qddqddq", 2, 1, 2, -1, 1, 2, -1)
        images.write_bytes(images.read_bytes().replace(name + bytes(8), name + two_points))
    else:
        as_text(root / "sparse" / "0")
    return root


def as_text(model: Path) -> None:
    """The binary files of CAMERAS written anew by COLMAP's text layout, each image with an empty line of points."""
    cameras = [struct.unpack_from("<iiQQ4d", (model / "cameras.bin").read_bytes(), 8 + 56 * n) for n in range(3)]
    lines = [f"{number} PINHOLE {' '.join(map(str, numbers))}" for number, _, *numbers in cameras]
    (model / "cameras.txt").write_text("\n".join(["# ID MODEL W H fx fy cx cy", *lines]))
    size = struct.calcsize("<i7di")
    data, lines = (model / "images.bin").read_bytes(), []
    for start in range(8, len(data), size + 19):  # a name of ten letters, NUL, 0 points
        name = data[start + size : start + size + 10].decode()
        lines.append(" ".join(map(str, (*struct.unpack_from("<i7di", data, start), name))) + "\n")
    (model / "images.txt").write_text("\n".join(["# ID qw qx qy qz tx ty tz CAMERA NAME", *lines]))
    for name in ("cameras", "images", "points3D"):
        (model / f"{name}.bin").unlink()


@pytest.mark.parametrize(("binary", "dense"), [(False, True), (True, False)])
def test_frames_are_the_ones_written(tmp_path: Path, binary: bool, dense: bool) -> None:
    """Round trip: pose to 1e-9, depth as the file has it, colour bit for bit."""
    root = folder_of(tmp_path / "room", binary, dense)
    assert detect(root) == "colmap"
    frames = open_frames(root)
    assert [each.name for each in frames] == [name.removesuffix(".png") for name in CAMERAS]
    for each, camera in zip(frames, CAMERAS.values()):
        found, truth = each.load(), WORLD.rgbd(camera)
        np.testing.assert_allclose(found.camera.world_from_cam, camera.world_from_cam, atol=1e-9)
        assert found.camera.same_lens_as(LENS)
        np.testing.assert_array_equal(found.color, truth.color)
        assert np.abs(found.depth - truth.depth).max() < (1e-6 if dense else 6e-4)


def test_a_model_next_to_a_listing_is_read_where_it_is_asked_for(tmp_path: Path) -> None:
    """Oracle: the model's own frames; as `dlama sequence` writes both. The layout's name did not help: nothing was found."""
    root = folder_of(tmp_path / "room", True, False)
    (root / "transforms.json").write_text("{}")
    assert detect(root) == "nerfstudio"
    assert [each.name for each in open_frames(root, "colmap")] == [name.removesuffix(".png") for name in CAMERAS]


def test_inverse_depth_fitted_to_the_points(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """As 3D Gaussian Splatting keeps it: code / 65536 x scale + offset (oracle: the closed-form world); not above 0 is far.
    A picture without a scale is left out; a depth scale is refused."""
    root = folder_of(tmp_path / "room", False, False)
    (root / "depth").rename(root / "depths")
    scale, offset, stems = 0.8, -0.02, [Path(name).stem for name in CAMERAS]
    for name, camera in CAMERAS.items():
        w = 1 / WORLD.rgbd(camera).depth.astype(np.float64)
        w[0, 0] = -0.01
        Image.fromarray(np.rint((w - offset) / scale * 2**16).astype(np.uint16)).save(root / "depths" / name)
    fitted = {stem: {"scale": scale, "offset": offset} for stem in stems[:2]}
    (root / "sparse/0/depth_params.json").write_text(json.dumps(fitted))
    frames = open_frames(root)
    assert [each.name for each in frames] == stems[:2]
    assert "1 without a scale above 0 in depth_params.json" in caplog.text
    for each, camera in zip(frames, CAMERAS.values()):
        found, truth = each.load().depth, WORLD.rgbd(camera).depth
        assert found[0, 0] == np.inf
        np.testing.assert_allclose(1 / found.ravel()[1:], 1 / truth.ravel()[1:], atol=scale / 2**16)
    with pytest.raises(InputError, match="has a unit of its own"):
        open_frames(root, depth_scale=5000)
    (root / "sparse/0/depth_params.json").write_text(json.dumps({stems[0]: {"scale": "large"}}))
    with pytest.raises(CameraError, match=f"depth_params.json: {stems[0]}: scale is "):
        open_frames(root)


def test_models_that_are_not_read_are_reported(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A mapper that cannot join all pictures writes several models; one is read, without a word before (oracle: their names)."""
    root = folder_of(tmp_path / "room", False, False)
    assert len(open_frames(root)) == 3 and not caplog.text
    for name in ("10", "2"):
        (root / "sparse" / name).mkdir()
        write_model(root / "sparse" / name, CAMERAS, NO_POINTS)
    (root / "sparse" / "notes").mkdir()
    assert len(open_frames(root)) == 3
    assert f"{root / 'sparse'}: model 0 is read and 2, 10 not" in caplog.text


def test_the_model_that_is_written_is_the_views(tmp_path: Path) -> None:
    """Oracle: COLMAP's binary layout, by hand; the cloud's own points and colours. Its reader of text ends names at a blank."""
    cloud = lift(WORLD.rgbd(LENS))
    named = {name.replace("_", " \u00f6 "): camera for name, camera in CAMERAS.items()}
    write_model(tmp_path, named, cloud)
    images = (tmp_path / "images.bin").read_bytes()
    assert images.count(b"shot \xc3\xb6 1.png\0" + bytes(8)) == 1
    found = read_model(tmp_path)
    assert [image.name for image in found] == list(named)
    for image, camera in zip(found, CAMERAS.values()):
        np.testing.assert_allclose(image.world_from_cam, camera.world_from_cam, atol=1e-12)
    data = (tmp_path / "points3D.bin").read_bytes()
    points = [struct.unpack_from("<Q3d3BdQ", data, 8 + 51 * n) for n in range(len(cloud))]
    assert len(data) == 8 + 51 * len(cloud) and data[:8] == struct.pack("<Q", len(cloud))
    np.testing.assert_array_equal([point[1:4] for point in points], cloud.points)
    np.testing.assert_array_equal([point[4:7] for point in points], cloud.color)
    assert {point[7:] for point in points} == {(0.0, 0)}


def test_damaged_models_are_named(tmp_path: Path) -> None:
    """Truncated binary, a distorted lens, a camera that is not there, no depth: file and reason."""
    root = folder_of(tmp_path / "a", True, False)
    images = root / "sparse" / "0" / "images.bin"
    images.write_bytes(images.read_bytes()[:100])
    with pytest.raises(FileError, match=r"images\.bin: ends early; it is truncated"):
        open_frames(root)
    root = folder_of(tmp_path / "b", False, False)
    cameras = root / "sparse" / "0" / "cameras.txt"
    text = cameras.read_text()
    cameras.write_text(text.replace("PINHOLE 48 36 40.0", "SIMPLE_RADIAL 48 36 40.0").replace(" 41.0", "", 1))
    with pytest.raises(CameraError, match=r"cameras\.txt:2:3: camera model SIMPLE_RADIAL has"):
        open_frames(root)
    bent = re.sub(r"PINHOLE 48 36 40.0 41.0 (\S+) (\S+)", r"SIMPLE_RADIAL 48 36 40.0 \1 \2 0.1", text, count=1)
    cameras.write_text(bent)
    with pytest.raises(CameraError, match=r"cameras\.txt:2:3: the camera is distorted; .* colmap image_undistorter"):
        open_frames(root)
    cameras.write_text(bent.replace(" 0.1\n", " 0.001\n"))  # moves the corners by 0.02 px
    assert len(open_frames(root)) == 3
    cameras.write_text("\n".join(text.splitlines()[:2]))
    with pytest.raises(FileError, match="has camera 2, which cameras does not hold"):
        open_frames(root)
    cameras.write_text(text)
    for path in (root / "depth").iterdir():
        path.unlink()
    with pytest.raises(FileError, match="none of its 3 frames can be used \\(3 without depth/NAME"):
        open_frames(root)


def test_images_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """Oracle: by hand; 9.png comes before 10.png, as in all other layouts."""
    names = ["2.png", "9.png", "10.png"]
    write_model(tmp_path, dict(zip(names, CAMERAS.values())), NO_POINTS)
    assert [image.name for image in read_model(tmp_path)] == names


@pytest.mark.parametrize("points", ["", "1.0 2.0 -1 " * 5])
def test_names_with_blanks(tmp_path: Path, points: str) -> None:
    """Oracle: by hand; COLMAP writes a name as it is, and a line of points (three numbers each, or none) below each image."""
    root = folder_of(tmp_path / "room", binary=False, dense=False)
    model = root / "sparse" / "0"
    pairs = [line for line in (model / "images.txt").read_text().splitlines() if line and not line.startswith("#")]
    (model / "images.txt").write_text("\n".join(f"{line.replace('shot_', 'my shot ')}\n{points}" for line in pairs))
    assert [image.name for image in read_model(model)] == ["my shot 0.png", "my shot 1.png", "my shot 2.png"]
