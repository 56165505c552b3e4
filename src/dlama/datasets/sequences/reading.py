"""The frames of a scene that were read, in; what was decided of their depth and size, for meta.json and in warnings, out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dlama.datasets.frames import Frame
from dlama.datasets.posed.posed_frames import FrameFiles, PosedFrame, count_readings, measured_depth, size_of_picture
from dlama.errors import format_size, warn
from dlama.perception.missing_depth import has_single_readings

Decisions = dict[str, dict[str, Any]]


def decide_reading(frames: Sequence[Frame], hw: tuple[int, int], max_depth: float | None) -> Decisions:
    """Of frames that were read at the size hw: whether depth was filled between its readings (`densify`), what was left out
    beyond its range, whether pictures were shrunk. max_depth: metres, as given."""
    files = [frame.files for frame in frames if isinstance(frame, PosedFrame)]
    if not files:
        return {}
    return decide_depth(files[0], hw) | decide_range(files, max_depth) | decide_size(files[0], hw)


def decide_depth(files: FrameFiles, hw: tuple[int, int]) -> Decisions:
    """By the first frame."""
    recorded = measured_depth(files)
    if recorded.shape != hw or not has_single_readings(recorded):
        return {}
    reason = "single readings, as of a LIDAR: filled along colours between them"
    return {"depth": {"name": "densified", "reason": reason}}


def decide_range(files: Sequence[FrameFiles], max_depth: float | None) -> Decisions:
    """Of all frames; warns of a range that was not asked for."""
    limit = files[0].range_m
    if limit == np.inf:
        return {}
    counts = np.array([count_readings(each) for each in files])
    every, beyond = (int(count) for count in counts.sum(0))
    reason = "as given" if max_depth is not None else "the range of a phone's LIDAR"
    if beyond and max_depth is None:
        warn(
            f"{beyond / every:.1%} of the depth readings, in {np.count_nonzero(counts[:, 1])} of {len(files)} frames, lie beyond "
            f"{limit:g} m, {reason}, and count as missing; `max_depth=METRES` (of sequence and video) says up to where they count"
        )
    return {"max_depth": {"name": f"{limit:g} m", "reason": reason, "readings": every, "dropped": beyond}}


def decide_size(files: FrameFiles, hw: tuple[int, int]) -> Decisions:
    """By the first frame; warns of pictures that were shrunk."""
    picture = size_of_picture(files)
    if picture == hw:
        return {}
    small = format_size(hw)
    warn(
        f"pictures of {format_size(picture)} are shrunk to {small}, as their depth is smaller; `resize_depth=guided` enlarges "
        "depth to the pictures' size in place of that"
    )
    return {"size": {"name": small, "reason": f"depth is smaller than the pictures, which are {format_size(picture)}"}}
