"""A data set in; findings on its frames, their poses, its stereo pairs and its removals out."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from dlama.datasets.frames import Dataset, Frame, RemovalTruth, StereoTruth
from dlama.datasets.layouts import open_dataset
from dlama.datasets.posed.posed_frames import LOG
from dlama.datasets.posed.view_pairs import NoPairsError
from dlama.errors import InputError, format_count
from dlama.geometry.rgbd import RGBD
from dlama.perception.diagnosis.finding import Finding, Observed
from dlama.perception.diagnosis.odd_frames import check_sizes, compare_frames
from dlama.perception.diagnosis.poses import SmallFrame, shrink
from dlama.perception.diagnosis.rgbd_checks import describe_frame, run_checks
from dlama.perception.diagnosis.stereo_pair import check_pair
from dlama.workers.progress import log_messages

SCENES, FRAMES, CASES = 3, 6, 3
"""At most so many scenes, frames in a row of each, and stereo or removal cases are looked at."""
COMPARED = 100
"""At most so many frames of a scene are compared with their neighbours."""
Found = tuple[list[Finding], str, list[str]]
"""Findings, how the inputs are called, and what was made of them."""


def examine_dataset(root: Path, layout: str | None, options: Mapping[str, Any]) -> Found:
    """Findings on the frames, stereo pairs and removals of a data set; how it is called, and what was made of it."""
    dataset, found = _open(root, layout, options)
    examined: list[RGBD] = []
    for scene in list(dict.fromkeys(frame.scene for frame in dataset.frames))[:SCENES]:
        noted, rgbd = examine_scene([frame for frame in dataset.frames if frame.scene == scene])
        found, examined = [*found, *noted], [*examined, rgbd]
    for case in (*dataset.of("sii")[:CASES], *dataset.of("ori")[:CASES]):
        truth = case.load()
        if isinstance(truth, StereoTruth):
            noted = check_pair(truth.left, truth.right, truth.rig.doffs)
            found += [replace(each, what=f"{case.scene}: {each.what}") for each in noted]
        elif isinstance(truth, RemovalTruth):
            name = f"{case.scene}/{case.frame}"
            found += run_checks(Observed.of(truth.source, (name, name, f"{name}, mask"), truth.mask))
    found = list({finding.line: finding for finding in found}.values())
    counts = [format_count(len(dataset.frames), "frame"), format_count(len(dataset.cases), "case")]
    seen = describe_frame(examined[0]) if examined else []
    return found, root.resolve().name, [f"layout {dataset.layout}", *counts, *seen]


def _open(root: Path, layout: str | None, options: Mapping[str, Any]) -> tuple[Dataset, list[Finding]]:
    """The data set, also where no case can be made of its frames; what its reader logs (frames left out) are notes."""
    noted, found = list[str](), list[Finding]()
    try:
        with log_messages(noted.append, LOG, logging.getLogger("dlama.kernels")):
            dataset = open_dataset(root, layout, **options)
    except NoPairsError as error:
        dataset = error.dataset
        if error.turned:
            found.append(Finding("no-overlap", "fault", 0.9, str(error)))
    return dataset, [*(Finding("frames", "note", 1.0, note) for note in noted), *found]


def examine_scene(frames: Sequence[Frame]) -> tuple[list[Finding], RGBD]:
    """Findings on the frames of a scene, those that cannot be read among them; and the first frame in a row that can. The
    reader's error where none can."""
    row, scene = frames_in_a_row(frames), frames[0].scene
    spread = np.linspace(0, len(frames) - 1, min(len(frames), COMPARED)).round().astype(int)
    small, sizes, unread = _look_at({name_of(each): each for each in (*(frames[place] for place in spread), *row)})
    if small.keys().isdisjoint(map(name_of, row)):
        start = next(place for place in spread if name_of(frames[place]) in small)
        row = list(frames[start : start + FRAMES])
    first = next(each for each in row if name_of(each) in small)
    rgbd, name = first.load(), name_of(first)
    found = run_checks(Observed.of(rgbd, (name, name, name))) + check_sizes(sizes, scene)
    of_poses = compare_frames(small, list(map(name_of, row)), scene)
    if any(each.check == "depth-scale" and each.what.startswith(f"{name}:") for each in of_poses):
        found = [each for each in found if each.check != "depth-scale"]
    return [*unread, *found, *of_poses], rgbd


def _look_at(
    frames: Mapping[str, Frame],
) -> tuple[dict[str, SmallFrame], dict[str, tuple[int, int]], list[Finding]]:
    """The frames by their names: small; their heights and widths; and findings on those that cannot be read. The reader's error
    where none can."""
    small, sizes, errors = dict[str, SmallFrame](), dict[str, tuple[int, int]](), list[InputError]()
    for name, each in frames.items():
        try:
            frame = each.load()
            small[name], sizes[name] = shrink(frame), frame.camera.hw
        except InputError as error:
            errors.append(error)
    if errors and not small:
        raise errors[0]
    return small, sizes, [Finding("reading", "fault", 1.0, error.marked) for error in errors]


def name_of(frame: Frame) -> str:
    """How findings call a frame."""
    return f"{frame.scene}/{frame.name}"


def frames_in_a_row(frames: Sequence[Frame]) -> list[Frame]:
    """Some of a scene's frames, neighbours in a row: by yaw about 0 where they have one, else from the middle of the listing."""
    by_yaw = {frame.yaw: frame for frame in frames if frame.yaw is not None}
    if all(frame.yaw is not None for frame in frames):
        return [by_yaw[yaw] for yaw in sorted(sorted(by_yaw, key=abs)[:FRAMES])]
    start = max(0, (len(frames) - FRAMES) // 2)
    return list(frames[start : start + FRAMES])
