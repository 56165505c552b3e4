"""`dlama mask`: a picture and what is pointed at in it in; the mask of the object, and its files, out."""

from __future__ import annotations

import warnings
from functools import partial
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import Depth, Estimating, Image, Lens, Pointing, Reading, Report, given_options, option
from dlama.apps.places import check_file_apart
from dlama.errors import InputError
from dlama.jobs.parameters import PICTURE, POINTING, is_pointed, read_parameters

ASSUMED = "the (scale of the estimated depth|field of view) is assumed"
"""Warnings of a picture whose depth is estimated; a mask in it depends on neither."""


def mask(
    image: Positional[Image],
    depth: Positional[Depth] = None,
    /,
    *,
    output: Annotated[Path, option("MASK.png", None, aliases=["-o"])],
    pointing: Pointing,
    lens: Lens,
    reading: Reading,
    estimating: Estimating,
    report: Report,
) -> None:
    """The mask of an object that you point at: click on it, or draw a box around it.

    Args:
        image: The colour picture: PNG, JPEG, WebP, TIFF or HEIC.
        depth: Its depth, same size: 16-bit PNG or TIFF (millimetres), EXR, PFM, NPY or NPZ; without it, it is estimated
            where the masker needs it.
        output: The mask, 255 = the object; next to it MASK_overlay.png shows it in the picture.
    """
    with command("mask", report) as this:
        files, overlay = {"image": image, "depth": depth}, overlay_of(output)
        for file in (output, overlay):
            check_file_apart(file, files)
        given = given_options(pointing, lens, reading, estimating)
        if not is_pointed(given):
            raise InputError(
                "no object is pointed at: give --click X,Y on it, --box X,Y,W,H round it, --salient or --class NAME"
            )
        from dlama.jobs.early import check_options
        from dlama.jobs.inputs import find_pointed

        given |= {name: path for name, path in files.items() if path is not None}
        p = read_parameters({**PICTURE, **POINTING}, given, partial(check_options, image=image))
        with warnings.catch_warnings():
            if depth is None and "with_shadow" not in p:
                warnings.filterwarnings("ignore", ASSUMED)
            by_color = "salient" in p or "object_class" in p or p.get("masker", "rgbd") != "rgbd"
            needs_depth = depth is not None or "with_shadow" in p or not by_color
            picture = this.read_picture(p) if needs_depth else this.read_color(p)
        found, _ = find_pointed(picture, image, p)
        this.write_mask(found, picture, output, overlay)


def overlay_of(output: Path) -> Path:
    """Where the overlay of a mask goes. InputError: the mask's name does not end in .png."""
    if output.suffix.lower() != ".png":
        raise InputError(f"`output` is {output}; a name that ends in .png is expected")
    return output.with_name(f"{output.stem}_overlay.png")
