"""A bag of ROS 1 (.bag), of ROS 2 (a folder with metadata.yaml, .db3) or an MCAP file in; posed frames and cases out.

A colour and a depth topic are chosen, depth that is registered to the colour camera before other depth; their camera_info stands
next to them. The pose of a picture is that of its frame in the root of /tf and /tf_static (nav_msgs/Odometry counts too) at the
picture's time. Depth of another camera is moved into the colour camera. Read by the package rosbags (extra `ros`);
formats: wiki.ros.org/Bags/Format/2.0, github.com/ros2/rosbag2, mcap.dev/spec; messages: `ros_messages`. What a RealSense camera
recorded by itself names its topics in its own way: `realsense`.
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from dlama.datasets.captures import realsense
from dlama.datasets.captures.ros_messages import (
    Topic,
    Track,
    Transforms,
    color_of,
    depth_of,
    distortion_px_of_info,
    encoding_of,
    intrinsics_of_info,
    is_color,
    is_depth,
    is_rectified,
    seconds_of,
    times_to_match,
)
from dlama.datasets.posed.lenses import Lens, register_depth
from dlama.datasets.posed.nerfstudio import SHOWS_PX
from dlama.datasets.posed.posed_frames import LOG, MOST_ENLARGED, FrameFiles, Listed
from dlama.datasets.text_tables import NEAREST_S, nearest_in_time
from dlama.errors import CameraError, FileError, any_error, import_extra
from dlama.files.fields import FileFields
from dlama.writing.unchanged import while_unchanged

FILES = (".bag", ".mcap", ".db3")
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
INFO, TF, ODOMETRY = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry"
KINDS = (*IMAGES, INFO, TF, "tf/msg/tfMessage", ODOMETRY)


def looks_like(root: Path) -> bool:
    """True for the folder of a bag of ROS 2."""
    return (root / "metadata.yaml").is_file() and any(path.suffix.lower() in FILES[1:] for path in root.iterdir())


def list_frames(path: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    bag = open_bag(path)
    color, depth = bag.pair()
    lens, depth_lens = bag.lens(color), bag.lens(depth)
    transforms = bag.transforms
    if not transforms.moves(color.frame):
        LOG.warning(
            "%s: holds no moving transform (/tf) of the camera's frame '%s': the camera is taken as standing still",
            path,
            color.frame,
        )
    matched, of_depth = times_to_match(color, depth)
    for number, stamp in enumerate(color.stamps.tolist()):
        name = f"{number:06d}"
        near, pose = nearest_in_time(of_depth, matched[number]), transforms.root_from(color.frame, stamp)
        if near is None:
            yield name, f"without depth within {NEAREST_S:g} s"
            continue
        if pose is None:
            yield name, "without a pose"
            continue
        decode = partial(depth_of, unit=bag.units.get(depth.name))
        metres: Any = partial(_decode, decode, path, depth.name, depth.places[near])
        if color.frame != depth.frame:
            found = transforms.between(color.frame, depth.frame, stamp)
            if found is None:
                raise FileError(
                    f"{path}: depth is in the frame {depth.frame!r} and colour in {color.frame!r}, and no transform leads "
                    "from one to the other; depth registered to the colour camera is expected"
                )
            metres = partial(register_depth, metres, depth_lens, lens, found)
        names = f"{path}, {color.name} {number}", f"{path}, {depth.name} {near}"
        picture = partial(_decode, color_of, path, color.name, color.places[number])
        yield name, FrameFiles(names, picture, metres, lens, pose, enlarged=MOST_ENLARGED)


@contextmanager
def bag_errors(message: str) -> Iterator[None]:
    """Context: what reading raises becomes a FileError, MemoryError, too: a damaged bag claims sizes beyond any memory."""
    with any_error(FileError, message):
        try:
            yield
        except MemoryError as error:
            raise FileError(f"{message} (it claims more than memory holds)") from error


def _decode(how: Callable[[Any, str], Any], path: Path, topic: str, place: int) -> Any:
    """What `how` reads of the message of a topic that was recorded at `place`, ns. FileError."""
    message = open_bag(path).message(topic, place)
    with bag_errors(f"{path}, {topic}: is damaged"):
        return how(message, f"{path}, {topic}")


class Bag:
    """An open bag; its pictures are found once, and read when they are needed. It is closed when it is no longer kept."""

    def __init__(self, path: Path) -> None:
        names = "rosbags.highlevel", "rosbags.typesys"
        highlevel, types = (import_extra(name, f"{path}: a bag of ROS", "rosbags", "ros") for name in names)
        self.path, self.lock = path, Lock()
        is_old = path.suffix.lower() == ".bag"
        with bag_errors(f"{path}: is no readable bag"):  # AnyReaderError, struct.error, KeyError, ...
            store = types.get_typestore(types.Stores.ROS1_NOETIC if is_old else types.Stores.ROS2_HUMBLE)
            self.reader = highlevel.AnyReader([path], default_typestore=store)
            self.reader.open()
            weakref.finalize(self, self.reader.close)
            self.units, self.unread = dict[str, float](), dict[str, str]()
            self.topics, self.infos, self.transforms = self._list_topics()

    def _list_topics(self) -> tuple[dict[str, tuple[Topic, Any]], dict[str, Any], Transforms]:
        """Topic -> its pictures and the first message, camera_info by topic, and the transforms."""
        pictures: dict[str, tuple[Any, list[tuple[float, int, str]]]] = {}
        infos, transforms = dict[str, Any](), Transforms()
        options = dict[str, float]()
        for topic, kind, place, message in self._messages():
            if kind in IMAGES:
                if is_color(message) or is_depth(message):
                    frame = realsense.stream_of(topic) or message.header.frame_id
                    pictures.setdefault(topic, (message, []))[1].append((seconds_of(message), place, frame))
                else:
                    self.unread.setdefault(topic, encoding_of(message))
            elif kind == INFO:
                infos.setdefault(topic, message)
            elif unit := realsense.unit_of_option(topic, message):
                options.setdefault(*unit)
            else:
                self._add_transforms(transforms, topic, message)
        topics = {}
        for name, (first, heads) in pictures.items():
            stamps, places, frames = zip(*sorted(heads))
            topics[name] = (Topic(name, frames[0].lstrip("/"), np.array(stamps), places), first)
            stream = realsense.stream_of(name)
            if stream and self._has_depth(name, first):
                self._find_unit(name, options.get(stream.rsplit("/", 1)[0], 0.0))
        return topics, infos, transforms

    def _add_transforms(self, transforms: Transforms, topic: str, message: Any) -> None:
        """Those of a message of odometry, of a transform of RealSense, or of /tf."""
        where = f"{self.path}, {topic}"
        if stream := realsense.extrinsics_of(topic, message, where):
            transforms.tracks.setdefault(stream[0], Track(stream[1], [0.0], [stream[2]], fixed=True))
        elif hasattr(message, "pose"):
            ends = message.child_frame_id, message.header.frame_id
            transforms.add(*ends, seconds_of(message), message.pose.pose, False, where)
        elif hasattr(message, "transforms"):
            for each in message.transforms:
                ends = each.child_frame_id, each.header.frame_id
                transforms.add(*ends, seconds_of(each), each.transform, topic.endswith("static"), where)

    def _find_unit(self, topic: str, option: float) -> None:
        """Metres a level of RealSense's depth: of its images, or of the option of its sensor."""
        if topic not in self.units:
            if not option > 0:
                LOG.warning("%s, %s: no unit of depth is recorded: millimetres are taken", self.path, topic)
            self.units[topic] = option if option > 0 else 1e-3

    def _messages(self) -> Iterator[tuple[str, str, int, Any]]:
        chosen = [each for each in self.reader.connections if each.msgtype in KINDS or realsense.is_used(each.topic)]
        if not chosen:
            raise FileError(f"{self.path}: holds no pictures of ROS (sensor_msgs/Image or CompressedImage)")
        for connection, place, data in self.reader.messages(connections=chosen):
            yield connection.topic, connection.msgtype, place, self._deserialize(connection, data)

    def _deserialize(self, connection: Any, data: Any) -> Any:
        if connection.msgtype == IMAGES[0] and realsense.stream_of(connection.topic):
            data, unit = realsense.split_image(data)
            if unit is not None and unit > 0:
                self.units.setdefault(connection.topic, unit)
        return self.reader.deserialize(data, connection.msgtype)

    def message(self, topic: str, place: int) -> Any:
        """The message of a topic that was recorded at `place`, ns. FileError."""
        with self.lock, bag_errors(f"{self.path}, {topic}: is damaged"):
            chosen = [each for each in self.reader.connections if each.topic == topic]
            for connection, _, data in self.reader.messages(connections=chosen, start=place, stop=place + 1):
                return self._deserialize(connection, data)
        raise FileError(f"{self.path}, {topic}: has lost the message at {place} ns")

    def pair(self) -> tuple[Topic, Topic]:
        """The colour and the depth topic: those of one camera frame first, then by name. FileError."""
        colors = [found for found, message in self.topics.values() if is_color(message)]
        depths = [found for found, message in self.topics.values() if self._has_depth(found.name, message)]
        unread = [f"{topic} has the encoding {code}, which is not read" for topic, code in self.unread.items()]
        if not colors or not depths:
            found = "; ".join([", ".join(sorted(self.topics)) or "none", *unread])
            raise FileError(f"{self.path}: a colour and a depth topic are expected; of pictures it has {found}")
        pairs = itertools.product(colors, depths)
        color, depth = min(pairs, key=lambda pair: (pair[0].frame != pair[1].frame, *map(self._rank, pair)))
        if len(colors) * len(depths) > 1:
            LOG.info("%s: %s and %s are taken of %d topics", self.path, color.name, depth.name, len(self.topics))
        if unread and self._is_grey(color):
            LOG.warning("%s: %s, which is grey, is taken for the picture; %s", self.path, color.name, "; ".join(unread))
        return color, depth

    def _rank(self, topic: Topic) -> tuple[bool, bool, int, str]:
        """Pictures in colour before infrared ones, those with a camera_info first, then those of which there are most."""
        return self._is_grey(topic), self._info(topic) is None, -len(topic.stamps), topic.name

    def _is_grey(self, topic: Topic) -> bool:
        return "infra" in topic.name or encoding_of(self.topics[topic.name][1]) in ("mono8", "8UC1")

    def _has_depth(self, topic: str, message: Any) -> bool:
        """mono16, and of RealSense 16UC1, is depth where the topic says so, else infrared."""
        grey = encoding_of(message) == "mono16" or realsense.stream_of(topic) is not None
        return is_depth(message) and not (grey and "depth" not in topic.lower())

    def _info(self, topic: Topic) -> Any:
        """The camera_info next to a topic, or that of its frame."""
        parts = topic.name.split("/")
        tails = "camera_info", "info/camera_info"
        candidates = ["/".join([*parts[:-count], tail]) for count in (1, 2) for tail in tails]
        found = next((self.infos[name] for name in candidates if name in self.infos), None)
        of_frame = [info for info in self.infos.values() if info.header.frame_id.lstrip("/") == topic.frame]
        return found if found is not None or not of_frame else of_frame[0]

    def lens(self, topic: Topic) -> Lens:
        """FileError, CameraError; warns of distortion that shows."""
        info = self._info(topic)
        if info is None:
            raise FileError(f"{self.path}, {topic.name}: has no camera_info next to it; one is expected")
        where = f"{self.path}, camera_info of {topic.name}"
        rectified = is_rectified(topic.name)
        name, (matrix, hw) = "P" if rectified else "K", intrinsics_of_info(info, rectified)
        if not any(map(any, matrix)):
            raise CameraError(
                f"{where}: {name} is zero everywhere: the camera was not calibrated; intrinsics are expected"
            )
        intrinsics = FileFields(where, {name: matrix}).intrinsics(name)
        moved = 0.0 if rectified else distortion_px_of_info(info)
        if moved > SHOWS_PX:
            LOG.warning("%s: distortion moves the picture's corners by %.1f px; it is not undone", where, moved)
        return Lens(where, intrinsics, 0.0, hw)


@while_unchanged(keep=2)
def open_bag(path: Path) -> Bag:
    """The bag; the last two stay open."""
    return Bag(path)
