"""Every reader of the package with a small valid file: what `fuzz_readers.py` damages."""

from __future__ import annotations

import io
import json
import os
import pickle
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import lzfse
import numpy as np
import tifffile
from PIL import Image

from depth_photos import apple_xmp, dynamic_depth, gdepth, heic_with_depth, multi_picture, standard, with_segments
from dlama.datasets.easysynth.text_files import METRIC_HEADER, UNREAL_HEADER, read_poses, read_rig
from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.trajectory_log import read_log
from dlama.datasets.sequences.loading import open_frames
from dlama.datasets.text_tables import read_matrix
from dlama.errors import InputError
from dlama.evaluation.report.panels import choose
from dlama.evaluation.runner.store import Row, Stored, read_stored, write_stored
from dlama.files.cameras import read_camera, read_cameras, read_stereo_calib
from dlama.files.photos.depth import read_photo_depth
from dlama.files.rasters.depth import (
    read_depth,
    read_disparity,
    read_inverse_depth,
    write_depth_exr,
    write_disparity_pfm,
)
from dlama.files.rasters.float_files import read_colmap_depth
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.masks import read_mask, read_region
from dlama.files.rasters.pictures import read_color
from dlama.files.rasters.video_frames import read_raw_frame, read_video_frame
from dlama.files.results.video import write_video
from dlama.files.scenes.clouds import read_ply, write_ply
from dlama.files.scenes.scene_npz import read_npz, read_scene, write_npz
from dlama.files.semantic_classes import read_classes
from dlama.geometry.camera import Camera
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.inpainters.networks.contract import CONTRACT_KEY, Contract, from_metadata
from dlama.models.cache import known_size_and_sha256
from dlama.models.network_file import NetworkFile
from dlama.models.records import CATALOGUE
from dlama.nets.safetensors_file import read_safetensors, write_safetensors
from dlama.nets.torch_file import TorchFile
from dlama.training.presets import PRESETS, from_json, to_json
from rosbag_writer import Writer

RNG = np.random.default_rng(0)
COLOR = RNG.integers(0, 256, (9, 12, 3), dtype=np.uint8)
DEPTH = (1 + 5 * RNG.random((9, 12))).astype(np.float32)
CAMERA = Camera.from_fov(12, 9, 60)
LENS = {"width": 12, "height": 9, "fx": 10.5, "fy": 10.5, "cx": 6.0, "cy": 4.5, "pixel_center": 0.5}
POSE = np.eye(4).tolist()
CONTRACT = Contract(("red", "green", "blue", "mask"), ("red", "green", "blue"))


@dataclass(frozen=True)
class Reader:
    """One reader."""

    name: str
    """Of the file, too."""
    data: bytes
    """Of a valid file, or of the part of it that is damaged."""
    read: Callable[[Path], Any]
    wrap: Callable[[bytes], bytes] = bytes
    """The file with that part in it."""
    refused: str = ""
    """What the valid file itself is refused with: its contents are read, and are no use."""
    reserves: bool = False
    """A library of others reads it, and reserves (without taking it) whatever memory the file claims."""


def made(write: Callable[[Path], Any], suffix: str) -> bytes:
    """The bytes of a file that `write` writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"file{suffix}"
        write(path)
        return path.read_bytes()


def picture(kind: str, values: np.ndarray, **options: Any) -> bytes:
    """A picture file by Pillow."""
    stream = io.BytesIO()
    Image.fromarray(values).save(stream, kind, **options)
    return stream.getvalue()


def summed(data: bytes) -> bytes:
    """A PNG whose chunks have their right checksums, as far as they go: damage gets past the first check."""
    out, at = data[:8], 8
    while at + 12 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        body = data[at + 4 : at + 8 + length]
        out += struct.pack(">I", max(0, len(body) - 4)) + body + struct.pack(">I", zlib.crc32(body))
        at += 12 + length
    return out


def both_scenes(path: Path) -> None:
    """The view and its scene, and the scene alone."""
    read_npz(path)
    read_scene(path)


def zipped(name: str, **others: bytes) -> Callable[[bytes], bytes]:
    """A ZIP with the damaged part under `name`, and others whole."""

    def wrap(data: bytes) -> bytes:
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w") as archive:
            for each, content in {name: data, **others}.items():
                archive.writestr(each, content)
        return stream.getvalue()

    return wrap


def npy(array: np.ndarray) -> bytes:
    """An NPY file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def scene_parts() -> dict[str, bytes]:
    """The arrays of a scene.npz."""
    view = View.from_rgbd(RGBD(COLOR, DEPTH, CAMERA))
    with zipfile.ZipFile(io.BytesIO(made(lambda path: write_npz(path, view, Scene((view,))), ".npz"))) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def read_next_to(name: str, others: dict[str, bytes], read: Callable[[Path], Any]) -> Callable[[Path], Any]:
    """A reader of a folder in which the damaged file has a name of its own and others lie next to it."""

    def run(path: Path) -> None:
        folder = path.parent / "set"
        folder.mkdir(exist_ok=True)
        for each, content in {name: path.read_bytes(), **others}.items():
            (folder / each).parent.mkdir(exist_ok=True, parents=True)
            (folder / each).write_bytes(content)
        read(folder)

    return run


def every_tensor(path: Path) -> None:
    """All tensors of a torch file."""
    file = TorchFile(path)
    file.read(file.tensors)


def frames_of(folder: Path) -> None:
    """A data set, and its first frame."""
    found = open_dataset(folder)
    for frame in found.frames[:1]:
        frame.load()


def every_frame(path: Path) -> None:
    """All frames of a recording."""
    for frame in open_frames(path):
        frame.load()


def torch_pickle() -> bytes:
    """The data.pkl of a state dict with one tensor of eight floats (opcodes as torch.save writes them, protocol 2)."""
    tensor = (
        b"ctorch._utils\n_rebuild_tensor_v2\n((X\x07\x00\x00\x00storagectorch\nFloatStorage\nX\x01\x00\x00\x000"
        b"X\x03\x00\x00\x00cpuK\x08tQK\x00K\x02K\x04\x86K\x04K\x01\x86\x89ccollections\nOrderedDict\n)RtR"
    )
    return b"\x80\x02ccollections\nOrderedDict\n)R(X\x01\x00\x00\x00w" + tensor + b"X\x05\x00\x00\x00epochK\x03u."


def onnx_file() -> bytes:
    """An identity network with a contract."""
    from onnx import TensorProto, helper

    ends = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["b", 4, "h", "w"]) for name in ("a", "b")]
    graph = helper.make_graph([helper.make_node("Identity", ["a"], ["b"])], "tiny", ends[:1], ends[1:])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, CONTRACT.metadata())
    return bytes(model.SerializeToString())


def tables() -> list[Reader]:
    """Text: cameras, poses, listings, settings, contracts."""
    info = b"image_width: 12\nimage_height: 9\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [10.0, 0, 6, 0, 10, 4, 0, 0, 1]\n"
    info += b"distortion_coefficients:\n  rows: 1\n  cols: 2\n  data: [0.5, 0]\n"
    matrix = b"projection_matrix:\n  rows: 3\n  cols: 4\n  data: [10, 0, 6, -1.2, 0, 10, 4, 0, 0, 0, 1, 0]\n"
    right = b"image_width: 12\nimage_height: 9\n" + matrix
    rows = [f"<{name}><data>10 0 6 {x} 0 10 4 0 0 0 1 0</data></{name}>" for name, x in (("P1", 0), ("P2", -1.2))]
    xml = f'<?xml version="1.0"?><opencv_storage><image_width>12</image_width><image_height>9</image_height>{"".join(rows)}'
    xml = f"{xml}</opencv_storage>".encode()
    calib = b"cam0=[10 0 6; 0 10 4; 0 0 1]\ncam1=[10 0 6; 0 10 4; 0 0 1]\ndoffs=0\nbaseline=120\nwidth=12\nheight=9\n"
    K = [[10, 0, 6], [0, 10, 4], [0, 0, 1]]
    pair = {"left_K": K, "right_K": K, "baseline_m": 0.1, "doffs": 0, "pixel_center": 0.5, "width": 12, "height": 9}
    rig = {"cameras": {"left": {"intrinsics": [10, 0, 6, 0, 10, 4, 0, 0, 1], "rotation": [0, 0, 0, 1],
                                "translation": [0, 0, 0], "sensor_size": [12, 9]}}}  # fmt: skip
    pictures = {"c.png": picture("PNG", COLOR), "d.png": picture("PNG", (DEPTH * 1000).astype(np.uint16))}
    frame = {"file_path": "c.png", "depth_file_path": "d.png", "transform_matrix": POSE}
    transforms = {"fl_x": 10, "fl_y": 10, "cx": 6, "cy": 4, "w": 12, "h": 9, "frames": [frame]}
    listed = {"color": "c.png", "depth": "d.png", "world_from_cam": POSE}
    pairs = {"width": 12, "height": 9, "K": K, "frames": {"a": listed, "b": listed}, "pairs": [{"a": "a", "b": "b"}]}
    camera = json.dumps(LENS).encode()
    unreal = ",".join(UNREAL_HEADER).encode() + b"\n0,1,2,3,0,0,0,1,0\n1,1,2,3,0,0,0,1,1\n"
    metric = ",".join(METRIC_HEADER).encode() + b"\n0,1,2,3,1,0,0,0,10,10,6,4\n"
    pose = "\n".join(" ".join(map(str, row)) for row in POSE).encode()
    tum = {"rgb.txt": b"1.0 c.png\n2.0 e.png\n", "depth.txt": b"1.0 d.png\n2.0 d.png\n",
           "groundtruth.txt": b"1.0 0 0 0 0 0 0 1\n2.0 0.1 0 0 0 0 0 1\n", "camera.json": camera,
           "e.png": pictures["c.png"], **pictures}  # fmt: skip
    contract = CONTRACT.metadata()[CONTRACT_KEY].encode()

    def text(read: Callable[[str, str], Any]) -> Callable[[Path], Any]:
        return lambda path: read(path.read_bytes().decode("utf-8", "replace"), str(path))

    return [
        Reader("camera.json", json.dumps({**LENS, "world_from_cam": POSE}).encode(), read_camera),
        Reader("cameras.json", json.dumps([{**LENS, "name": "a"}, {**LENS, "world_from_cam": POSE}]).encode(), read_cameras),
        Reader("a.geometric.bin", b"12&9&1&" + DEPTH.astype("<f4").tobytes(), read_colmap_depth),
        Reader("info.yaml", info, read_camera),
        Reader("calib.txt", calib, lambda path: (read_camera(path), read_stereo_calib(path))),
        Reader("pair.json", json.dumps(pair).encode(), read_stereo_calib),
        Reader("calib.json", json.dumps({"K": K, "baseline_m": 0.1, "width": 12, "height": 9}).encode(), read_stereo_calib),
        Reader("right.yaml", right, read_stereo_calib),
        Reader("pair.xml", xml, read_stereo_calib),
        Reader("rig.json", json.dumps(rig).encode(), read_rig),
        Reader("unreal.csv", unreal, read_poses),
        Reader("metric.csv", metric, read_poses),
        Reader("classes.csv", b"barrel,255,0,0\nwall, 1,2,3\n", read_classes),
        Reader("pose.txt", pose, read_matrix),
        Reader("log.log", b"0 0 1\n" + pose + b"\n1 1 2\n" + pose, lambda path: read_log(path, 2)),
        Reader("transforms.json", json.dumps(transforms).encode(), read_next_to("transforms.json", pictures, frames_of),
               refused="two or more of one scene are expected"),
        Reader("pairs.json", json.dumps(pairs).encode(), read_next_to("pairs.json", pictures, frames_of)),
        *(Reader(f"tum.{name}", tum[name], read_next_to(name, {k: v for k, v in tum.items() if k != name}, frames_of),
                 refused="no two of its")
          for name in ("rgb.txt", "depth.txt", "groundtruth.txt")),
        Reader("settings.json", to_json(PRESETS["tiny"].settings).encode(), text(from_json)),
        Reader("contract.json", contract, text(lambda words, file: from_metadata({CONTRACT_KEY: words}, file))),
    ]  # fmt: skip


def arrays() -> list[Reader]:
    """Pictures, depth, masks, scenes, clouds."""
    mask = np.zeros((9, 12), np.uint8)
    mask[2:5, 3:7] = 255
    codes = (DEPTH * 1000).astype(np.uint16)
    deep = cv2.imencode(".png", RNG.integers(0, 65536, (9, 12, 3), dtype=np.uint16))[1].tobytes()
    cloud = lift(RGBD(COLOR, DEPTH, CAMERA))
    parts = scene_parts()
    ply = b"ply\nformat ascii 1.0\nelement vertex 2\n" + b"".join(
        b"property %s %s\n" % (kind, name) for kind, names in ((b"float", b"xyz"),) for name in map(bytes, zip(names))
    )
    ply += b"property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n0 0 1 9 9 9\n1 2 3 4 5 6\n"
    exr = made(lambda path: write_depth_exr(path, DEPTH), ".exr")
    return [
        Reader("color.png", picture("PNG", COLOR), lambda path: (picture_hw(path), read_color(path))),
        Reader("summed.png", picture("PNG", COLOR), read_color, summed),
        Reader("palette.png", picture("PNG", mask), read_color, summed),
        Reader("deep.png", deep, read_color, summed),
        Reader("color.jpg", picture("JPEG", COLOR), read_color),
        *photos_with_depth(),
        Reader("frames.mp4", made(lambda path: write_video(path, [COLOR[:8]] * 3), ".mp4"), second_video_frame),
        Reader("scan.r3d", recording(), every_frame, reserves=True),
        *bags(),
        Reader("color.tif", picture("TIFF", COLOR), read_color),
        Reader("packed.tif", picture("TIFF", COLOR, compression="tiff_lzw"), read_color),
        Reader("depth.png", picture("PNG", codes), read_depth, summed),
        Reader("depth.tif", picture("TIFF", DEPTH), read_depth),
        Reader("depth.exr", exr, read_depth),
        Reader("depth.npy", npy(DEPTH), read_depth),
        Reader("depth.npz", npy(DEPTH), read_depth, zipped("depth.npy")),
        Reader("whole.npz", zipped("depth.npy")(npy(DEPTH)), read_depth),
        Reader("inverse.png", picture("PNG", codes), read_inverse_depth, summed),
        Reader("inverse.npy", npy(DEPTH), read_inverse_depth),
        Reader("disparity.pfm", made(lambda path: write_disparity_pfm(path, DEPTH), ".pfm"), read_disparity),
        Reader("disparity.png", picture("PNG", codes), read_disparity, summed),
        Reader("mask.png", picture("PNG", mask), read_mask, summed),
        Reader("mask.npy", npy(mask), read_mask),
        Reader("region.png", picture("PNG", mask), read_region, summed),
        Reader("class.png", picture("PNG", COLOR), lambda path: read_mask(path, mask_class="1,2,3"), summed, "no pixel shows"),
        *(Reader(f"scene.{name}.npz", data, both_scenes, zipped(name, **{k: v for k, v in parts.items() if k != name}))
          for name, data in parts.items() if not name.startswith("layer")),
        Reader("binary.ply", made(lambda path: write_ply(path, cloud), ".ply"), read_ply),
        Reader("ascii.ply", ply, read_ply),
    ]  # fmt: skip


def second_video_frame(path: Path) -> object:
    """A picture of a video, and its numbers as if they were not packed."""
    with suppress(InputError):
        read_raw_frame(path, 1, 0)
    return read_video_frame(path, 1)


def recording() -> bytes:
    """A recording of Record3D."""
    meta = {"w": 12, "h": 9, "dw": 12, "dh": 9, "K": [9, 0, 0, 0, 9, 0, 6, 4, 1], "poses": [[0, 0, 0, 1, 0, 0, 0]]}
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("metadata", json.dumps(meta))
        archive.writestr("rgbd/0.jpg", picture("JPEG", COLOR))
        archive.writestr("rgbd/0.depth", lzfse.compress(DEPTH.astype("<f4").tobytes()))
    return stream.getvalue()


def photos_with_depth() -> list[Reader]:
    """The containers in which phones keep depth, and a HEIC picture."""
    codes = np.tile(np.linspace(0, 255, 12).astype(np.uint8), (9, 1))
    apple = apple_xmp(0.5, 4, CAMERA.K, CAMERA.wh)
    depth = with_segments(picture("JPEG", codes), standard(apple))
    found = {
        "gdepth.jpg": gdepth(COLOR, codes, 0.4, 6, "RangeLinear", False),
        "extended.jpg": gdepth(COLOR, codes, 0.4, 6, "RangeLinear", True),
        "dynamic.jpg": dynamic_depth(COLOR, codes.astype(np.uint16) * 257, 0.4, 6),
        "apple.jpg": multi_picture(picture("JPEG", COLOR), [(0, depth)]),
    }
    if find_spec("pillow_heif"):
        small = np.kron(COLOR, np.ones((6, 6, 1), np.uint8)), np.kron(codes, np.ones((6, 6), np.uint8))
        found["apple.heic"] = made(lambda path: heic_with_depth(path, *small, apple), ".heic")
    return [Reader(name, data, lambda path: (read_photo_depth(path), read_color(path))) for name, data in found.items()]


def bags() -> list[Reader]:
    """A bag of ROS with a packed picture and its depth, and one that a RealSense camera recorded."""

    def of_ros(path: Path) -> None:
        with Writer(path, "ros1") as writer:
            writer.info("/c/camera_info", "c", CAMERA)
            writer.packed("/c/image_raw/compressed", "c", 1, picture("PNG", COLOR), "rgb8; png compressed ")
            writer.image("/c/depth", "c", 1, DEPTH, "32FC1")

    def of_realsense(path: Path) -> None:
        depth, color = "/device_0/sensor_0/Depth_0", "/device_0/sensor_1/Color_0"
        with Writer(path, "ros1") as writer:
            kind = "diagnostic_msgs/msg/KeyValue"
            writer.put("/device_0/sensor_0/property", kind, 1, writer.make(kind, key="Depth Units", value="0.001"))
            for stream, values, encoding in (
                (depth, (DEPTH * 1000).astype(np.uint16), "mono16"),
                (color, COLOR, "rgb8"),
            ):
                writer.info(f"{stream}/info/camera_info", "", CAMERA)
                writer.put(f"{stream}/tf/0", "geometry_msgs/msg/Transform", 1, writer.move(np.eye(4)))
                writer.image(f"{stream}/image/data", "0", 1, values, encoding)

    if not find_spec("rosbags"):
        return []
    return [
        Reader(f"{write.__name__}.bag", made(write, ".bag"), every_frame, reserves=True)
        for write in (of_ros, of_realsense)
    ]


def networks() -> list[Reader]:
    """Weights, networks."""
    tensors = {"w": RNG.random((2, 3), np.float32), "n": np.arange(3)}
    weights = made(lambda path: write_safetensors(path, tensors), ".safetensors")
    storage = {"a/data/0": bytes(32), "a/version": b"3\n"}
    return [
        Reader("weights.safetensors", weights, read_safetensors),
        Reader("pickle.pt", torch_pickle(), every_tensor, zipped("a/data.pkl", **storage)),
        Reader("object.pt", pickle.dumps({"state_dict": {"w": 1}, "x": [{}, (1, "a")]}, 2), every_tensor,
               zipped("a/data.pkl", **storage), "pickle"),
        Reader("whole.pt", zipped("a/data.pkl", **storage)(torch_pickle()), every_tensor),
        Reader("network.onnx", onnx_file(), lambda path: NetworkFile(path, "cpu", 1).session),
    ]  # fmt: skip


def kept() -> list[Reader]:
    """What dlama itself wrote to be read again: hashes of models, results of an evaluation."""
    pins = {"big-lama.pt": {"sha256": "0" * 64, "bytes": 12}, "migan.onnx": {"sha256": "1" * 64, "bytes": 7}}
    rows = tuple(
        Row("vpi", "street", "s01", "0001", -20.0, recipe, "telea", *measure)
        for recipe in ("dlama", "dlama+object,dilate=3")
        for measure in (("whole", "rgb", "ssim", 0.5), ("unseen", "rgb", "psnr", float("inf")))
    )
    case = Stored("key", rows, rows[:1], {"dlama": "case--0.jpg"}, ("warned",))
    return [
        Reader("pins.json", json.dumps(pins).encode(), pinned),
        Reader("case.json", made(lambda path: write_stored(path, case), ".json"), rows_of_stored),
        Reader("big.tif", big_tiff(), read_color),
    ]


def pinned(path: Path) -> object:
    """The hashes and sizes in a folder of models."""
    os.environ["DLAMA_MODELS"] = str(path.parent)
    return [known_size_and_sha256(entry) for entry in CATALOGUE.values()]


def rows_of_stored(path: Path) -> object:
    """A stored result, as tables take it."""
    found = read_stored(path)
    return None if found is None else choose([found])


def big_tiff() -> bytes:
    """A BigTIFF that is turned."""
    stream = io.BytesIO()
    tifffile.imwrite(stream, COLOR, bigtiff=True, photometric="rgb", extratags=[(274, "H", 1, 6, True)])
    return stream.getvalue()


def all_readers() -> dict[str, Reader]:
    """By name."""
    return {reader.name: reader for reader in (*tables(), *arrays(), *networks(), *kept())}
