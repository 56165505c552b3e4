"""`dlama mask`: a picture and what is pointed at in it in; the mask of the object, and its files, out."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import Depth, Estimating, Image, Lens, Reading, Report, option
from dlama.apps.places import check_file_apart
from dlama.apps.pointing import Pointing, mask_notes
from dlama.errors import InputError

if TYPE_CHECKING:
    import dlama

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
        files = this.write_mask(found, picture, output, overlay_of(output))
        this.result.add(found_line(found, output, this.seconds), **found_values(found, files))


def overlay_of(output: Path) -> Path:
    """Where the overlay of a mask goes. InputError: the mask's name does not end in .png."""
    if output.suffix.lower() != ".png":
        raise InputError(f"`output` is {output}; a name that ends in .png is expected")
    return output.with_name(f"{output.stem}_overlay.png")


def found_line(found: dlama.ObjectMask, output: Path, seconds: float) -> str:
    """One line: where the mask lies, how large it is, which other readings there are."""
    shadow = "" if found.shadow is None or not found.shadow.any() else f", {found.shadow.mean():.1%} of it shadow"
    line = f"{output}: {found.chosen} by {found.masker}, {found.mask.mean():.1%} of the picture{shadow}"
    return f"{line}{mask_notes(found.chosen, found.candidates, found.notes)}, {seconds:.1f} s"


def found_values(found: dlama.ObjectMask, files: list[Path]) -> dict[str, Any]:
    """The same, JSON-ready."""
    return {
        "files": [str(file) for file in files],
        **found.about,
        "shadow_share": None if found.shadow is None else round(float(found.shadow.mean()), 6),
        "share": round(float(found.mask.mean()), 6),
    }
