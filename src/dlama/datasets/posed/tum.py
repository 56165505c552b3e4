"""TUM RGB-D sequences in (rgb.txt, depth.txt, groundtruth.txt); posed frames and the cases between them out.

Lines `time file` and `time tx ty tz qx qy qz qw` (camera to world, OpenCV axes, metres); # begins a remark. To each colour
picture belong the depth picture and the pose nearest in time, at most 0.02 s away. Depth: 16-bit PNG, 5000 units a metre.
The intrinsics are in no file of the set: give `camera`, or put a camera.json into the folder. ETH3D's SLAM sequences have them in
calibration.txt. Formats: cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats, eth3d.net/slam_documentation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.datasets.posed.lenses import CameraOption, lens_for
from dlama.datasets.posed.posed_frames import Listed, files_of
from dlama.datasets.text_tables import NEAREST_S, Row, holds, nearest_in_time, pose_of, read_rows
from dlama.errors import FileError
from dlama.geometry.camera import Float64Array

LISTINGS = ("rgb.txt", "depth.txt", "groundtruth.txt")
looks_like = holds(*LISTINGS)
ADVICE = (
    "TUM's intrinsics are in no file of the set; its page names fx fy cx cy of freiburg1 as 517.3 516.5 318.6 255.3, "
    "freiburg2 520.9 521.0 325.1 249.7, freiburg3 535.4 539.2 320.1 247.6 with pixel_center 0.0"
)


def list_frames(folder: Path, root: Path, camera: CameraOption) -> Listed:
    """The frames of one sequence. Raises FileError, CameraError."""
    lens = lens_for(folder, root, camera, ("camera.json", "calibration.txt"), ADVICE)
    (times, rows), *others = (_listing(folder / name, count) for name, count in zip(LISTINGS, (2, 2, 8)))
    for time, row in zip(times.tolist(), rows):
        color = folder / row.words[1]
        places = [nearest_in_time(each, time) for each, _ in others]
        lacks = next((what for what, place in zip(("depth", "a pose"), places) if place is None), None)
        if lacks is not None:
            yield color.stem, f"without {lacks} within {NEAREST_S:g} s"
            continue
        depth, pose = (each[place] for (_, each), place in zip(others, places) if place is not None)
        _, *numbers = pose.numbers("time tx ty tz qx qy qz qw", 8)
        at = pose_of(pose.at(4), numbers[:3], numbers[3:])
        yield color.stem, files_of(color, folder / depth.words[1], lens, at, units=5000.0)


def _listing(path: Path, count: int) -> tuple[Float64Array, list[Row]]:
    """The times of a listing, s, ascending, and its lines of `count` values, the time first; raises FileError."""
    rows: dict[float, Row] = {}
    for row in read_rows(path):
        row.need(count, "time and file name" if count == 2 else "time tx ty tz qx qy qz qw")
        time, *_ = [row.number(index) for index in range(count if count == 8 else 1)]  # unused lines are checked too
        if time in rows:
            raise FileError(f"{row.at(0)}: the time {row.words[0]} stands in line {rows[time].line} too")
        rows[time] = row
    times = sorted(rows)
    return np.array(times), [rows[time] for time in times]
