"""Pictures in; a video, or an animated picture, as a file out: MP4 by PyAV (extra `video`), WebP and GIF by Pillow."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dlama.errors import InputError, OutputError, ShapeError, format_size, import_extra, system_errors
from dlama.geometry.rgbd import UInt8Array
from dlama.writing.atomic_write import PathLike, new_file

VIDEOS, ANIMATIONS = (".mp4", ".mov", ".mkv"), (".webp", ".gif")
BT_709, SRGB, LIMITED = 1, 13, 1
"""Codes of ITU-T H.273: of primaries and of the way from RGB to YCbCr; of the transfer curve; of the range 16 to 235."""


def check_video(path: PathLike, fps: float = 24.0, hw: Sequence[int] = (2, 2)) -> None:
    """Raise before anything is computed: InputError for a name of another kind, more pictures a second, or larger or smaller ones
    (`hw`), than it can hold; MissingExtraError without what writes it."""
    suffix = Path(path).suffix.lower()
    if suffix not in (*VIDEOS, *ANIMATIONS):
        raise InputError(
            f"`output` is {path}; a name that ends in {', '.join((*VIDEOS, *ANIMATIONS))} is expected; "
            "`dlama sequence SCENE --views` writes pictures"
        )
    if suffix == ".gif" and fps > 50:  # players show a picture of a hundredth of a second for ten
        raise InputError(f"`fps` is {fps:g}; a GIF has at most 50 pictures a second, WebP and MP4 have more")
    least, most = {".webp": (1, 16383), ".gif": (1, 65535)}.get(suffix, (2, 16384))  # px of a side; H.264
    if not least <= min(hw[:2]) <= max(hw[:2]) <= most:
        raise InputError(f"the pictures are {format_size(hw)}; {suffix} has sides of {least} to {most} px")
    if suffix in VIDEOS:
        _av()


@system_errors(OutputError)
def write_video(path: PathLike, pictures: Iterable[UInt8Array], fps: float = 24.0) -> int:
    """Write pictures (H x W x 3, RGB, one size, one at least) as a video, by the name's ending; how many there were.

    Odd sides lose a row or a column in videos, as H.264 needs even ones. Raises InputError, MissingExtraError, ShapeError (sizes
    that differ), OutputError; nothing half-written is left.
    """
    check_video(path, fps)
    frames = _check_sizes(path, pictures)
    with new_file(path) as draft:
        if Path(path).suffix.lower() in VIDEOS:
            return _encode_video(draft, frames, fps)
        return _write_animation(draft, frames, fps)


def _check_sizes(path: PathLike, pictures: Iterable[UInt8Array]) -> Iterator[UInt8Array]:
    first = None
    for picture in pictures:
        if first is None:
            first = picture.shape
            check_video(path, hw=first)
        if picture.shape != first:
            raise ShapeError(f"a picture of a video is {picture.shape} and the first one {first}; one size is expected")
        yield picture


def _encode_video(path: Path, pictures: Iterator[UInt8Array], fps: float) -> int:
    av, count, stream = _av(), 0, None
    options = {} if path.suffix.lower() == ".mkv" else {"movflags": "+faststart"}
    with av.open(str(path), "w", options=options) as container:
        for picture in pictures:
            even = np.ascontiguousarray(picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2])
            if stream is None:
                stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
                stream.height, stream.width, stream.pix_fmt = *even.shape[:2], "yuv420p"
                stream.options = {"crf": "18", "preset": "medium"}  # hardly distinguishable from the pictures
                stated = stream.codec_context  # what a file does not state players guess, by the picture's size
                stated.color_primaries, stated.color_trc, stated.colorspace = BT_709, SRGB, BT_709
                stated.color_range = LIMITED
            frame = av.VideoFrame.from_ndarray(even, format="rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace=BT_709, dst_color_range=LIMITED)
            container.mux(stream.encode(frame))
            count += 1
        if stream is not None:
            container.mux(stream.encode(None))
    return count


def _write_animation(path: Path, pictures: Iterator[UInt8Array], fps: float) -> int:
    frames, webp = [Image.fromarray(picture) for picture in pictures], path.suffix.lower() == ".webp"
    options: dict[str, Any] = {"quality": 80, "method": 4} if webp else {}
    step = 1 if webp else 10  # ms
    # of begins that are rounded: durations that are, each by itself, would make the whole too short
    begins = [round(1000 * number / fps / step) * step for number in range(len(frames) + 1)]
    durations = np.diff(begins).tolist()
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations, loop=0, **options)
    return len(frames)


def _av() -> Any:
    """PyAV, or MissingExtraError."""
    return import_extra("av", "writing a video (WebP and GIF go without)", "av", "video")
