"""The files of one job in; what was read from them, and the result written with their hashes and told in one line, out."""

from __future__ import annotations

import logging
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlama.apps.options import Estimating, Lens, Masking, Only, Reading, Report, names_in
from dlama.apps.terminal.output import Result, reported, stages_bar

if TYPE_CHECKING:
    import dlama
    from dlama.apps.pointing import Pointing
    from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array

LOG = logging.getLogger("dlama")
STAGES = 20
"""About as many as a job logs: the length of the bar."""
SHOWN = 5e-4
"""The smallest share of a picture that the summary line names: 0.1 % when rounded."""


NO_ESTIMATE = Estimating()


@dataclass
class Job:
    """What one job has read so far; its Result takes what it has written."""

    result: Result = field(default_factory=Result)
    inputs: dict[str, Path] = field(default_factory=dict)
    intrinsics_from: str = ""
    read_seconds: float = 0.0
    object_mask: dict[str, Any] = field(default_factory=dict)
    """How the mask was found, where it was pointed at."""
    started: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        """Since the job began."""
        return time.perf_counter() - self.started

    @contextmanager
    def reading(self, *names: Path) -> Iterator[None]:
        """Files being read: shown in the bar, and timed."""
        LOG.info("read %s", ", ".join(name.name for name in names))
        started = time.perf_counter()
        yield
        self.read_seconds += time.perf_counter() - started
        LOG.info("complete")

    def rgbd(
        self, image: Path, depth: Path | None, lens: Lens, reading: Reading, estimating: Estimating = NO_ESTIMATE
    ) -> dlama.RGBD:
        """A picture, its depth (estimated, where there is no file) and its camera."""
        from dlama.files.cameras import camera_for
        from dlama.files.rasters.images import picture_hw
        from dlama.files.rgbd import read_rgbd

        self.inputs |= {"image": image} | ({"camera": lens.camera} if lens.camera else {})
        options = reading.settings() | estimating.settings()
        if depth is None:
            with self.reading(image):
                rgbd = read_rgbd(image, **lens.settings(), **options)
            self.intrinsics_from = (rgbd.estimate or {})["field_of_view"]["from"]
            return rgbd
        self.inputs["depth"] = depth
        with self.reading(image, depth):
            camera, self.intrinsics_from = camera_for(picture_hw(image), image=image, **lens.settings())
            return read_rgbd(image, depth, camera=camera, **options)

    def mask(self, path: Path, masking: Masking, role: str = "mask") -> BoolArray:
        """A mask, True = remove."""
        from dlama.files.rasters.pictures import read_mask

        self.inputs[role] = path
        with self.reading(path):
            return read_mask(path, **masking.settings())

    def picture(
        self,
        image: Path,
        depth: Path | None,
        lens: Lens,
        reading: Reading,
        estimating: Estimating,
        *,
        needs_depth: bool,
    ) -> dlama.RGBD | UInt8Array:
        """As `rgbd`; the colours alone where there is no depth file, and none is needed."""
        from dlama.files.rasters.pictures import read_color

        if depth is not None or needs_depth:
            return self.rgbd(image, depth, lens, reading, estimating)
        self.inputs["image"] = image
        with self.reading(image):
            return read_color(image)

    def pointed(self, rgbd: dlama.RGBD, pointing: Pointing, image: Path) -> BoolArray:
        """The mask of what is pointed at in a picture, read from `image`; how it was found goes into meta.json."""
        found = pointing.find(rgbd, image)
        self.object_mask = {
            **pointing.settings(),
            "masker": found.masker,
            "candidate": found.chosen,
            "notes": list(found.notes),
        }
        return found.mask

    def left_mask(
        self, path: Path | None, masking: Masking, pointing: Pointing, left: Path
    ) -> BoolArray | Callable[[dlama.RGBD], BoolArray] | None:
        """The mask of the left picture of a pair: of its file, or found in the depth that the pair gives. InputError: both."""
        from dlama.errors import InputError

        if not pointing.given:
            return self.optional_mask(path, masking)
        if path is not None:
            raise InputError(f"a mask file ({path}) and clicks or a box were both given; one of them is wanted")
        return lambda rgbd: self.pointed(rgbd, pointing, left)

    def optional_mask(self, path: Path | None, masking: Masking, role: str = "mask") -> BoolArray | None:
        """A mask, where one is given."""
        return None if path is None else self.mask(path, masking, role)

    def optional_disparity(self, path: Path | None, scale: float | None) -> Float32Array | None:
        """A disparity, where one is given."""
        from dlama.errors import InputError
        from dlama.files.rasters.depth import read_disparity

        if path is None:
            if scale is not None:
                raise InputError("disparity_scale is given without disparity; the file it belongs to is wanted too")
            return None
        self.inputs["disparity"] = path
        with self.reading(path):
            return read_disparity(path, scale=scale)

    def pair(self, left: Path, right: Path, calib: Path) -> tuple[UInt8Array, UInt8Array, dlama.StereoRig]:
        """The pictures of a rectified pair and the cameras that took them."""
        from dlama.files.cameras import read_stereo_calib
        from dlama.files.rasters.pictures import read_color

        self.inputs |= {"left": left, "right": right, "calib": calib}
        self.intrinsics_from = f"calib {calib.name}"
        with self.reading(left, right, calib):
            pictures = read_color(left), read_color(right)
            return *pictures, read_stereo_calib(calib, hw=pictures[0].shape[:2])

    def write(self, done: dlama.Completion, output: Path, only: Only = None, shown: Path | None = None) -> None:
        """The result, or what --only names, to its directory; the line about it names that, or what is `shown` instead."""
        if self.object_mask:
            done.meta["object_mask"] = self.object_mask
        from dlama.files.results.completion import file_names, write

        place, names = shown or output, names_in(only)
        seconds = {"read": self.read_seconds}
        write(done, output, only=names, inputs=self.inputs, intrinsics_from=self.intrinsics_from, seconds=seconds)
        line = summary_line(done.meta, place, self.seconds)
        self.result.add(line, **summary_values(done.meta, place, file_names(done, names)))


@contextmanager
def job(verb: str, report: Report) -> Iterator[Job]:
    """A job under way: a bar while it lasts, its Result at the end."""
    with reported(verb, report) as result, stages_bar(verb, STAGES, report):
        yield Job(result)


def summary_line(meta: dict[str, Any], place: object, seconds: float) -> str:
    """One line: where it lies, what share was unknown and why, which filler filled it, how long it took.

    Shares are means over the views. Pixels that lacked only depth have a share of their own; they are of type `sensor`.
    """
    unknown, depth_only = (statistics.fmean(meta[name]) for name in ("hole_share", "depth_only_share"))
    views = meta["hole_share_by_type"]
    kinds = {name: statistics.fmean(view[name] for view in views) for name in views[0]}
    kinds["sensor"] -= depth_only
    shares = [f"{name.replace('_', ' ')} {share:.1%}" for name, share in kinds.items() if share >= SHOWN]
    why = f" ({', '.join(shares)})" if shares else ""
    if depth_only >= SHOWN:
        why += f", {depth_only:.1%} lacked only depth"
    if meta["nothing_visible"]:
        why = "; nothing of the scene is visible from there, so nothing could be filled"
    return f"{place}: {unknown:.1%} was unknown{why}, filler {meta['filler']}, {seconds:.1f} s"


def summary_values(meta: dict[str, Any], place: Path, files: list[str]) -> dict[str, Any]:
    """The same, JSON-ready; shares view by view."""
    names = ("filler", "hole_share", "depth_only_share", "hole_share_by_type", "nothing_visible", "law_violations")
    values = {"recipe": meta["recipe"]["name"], **{name: meta[name] for name in names}}
    return {"output": str(place), "files": files, **values, "seconds_by_stage": meta["seconds"]}
