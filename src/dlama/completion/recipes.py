"""The name of a recipe and changes to it in; the settings of the whole method out. `dlama` is ours, `paper` is as published."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal, get_args

from dlama.arguments import check, check_count, check_word, is_finite
from dlama.errors import InputError
from dlama.geometry.rendering import MODES, Mode

DepthBy = Literal["surfaces", "filler"]
"""What fills depth for a filler of pictures: surfaces continued behind the hole, or the filler itself."""
NEAREST_CLIP_M = 0.01
"""A nearer clip would make a wall of every scene."""
WIDEST_PX = 1024
"""By how much masks and holes are dilated at most."""


@dataclass(frozen=True)
class Recipe:
    """How a scene is completed. Contradictions raise InputError.

    What is not given is as in `dlama`. A recipe of one's own: `Recipe("mine", footprint=True)`.
    """

    name: str
    """`dlama` or `paper`; further changes are listed next to it in meta.json."""
    mode: Mode = "surface"
    """How clouds are rendered: a cut triangle mesh, or nearest pixels."""
    dilate: int | None = None
    """Radius in px by which an object mask grows before its pixels leave the cloud (disc kernel); None: 3, in proportion
    more where the longer side exceeds 1024 px."""
    dilate_holes: int = 0
    """Radius in px by which the holes of the new view grow (disc kernel)."""
    clip: float | None = None
    """Everything at or beyond this many metres, sky too, is put at it (the paper: 10 m); None: nothing is clipped."""
    eight_bit_depth: bool = False
    """Filled depth in 8-bit steps of clip / 255, as the paper's depth pictures."""
    depth_by: DepthBy = "surfaces"
    """What fills depth where the filler is one of pictures (telea, lama, migan): surfaces continued behind the hole, or the
    filler's own way. Fillers of colour and depth (layered, joint) always go their own."""
    law: bool = True
    """Put filled depth behind what was measured (the visibility law). False: the method as published, which has no such law;
    for comparisons."""
    footprint: bool = False
    """Add the projected footprint of the object mask to the hole of the new view (fig. 5, the union)."""
    source_first: bool = True
    """Fill sensor holes and removed objects in the source view, then move; else move first, as the paper does."""

    def __post_init__(self) -> None:
        check_word(self.mode, "mode", MODES)
        for name in ("eight_bit_depth", "law", "footprint", "source_first"):
            check(getattr(self, name), bool, name)
        for name in ("dilate", "dilate_holes"):
            check_count(getattr(self, name), name, 0, WIDEST_PX)
        if self.clip is not None and not (is_finite(self.clip) and self.clip >= NEAREST_CLIP_M):
            raise InputError(f"`clip` is {self.clip!r} m; {NEAREST_CLIP_M} or more is expected")
        check_word(self.depth_by, "depth_by", get_args(DepthBy))
        if self.eight_bit_depth and self.clip is None:
            raise InputError("8-bit depth needs clip, the depth of level 255")
        if self.eight_bit_depth and self.depth_by != "filler":
            raise InputError("8-bit depth is the filler's; `depth_by` 'filler' is expected with it")


RECIPES: dict[str, Recipe] = {
    "dlama": Recipe("dlama"),
    "paper": Recipe(
        "paper",
        mode="points",
        dilate=3,
        clip=10.0,
        eight_bit_depth=True,
        depth_by="filler",
        footprint=True,
        source_first=False,
    ),
}


def check_seed(seed: int) -> None:
    """InputError unless the seed is 0 to 2**32 - 1, as NumPy's generators take it."""
    check_count(seed, "seed", 0, 2**32 - 1)


def check_confidence(min_confidence: float) -> float:
    """The least confidence, if it is a probability; else InputError."""
    if not is_finite(min_confidence) or not 0 <= min_confidence <= 1:
        raise InputError(f"`min_confidence` is {min_confidence!r}; a probability from 0 to 1 is expected")
    return min_confidence


def find_recipe(name: str | Recipe, **changes: Any) -> Recipe:
    """The recipe of that name (or the one given) with the changes to its settings that are not None.

    Raises InputError: an unknown name (the known ones are listed), or options that contradict each other.
    """
    if not isinstance(name, Recipe) and name not in RECIPES:
        raise InputError(f"`recipe` is {name!r}; one of {', '.join(RECIPES)} is expected")
    chosen = name if isinstance(name, Recipe) else RECIPES[name]
    return dataclasses.replace(chosen, **{key: value for key, value in changes.items() if value is not None})
