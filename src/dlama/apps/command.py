"""The options of one command in; what was read by them, and the result, written and reported in one line, out."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlama.apps.options import Estimating, Lens, Masking, Reading, Report, Results
from dlama.apps.places import Inputs, check_folder_apart
from dlama.apps.pointing import mask_notes
from dlama.apps.terminal.output import Result, report_result, stages_bar
from dlama.errors import InputError
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs, mask_and_pointing

if TYPE_CHECKING:
    import dlama
    from dlama.apps.pointing import Pointing
    from dlama.geometry.rgbd import BoolArray, UInt8Array

STAGES = 20
"""About as many as a command logs: the length of the bar."""
SHOWN = 5e-4
"""The smallest share of a picture that the summary line names: 0.1 % when rounded."""


NO_ESTIMATE = Estimating()


@dataclass
class Command(JobInputs):
    """What one command has read so far; its Result takes what it has written."""

    result: Result = field(default_factory=Result)

    def check(
        self,
        output: Path,
        results: Results,
        read: Inputs,
        image: Path | None,
        *options: Mapping[str, Any],
        removes: bool = False,
    ) -> None:
        """OutputError and InputError for all that can be refused before anything is read: `output`, names, options.

        read: the files that are read, by their roles; image: the picture, whose size shows whether points lie in it.
        """
        check_folder_apart(output, read)
        given = {name: value for group in options for name, value in group.items()}
        check_options(given | results.settings(), image, removes)

    def rgbd(
        self, image: Path, depth: Path | None, lens: Lens, reading: Reading, estimating: Estimating = NO_ESTIMATE
    ) -> dlama.RGBD:
        """A picture, its depth (estimated, where there is no file) and its camera."""
        return self.read_picture(image, depth, lens.settings(), reading.settings() | estimating.settings())

    def scene(self, file: Path, depth: Path | None, options: Sequence[Any]) -> dlama.Scene:
        """A completed scene. InputError: a depth file, or options (those of a verb, by class) that say how a picture is read."""
        from dlama.files.scenes.scene_npz import read_scene

        if depth is not None:
            raise InputError(f"{file}: is a scene, which has its depth; {depth} does not apply to it")
        for one in options:
            for field_, value in vars(one).items():
                if value != getattr(type(one)(), field_):
                    raise InputError(f"`{field_}` does not apply to a scene ({file.name}); it is for pictures")
        self.inputs["scene"] = file
        with self.reading(file):
            return read_scene(file)

    def mask(self, path: Path, masking: Masking, picture: Path, role: str = "mask") -> BoolArray:
        """A mask of a picture, True = remove."""
        return self.read_mask_file(path, masking.settings(), picture, role)

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
        return self.find_pointed(rgbd, image, pointing.settings(), pointing.object_class)

    def left_mask(
        self, path: Path | None, masking: Masking, pointing: Pointing, left: Path
    ) -> BoolArray | Callable[[dlama.RGBD], BoolArray] | None:
        """The mask of the left picture of a pair: of its file, or found in the depth that the pair gives. InputError: both."""
        if not pointing.given:
            return self.optional_mask(path, masking, left)
        if path is not None:
            raise mask_and_pointing(path)
        return lambda rgbd: self.pointed(rgbd, pointing, left)

    def optional_mask(self, path: Path | None, masking: Masking, picture: Path, role: str = "mask") -> BoolArray | None:
        """A mask, where one is given."""
        return None if path is None else self.mask(path, masking, picture, role)

    def write(self, done: dlama.Completion, output: Path, results: Results, shown: Path | None = None) -> None:
        """The result to its directory; the line about it names that, or what is `shown` instead."""
        place = shown or output
        files = self.write_completion(done, output, **results.settings())
        line = summary_line(done.meta, place, self.seconds)
        self.result.add(line, **summary_values(done.meta, place, files))


@contextmanager
def command(verb: str, report: Report) -> Iterator[Command]:
    """A command under way: a bar while it lasts, its Result at the end."""
    with report_result(verb, report) as result, stages_bar(verb, STAGES, report):
        yield Command(result=result)


def summary_line(meta: dict[str, Any], place: object, seconds: float) -> str:
    """One line: where it lies, what share was unknown and why, which filler filled it, what to know of the mask, seconds.

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
    from dlama.perception.depth_scale import describe_depth_source

    ran = meta.get("notes", {}).get("guesses")
    how = f", filler {meta['filler']}" + (f" ({', '.join(ran)})" if ran else "")
    if estimate := meta.get("depth_estimate"):
        how += f", depth {describe_depth_source(estimate)}"
    if pointed := meta.get("object_mask"):
        how += mask_notes(pointed["candidate"], pointed["candidates"], pointed["notes"])
    return f"{place}: {unknown:.1%} was unknown{why}{how}, {seconds:.1f} s"


def summary_values(meta: dict[str, Any], place: Path, files: list[str]) -> dict[str, Any]:
    """The same, JSON-ready; shares view by view."""
    names = ("filler", "hole_share", "depth_only_share", "hole_share_by_type", "nothing_visible", "law_violations")
    values = {"recipe": meta["recipe"]["name"], **{name: meta[name] for name in names}}
    return {"output": str(place), "files": files, **values, "seconds_by_stage": meta["seconds"]}
