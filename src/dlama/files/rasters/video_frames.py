"""A video file in; how many pictures a track of it holds, and one of them by its place, out. By PyAV (extra `video`).

Pictures are found by their time stamps and not by the frame rate: phones record at a varying one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from dlama.errors import FileError, any_error, import_extra, system_errors
from dlama.files.rasters.images import check_pixels, existing_file
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import UInt8Array, UInt16Array
from dlama.writing.unchanged import while_unchanged


@system_errors(FileError)
def video_times(path: Path, track: int = 0) -> Float64Array:
    """Seconds of the pictures of a track, ascending; they are not decoded. FileError, MissingExtraError."""
    video = _open_video(existing_file(path), track)
    return np.array(video.stamps, np.float64) * float(video.stream.time_base or 1)


@system_errors(FileError)
def video_tracks(path: Path) -> tuple[list[dict[str, str]], dict[str, bytes]]:
    """The tags of each video track, and name -> bytes of what is attached to the file. FileError, MissingExtraError."""
    streams: Any = _open_video(existing_file(path), 0).container.streams
    attached = {each.name: each.data for each in streams if each.type == "attachment"}
    return [dict(each.metadata) for each in streams.video], attached


@system_errors(FileError)
def read_video_frame(path: Path, place: int, track: int = 0) -> UInt8Array:
    """The picture at a place from 0: uint8 H x W x 3 RGB, as stored (never turned). FileError, MissingExtraError."""
    return np.asarray(_picture(path, place, track, Video.picture), np.uint8)


@system_errors(FileError)
def read_raw_frame(path: Path, place: int, track: int) -> UInt16Array:
    """H x W numbers of an uncompressed 16-bit track, big endian in the file (b16g). FileError, MissingExtraError."""
    return np.asarray(_picture(path, place, track, Video.numbers), np.uint16)


def _picture(path: Path, place: int, track: int, how: Callable[[Video, int], np.ndarray]) -> np.ndarray:
    video = _open_video(existing_file(path), track)
    with any_error(FileError, f"{path}: picture {place} is damaged"):
        return how(video, place)


class Video:
    """A track of an open video; one picture is decoded after the other as long as places ascend."""

    def __init__(self, path: Path, track: int) -> None:
        av = import_extra("av", f"{path}: a video", "av", "video")
        self.path, self.lock, self.next = path, Lock(), 0
        with any_error(FileError, f"{path}: is no readable video"):
            self.container = av.open(str(path))
            self.stream = self.container.streams.video[track]
            found = (packet.pts for packet in self.container.demux(self.stream))
            self.stamps = sorted({stamp for stamp in found if stamp is not None})
        if not self.stamps:
            raise FileError(f"{path}: holds no picture")
        check_pixels(path, self.stream.width, self.stream.height)
        self.stream.thread_type = "AUTO"
        self.next = len(self.stamps)
        self.decoded: Any = iter(())

    def picture(self, place: int) -> UInt8Array:
        """H x W x 3 RGB."""
        with self.lock:
            if not self.next <= place < self.next + 60:  # so many are decoded on the way rather than sought
                self.container.seek(self.stamps[place], stream=self.stream)
                self.decoded = self.container.decode(self.stream)
            for frame in self.decoded:
                if frame.pts is not None and frame.pts >= self.stamps[place]:
                    self.next = place + 1
                    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
            self.next = len(self.stamps)
            raise FileError(f"{self.path}: ends before picture {place}")

    def numbers(self, place: int) -> UInt16Array:
        """H x W of a track that is not packed."""
        with self.lock:
            self.next = len(self.stamps)
            self.container.seek(self.stamps[place], stream=self.stream)
            for packet in self.container.demux(self.stream):
                if packet.pts == self.stamps[place]:
                    data, (height, width) = bytes(packet), (self.stream.height, self.stream.width)
                    if len(data) != 2 * height * width:
                        break
                    return np.frombuffer(data, ">u2").reshape(height, width).astype(np.uint16)
            raise FileError(
                f"{self.path}: picture {place} has not the size of {self.stream.width}x{self.stream.height} numbers"
            )


@while_unchanged(keep=4)
def _open_video(path: Path, track: int) -> Video:
    """The track; the last four stay open."""
    return Video(path, track)
