"""A picture and a user's clicks or box in; the mask of the object out. MASKERS is the closed list of methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from dlama.arguments import check_arguments, check_word
from dlama.errors import InputError, MaskError
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array, check_color, make_read_only, percent
from dlama.perception.masks.choice import rgbd_masker
from dlama.perception.masks.prompt import Box, Point, Pointed, Prompt
from dlama.perception.masks.salient import salient_masker
from dlama.perception.masks.segment_anything import segment_anything_masker
from dlama.perception.missing_depth import densify
from dlama.perception.shadows.find import find_shadow

MaskModel = str | Path | tuple[str | Path, str | Path]
"""A name of `dlama.perception.masks.segment_anything.PAIRS`, `NAME=ENCODER,DECODER`, or the two files of a pair."""
TOO_MUCH = "more than half of the picture: say what does not belong to it, or give a box round it alone"


@dataclass(frozen=True)
class MaskerRecord:
    """A masker, and what it needs."""

    open: Callable[[Any, Any], Pointed]
    """(picture, mask_model) -> a function of prompts; what does not depend on the prompt is computed once."""
    needs_depth: bool = False
    """Whether the picture must be an RGBD; else `open` gets its colours."""
    needs_prompt: bool = True
    """Whether it needs clicks or a box."""
    takes_model: bool = False
    """Whether it runs networks that mask_model names."""


@dataclass(frozen=True, eq=False)
class ObjectMask:
    """An object found in a picture."""

    mask: BoolArray
    """H x W, True on the object."""
    candidates: Mapping[str, BoolArray]
    """Other readings of the same clicks, by name: part, object, group; those that differ, `mask` among them."""
    chosen: str
    """Name of the candidate that `mask` is."""
    masker: str
    """Which of MASKERS found it."""
    shadow: BoolArray | None = None
    """H x W, True in the shadow that the object casts, a part of `mask`; None where it was not asked for."""
    notes: tuple[str, ...] = ()
    """Notes for the user."""

    def __repr__(self) -> str:
        height, width = self.mask.shape
        return f"ObjectMask({self.chosen} by {self.masker}, {percent(self.mask)} of {width}x{height})"

    @property
    def about(self) -> dict[str, Any]:
        """How it was found, JSON-ready: masker, candidate, candidates (name -> share of the picture) and notes."""
        shares = {name: round(float(mask.mean()), 6) for name, mask in self.candidates.items()}
        return {"masker": self.masker, "candidate": self.chosen, "candidates": shares, "notes": list(self.notes)}


class MaskSession:
    """A picture for repeated prompts.

    What does not depend on the clicks (the planes of its depth, a network's embedding) is computed at the first `find` and
    kept.
    """

    def __init__(
        self, picture: RGBD | UInt8Array, *, masker: str | None = None, mask_model: MaskModel | None = None
    ) -> None:
        """Parameters and errors as `find_mask`. Only depth between single readings is computed here (`densify`)."""
        check_arguments(MaskSession.__init__, locals())
        self.picture = densify(picture) if isinstance(picture, RGBD) else check_color(picture, "picture")
        self.color = self.picture.color if isinstance(self.picture, RGBD) else self.picture
        self.masker, self.mask_model = check_names(masker, mask_model), mask_model
        if MASKERS[self.masker].needs_depth and not isinstance(picture, RGBD):
            raise InputError(f"masker {self.masker!r} needs depth and the picture has none; an RGBD is expected")

    @cached_property
    def _pointed(self) -> Pointed:
        masker = MASKERS[self.masker]
        return masker.open(self.picture if masker.needs_depth else self.color, self.mask_model)

    def find(
        self,
        *,
        clicks: Sequence[Point] = (),
        not_clicks: Sequence[Point] = (),
        box: Box | None = None,
        candidate: str = "object",
        with_shadow: bool = False,
    ) -> ObjectMask:
        """The mask of the object under clicks or in a box; parameters and errors as `find_mask`."""
        check_arguments(MaskSession.find, locals())
        check_names(self.masker, self.mask_model, candidate)
        masks, notes = self._pointed(self._prompt(clicks, not_clicks, box))
        masks = {each: make_read_only(mask) for each, mask in masks.items() if mask.any()}
        if not masks:
            raise MaskError("nothing of the object is left; fewer `not_clicks` are expected")
        chosen = candidate if candidate in masks else next(iter(masks))
        if candidate not in (chosen, "object"):
            notes = (*notes, f"there is no other reading as a {candidate}, so the mask is the {chosen}")
        if masks[chosen].mean() > 0.5:
            notes = (*notes, TOO_MUCH)
        return complete_mask(self.picture, masks, chosen, self.masker, with_shadow, notes)

    def _prompt(self, clicks: Sequence[Point], not_clicks: Sequence[Point], box: Box | None) -> Prompt:
        height, width = self.color.shape[:2]
        on, off = (tuple((x, y) for x, y in points) for points in (clicks, not_clicks))
        prompt = Prompt((height, width), on, off, None if box is None else (box[0], box[1], box[2], box[3]))
        if MASKERS[self.masker].needs_prompt and not prompt.clicks and prompt.box is None:
            raise InputError("`clicks` and `box` are both missing; give `clicks` on the object, or a `box` round it")
        return prompt


def check_names(masker: str | None, mask_model: MaskModel | None, candidate: str = "object") -> str:
    """The masker, by its name. InputError: an unknown masker or candidate, or networks for a masker that takes none."""
    masker = masker or "rgbd"
    check_word(masker, "masker", MASKERS)
    if mask_model is not None and not MASKERS[masker].takes_model:
        raise InputError(f"`mask_model` is given and the masker {masker!r} runs no network of the user's choice")
    check_word(candidate, "candidate", ("part", "object", "group"))
    return masker


def complete_mask(
    picture: RGBD | UInt8Array,
    masks: Mapping[str, BoolArray],
    chosen: str,
    masker: str,
    with_shadow: bool,
    notes: Sequence[str] = (),
) -> ObjectMask:
    """The chosen mask, with the object's cast shadow on request. InputError: that needs depth."""
    mask = masks[chosen]
    if not with_shadow:
        return ObjectMask(mask, masks, chosen, masker, notes=tuple(notes))
    if not isinstance(picture, RGBD):
        raise InputError("`with_shadow` needs depth and the picture has none; an RGBD is expected")
    shadow = find_shadow(picture, mask)
    missing = () if shadow.any() else ("no shadow found",)
    return ObjectMask(make_read_only(mask | shadow), masks, chosen, masker, make_read_only(shadow), (*notes, *missing))


def find_mask(
    picture: RGBD | UInt8Array,
    *,
    clicks: Sequence[Point] = (),
    not_clicks: Sequence[Point] = (),
    box: Box | None = None,
    masker: str | None = None,
    mask_model: MaskModel | None = None,
    candidate: str = "object",
    with_shadow: bool = False,
) -> ObjectMask:
    """The mask of the object under clicks or in a box. `MaskSession` answers further clicks in the same picture faster.

    Args:
        picture: A picture with depth, or H x W x 3 uint8 RGB for maskers that need no depth.
        clicks: Pixels on the object, (x, y), x right, y down.
        not_clicks: Pixels on the background, as corrections.
        box: x, y, width, height round the object, in pixels.
        masker: A name of MASKERS; None: rgbd.
        mask_model: The networks of the masker segment-anything: sam-vit-b, mobile-sam or efficient-sam (pulled before), the files
            (encoder, decoder) of a pair that carries its contract, or `NAME=ENCODER,DECODER`: with the contract of that name.
        candidate: Which reading of an ambiguous click: part, object or group; `object` where there is no such reading.
        with_shadow: Add the shadow that the object casts on the surface it stands on; needs depth.

    Raises:
        InputError: an unknown masker or candidate, neither clicks nor box, a click or box outside the picture.
        ShapeError: a picture that is none.
        MaskError: there is no object there.
        FileError: a network that is missing, or does not keep its contract.
    """
    session = MaskSession(picture, masker=masker, mask_model=mask_model)
    return session.find(clicks=clicks, not_clicks=not_clicks, box=box, candidate=candidate, with_shadow=with_shadow)


MASKERS: dict[str, MaskerRecord] = {
    "rgbd": MaskerRecord(rgbd_masker, needs_depth=True),
    "salient": MaskerRecord(salient_masker, needs_prompt=False),
    "segment-anything": MaskerRecord(segment_anything_masker, takes_model=True),
}
"""Name -> record; the default comes first."""
