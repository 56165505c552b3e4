"""One run of one verb: files read and remembered, the result written with their hashes, one summary line printed."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from dlama.apps.options import Lens, Masking, Reading
from dlama.apps.terminal import stages, summary
from dlama.completion.pipeline import Completion
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array

LOG = logging.getLogger("dlama")
STAGES = 20
"""About as many as a job logs: the length of the bar."""


@dataclass
class Job:
    """What one run has read so far."""

    inputs: dict[str, Path] = field(default_factory=dict)
    intrinsics_from: str = ""
    summary: str = ""
    read_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def reading(self, *names: Path) -> Iterator[None]:
        """Files being read: told to the bar, and timed."""
        LOG.info("read %s", ", ".join(name.name for name in names))
        started = time.perf_counter()
        yield
        self.read_seconds += time.perf_counter() - started
        LOG.info("complete")

    def rgbd(self, image: Path, depth: Path, lens: Lens, reading: Reading) -> RGBD:
        """A picture, its depth and its camera."""
        from dlama.files.cameras import camera_for
        from dlama.files.rgbd import read_rgbd

        self.inputs |= {"image": image, "depth": depth} | ({"camera": lens.camera} if lens.camera else {})
        with self.reading(image, depth):
            rgbd = read_rgbd(image, depth, **lens.settings(), **reading.settings())
            _, self.intrinsics_from = camera_for(rgbd.camera.hw, image=image, **lens.settings())
        return rgbd

    def required_mask(self, path: Path, masking: Masking, role: str = "mask") -> BoolArray:
        """A mask, True = remove."""
        from dlama.files.pictures import read_mask

        self.inputs[role] = path
        with self.reading(path):
            return read_mask(path, **masking.settings())

    def mask(self, path: Path | None, masking: Masking, role: str = "mask") -> BoolArray | None:
        """A mask, where one is given."""
        return None if path is None else self.required_mask(path, masking, role)

    def pair(self, left: Path, right: Path, calib: Path) -> tuple[UInt8Array, UInt8Array, StereoRig]:
        """The pictures of a rectified pair and the cameras that took them."""
        from dlama.files.cameras import read_stereo_calib
        from dlama.files.pictures import read_color

        self.inputs |= {"left": left, "right": right, "calib": calib}
        self.intrinsics_from = f"--calib {calib.name}"
        with self.reading(left, right, calib):
            pictures = read_color(left), read_color(right)
            return *pictures, read_stereo_calib(calib, hw=pictures[0].shape[:2])

    def write(self, done: Completion, output: Path, shown: Path | None = None) -> None:
        """The result to its directory; the summary names it, or what is `shown` instead."""
        from dlama.files.results import write

        seconds = {"read": self.read_seconds}
        write(done, output, inputs=self.inputs, intrinsics_from=self.intrinsics_from, seconds=seconds)
        self.summary = summary(done, shown or output, time.perf_counter() - self.started)


@contextmanager
def job(title: str) -> Iterator[Job]:
    """A run under way: a bar while it lasts, its summary at the end."""
    with stages(title, STAGES):
        run = Job()
        yield run
    print(run.summary)
