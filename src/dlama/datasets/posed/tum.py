"""TUM RGB-D sequences in (rgb.txt, depth.txt, groundtruth.txt); posed frames and the cases between them out.

Lines `time file` and `time tx ty tz qx qy qz qw` (camera to world, OpenCV axes, metres); # begins a remark. To each colour
picture belong the depth picture and the pose nearest in time, at most 0.02 s away. Depth: 16-bit PNG, 5000 units a metre.
The intrinsics are in no file of the set: give `camera`, or put a camera.json into the folder.
Format: cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dlama.datasets.posed.posed_frames import (
    CameraOption,
    PosedFrame,
    files_of,
    lens_for,
    posed_frame,
    report_left_out,
)
from dlama.datasets.text_tables import Row, nearest_in_time, pose_of, read_rows
from dlama.errors import FileError
from dlama.geometry.camera import Float64Array

LISTINGS = ("rgb.txt", "depth.txt", "groundtruth.txt")
NEAREST_S = 0.02
"""Seconds up to which a time stamp belongs to another (TUM's own associate.py has the same)."""
UNITS_PER_METRE = 5000.0
ADVICE = (
    "TUM's intrinsics are in no file of the set; its page names fx fy cx cy of freiburg1 as 517.3 516.5 318.6 255.3, "
    "freiburg2 520.9 521.0 325.1 249.7, freiburg3 535.4 539.2 320.1 247.6 with pixel_center 0.0"
)


def looks_like(root: Path) -> bool:
    """True where a folder holds all three listings."""
    return all((root / name).is_file() for name in LISTINGS)


def list_frames(scene: str, folder: Path, root: Path, camera: CameraOption) -> list[PosedFrame]:
    """The frames of one sequence. Raises FileError, CameraError."""
    lens = lens_for(folder, root, camera, ("camera.json",), ADVICE)
    color, depth, poses = (Timeline.read(folder / name, count) for name, count in zip(LISTINGS, (2, 2, 8)))
    frames = []
    for time, row in zip(color.times.tolist(), color.rows):
        depth_row, pose_row = depth.nearest(time), poses.nearest(time)
        if depth_row is not None and pose_row is not None:
            _, *numbers = pose_row.numbers("time tx ty tz qx qy qz qw", 8)
            pose = pose_of(pose_row.at(4), numbers[:3], numbers[3:])
            files = files_of(folder / row.words[1], folder / depth_row.words[1], lens, pose, UNITS_PER_METRE)
            frames.append(posed_frame(scene, Path(row.words[1]).stem, files))
    without = {f"without depth or a pose within {NEAREST_S:g} s": len(color.rows) - len(frames)}
    report_left_out(folder, frames, len(color.rows), without)
    return frames


@dataclass(frozen=True, eq=False)
class Timeline:
    """The lines of a listing in order of time."""

    times: Float64Array
    """Seconds, ascending."""
    rows: tuple[Row, ...]

    @classmethod
    def read(cls, path: Path, count: int) -> Timeline:
        """A listing of lines with `count` values, the time first; raises FileError."""
        rows: dict[float, Row] = {}
        for row in read_rows(path):
            row.need(count, "time and file name" if count == 2 else "time tx ty tz qx qy qz qw")
            time, *_ = [
                row.number(index) for index in range(count if count == 8 else 1)
            ]  # unused lines are checked too
            if time in rows:
                raise FileError(f"{row.at(0)}: the time {row.words[0]} stands in line {rows[time].line} too")
            rows[time] = row
        times = sorted(rows)
        return cls(np.array(times, np.float64), tuple(rows[time] for time in times))

    def nearest(self, time: float) -> Row | None:
        """The line nearest in time, the earlier of two as near; None if it is farther than NEAREST_S."""
        place = nearest_in_time(self.times, time, NEAREST_S)
        return None if place is None else self.rows[place]
