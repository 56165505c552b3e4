"""Bags of ROS 1 and 2 and MCAP, written message by message by the package rosbags."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.motion.poses import quaternion_from_rotation


class Writer:
    """A bag under way, of any kind."""

    def __init__(self, path: Path, kind: str) -> None:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.old = kind == "ros1"
        self.types = get_typestore(Stores.ROS1_NOETIC if self.old else Stores.ROS2_HUMBLE)
        if self.old:
            text = "geometry_msgs/TransformStamped[] transforms"
            self.types.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        self.writer: Any = Writer1(path) if self.old else Writer2(path, version=9, storage_plugin=plugin)
        self.connections: dict[str, Any] = {}
        self.count = 0

    def __enter__(self) -> Writer:
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def make(self, kind: str, **fields: Any) -> Any:
        """A message; ROS 1 has a number in its heads and other letters in CameraInfo."""
        if self.old and kind.endswith("Header"):
            fields["seq"] = 0
        if self.old and kind.endswith("CameraInfo"):
            fields = {name.upper() if name in ("d", "k", "r", "p") else name: value for name, value in fields.items()}
        return self.types.types[kind](**fields)

    def head(self, frame: str, seconds: float) -> Any:
        whole = int(seconds)
        stamp = self.make("builtin_interfaces/msg/Time", sec=whole, nanosec=round((seconds - whole) * 1e9))
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def put(self, topic: str, kind: str, seconds: float, message: Any, behind: bytes = b"") -> None:
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.types)
        data = self.types.serialize_ros1(message, kind) if self.old else self.types.serialize_cdr(message, kind)
        self.count += 1
        self.writer.write(self.connections[topic], int(seconds * 1e9) + self.count, bytes(data) + behind)

    def image(
        self, topic: str, frame: str, seconds: float, values: np.ndarray, encoding: str, behind: bytes = b""
    ) -> None:
        """Rows are padded by three bytes; behind: what follows the message."""
        height, width = values.shape[:2]
        rows = values.reshape(height, -1).view(np.uint8)
        rows = np.concatenate([rows, np.full((height, 3), 99, np.uint8)], 1)
        fields = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0, "step": rows.shape[1]}
        message = self.make("sensor_msgs/msg/Image", header=self.head(frame, seconds), **fields, data=rows.ravel())
        self.put(topic, "sensor_msgs/msg/Image", seconds, message, behind)

    def packed(self, topic: str, frame: str, seconds: float, data: bytes, form: str) -> None:
        message = self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.head(frame, seconds),
            format=form,
            data=np.frombuffer(data, np.uint8),
        )
        self.put(topic, "sensor_msgs/msg/CompressedImage", seconds, message)

    def info(
        self,
        topic: str,
        frame: str,
        camera: Camera,
        distortion: tuple[float, ...] = (0.0,) * 5,
        model: str = "plumb_bob",
        rectified: Camera | None = None,
        uncalibrated: bool = False,
        region: tuple[int, int, int, int] = (0, 0, 0, 0),
        binning: tuple[int, int] = (0, 0),
    ) -> None:
        """camera: K; rectified: P, default as K; region: x, y, width, height."""
        K, P = (each.K.copy() for each in (camera, rectified or camera))
        for matrix in (K, P):
            matrix[:2, 2] -= 0.5
            matrix *= not uncalibrated
        cut = dict(zip(("x_offset", "y_offset", "width", "height"), region))
        roi = self.make("sensor_msgs/msg/RegionOfInterest", **cut, do_rectify=False)
        message = self.make(
            "sensor_msgs/msg/CameraInfo", header=self.head(frame, 1.0), height=camera.height, width=camera.width,
            distortion_model=model, d=np.array(distortion), k=K.ravel(), r=np.eye(3).ravel(),
            p=np.hstack([P, np.zeros((3, 1))]).ravel(), binning_x=binning[0], binning_y=binning[1], roi=roi,
        )  # fmt: skip
        self.put(topic, "sensor_msgs/msg/CameraInfo", 1.0, message)

    def move(self, pose: np.ndarray) -> Any:
        x, y, z, w = map(float, quaternion_from_rotation(pose[:3, :3]))
        turn = self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
        shift = self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, pose[:3, 3]))))
        return self.make("geometry_msgs/msg/Transform", translation=shift, rotation=turn)

    def transform(self, topic: str, parent: str, child: str, seconds: float, pose: np.ndarray) -> None:
        moved, head = self.move(pose), self.head(parent, seconds)
        each = self.make("geometry_msgs/msg/TransformStamped", header=head, child_frame_id=child, transform=moved)
        self.put(topic, "tf2_msgs/msg/TFMessage", seconds, self.make("tf2_msgs/msg/TFMessage", transforms=[each]))


def as_rvl(codes: np.ndarray) -> bytes:
    """Packed as by the listing in A. Wilson, "Fast Lossless Depth Image Compression" (2017), number by number."""
    flat, nibbles, at, last = codes.ravel().tolist(), [], 0, 0

    def put(number: int) -> None:
        while True:
            number, low = number >> 3, number & 7
            nibbles.append(low | (8 if number else 0))
            if not number:
                return

    while at < len(flat):
        for wanted in (False, True):
            end = next((place for place in range(at, len(flat)) if bool(flat[place]) != wanted), len(flat))
            put(end - at)
            for code in flat[at:end] if wanted else ():
                put(2 * (code - last) if code >= last else 2 * (last - code) - 1)
                last = code
            at = end
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        sum(one << (28 - 4 * place) for place, one in enumerate(nibbles[i : i + 8])) for i in range(0, len(nibbles), 8)
    ]
    return struct.pack("<ii", codes.shape[1], codes.shape[0]) + struct.pack(f"<{len(words)}I", *words)
