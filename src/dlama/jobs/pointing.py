"""The options that point at an object in a picture, in; its mask out.

The command line's options are read by this file too: what computes is imported where it is used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlama.errors import InputError
from dlama.jobs.parameters import box as checked_box
from dlama.jobs.parameters import points

if TYPE_CHECKING:
    from dlama.geometry.rgbd import RGBD, UInt8Array
    from dlama.perception.object_masks import ObjectMask


def is_pointed(given: Mapping[str, Any]) -> bool:
    """Whether these options say which object is meant."""
    words = ("click", "not_click", "box", "salient", "object_class")
    return any(given.get(name) for name in words) or given.get("masker") == "salient"


def mask_and_pointing(mask: object) -> InputError:
    """The error where a mask file was given with clicks or a box."""
    return InputError(f"a mask file ({mask}) and clicks or a box were both given; one of them is expected")


def mask_settings(
    *,
    click: Sequence[Any] = (),
    not_click: Sequence[Any] = (),
    box: Any = None,
    salient: bool = False,
    masker: str | None = None,
    mask_model: str | None = None,
    candidate: str = "object",
    with_shadow: bool = False,
) -> dict[str, Any]:
    """The options as keyword arguments of find_mask; raises InputError."""
    if salient and masker not in (None, "salient"):
        raise InputError(f"`salient=True` and `masker={masker}` contradict each other; give one of them")
    return {
        "clicks": points("click", click),
        "not_clicks": points("not_click", not_click),
        "box": None if box is None else checked_box("box", box),
        "masker": "salient" if salient else masker,
        "mask_model": mask_model,
        "candidate": candidate,
        "with_shadow": with_shadow,
    }


def find_pointed(
    picture: RGBD | UInt8Array, image: Path, settings: Mapping[str, Any], object_class: str | None = None
) -> ObjectMask:
    """The object in a picture, read from `image`: by `settings` of find_mask, or of a semantic class. InputError and its kin."""
    from dlama.perception import object_masks

    if object_class is None:
        return object_masks.find_mask(picture, **settings)
    if settings["clicks"] or settings["not_clicks"] or settings["box"] or settings["masker"]:
        raise InputError("`object_class` and other ways to point at an object contradict each other; give one of them")
    from dlama.files.rasters.pictures import read_mask
    from dlama.files.semantic_classes import semantic_picture

    mask = read_mask(semantic_picture(image), mask_class=object_class)
    with_shadow = settings["with_shadow"]
    return object_masks.complete_mask(picture, {"object": mask}, "object", f"class {object_class}", with_shadow)
