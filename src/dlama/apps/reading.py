"""The options of one command in; what was read by them, and the result, written and reported in one line, out."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import dlama
from dlama.apps.options import Estimating, Lens, Masking, Pointing, Reading, Results, changed_options
from dlama.apps.places import Inputs, check_folder_apart
from dlama.apps.terminal.flags import with_flags
from dlama.apps.terminal.output import SHOWN, Result
from dlama.errors import InputError, OutputError
from dlama.files.rasters.images import ADDRESS
from dlama.files.rasters.pictures import read_color, write_color, write_mask
from dlama.files.results.estimated_depth import FILES, write_depth
from dlama.files.results.preview import tint
from dlama.files.scenes.scene_npz import read_scene
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, describe_depth_range
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs, find_pointed
from dlama.jobs.parameters import mask_and_pointing
from dlama.perception.depth_scale import RULES, describe_depth_source

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
        pair: bool = False,
    ) -> None:
        """OutputError and InputError for all that can be refused before anything is read: `output`, names, options.

        read: the files that are read, by their roles; image: the picture, whose size shows whether points lie in it.
        """
        if ADDRESS.match(str(output)):
            raise OutputError(f"`output` is {output}; a directory is expected, addresses are for `dlama batch` alone")
        check_folder_apart(output, read)
        self.check_options(image, *options, results.settings(), removes=removes, pair=pair)

    def check_options(
        self, image: Path | None, *options: Mapping[str, Any], removes: bool = True, pair: bool = False
    ) -> None:
        """InputError for options that cannot be, held against the size of a picture."""
        check_options({name: value for group in options for name, value in group.items()}, image, removes, pair)

    def rgbd(
        self, image: Path, depth: Path | None, lens: Lens, reading: Reading, estimating: Estimating = NO_ESTIMATE
    ) -> dlama.RGBD:
        """A picture, its depth (estimated, where there is no file) and its camera."""
        return self.read_picture(image, depth, lens.settings(), reading.settings() | estimating.settings())

    def refuse_of_pictures(
        self, given: Path, kind: str, depth: Path | None, options: Sequence[Any], taken: Sequence[str] = ()
    ) -> None:
        """InputError: a depth file, or options (those of a verb, by class; `taken` are not looked at) that say how a picture is
        read, with what is none but `kind`."""
        if depth is not None:
            raise InputError(f"{given}: is {kind}, which has its depth; {depth} does not apply to it")
        for one in options:
            for name in changed_options(one):
                if name not in taken:
                    raise InputError(f"`{name}` does not apply to {kind} ({given.name or given}); it is for pictures")

    def scene(self, file: Path, depth: Path | None, options: Sequence[Any]) -> dlama.Scene:
        """A completed scene. InputError: a depth file, or options (those of a verb, by class) that say how a picture is read."""
        self.refuse_of_pictures(file, "a scene", depth, options)
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
        if depth is not None or needs_depth:
            return self.rgbd(image, depth, lens, reading, estimating)
        self.inputs["image"] = image
        with self.reading(image):
            return read_color(image)

    def find(self, picture: dlama.RGBD | UInt8Array, pointing: Pointing, image: Path) -> dlama.ObjectMask:
        """What is pointed at in a picture, read from `image`. InputError and its kin."""
        return find_pointed(picture, image, pointing.settings(), pointing.object_class)

    def pointed(self, rgbd: dlama.RGBD, pointing: Pointing, image: Path) -> BoolArray:
        """The mask of what is pointed at in a picture, read from `image`; how it was found goes into meta.json."""
        return self.find_pointed(rgbd, image, pointing.settings(), pointing.object_class)

    def left_mask(
        self, path: Path | None, masking: Masking, pointing: Pointing, left: Path
    ) -> BoolArray | Callable[[dlama.RGBD], BoolArray] | None:
        """The mask of the left picture of a pair: of its file, or found in the depth that the pair gives, as its shadow is.
        InputError: both."""
        if not pointing.given:
            mask = self.optional_mask(path, masking, left)
            if mask is None or not pointing.with_shadow:
                return mask
            return partial(self.add_shadow, mask=mask, with_shadow=True)
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
        self.result.add(line, **summary_values(done.meta, place, files, self.stages))

    def write_mask(
        self, found: dlama.ObjectMask, picture: dlama.RGBD | UInt8Array, output: Path, overlay: Path
    ) -> None:
        """The mask, the picture with the object tinted and outlined, and the line about them. OutputError."""
        write_mask(output, found.mask)
        write_color(overlay, tint(picture.color if isinstance(picture, RGBD) else picture, found.mask))
        shares = {"shadow_share": None if found.shadow is None else round(float(found.shadow.mean()), 6)}
        shares["share"] = round(float(found.mask.mean()), 6)
        shadow = "" if found.shadow is None or not found.shadow.any() else f", {found.shadow.mean():.1%} of it shadow"
        line = f"{output}: {found.chosen} by {found.masker}, {found.mask.mean():.1%} of the picture{shadow}"
        line += f"{mask_notes(found.chosen, found.candidates, found.notes)}, {self.seconds:.1f} s"
        self.result.add(line, files=[str(output), str(overlay)], **found.about, **shares)

    def write_depth(self, rgbd: dlama.RGBD, output: Path, flags: dict[str, str]) -> None:
        """Depth to its directory, and the line about it, in which the flags stand for parameters."""
        write_depth(rgbd, output, inputs=self.inputs, seconds=self.stages)
        about = dict(rgbd.estimate or {})
        scale = with_flags(RULES[about["scale"]["rule"]], flags)
        line = f"{output}: {describe_depth_range(rgbd.depth)}, {describe_depth_source(about)}, {scale}"
        values = {"output": str(output), "files": list(FILES), "depth_estimate": about}
        self.result.add(f"{line}, {self.seconds:.1f} s", **values)


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
    if "left_open_share" in meta:
        why += f", {statistics.fmean(meta['left_open_share']):.1%} left open"
    if meta["nothing_visible"]:
        why = "; nothing of the scene is visible from there, so nothing could be filled"
    how = f", filler {meta['filler']}"
    if estimate := meta.get("depth_estimate"):
        how += f", depth {describe_depth_source(estimate)}"
    if pointed := meta.get("object_mask"):
        how += mask_notes(pointed["candidate"], pointed["candidates"], pointed["notes"])
    return f"{place}: {unknown:.1%} was unknown{why}{how}, {seconds:.1f} s"


def summary_values(meta: dict[str, Any], place: Path, files: list[str], stages: Mapping[str, float]) -> dict[str, Any]:
    """The same, JSON-ready; shares view by view, and with the seconds of stages round the completion."""
    names = ("filler", "hole_share", "depth_only_share", "hole_share_by_type", "nothing_visible", "law_violations")
    values = {"recipe": meta["recipe"]["name"], **{name: meta[name] for name in names}}
    return {"output": str(place), "files": files, **values, "seconds_by_stage": {**stages, **meta["seconds"]}}


def mask_notes(chosen: str, candidates: Iterable[str], notes: Iterable[str]) -> str:
    """For the last line: which other readings of the clicks there are, and what to know of the mask; "" where nothing is."""
    others = [name for name in candidates if name != chosen]
    differs = [f"--candidate {' or '.join(others)} gives another mask"] if others else []
    return "".join(f"; {one}" for one in [*differs, *notes])
