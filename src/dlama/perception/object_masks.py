"""A picture and what a user points at (clicks, a box, nothing) in; the mask of the thing out. METHODS is the closed list."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dlama.errors import InputError, MaskError
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, read_only
from dlama.perception.masks.prompt import Box, Point, Prompt
from dlama.perception.shadows import find_shadow


@dataclass(frozen=True)
class MaskMethod:
    """Where a method's code stands, and what it needs."""

    entry_point: str
    """`module:name` of a function (picture, prompt) -> (masks by name, notes)."""
    needs_depth: bool = False
    """Whether the picture must be an RGBD."""
    needs_prompt: bool = True
    """Whether clicks or a box say which thing is meant."""


@dataclass(frozen=True, eq=False)
class ObjectMask:
    """A thing found in a picture."""

    mask: BoolArray
    """H x W, True on the thing."""
    candidates: Mapping[str, BoolArray]
    """Other readings of the same clicks, by name: part, thing, group; those that differ, `mask` among them."""
    chosen: str
    """Name of the candidate that `mask` is."""
    method: str
    """Which of METHODS found it."""
    shadow: BoolArray | None = None
    """H x W, True in the shadow that the thing casts, a part of `mask`; None where it was not asked for."""
    notes: tuple[str, ...] = ()
    """What a user should know, in words."""


def find_mask(
    picture: RGBD | UInt8Array,
    *,
    clicks: Sequence[Point] = (),
    not_clicks: Sequence[Point] = (),
    box: Box | None = None,
    method: str | None = None,
    candidate: str = "thing",
    with_shadow: bool = False,
) -> ObjectMask:
    """The mask of the thing that clicks or a box mean.

    Args:
        picture: A picture with depth, or H x W x 3 uint8 RGB for methods that need no depth.
        clicks: Pixels on the thing, (x, y), x right, y down.
        not_clicks: Pixels beside it, to correct with.
        box: x, y, width, height round the thing, in pixels.
        method: A name of METHODS; None: rgbd.
        candidate: Which reading of an ambiguous click: part, thing or group; `thing` where it has no such.
        with_shadow: Add the shadow that the thing casts on the surface it stands on; needs depth.

    Raises:
        InputError: an unknown method or candidate, nothing that says what is meant, a click or box outside the picture.
        MaskError: nothing that stands apart is there.
    """
    name = method or "rgbd"
    if name not in METHODS:
        raise InputError(f"method is {name!r}; one of {', '.join(METHODS)} is wanted")
    if candidate not in CANDIDATES:
        raise InputError(f"candidate is {candidate!r}; one of {', '.join(CANDIDATES)} is wanted")
    record = METHODS[name]
    hw = picture.depth.shape if isinstance(picture, RGBD) else np.asarray(picture).shape[:2]
    prompt = Prompt((hw[0], hw[1]), tuple(map(tuple, clicks)), tuple(map(tuple, not_clicks)), box and tuple(box))  # type: ignore[arg-type]
    if record.needs_depth and not isinstance(picture, RGBD):
        raise InputError(f"method {name!r} needs depth and the picture has none; an RGBD is wanted")
    if record.needs_prompt and not prompt.clicks and prompt.box is None:
        raise InputError("clicks and box are both missing; give clicks on the thing, or a box round it")
    found: Any = pkgutil.resolve_name(record.entry_point)
    masks, notes = found(picture, prompt)
    masks = {each: read_only(mask) for each, mask in masks.items() if mask.any()}
    if not masks:
        raise MaskError("nothing of the thing is left; fewer not_clicks are wanted")
    chosen = candidate if candidate in masks else next(iter(masks))
    if not with_shadow:
        return ObjectMask(masks[chosen], masks, chosen, name, notes=tuple(notes))
    if not isinstance(picture, RGBD):
        raise InputError("with_shadow needs depth and the picture has none; an RGBD is wanted")
    shadow = find_shadow(picture, masks[chosen])
    said = () if shadow.any() else ("no shadow found",)
    return ObjectMask(read_only(masks[chosen] | shadow), masks, chosen, name, read_only(shadow), (*notes, *said))


CANDIDATES = ("part", "thing", "group")

METHODS: dict[str, MaskMethod] = {
    "rgbd": MaskMethod("dlama.perception.masks.rgbd:rgbd_candidates", needs_depth=True),
    "salient": MaskMethod("dlama.perception.masks.salient:salient_candidates", needs_prompt=False),
}
"""Name -> record; the default comes first."""
