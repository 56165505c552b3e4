"""Cases and protocols that cost nothing, importable by name so that they travel to other processes."""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset, Protocol, ViewTruth
from dlama.evaluation.protocols.methods import Measure, Method, ProtocolSettings, Scored
from dlama.evaluation.protocols.strips import strip
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, UInt8Array

LOG = "MADE_UP_LOG"
"""Environment variable with a file that gets a line for every run of the protocol."""
LEVELS = {"telea": 20.0, "layered": 10.0, "none": 60.0}
YAWS = (10.0, -10.0, 20.0, -20.0, 60.0, -60.0)


def truth(seed: int, side: int = 24) -> ViewTruth:
    """Noise before a wall."""
    rng = np.random.default_rng(seed)
    color = rng.integers(0, 255, (side, side, 3)).astype(np.uint8)
    frame = RGBD(color, np.full((side, side), 2 + seed % 3, np.float32), Camera.from_fov(side, side, 60))
    return ViewTruth(frame, frame)


def bad_truth(seed: int) -> ViewTruth:
    """A frame that cannot be read."""
    raise ValueError(f"frame {seed} is broken,\nso it is")


def made_up_dataset(scenes: int = 2, yaws: Sequence[float | None] = YAWS, protocol: Protocol = "vpi") -> Dataset:
    """Every scene with every yaw."""
    cases = tuple(
        Case(
            protocol,
            "toy",
            f"s{scene}",
            f"{yaw:+g}" if yaw else "frame",
            functools.partial(truth, 100 * scene + n),
            yaw,
        )
        for scene in range(scenes)
        for n, yaw in enumerate(yaws)
    )
    return Dataset("toy", "made-up", None, (), cases)


def protocol(truth: ViewTruth, method: Method, settings: ProtocolSettings) -> list[Scored]:
    """Numbers that depend on the case and the method, a panel, and one variant."""
    if os.environ.get(LOG):
        with Path(os.environ[LOG]).open("a") as stream:
            stream.write(f"{method.label} {os.getpid()} {os.environ.get('OMP_NUM_THREADS')}\n")
    if method.filler == "bad":
        raise RuntimeError(f"no such luck with {method.recipe}")
    worse = LEVELS.get(method.filler, 30.0) * (2 if method.recipe == "paper" else 1)
    level = worse + float(truth.source.color[0, 0, 0]) / 20
    measures = [
        Measure(region, modality, metric, value)
        for region in ("whole", "unseen", "mask")
        for modality in ("rgb", "depth")
        for metric, value in {
            "ssim": 1 - level / 200,
            "lpips": level / 150,
            "mse": level**2,
            "psnr": 40 - level / 5,
        }.items()
    ]
    extra = [
        Measure("whole", "rgb", "mask_ratio", level),
        Measure("outside", "rgb", "psnr", float("inf")),
        Measure("unseen", "depth_m", "mae", level / 100),
        Measure("whole", "time", "seconds", 0.25),
    ]
    changed = [one._replace(value=one.value * 1.5) for one in measures]
    shown = panel(truth, level)
    return [Scored((*measures, *extra), panel=shown), Scored(tuple(changed), "object,dilate=3")]


def panel(truth: ViewTruth, level: float) -> UInt8Array:
    """The truth, with noise for a fill."""
    color, depth = truth.source.color, truth.source.depth
    hole = np.zeros(depth.shape, bool)
    hole[4:12, 6:15] = True
    filled = np.where(hole[..., None], np.uint8(level), color)
    known = np.where(hole, 0, depth).astype(np.float32)
    return strip((color, color, filled, color), (depth, known, (depth * 1.1).astype(np.float32), depth), hole)


METHODS = tuple(Method(recipe, filler) for recipe in ("dlama", "paper") for filler in ("layered", "telea", "none"))
