"""What is pointed at in a picture in (options), and a mask found; the words for the library and the mask's files out."""

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

Points = Annotated[tuple[str, ...], option("X,Y ...", "none")]


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
    """What stands out in the picture, by a network that ships with dlama; needs no click."""
    candidate: Annotated[str, option("part|thing|group", "thing")] = "thing"
    """Which reading of an ambiguous click; `dlama mask` says which there are."""
    with_shadow: Annotated[bool, option("", "off")] = False
    """Take the shadow too that the thing casts on the surface it stands on, where there is a plain one."""

    @property
    def given(self) -> bool:
        """Whether anything is pointed at."""
        return bool(self.click or self.not_click or self.box or self.salient)

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of find_mask; raises InputError."""
        return {
            "clicks": [numbers(text, "click", 2, "X,Y") for text in self.click],
            "not_clicks": [numbers(text, "not", 2, "X,Y") for text in self.not_click],
            "box": None if self.box is None else numbers(self.box, "box", 4, "X,Y,W,H"),
            "method": "salient" if self.salient else None,
            "candidate": self.candidate,
            "with_shadow": self.with_shadow,
        }


def numbers(text: str, flag: str, count: int, wanted: str) -> Sequence[float]:
    """The numbers of an option, separated by commas; raises InputError."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count:
        raise InputError(f"--{flag} is {text!r}; {wanted} in pixels is wanted")
    return found


def write_found(found: dlama.ObjectMask, rgbd: dlama.RGBD, output: Path) -> list[Path]:
    """The mask, and beside it NAME_overlay.png: the thing tinted and outlined. OutputError."""
    from dlama.files.rasters.pictures import write_color, write_mask
    from dlama.files.results.preview import tinted

    if output.suffix.lower() != ".png":
        raise InputError(f"output is {output}; a name that ends in .png is wanted")
    overlay = output.with_name(f"{output.stem}_overlay.png")
    write_mask(output, found.mask)
    write_color(overlay, tinted(rgbd.color, found.mask))
    return [output, overlay]


def found_line(found: dlama.ObjectMask, output: Path, seconds: float) -> str:
    """One line: where the mask lies, how large it is, which other readings there are."""
    others = [name for name in found.candidates if name != found.chosen]
    rest = f", --candidate {' or '.join(others)} differs" if others else ""
    shadow = "" if found.shadow is None else f", {found.shadow.mean():.1%} of it shadow"
    notes = "".join(f"; {note}" for note in found.notes)
    line = f"{output}: {found.chosen} by {found.method}, {found.mask.mean():.1%} of the picture"
    return f"{line}{shadow}{rest}{notes}, {seconds:.1f} s"


def found_values(found: dlama.ObjectMask, files: list[Path]) -> dict[str, Any]:
    """The same, JSON-ready."""
    return {
        "files": [str(file) for file in files],
        "method": found.method,
        "candidate": found.chosen,
        "candidates": {name: round(float(mask.mean()), 6) for name, mask in found.candidates.items()},
        "shadow_share": None if found.shadow is None else round(float(found.shadow.mean()), 6),
        "share": round(float(found.mask.mean()), 6),
        "notes": list(found.notes),
    }
