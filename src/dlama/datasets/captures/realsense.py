"""Topics and messages that a RealSense camera recorded (a .bag of ROS 1) in; frames, units, bytes and transforms as of ROS out.

After librealsense's ros_file_format.h, ros_writer.cpp and msgs/sensor_msgs/Image.h: a stream is /device_D/sensor_S/NAME_I, with
image/data, info/camera_info and tf/GROUP (a geometry_msgs/Transform: points of the group's reference to the stream's axes,
`p_stream = R p_reference + t`); the unit of depth is the option "Depth Units" of its sensor, and in newer files also four bytes
behind each image that the message's definition does not name. Heads have no frame.
"""

from __future__ import annotations

import re
import struct
from typing import Any

from dlama.datasets.text_tables import pose_of
from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose

STREAM = re.compile(r"/(device_\d+/sensor_\d+)/([^/]+_\d+)/")
EXTRINSICS = re.compile(STREAM.pattern + r"tf/(\d+)$")
UNIT_TOPICS = re.compile(r"/(device_\d+/sensor_\d+)/(option/Depth Units/value|property)$")
UNITS = "Depth Units"


def stream_of(topic: str) -> str | None:
    """The stream that a topic belongs to, which serves as its frame; None: the topic is no camera's own."""
    found = STREAM.match(topic)
    return found and f"{found[1]}/{found[2]}"


def is_used(topic: str) -> bool:
    """Whether a topic says how a stream lies, or in which unit its depth is."""
    return bool(EXTRINSICS.match(topic) or UNIT_TOPICS.match(topic))


def extrinsics_of(topic: str, message: Any, where: str) -> tuple[str, str, Float64Array] | None:
    """The stream, the reference of its group, and the stream's pose in it (4x4). FileError, CameraError."""
    found = EXTRINSICS.match(topic)
    if not found:
        return None
    place, turn = message.translation, message.rotation
    moved = pose_of(where, [place.x, place.y, place.z], [turn.x, turn.y, turn.z, turn.w])
    return f"{found[1]}/{found[2]}", f"{found[1].split('/')[0]}/group_{found[3]}", invert_pose(moved)


def unit_of_option(topic: str, message: Any) -> tuple[str, float] | None:
    """The sensor and its metres a level, of a topic of its option or (older files) its properties."""
    found = UNIT_TOPICS.match(topic)
    if not found or getattr(message, "key", UNITS) != UNITS:
        return None
    return found[1], float(message.value if hasattr(message, "key") else message.data)


def split_image(data: bytes | memoryview) -> tuple[bytes | memoryview, float | None]:
    """A serialised image as the definition has it, and the metres a level that stand behind it. struct.error: is damaged."""
    at = 12 + _length(data, 12) + 4  # seq, stamp, frame_id
    at += 8  # height, width
    at += 4 + _length(data, at) + 5  # encoding, is_bigendian, step
    end = at + 4 + _length(data, at)
    return data[:end], struct.unpack_from("<f", data, end)[0] if len(data) == end + 4 else None


def _length(data: bytes | memoryview, at: int) -> int:
    """Of the text or array that begins there."""
    return int(struct.unpack_from("<I", data, at)[0])
