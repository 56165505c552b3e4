"""What is pointed at in a picture (options of `mask`, `remove` and `stereo`) in; the mask of the thing out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import arg

from dlama.apps.options import option
from dlama.errors import InputError

if TYPE_CHECKING:
    import dlama
    from dlama.geometry.rgbd import UInt8Array

Points = Annotated[tuple[str, ...], option("X,Y ...", "none")]
MASKERS = ("rgbd", "salient", "segment-anything")
"""Names of the maskers, the default first."""


@dataclass(frozen=True)
class Pointing:
    """Which thing is meant, in place of a mask file. Pixels as in the picture: x to the right, y down."""

    click: Points = ()
    """Pixels on the thing."""
    not_click: Annotated[tuple[str, ...], arg(name="not", metavar="X,Y ...", help_behavior_hint="(default: none)")] = ()
    """Pixels beside it, to correct with."""
    box: Annotated[str | None, option("X,Y,W,H")] = None
    """A box round the thing: its upper left corner, width and height."""
    salient: Annotated[bool, option("", "off")] = False
    """What stands out in the picture, by a network that ships with dlama; needs no click. Short for --masker salient."""
    object_class: Annotated[
        str | None, arg(name="class", metavar="NAME|R,G,B", help_behavior_hint="(default: none)")
    ] = None
    """The class of this name in the EasySynth semantic picture that belongs to IMAGE (in SemanticImage/ beside its folder)."""
    masker: Annotated[str | None, option("|".join(MASKERS), MASKERS[0])] = None
    """What finds the thing: rgbd by depth and colour, salient by a network that ships, segment-anything by a pair of networks."""
    mask_model: Annotated[str | None, option("NAME|NAME=ENCODER,DECODER")] = None
    """Networks of --masker segment-anything: sam-vit-b, mobile-sam or efficient-sam (`dlama models pull` gets NAME-encoder and
    NAME-decoder), or two ONNX files."""
    candidate: Annotated[str, option("part|thing|group", "thing")] = "thing"
    """Which reading of an ambiguous click; `dlama mask` says which there are."""
    with_shadow: Annotated[bool, option("", "off")] = False
    """Take the shadow too that the thing casts on the surface it stands on, where there is a plain one."""

    @property
    def given(self) -> bool:
        """Whether anything is pointed at."""
        pointed = self.click or self.not_click or self.box or self.salient
        return bool(pointed or self.object_class or self.masker == "salient")

    @property
    def needs_depth(self) -> bool:
        """Whether the thing is found in depth."""
        by_color = self.salient or self.object_class is not None or self.masker not in (None, "rgbd")
        return self.with_shadow or not by_color

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of find_mask; raises InputError."""
        if self.salient and self.masker not in (None, "salient"):
            raise InputError(f"--salient and --masker {self.masker} contradict each other; give one of them")
        return {
            "clicks": [numbers(text, "click", 2, "X,Y") for text in self.click],
            "not_clicks": [numbers(text, "not", 2, "X,Y") for text in self.not_click],
            "box": None if self.box is None else numbers(self.box, "box", 4, "X,Y,W,H"),
            "masker": "salient" if self.salient else self.masker,
            "mask_model": self.mask_model,
            "candidate": self.candidate,
            "with_shadow": self.with_shadow,
        }

    def find(self, picture: dlama.RGBD | UInt8Array, image: Path) -> dlama.ObjectMask:
        """The thing in a picture, read from `image`. InputError and its kin."""
        import dlama

        settings = self.settings()
        if self.object_class is None:
            return dlama.find_mask(picture, **settings)
        if self.click or self.not_click or self.box or settings["masker"]:
            raise InputError(
                "--class and other ways to say which thing is meant contradict each other; give one of them"
            )
        from dlama.files.rasters.pictures import read_mask
        from dlama.files.semantic_classes import semantic_picture
        from dlama.perception.object_masks import completed

        mask = read_mask(semantic_picture(image), mask_class=self.object_class)
        return completed(picture, {"thing": mask}, "thing", f"class {self.object_class}", self.with_shadow)


def numbers(text: str, flag: str, count: int, wanted: str) -> Sequence[float]:
    """The numbers of an option, separated by commas; raises InputError."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count:
        raise InputError(f"--{flag} is {text!r}; {wanted} in pixels is wanted")
    return found
