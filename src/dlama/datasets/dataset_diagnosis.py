"""The folder of a data set, or a scene.npz, in; what is wrong with its frames, pairs and poses, and what was understood, out."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Dataset, Frame, RemovalTruth, StereoTruth
from dlama.datasets.layouts import detect, open_dataset
from dlama.datasets.posed.posed_frames import CameraOption
from dlama.datasets.posed.scene_file import LAYOUT as SCENE
from dlama.datasets.posed.scene_file import is_scene_file
from dlama.datasets.posed.view_pairs import LOG, NoPairsError
from dlama.errors import InputError, format_count
from dlama.geometry.rgbd import RGBD, BoolArray, describe_depth_range
from dlama.perception.diagnosis.finding import Finding, Observed, understood
from dlama.perception.diagnosis.landing import SmallFrame, shrink
from dlama.perception.diagnosis.lens import check_lens
from dlama.perception.diagnosis.odd_frames import find_odd_frames
from dlama.perception.diagnosis.poses import check_poses
from dlama.perception.diagnosis.rgbd_checks import run_checks
from dlama.perception.diagnosis.stereo_pair import check_pair
from dlama.workers.progress import log_messages

SCENES, FRAMES, CASES = 3, 6, 3
"""At most so many scenes, frames in a row of each, and stereo or removal cases are looked at."""
COMPARED = 100
"""At most so many frames of a scene are compared with their neighbours."""


def diagnose_dataset(root: Path, layout: str | None = None, camera: CameraOption = None) -> list[Finding]:
    """Findings on a data set; the last one says what was understood. A folder that cannot be read is a finding, too."""
    try:
        dataset, found = _open(root, layout, camera)
        scenes = list(dict.fromkeys(frame.scene for frame in dataset.frames))[:SCENES]
        shown: list[RGBD] = []
        for scene in scenes:
            noted, first = _of_scene([frame for frame in dataset.frames if frame.scene == scene])
            found += noted
            shown.append(first)
        for each in _of_cases(dataset):
            found += each
    except InputError as error:
        return [Finding("reading", "fault", 1.0, str(error))]
    found = list({finding.line: finding for finding in found}.values())
    parts = [
        f"layout {dataset.layout}",
        format_count(len(dataset.frames), "frame"),
        format_count(len(dataset.cases), "case"),
    ]
    if shown:
        size = shown[0].camera
        parts += [f"{size.width}x{size.height}", f"{size.fov_deg:.3g} degrees wide"]
        parts.append(f"depth {describe_depth_range(shown[0].depth)}")
    return [*found, understood(root.name, parts, found)]


def _of_scene(frames: Sequence[Frame]) -> tuple[list[Finding], RGBD]:
    """Findings on the frames of a scene, each read once, and the first frame in a row."""
    scene, chosen = frames[0].scene, frames_in_a_row(frames)
    row: dict[str, RGBD] = {}
    small: dict[str, SmallFrame] = {}
    for frame in {each.name: each for each in (*spread_frames(frames), *chosen)}.values():
        read = frame.load()
        small[f"{scene}/{frame.name}"] = shrink(read)
        if frame in chosen:
            row[frame.name] = read
    in_a_row = [row[frame.name] for frame in chosen]
    first, name = in_a_row[0], f"{scene}/{chosen[0].name}"
    found = check_poses(in_a_row, scene)
    if all(each.severity != "fault" for each in found):
        # one odd frame also makes frames in a row fit badly, or changes their brightness
        found = find_odd_frames(list(small.values()), list(small)) or found
    odd_scale = any(each.check == "depth-scale" and each.what.startswith(f"{name}:") for each in found)
    of_first = [each for each in _of_picture(first, name) if not (odd_scale and each.check == "depth-scale")]
    return [*of_first, *found], first


def spread_frames(frames: Sequence[Frame]) -> list[Frame]:
    """All frames of a scene, or as many as are compared with each other, evenly."""
    return [frames[place] for place in np.linspace(0, len(frames) - 1, min(len(frames), COMPARED)).round().astype(int)]


def frames_in_a_row(frames: Sequence[Frame]) -> list[Frame]:
    """Some of a scene's frames, neighbours in a row: by yaw about 0 where they have one, else from the middle of the listing."""
    if all(frame.yaw is not None for frame in frames):
        unlike = {frame.yaw: frame for frame in frames}
        near = sorted(unlike, key=lambda yaw: abs(yaw or 0))[:FRAMES]
        return [unlike[yaw] for yaw in sorted(near, key=lambda yaw: yaw or 0)]
    start = max(0, (len(frames) - FRAMES) // 2)
    return list(frames[start : start + FRAMES])


def _open(root: Path, layout: str | None, camera: CameraOption) -> tuple[Dataset, list[Finding]]:
    """The data set, also where no case can be made of its frames; what its reader logs (frames left out) are notes."""
    noted: list[str] = []
    try:
        with log_messages(noted.append, LOG, logging.getLogger("dlama.kernels")):
            dataset, found = open_dataset(root, layout, camera=camera), list[Finding]()
    except NoPairsError as error:
        name = layout or (SCENE if is_scene_file(root) else detect(root))
        stands_still = len({frame.world_from_cam.tobytes() for frame in error.frames}) == 1
        found = [] if stands_still else [Finding("no-overlap", "fault", 0.9, str(error))]
        dataset = Dataset(root.name, name, root, error.frames, ())
    return dataset, [*(Finding("frames", "note", 1.0, note) for note in noted), *found]


def _of_picture(frame: RGBD, name: str, mask: BoolArray | None = None) -> list[Finding]:
    seen = Observed(frame.color, frame.depth.astype(np.float64), 1.0, frame.camera, mask, (name, name, f"{name}, mask"))
    found = check_lens(frame.camera) + run_checks(seen)
    return [replace(each, mend="check the unit of depth") if each.check == "depth-scale" else each for each in found]


def _of_cases(dataset: Dataset) -> Iterator[list[Finding]]:
    """Of the first stereo pairs and removals."""
    for case in (*dataset.of("sii")[:CASES], *dataset.of("ori")[:CASES]):
        truth = case.load()
        if isinstance(truth, StereoTruth):
            noted = check_pair(truth.left, truth.right, truth.rig.doffs)
            yield [replace(each, what=f"{case.scene}: {each.what}") for each in noted]
        elif isinstance(truth, RemovalTruth):
            yield _of_picture(truth.source, f"{case.scene}/{case.frame}", truth.mask)
