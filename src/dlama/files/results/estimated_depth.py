"""A picture with its depth in; a directory with depth, a coloured preview, the camera, the points and meta.json out."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path

from dlama import __version__
from dlama.arguments import check_arguments
from dlama.completion.start import describe_depth
from dlama.files.cameras import camera_as_json, write_camera
from dlama.files.rasters.depth import write_depth_exr, write_depth_png
from dlama.files.results.completion import check_inputs_stay
from dlama.files.results.contact_sheet import write_contact_sheet
from dlama.files.results.meta_json import hash_inputs, legends, versions, write_meta
from dlama.files.scenes.clouds import write_ply
from dlama.geometry.figures.false_color import SKY, depth_limits, depth_picture
from dlama.geometry.projection import lift
from dlama.geometry.rgbd import RGBD, describe_depth_range
from dlama.perception.depth_scale import describe_depth_source
from dlama.writing.atomic_write import PathLike, new_directory

FILES = ("camera.json", "cloud.ply", "depth.exr", "depth.png", "meta.json", "preview.png")
"""What is written."""


def write_depth(
    rgbd: RGBD,
    directory: PathLike,
    *,
    inputs: Mapping[str, PathLike] | None = None,
    seconds: Mapping[str, float] | None = None,
) -> Path:
    """Write a picture's depth to a directory (made if need be) and return it. If anything fails nothing is left behind.

    depth.png in millimetres, depth.exr in metres, camera.json, cloud.ply (world metres, with origin and confidence), preview.png,
    and meta.json, which says how the depth was estimated.

    Args:
        rgbd: What `estimate_depth` (its `rgbd`) or `read_rgbd` gave.
        directory: Files of the same names in it are replaced, all others stay.
        inputs: Role -> file; path and SHA-256 of each go into meta.json.
        seconds: Stages before this one, for meta.json.

    Raises:
        OutputError: the directory cannot be written, or a result would replace one of `inputs`.
        FileError: an input cannot be read.
    """
    check_arguments(write_depth, locals())
    target, started = Path(directory), time.perf_counter()
    check_inputs_stay(target, FILES, inputs or {})
    meta = {
        "dlama": __version__,
        "camera": camera_as_json(rgbd.camera),
        **describe_depth(rgbd),
        "inputs": hash_inputs(inputs or {}),
        "legends": {name: text for name, text in legends().items() if name in (*FILES, "origin.png")},
        "versions": versions(),
    }
    with new_directory(target) as folder:
        meta["depth_png_clipped_pixels"] = write_depth_png(folder / "depth.png", rgbd.depth)
        write_depth_exr(folder / "depth.exr", rgbd.depth)
        write_camera(folder / "camera.json", rgbd.camera)
        write_ply(folder / "cloud.ply", lift(rgbd))
        write_depth_preview(folder / "preview.png", rgbd)
        write_meta(folder, {**meta, "seconds": {}}, seconds or {}, time.perf_counter() - started)
    return target


def write_depth_preview(path: PathLike, rgbd: RGBD) -> None:
    """The picture next to its depth in colour, near red, far blue. Raises OutputError."""
    lo, hi = depth_limits(rgbd.depth)
    estimate = rgbd.estimate or {}
    title = f"Depth, {describe_depth_range(rgbd.depth)}"
    if estimate:
        title += f", {describe_depth_source(estimate)}, scale: {estimate['scale']['rule'].replace('_', ' ')}"
    depth = depth_picture(rgbd.depth, None, lo, hi)
    sky = [("far (sky)", SKY)] if rgbd.far.any() else []
    panels = [("picture", rgbd.color), (f"depth, {lo:.2g} m (red) to {hi:.2g} m (blue)", depth)]
    write_contact_sheet(path, title, panels, sky)
