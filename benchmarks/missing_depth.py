"""Depth that a camera did not give, completed along the colours, beside OpenCV's fills; prints one table.

    python benchmarks/missing_depth.py ../shared/data/kitchen_sequence --first 2 --every 3
    python benchmarks/missing_depth.py worlds --count 24

A data set of real frames: depth is hidden in a strip inside the border of what was measured (as where the depth camera sees less
than the colour camera) and in 22 ellipses astride depth edges (as on what is black or shiny), and compared with itself; 3 px
beside depth edges, where a Kinect's depth is off, do not count. `worlds`: rooms and streets of procedural worlds through the
noise of a Kinect and of a stereo matcher, compared with the exact depth where these gave none.

Right: the share within 5 %. Gross: the share off by more than 20 %. Both are means over frames.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import cv2
import numpy as np

import dlama
from dlama.datasets.layouts import open_dataset
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array
from dlama.training.data.sensors import stereo_matcher, structured_light
from dlama.worlds.dataset import world

STRIPS = (22, 25, 20, 44)
"""Pixels hidden at the top, the bottom, the left and the right of what was measured."""
ELLIPSES = 22
EDGE = 0.1
"""Step of the logarithm of depth (Laplacian) that is an edge."""


class Task(NamedTuple):
    """A frame without some of its depth, and what it is compared with."""

    frame: RGBD
    truth: Float32Array
    regions: dict[str, BoolArray]


def hidden(frame: RGBD, seed: int) -> Task:
    """A real frame with more of its depth missing."""
    known = (frame.depth > 0) & np.isfinite(frame.depth)
    rows, columns = np.nonzero(known)
    top, bottom, left, right = STRIPS
    inside = np.zeros_like(known)
    inside[rows.min() + top : rows.max() + 1 - bottom, columns.min() + left : columns.max() + 1 - right] = True
    log = np.where(known, np.log(np.maximum(frame.depth, 1e-3)), 0).astype(np.float32)
    edge = np.abs(cv2.Laplacian(log, cv2.CV_32F)) > EDGE
    rng, drawn = np.random.default_rng(seed), np.zeros(known.shape, np.uint8)
    places = np.argwhere(edge & known)
    for y, x in places[rng.integers(len(places), size=ELLIPSES)] + rng.integers(-15, 16, (ELLIPSES, 2)):
        axes = tuple(map(int, rng.integers(6, 26, 2)))
        cv2.ellipse(drawn, (int(x), int(y)), axes, float(rng.uniform(0, 180)), 0, 360, 1, -1)
    sure = known & (cv2.dilate((edge | ~known).astype(np.uint8), np.ones((7, 7), np.uint8)) == 0)
    left_over = np.where(~inside | (drawn > 0), np.float32(0), frame.depth)
    regions = {"strip": sure & ~inside, "ellipses": sure & inside & (drawn > 0)}
    return Task(dataclasses.replace(frame, depth=left_over), frame.depth, regions)


def of_worlds(count: int) -> Iterator[Task]:
    """Worlds (seeds 700 on) seen by a Kinect and by a stereo matcher."""
    for number in range(count):
        kind = "room" if number % 2 else "street"
        made = world(700 + number, kind=kind, antialias=False)
        exact = made.frame(made.camera(0, 256))
        for name, sensor in (("Kinect", structured_light), ("matcher", stereo_matcher)):
            frame = sensor(exact, np.random.default_rng(number))
            missing = (frame.depth == 0) & np.isfinite(exact.depth)
            if missing.any():
                yield Task(frame, exact.depth, {f"{kind}s, {name}": missing})


def by_dlama(frame: RGBD) -> Float32Array:
    """What `dlama.view` gives at the frame's own camera."""
    return dlama.view(frame, yaw=0).view.depth


def by_opencv(method: int) -> Callable[[RGBD], Float32Array]:
    """OpenCV's fills on 16-bit millimetres; far counts as 65 m."""

    def fill(frame: RGBD) -> Float32Array:
        millimetres = (np.minimum(frame.depth, 65) * 1000).astype(np.uint16)
        return cv2.inpaint(millimetres, frame.missing.astype(np.uint8), 5, method).astype(np.float32) / 1000

    return fill


METHODS: dict[str, Callable[[RGBD], Float32Array]] = {
    "dlama": by_dlama,
    "nearest known pixel": lambda frame: fill_with_nearest(frame.depth, ~frame.missing),
    "OpenCV Telea": by_opencv(cv2.INPAINT_TELEA),
    "OpenCV Navier-Stokes": by_opencv(cv2.INPAINT_NS),
}


def table(tasks: list[Task]) -> str:
    """Rows of Markdown, a method each."""
    names = list(dict.fromkeys(name for task in tasks for name in task.regions))
    head = [f"{name}: {what}" for name in names for what in ("right", "gross")]
    lines = ["| method | " + " | ".join(head) + " | s |", "|---" * (len(head) + 2) + "|"]
    for method, complete in METHODS.items():
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
        started = time.process_time()
        for task in tasks:
            filled = np.clip(complete(task.frame), 1e-3, 1e3)
            error = np.abs(np.log(filled / np.clip(task.truth, 1e-3, 1e3)))
            for name, where in task.regions.items():
                if where.any():
                    found[name].append(((error[where] < 0.05).mean(), (error[where] > 0.2).mean()))
        seconds = (time.process_time() - started) / len(tasks)
        numbers = [f"{value:.3f}" for name in names for value in np.mean(found[name], axis=0)]
        lines.append(f"| {method} | " + " | ".join(numbers) + f" | {seconds:.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", help="a folder of frames with depth, or `worlds`")
    parser.add_argument("--first", type=int, default=0, help="number of the first frame")
    parser.add_argument("--every", type=int, default=1, help="every so many frames")
    parser.add_argument("--count", type=int, default=24, help="worlds")
    options = parser.parse_args()
    if options.dataset == "worlds":
        tasks = list(of_worlds(options.count))
    else:
        frames = open_dataset(options.dataset).frames[options.first :: options.every]
        tasks = [hidden(frame.load(), number) for number, frame in enumerate(frames)]
    print(f"{options.dataset}, {len(tasks)} frames\n")
    print(table(tasks))


if __name__ == "__main__":
    main()
