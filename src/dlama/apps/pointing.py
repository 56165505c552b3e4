"""What is pointed at in a picture (options of `mask`, `remove` and `stereo`) in; the mask of the object out."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from dlama.apps.options import option
from dlama.jobs.inputs import find_pointed, is_pointed, mask_settings

if TYPE_CHECKING:
    import dlama
    from dlama.geometry.rgbd import UInt8Array

Points = Annotated[tuple[str, ...], option("X,Y ...", "none")]
MASKERS = ("rgbd", "salient", "segment-anything")
"""Names of the maskers, the default first."""


@dataclass(frozen=True)
class Pointing:
    """Points at the object, in place of a mask file. Pixels as in the picture: x to the right, y down."""

    click: Points = ()
    """Pixels on the object."""
    not_click: Annotated[tuple[str, ...], arg(name="not", metavar="X,Y ...", help_behavior_hint="(default: none)")] = ()
    """Pixels next to it, which the mask must not hold."""
    box: Annotated[str | None, option("X,Y,W,H")] = None
    """A box around the object: its upper left corner, width and height."""
    salient: Annotated[bool, option("", "off")] = False
    """What stands out in the picture, by a network that ships with dlama; needs no click. Short for --masker salient."""
    object_class: Annotated[
        str | None, arg(name="class", metavar="NAME|R,G,B", help_behavior_hint="(default: none)")
    ] = None
    """The class of this name in the EasySynth semantic picture that belongs to IMAGE (in SemanticImage/, next to its folder)."""
    masker: Annotated[str | None, option("|".join(MASKERS), MASKERS[0])] = None
    """What finds the object: rgbd by depth and colour, salient by a network that ships, segment-anything by two networks."""
    mask_model: Annotated[
        str | None,
        option(
            "NAME|NAME=ENCODER,DECODER",
            help="Networks of --masker segment-anything: sam-vit-b, mobile-sam or efficient-sam (`dlama models pull` gets "
            "NAME-encoder and NAME-decoder), or two ONNX files.",
        ),
    ] = None
    candidate: Annotated[str, option("part|object|group", "object")] = "object"
    """Which reading of an ambiguous click; `dlama mask` prints which there are."""
    with_shadow: Annotated[bool, option("", "off")] = False
    """Add the shadow that the object casts on the surface it stands on, where it is clear."""

    @property
    def given(self) -> bool:
        """Whether anything is pointed at. InputError, before anything is read, for words that are no pixels."""
        self.settings()
        return is_pointed(dataclasses.asdict(self))

    @property
    def needs_depth(self) -> bool:
        """Whether the object is found in depth."""
        by_color = self.salient or self.object_class is not None or self.masker not in (None, "rgbd")
        return self.with_shadow or not by_color

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of find_mask; raises InputError."""
        options = dataclasses.asdict(self)
        del options["object_class"]
        return mask_settings(**options)

    def find(self, picture: dlama.RGBD | UInt8Array, image: Path) -> dlama.ObjectMask:
        """The object in a picture, read from `image`. InputError and its kin."""
        return find_pointed(picture, image, self.settings(), self.object_class)


def mask_notes(chosen: str, candidates: Iterable[str], notes: Iterable[str]) -> str:
    """For the last line: which other readings of the clicks there are, and what to know of the mask; "" where nothing is."""
    others = [name for name in candidates if name != chosen]
    differs = [f"--candidate {' or '.join(others)} gives another mask"] if others else []
    return "".join(f"; {one}" for one in [*differs, *notes])
