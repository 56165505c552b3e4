"""`dlama sequence`: a data set of posed frames and masks in; the same completed, as a data set, out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional

import dlama
from dlama.apps.options import (
    CameraFile,
    Masking,
    Method,
    Metres,
    Output,
    Report,
    check_of_object,
    given_options,
    option,
)
from dlama.apps.places import check_folder_apart
from dlama.apps.terminal.output import SHOWN, follow_run, report_result
from dlama.completion.options import options_in
from dlama.errors import InputError, format_count
from dlama.jobs import options as groups
from dlama.jobs.parameters import RESULTS, read_parameters, text

if TYPE_CHECKING:
    from dlama.geometry.rgbd import BoolArray


ResizeDepth = Annotated[
    Literal["guided", "nearest"] | None,
    option("guided|nearest", "pictures are shrunk", help=options_in(groups.Reading)["resize_depth"].text),
]


@dataclass(frozen=True)
class Source:
    """Which frames of which data set."""

    frames: Annotated[str | None, option("FIRST:END:STEP", "all")] = None
    """Frames by their place, from 0, the end not among them: 0:480:10, ::5."""
    layout: Annotated[str | None, option("NAME", "recognised")] = None
    """How the data set lies on disk: tum, 7-scenes, scannet, redwood, nerfstudio, colmap, easysynth, ..."""
    scene: Annotated[str | None, option("NAME", "the only one")] = None
    """Which scene, of a folder that holds several."""
    camera: CameraFile = None
    """The camera file of a layout that has none of its own (tum, 7-scenes, redwood)."""
    depth_range: Metres = None
    """EasySynth: metres that 1.0 stands for in its depth files."""
    depth_scale: Annotated[float | None, option("UNITS", "the layout's")] = None
    """Units per metre in depth files of posed frames: 1000 = millimetres, Replica 6553.5."""
    max_depth: Annotated[float | None, option("METRES", "5 of a phone's LIDAR")] = None
    """Depth beyond this is missing."""
    resize_depth: ResizeDepth = None
    keep_poses: Annotated[bool, option("", "they are corrected")] = False
    """Keep poses that are off by a pixel or more; else picture features correct them first, as hand-held ones need it."""


MASK = (
    "An object to remove from all frames, by its mask in one or several of them. FRAME is a frame's name, or its place from 0 "
    "among those that --frames chooses."
)


@dataclass(frozen=True)
class Objects:
    """What is removed from all frames."""

    mask: Annotated[tuple[str, ...], option("FRAME=FILE ...", help=MASK)] = ()
    masks: Annotated[Path | None, option("FOLDER")] = None
    """The same: a folder of masks with the names of their frames; those of no object (black) are passed over."""
    with_shadow: Annotated[bool, option("", "off")] = False
    """Remove the shadow that the object casts on the surface it stands on, where it is clear, in each frame."""


VIEWS = (
    "Which cameras are completed: the frames' own, a path from the middle frame, or those of a file (a list of cameras as "
    "--to of dlama view takes one, each with an optional name)."
)


@dataclass(frozen=True)
class Results:
    """Which cameras are completed, and which files are written."""

    views: Annotated[str, option("frames|orbit|spiral|dolly|CAMERAS.json", "frames", help=VIEWS)] = "frames"
    only: Annotated[str | None, option("NAME,...", "mesh,colmap,video")] = None
    """What is written next to the views, of scene, points, mesh, colmap, video (.mp4 with the extra video, else .webp)."""
    also: Annotated[str | None, option("NAME,...")] = None
    """More of these names: scene (scene.npz, which view, video and show read), points."""


def sequence(
    dataset: Positional[Annotated[Path, option("DATASET|SCENE.npz", None)]],
    /,
    *,
    output: Output,
    source: Source,
    objects: Objects,
    masking: Masking,
    method: Method,
    results: Results,
    report: Report,
) -> None:
    """Many posed frames of one scene, completed: what one frame lacks another one shows, and only the rest is filled, once.

    Args:
        dataset: The folder of posed frames with depth, in any layout that `dlama evaluate` reads; or a scene.npz.
        output: Directory for the results, a data set in nerfstudio's layout, and scene.glb; a killed run continues.
    """
    from dlama.datasets.sequences.results import check_results

    with report_result("sequence", report) as result:
        check_folder_apart(output, {"data set": dataset, "folder of masks": objects.masks})
        files, how = mask_files(objects.mask, objects.masks), given_options(masking)
        check_of_object(how, *files.values())
        found = read_masks(files, **how)
        chosen = read_parameters({"views": text, **RESULTS}, given_options(results))
        written = {name: chosen.pop(name) for name in ("only", "also") if name in chosen}
        check_results(written.get("only"), written.get("also", ()))  # before minutes of reading
        options = {"masks": found, "with_shadow": objects.with_shadow, **vars(source), **chosen}
        with follow_run("sequence", report) as progress:
            completion = dlama.sequence(dataset, **options, **given_options(method))
            meta = completion.write(output, progress=progress, **written)
        result.add(summary_line(meta, output, result.seconds), **summary_values(meta, output))


def mask_files(named: Sequence[str], folder: Path | None) -> dict[str, Path]:
    """Frame -> file, from FRAME=FILE words and from the names in a folder. InputError."""
    files: dict[str, Path] = {}
    for word in named:
        frame, equals, file = word.partition("=")
        if not (frame and equals and file):
            raise InputError(f"`mask` is {word!r}; FRAME=FILE is expected, such as 0=mask.png")
        if frame in files:
            raise InputError(f"`mask` is given twice for frame {frame}; one mask a frame is expected")
        files[frame] = Path(file)
    if folder is not None:
        files |= {frame: file for frame, file in _masks_in(folder).items() if frame not in files}
    return files


def read_masks(files: Mapping[str, Path], **how: Any) -> dict[str, BoolArray]:
    """Frame -> mask, without those in which nothing is marked. FileError, MaskError, also where nothing is marked in any."""
    from dlama.files.rasters.masks import EmptyMaskError

    found, empty = dict[str, "BoolArray"](), None
    for frame, path in files.items():
        try:
            found[frame] = dlama.read_mask(path, **how)
        except EmptyMaskError as error:
            empty = error
    if empty is not None and not found:
        raise empty
    return found


def _masks_in(folder: Path) -> dict[str, Path]:
    """Name of a frame -> file, of the pictures in a folder, else of the arrays of NumPy. InputError: none."""
    from dlama.datasets.text_tables import files_in
    from dlama.files.rasters.images import SUFFIXES

    if not folder.is_dir():
        raise InputError(f"`masks` is {folder}; a folder of masks with the names of their frames is expected")
    listed = files_in(folder, SUFFIXES) or files_in(folder, (".npy", ".npz"))
    if not listed:
        raise InputError(f"`masks` is {folder}, which holds no picture")
    found = {path.stem: path for path in listed}
    twice = next((path for path in listed if found[path.stem] != path), None)
    if twice is not None:
        raise InputError(
            f"`masks`: frame {twice.stem} has two, {twice} and {found[twice.stem].name}; one a frame is expected"
        )
    return found


def summary_line(meta: dict[str, Any], output: Path, seconds: float) -> str:
    """One line: how many views of how many frames, what was left out, what share was filled by which filler, how long it took."""
    shares, count = meta["filled_share"].values(), len(meta["frames"]["names"])
    mean, depth = (sum(meta[name].values()) / max(len(shares), 1) for name in ("filled_share", "depth_filled_share"))
    out = f", {len(meta['left_out'])} left out ({', '.join(list(meta['left_out'])[:3])})" if meta["left_out"] else ""
    poses, moved = meta["decisions"].get("poses", {}), ""
    if poses.get("name") == "aligned":
        moved = f", poses corrected from {poses['before_px']:.1f} to {poses['after_px']:.1f} px"
    earlier = f", {meta['views_from_earlier_run']} from an earlier run" if meta["views_from_earlier_run"] else ""
    alone = f", {depth:.1%} in depth alone" if depth >= SHOWN else ""
    if meta["min_confidence"]:
        alone += f", {sum(meta['left_open_share'].values()) / max(len(shares), 1):.1%} left open"
    how = f"{mean:.1%} filled{alone}{earlier}, filler {meta['filler']}, {seconds:.1f} s"
    if meta["remaining_shadow"] and not meta["with_shadow"]:
        how += f"; {meta['remaining_shadow']}: --with-shadow removes it, too"
    return f"{output}: {format_count(len(shares), 'view')} of {format_count(count, 'frame')}{out}{moved}, {how}"


def summary_values(meta: dict[str, Any], output: Path) -> dict[str, Any]:
    """The same, JSON-ready."""
    names = (
        "filler",
        "filled_share",
        "depth_filled_share",
        "left_open_share",
        "left_out",
        "views_from_earlier_run",
        "masked_frames",
        "remaining_shadow",
    )
    return {"output": str(output), "frames": meta["frames"]["names"], **{name: meta[name] for name in names}}
