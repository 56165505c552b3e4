"""Stray Scanner recordings in (rgb.mp4, odometry.csv, camera_matrix.csv, depth/, confidence/); posed frames and cases out.

odometry.csv: timestamp, frame, x, y, z, qx, qy, qz, qw, in newer versions fx, fy, cx, cy too; a line for each picture of the
video. Poses are camera to world in metres; the app turns ARKit's axes into OpenCV's itself (OdometryEncoder.swift multiplies
with a turn by 180 degrees about x). depth/000000.png, of early versions .npy, in millimetres, confidence/000000.png 0 to 2. K is
for the video's pictures. Formats: github.com/strayrobots/scanner (format.md), github.com/kekeblom/StrayVisualizer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from dlama.datasets.posed.lenses import Lens, read_lens
from dlama.datasets.posed.posed_frames import Listed, levels_of_png, lidar_frame
from dlama.datasets.text_tables import Row, files_by_stem, holds, pose_of, read_rows
from dlama.errors import FileError
from dlama.files.rasters.depth import MILLIMETRES, read_depth
from dlama.files.rasters.video_frames import read_video_frame, video_times

VIDEO, ODOMETRY, MATRIX = "rgb.mp4", "odometry.csv", "camera_matrix.csv"
looks_like = holds(VIDEO, ODOMETRY, "depth")
BARE = ("x", "y", "z", "qx", "qy", "qz", "qw")
"""Columns of early versions, which wrote no head line."""


def list_frames(folder: Path) -> Listed:
    """The frames of one scene. Raises FileError, CameraError."""
    names, rows = _odometry(folder / ODOMETRY)
    shared = None if {"fx", "fy", "cx", "cy"} <= set(names) else replace(read_lens(folder / MATRIX), pixel_center=0.5)
    pictures = len(video_times(folder / VIDEO))
    depths, levels = files_by_stem(folder / "depth", (".png", ".npy")), files_by_stem(folder / "confidence", (".png",))
    for place, row in enumerate(rows):
        values = dict(zip(names, row.numbers(", ".join(names), len(names))))
        name = f"{int(values.get('frame', place)):06d}"
        if place >= pictures:
            yield name, "without a picture in the video"
            continue
        if name not in depths:
            yield name, "without depth"
            continue
        files = lidar_frame(
            (f"{folder / VIDEO}, picture {place}", str(depths[name])),
            partial(read_video_frame, folder / VIDEO, place),
            partial(read_depth, depths[name], depth_scale=MILLIMETRES),
            shared or Lens(row.at(0), (values["fx"], values["fy"], values["cx"], values["cy"]), 0.5),
            pose_of(row.at(0), [values[each] for each in BARE[:3]], [values[each] for each in BARE[3:]]),
            confidence=partial(levels_of_png, levels[name]) if name in levels else None,
        )
        yield name, files


def _odometry(path: Path) -> tuple[Sequence[str], list[Row]]:
    rows = read_rows(path, commas=True)
    if not rows:
        raise FileError(f"{path}: holds no line")
    names, rows = (rows[0].words, rows[1:]) if "x" in rows[0].words else (BARE, rows)
    missing = [name for name in BARE if name not in names]
    if missing:
        raise FileError(f"{path}:1: has no column {missing[0]}; {', '.join(BARE)} are expected")
    return names, rows
