"""The files of one job in; what was read from them, and the result written with their hashes and told in one line, out."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlama.apps.options import Lens, Masking, Reading, Report
from dlama.apps.terminal import Result, reported, stages_bar

if TYPE_CHECKING:
    import dlama
    from dlama.geometry.rgbd import BoolArray, UInt8Array

LOG = logging.getLogger("dlama")
STAGES = 20
"""About as many as a job logs: the length of the bar."""


@dataclass
class Job:
    """What one job has read so far; its Result takes what it has written."""

    result: Result = field(default_factory=Result)
    inputs: dict[str, Path] = field(default_factory=dict)
    intrinsics_from: str = ""
    read_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def reading(self, *names: Path) -> Iterator[None]:
        """Files being read: shown in the bar, and timed."""
        LOG.info("read %s", ", ".join(name.name for name in names))
        started = time.perf_counter()
        yield
        self.read_seconds += time.perf_counter() - started
        LOG.info("complete")

    def rgbd(self, image: Path, depth: Path, lens: Lens, reading: Reading) -> dlama.RGBD:
        """A picture, its depth and its camera."""
        from dlama.files.cameras import camera_for
        from dlama.files.images import picture_hw
        from dlama.files.rgbd import read_rgbd

        self.inputs |= {"image": image, "depth": depth} | ({"camera": lens.camera} if lens.camera else {})
        with self.reading(image, depth):
            camera, self.intrinsics_from = camera_for(picture_hw(image), image=image, **lens.settings())
            return read_rgbd(image, depth, camera=camera, **reading.settings())

    def mask(self, path: Path, masking: Masking, role: str = "mask") -> BoolArray:
        """A mask, True = remove."""
        from dlama.files.pictures import read_mask

        self.inputs[role] = path
        with self.reading(path):
            return read_mask(path, **masking.settings())

    def optional_mask(self, path: Path | None, masking: Masking, role: str = "mask") -> BoolArray | None:
        """A mask, where one is given."""
        return None if path is None else self.mask(path, masking, role)

    def pair(self, left: Path, right: Path, calib: Path) -> tuple[UInt8Array, UInt8Array, dlama.StereoRig]:
        """The pictures of a rectified pair and the cameras that took them."""
        from dlama.files.cameras import read_stereo_calib
        from dlama.files.pictures import read_color

        self.inputs |= {"left": left, "right": right, "calib": calib}
        self.intrinsics_from = f"--calib {calib.name}"
        with self.reading(left, right, calib):
            pictures = read_color(left), read_color(right)
            return *pictures, read_stereo_calib(calib, hw=pictures[0].shape[:2])

    def write(self, done: dlama.Completion, output: Path, shown: Path | None = None) -> None:
        """The result to its directory; the line about it names that, or what is `shown` instead."""
        from dlama.files.results import write

        place = shown or output
        seconds = {"read": self.read_seconds}
        write(done, output, inputs=self.inputs, intrinsics_from=self.intrinsics_from, seconds=seconds)
        line = summary_line(done.meta, place, time.perf_counter() - self.started)
        self.result.add(line, **summary_values(done.meta, place, sorted_files(output)))


@contextmanager
def job(verb: str, report: Report) -> Iterator[Job]:
    """A job under way: a bar while it lasts, its Result at the end."""
    with reported(verb, report) as result, stages_bar(verb, STAGES, report):
        yield Job(result)


def sorted_files(folder: Path) -> list[str]:
    """The files under a folder, relative to it."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def mean_shares(meta: dict[str, Any]) -> dict[str, float]:
    """Hole type -> its share of the picture, mean over the views."""
    views = meta["hole_share_by_type"]
    return {name: sum(view[name] for view in views) / len(views) for name in views[0]}


def summary_line(meta: dict[str, Any], place: object, seconds: float) -> str:
    """One line: where it lies, what share was unknown and why, which filler filled it, how long it took."""
    kinds = mean_shares(meta)
    shares = [f"{name.replace('_', ' ')} {share:.1%}" for name, share in kinds.items() if share >= 5e-4]
    why = f" ({', '.join(shares)})" if shares else ""
    if meta["nothing_visible"]:
        why = "; nothing of the scene is visible from there, so nothing could be filled"
    return f"{place}: {sum(kinds.values()):.1%} was unknown{why}, filler {meta['filler']}, {seconds:.1f} s"


def summary_values(meta: dict[str, Any], place: Path, files: list[str]) -> dict[str, Any]:
    """The same, JSON-ready."""
    told = ("filler", "hole_share", "hole_share_by_type", "nothing_visible", "law_violations")
    named = {"recipe": meta["recipe"]["name"], **{key: meta[key] for key in told}}
    return {"output": str(place), "files": files, **named, "seconds_by_stage": meta["seconds"]}
