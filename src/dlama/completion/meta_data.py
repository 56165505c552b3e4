"""What is known of a completion, as a dict in; the same with its types, read-only, out."""

from __future__ import annotations

from typing import Any, NoReturn, TypedDict, cast


class MetaData(TypedDict, total=False):
    """How a completion came about (docs/reference/formats.md). Read-only, JSON-ready; `|` gives a dict that is neither."""

    depth: str
    """measured or estimated."""
    depth_estimate: dict[str, Any]
    """How it was estimated and scaled."""
    depth_reading: dict[str, Any]
    """The options that a depth or disparity file was read with, of those given."""
    frames: dict[str, Any]
    """Of many frames: numbers, gains, depth noise."""
    object_mask: dict[str, Any]
    """How the mask of the removed object was found."""
    recipe: dict[str, Any]
    """The settings that ran."""
    filler: str
    """The filler that ran."""
    decisions: dict[str, dict[str, Any]]
    """What was chosen, and the reason of each."""
    seed: int
    """Of the fillers."""
    hole_share: list[float]
    """Share of each view (0..1) whose colour was unknown."""
    depth_only_share: list[float]
    """Share of each view with measured colour that lacked only depth."""
    hole_share_by_type: list[dict[str, float]]
    """Both together, by hole type."""
    min_confidence: float
    """The least confidence of a fill,"""
    left_open_share: list[float]
    """and the share of each view that was filled with less and is open."""
    dilation: dict[str, Any]
    """Pixels of masks and holes before and after they grew."""
    flying_pixels_rejected: int
    """Pixels of a depth camera that mix two surfaces, left out."""
    filled_pixels: int
    """Pixels that were written."""
    law_moves: int
    """Filled pixels moved behind what was measured."""
    law_violations: int
    """Those that still break the visibility law: 0."""
    nothing_visible: bool
    """Whether a view shows nothing that was measured."""
    expected_error: dict[str, Any]
    """Mean expected error of what was filled in each view: depth_m and color_levels."""
    stereo: dict[str, Any]
    """Of a pair: lens, gain, shares transferred, agreement."""
    photo3d: dict[str, Any]
    """Of a Photo3D: the box, the cameras it was filled for, what stayed open."""
    seconds: dict[str, float]
    """By stage."""
    notes: dict[str, Any]
    """The fillers' own: networks with their SHA-256, provider and threads ..."""


def read_only(meta: Any) -> MetaData:
    """The meta data, with dicts and lists that refuse to be changed, at any depth."""
    return cast("MetaData", frozen(meta))


def frozen(value: Any) -> Any:
    """A value whose dicts and lists refuse to be changed, at any depth; tuples become lists, as in JSON."""
    if isinstance(value, dict):
        return FrozenDict({key: frozen(one) for key, one in value.items()})
    return FrozenList(map(frozen, value)) if isinstance(value, (list, tuple)) else value


def refuse(*_: Any, **__: Any) -> NoReturn:
    """What stands in the place of each method that changes a FrozenDict or a FrozenList."""
    raise TypeError("meta data are read-only; `dataclasses.replace(done, meta=done.meta | {...})` has others")


class FrozenDict(dict[str, Any]):
    """A dict that refuses to be changed."""

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenDict, (dict(self),)


class FrozenList(list[Any]):
    """A list that refuses to be changed."""

    __setitem__ = __delitem__ = __iadd__ = __imul__ = append = clear = extend = insert = refuse
    pop = remove = reverse = sort = refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenList, (list(self),)
