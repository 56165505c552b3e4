"""`dlama photo3d`: a picture, a scene or a data set of posed frames in; a 3-D photo that turns without holes, as files, out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional

import dlama
from dlama.apps.command import command
from dlama.apps.options import Depth, Filler, Output, PictureOptions, Report, given_options, option
from dlama.apps.places import check_folder_apart, given_files
from dlama.errors import format_count
from dlama.jobs.parameters import METHOD, PICTURE, RESULTS, read_parameters


@dataclass(frozen=True)
class Box:
    """How far it moves."""

    angle: Annotated[float | None, option("DEG", "4 % of the width of parallax")] = None
    """Degrees to which it turns to each side, up and down."""
    distance: Annotated[float | None, option("SHARE", "half the way to the side")] = None
    """How far it goes forward and back, as a share of the distance it turns about."""


FILES = (
    "What is written, of page (photo3d.html), mesh (photo3d.glb), usdz (extra usd), splats (.ply), spz (the splats, "
    "compressed), stereo (side by side, anaglyph), loop (.mp4 and .webp, extra video), scene."
)


@dataclass(frozen=True)
class Results:
    """Which files are written."""

    only: Annotated[str | None, option("NAME,...", "page,mesh", help=FILES)] = None
    also: Annotated[str | None, option("NAME,...")] = None
    """More of these names."""


def photo3d(
    image: Positional[Annotated[Path, option("IMAGE|SCENE.npz|DATASET", None)]],
    depth: Positional[Depth] = None,
    /,
    *,
    output: Output,
    picture: PictureOptions,
    filler: Filler,
    box: Box,
    results: Results,
    report: Report,
) -> None:
    """A 3-D photo: one HTML file that turns under the finger, and a mesh, with what the picture hides filled in.

    Args:
        image: The picture: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC. Or the scene.npz of a result, such as of an object
            removed, or of a stereo pair; or the folder of a data set of posed frames, or a recording (.bag, .mcap, .db3, .mkv,
            .r3d); --camera, --depth-range, --depth-scale and --resize-depth are for these, too.
        depth: Its depth, same size: 16-bit PNG, TIFF or PGM (millimetres), EXR, PFM, NPY or NPZ; without it, it is estimated.
        output: Directory for the results, made if need be; files of the same names are replaced.
    """
    from dlama.datasets.layouts import is_capture_file
    from dlama.datasets.sequences.loading import read_scene_of
    from dlama.files.results.photo3d import check_names
    from dlama.jobs.early import check_options
    from dlama.jobs.inputs import refuse_of_pictures, select

    with command("photo3d", report) as this:
        names = read_parameters(RESULTS, given_options(results))
        check_names(**names)
        files = {"image": image, "depth": depth}
        check_folder_apart(output, files)
        given = given_files(files) | given_options(picture, filler)
        p = read_parameters(PICTURE, given, partial(check_options, image=image))
        source: dlama.RGBD | dlama.Scene
        if image.is_dir() or is_capture_file(image):
            reading = ("camera", "depth_range", "depth_scale", "resize_depth")
            refuse_of_pictures(p, "a data set", reading)
            options: dict[str, Any] = {name: given.get(name) for name in reading}
            source = read_scene_of(image, **options).scene
        else:
            source = this.read_source(p)
        done = dlama.photo3d(source, **vars(box), **select(p, METHOD))
        dlama.write_photo3d(
            replace(done, meta=done.meta | this.about_inputs()),
            output,
            **names,
            inputs=this.inputs,
            intrinsics_from=this.intrinsics_from or "the scene",
            seconds=this.stages,
        )
        figures, turned, name = done.meta["photo3d"], done.box, done.meta["filler"]
        cameras = format_count(len(figures["filled_cameras"]), "camera")
        line = f"{output}: turns by {turned.angle:.1f} degrees about {turned.pivot:.3g} m, filled for {cameras}"
        values = {"angle": turned.angle, "distance": turned.distance, "open_share": figures["open_share"]}
        line += f", filler {name}, {this.result.seconds:.1f} s"
        this.result.add(line, output=str(output), **values, filler=name)
