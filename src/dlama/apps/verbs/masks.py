"""`dlama mask`: a picture and what is pointed at in it in; the mask of the object, and its files, out."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import Depth, Estimating, Image, Lens, Pointing, Reading, Report, option
from dlama.apps.places import check_file_apart
from dlama.errors import InputError

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
        for file in (output, overlay_of(output)):
            check_file_apart(file, {"image": image, "depth": depth})
        if not pointing.given:
            raise InputError(
                "no object is pointed at: give --click X,Y on it, --box X,Y,W,H round it, --salient or --class NAME"
            )
        this.check_options(image, reading.settings(), estimating.settings(), pointing.settings())
        with warnings.catch_warnings():
            if depth is None and not pointing.with_shadow:
                warnings.filterwarnings("ignore", ASSUMED)
            picture = this.picture(image, depth, lens, reading, estimating, needs_depth=pointing.needs_depth)
        found = this.find(picture, pointing, image)
        this.write_mask(found, picture, output, overlay_of(output))


def overlay_of(output: Path) -> Path:
    """Where the overlay of a mask goes. InputError: the mask's name does not end in .png."""
    if output.suffix.lower() != ".png":
        raise InputError(f"`output` is {output}; a name that ends in .png is expected")
    return output.with_name(f"{output.stem}_overlay.png")
