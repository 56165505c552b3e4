"""The options of one command in; what the job of that verb makes of them, written and reported in one line, out."""

from __future__ import annotations

import shlex
import statistics
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import dlama
from dlama.apps.options import given_options
from dlama.apps.places import Inputs, check_folder_apart, given_files
from dlama.apps.terminal.output import SHOWN, WITH_FLAGS, Result
from dlama.completion.report import describe_remaining_shadow
from dlama.errors import InputError, OutputError
from dlama.files.rasters.images import ADDRESS, SUFFIXES
from dlama.files.rasters.masks import write_mask
from dlama.files.rasters.pictures import write_color
from dlama.files.results.completion import file_names
from dlama.files.results.estimated_depth import FILES as FILES_OF_DEPTH
from dlama.files.results.preview import tint
from dlama.geometry.rgbd import RGBD, UInt8Array, describe_depth_range
from dlama.jobs.early import check_options
from dlama.jobs.inputs import JobInputs, Parameters, find_pointed, is_scene, picture_of, select
from dlama.jobs.parameters import PICTURE, POINTING, RESULTS, check_parameters, read_parameters
from dlama.jobs.verbs import check_job, perform
from dlama.perception.depth_scale import RULES, describe_depth_source


@dataclass
class Command(JobInputs):
    """What one command has read so far; its Result takes what it has written."""

    result: Result = field(default_factory=Result)

    def run(self, verb: str, output: Path, files: Inputs, *groups: Any, **others: Any) -> None:
        """The job of that verb, of the files and options (by class, and others by name) that are given: its result is written to
        `output`, and reported.

        OutputError and InputError, before anything is read, for all that can be refused then: names and options.
        """
        if ADDRESS.match(str(output)):
            raise OutputError(f"`output` is {output}; a directory is expected, addresses are for `dlama batch` alone")
        refuse_many(verb, files.get("image", files.get("left")))
        check_folder_apart(output, files)
        given = given_files({**files, **others}) | given_options(*groups)
        parameters = check_parameters(verb, given, False, partial(check_job, verb))
        done = perform(self, verb, parameters, output)
        if isinstance(done, dlama.Completion):
            self.report_completion(done, output, parameters)
        else:
            self.report_depth(done, output)

    def report_completion(self, done: dlama.Completion, place: Path, parameters: Parameters) -> None:
        """The line about a result that lies in a place; as values its shares view by view, and the seconds of all stages."""
        meta: Mapping[str, Any] = done.meta
        files = file_names(done, **select(parameters, RESULTS))
        names = ("filler", "hole_share", "depth_only_share", "hole_share_by_type", "nothing_visible", "law_violations")
        values = {"recipe": meta["recipe"]["name"], **{name: meta[name] for name in names}}
        seconds = {**self.stages, **meta["seconds"]}
        line = summary_line(meta, place, self.result.seconds)
        self.result.add(line, output=str(place), files=files, **values, seconds_by_stage=seconds)

    def report_depth(self, rgbd: RGBD, output: Path) -> None:
        """The line about estimated depth."""
        about = dict(rgbd.estimate or {})
        scale = WITH_FLAGS.get()(RULES[about["scale"]["rule"]])
        line = f"{output}: {describe_depth_range(rgbd.depth)}, {describe_depth_source(about)}, {scale}"
        values = {"output": str(output), "files": list(FILES_OF_DEPTH), "depth_estimate": about}
        self.result.add(f"{line}, {self.result.seconds:.1f} s", **values)

    def find_mask(self, files: Inputs, options: Parameters) -> tuple[dlama.ObjectMask, RGBD | UInt8Array]:
        """What the options point at in a picture, and that, with its depth where it is needed. InputError and its kin."""
        image = Path(str(files["image"]))
        refuse_many("mask", image)
        given = given_files(files) | dict(options)
        p = read_parameters({**PICTURE, **POINTING}, given, partial(check_options, image=image))
        by_color = "salient" in p or "object_class" in p or p.get("masker", "rgbd") != "rgbd"
        needs_depth = "depth" in p or "with_shadow" in p or not by_color
        with warnings.catch_warnings():
            if "with_shadow" not in p:  # the mask does not depend on what is assumed
                warnings.filterwarnings("ignore", "the (scale of the estimated depth|field of view) is assumed")
            scene = is_scene(image)
            picture = picture_of(self.read_source(p)) if needs_depth or scene else self.read_color(p)
        return find_pointed(picture, image, p)[0], picture

    def write_mask(self, found: dlama.ObjectMask, picture: RGBD | UInt8Array, output: Path, overlay: Path) -> None:
        """The mask, the picture with the object tinted and outlined, and the line about them. OutputError."""
        write_mask(output, found.mask)
        write_color(overlay, tint(picture.color if isinstance(picture, RGBD) else picture, found.mask))
        shares = {"shadow_share": None if found.shadow is None else round(float(found.shadow.mean()), 6)}
        shares["share"] = round(float(found.mask.mean()), 6)
        shadow = "" if found.shadow is None or not found.shadow.any() else f", {found.shadow.mean():.1%} of it shadow"
        line = f"{output}: {found.chosen} by {found.masker}, {found.mask.mean():.1%} of the picture{shadow}"
        line += f", {self.result.seconds:.1f} s{mask_notes(found.chosen, found.candidates, found.notes)}"
        self.result.add(line, files=[str(output), str(overlay)], **found.about, **shares)


def refuse_many(verb: str, image: Path | str | None) -> None:
    """InputError where a data set, or a folder of pictures, is given in place of a picture: it names the verbs that take it."""
    if image is None or not (place := Path(image)).is_dir():
        return
    from dlama.datasets.layouts import layout_of
    from dlama.datasets.text_tables import files_in

    expected = f"{'the left picture of a pair' if verb == 'stereo' else 'a picture'} is expected"
    try:
        layout = layout_of(place, None)
    except InputError:
        if (place / "meta.json").is_file():  # a result: the error says so
            raise
        pictures = files_in(place, SUFFIXES) if verb not in ("mask", "stereo") else []
        which = [
            f"`dlama batch --images {shlex.quote(f'{place}/*{one.suffix}')} --verb {verb}` takes all in it"
            for one in pictures[:1]
        ]
        raise InputError("; ".join([f"{place}: is a folder, {expected}", *which])) from None
    raise InputError(
        "; ".join([f"{place}: is a data set (layout {layout}), {expected}", *takers_of(place, layout, verb)])
    )


def takers_of(place: Path, layout: str, verb: str) -> Iterator[str]:
    """In words, which verbs take a data set of that layout in place of that one."""
    of_pairs = layout == "stereo"
    if not of_pairs and verb not in ("depth", "mask"):
        yield "`dlama sequence` and `dlama video` take its frames as one scene"
    if verb != "mask" and of_pairs >= (verb == "stereo"):
        yield f"`dlama batch --data {shlex.quote(str(place))} --verb {'stereo' if of_pairs else verb}` takes each by itself"


def summary_line(meta: Mapping[str, Any], place: object, seconds: float) -> str:
    """One line: where it lies, what share was unknown and why, which filler filled it, seconds, what to know of the mask."""
    how = f", filler {meta['filler']}"
    if estimate := meta.get("depth_estimate"):
        how += f", depth {describe_depth_source(estimate)}"
    pointed = meta.get("object_mask")
    notes = mask_notes(pointed["candidate"], pointed["candidates"], pointed["notes"]) if pointed else ""
    shadow = remaining_shadow(meta, bool(pointed and pointed.get("with_shadow")))
    return f"{place}: {describe_unknown(meta)}{how}, {seconds:.1f} s{notes}{shadow}"


def describe_unknown(meta: Mapping[str, Any]) -> str:
    """The share that was unknown, and why: means over the views. Pixels that lacked only depth have a share of their own; they
    are of type `sensor`."""
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
    return f"{unknown:.1%} was unknown{why}"


def remaining_shadow(meta: Mapping[str, Any], with_shadow: bool) -> str:
    """For the last line: what is known of a shadow that stays, and the option; "" where there is none, or it was removed."""
    stays = "" if with_shadow else describe_remaining_shadow(meta)
    return f"; {stays}: --with-shadow removes it, too" if stays else ""


def mask_notes(chosen: str, candidates: Iterable[str], notes: Iterable[str]) -> str:
    """For the last line: which other readings of the clicks there are, and what to know of the mask; "" where nothing is."""
    others = [name for name in candidates if name != chosen]
    differs = [f"--candidate {' or '.join(others)} gives another mask"] if others else []
    return "".join(f"; {one}" for one in [*differs, *notes])
