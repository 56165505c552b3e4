"""Switches of the rules of filling: each name turns one rule off in this process, for `bench.py run --without RULE` and `--each`;
no product option. A rule stays that gains on data that it was not made on, in two domains at least (docs/benchmarks.md)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

_REPLACED: list[tuple[Any, str, Any]] = []
"""Owner, name and value from before, of all that is switched off now."""


@contextlib.contextmanager
def without(rule: str) -> Iterator[None]:
    """Switch a rule off; "" is none."""
    start = len(_REPLACED)
    if rule:
        (RULES | SHADOW_RULES | MASK_RULES)[rule]()
    try:
        yield
    finally:
        while len(_REPLACED) > start:
            setattr(*_REPLACED.pop())


def _set(owner: Any, name: str, value: Any) -> None:
    _REPLACED.append((owner, name, getattr(owner, name)))
    setattr(owner, name, value)


def _replace(place: str, name: str, value: Any) -> None:
    import importlib

    module = importlib.import_module(f"dlama.{place}")
    assert hasattr(module, name), f"{place}.{name}"
    _set(module, name, value)


def _foliage() -> None:
    _replace("inpainters.layered.depth.surfaces", "copy_leaves", lambda *of, seed=0: np.zeros((2, 0), np.intp))
    _no_cut_crowns()


def _no_cut_crowns() -> None:
    from dlama.inpainters.layered.depth.cut_objects import find_cut_objects

    _replace(
        "inpainters.layered.depth.surfaces",
        "find_cut_objects",
        lambda *of, **_: find_cut_objects(*of, with_leaves=False),
    )


def _low_frequency() -> None:
    for place in ("inpainters.layered.filler", "inpainters.layered.depth_first"):
        _replace(place, "blend_with_low_frequency", lambda view, color, *rest, **more: color)


def _remaining_shadows() -> None:
    for place in ("inpainters.layered.color.surface_colors", "inpainters.layered.depth_first"):
        _replace(place, "find_remaining_shadow", lambda view, *rest: np.zeros_like(view.hole))


def _plane_edges() -> None:
    _replace("inpainters.layered.depth.surface_labels", "align_lines_to_edges", lambda lines, *rest: lines)


def _of_coarse(method: str, value: Callable[..., Any]) -> Callable[[], None]:
    def switch() -> None:
        from dlama.inpainters.layered.depth.surface_labels import CoarseView

        _set(CoarseView, method, value)

    return switch


def _ending_cost() -> None:
    _replace("inpainters.layered.depth.surface_labels", "ending_cost", lambda *rest: np.float32(0))


def _hanging() -> None:
    _replace(
        "inpainters.layered.depth.out_of_view", "has_ended", lambda first, length, **_: (first > 0) & (length == 0)
    )


def _between() -> None:
    def nothing(lines: Any, cells: Any, *rest: Any) -> tuple[Any, Any]:
        return (np.zeros(cells.candidates.shape, np.float32),) * 2

    _replace("inpainters.layered.depth.surface_labels", "continue_between", nothing)


def _seams() -> None:
    _replace("inpainters.layered.depth_first", "seams", lambda label, hole: np.zeros_like(hole))


def _whole_occluders() -> None:
    _replace("inpainters.layered.depth_first", "OCCLUDER_REACH", 0.0)


def _occluders() -> None:
    _replace("inpainters.layered.depth_first", "is_in_front", lambda view, *rest: np.zeros_like(view.hole))


def _sky_without_depth() -> None:
    _replace("perception.missing_depth", "find_plain_sky", lambda color, free, depth: np.zeros_like(free))


def _plain_infinity() -> None:
    _replace("completion.stereo.disparities", "drop_plain_infinity", lambda color, disparity, depth: disparity)


def _refined_disparity() -> None:
    from dlama.perception.stereo.subpixel import denoise

    _replace("perception.stereo.matching", "refine_disparity", lambda left, right, found, lowest: denoise(found))


def _beyond_range() -> None:
    _replace("inpainters.layered.depth.surfaces", "move_beyond_range", lambda filled, *rest: filled)


def _seen_past() -> None:
    from dlama.perception.missing_depth import fill_along_colors

    _replace("inpainters.layered.depth.surfaces", "fill_along_colors", lambda *of: fill_along_colors(*of[:5]))


def _unlike_frames() -> None:
    _replace("geometry.frames.merging", "UNLIKE", np.inf)


def _narrow_occluders() -> None:
    """Occluders give colours to narrow holes next to them."""
    _replace("inpainters.layered.filler", "NEARER", np.inf)


def _mixed_fills() -> None:
    """What is filled next to an occluder is seen by other cameras, too."""
    from dlama.geometry.drawing.grid_mesh import Seen, mesh_grid

    _replace("geometry.drawing.layers", "seen_from_elsewhere", lambda view: Seen(*mesh_grid(view), view.far))


def _depth_camera() -> None:
    """What depth edges next to the picture's change: their place, halo, softening, solid planes."""
    _replace("geometry.drawing.picture_edges", "edge_uncertainty", lambda view: 0)


def _shadow(name: str, value: Any, place: str = "find") -> Callable[[], None]:
    return lambda: _replace(f"perception.shadows.{place}", name, value)


def _no_pixel_classifier() -> None:
    """Pixels of a shadow by the network alone."""
    from dlama.perception.shadows import classifier as room

    def of_network(planes: Any, parts: Any, file: Any = None) -> Any:
        import dataclasses

        marked = room.network_probability(planes, file)
        return [dataclasses.replace(one, probability=marked) for one in before(planes, parts, file)]

    before = room.find_likely_shadows
    _set(room, "find_likely_shadows", of_network)


def _network_alone() -> Callable[[], None]:
    """No classifiers: what the network marks is the shadow."""

    def marked_alone(planes: Any) -> Any:
        from dlama.perception.shadows import classifier as room

        marked = room.network_probability(planes)
        return marked if (marked > room.SHADOW).any() else None

    return _shadow("shadow_probability", marked_alone)


def _empty_plane(name: str) -> Callable[[], None]:
    """A plane of the shadow network that is empty."""

    def off() -> None:
        from dlama.perception.shadows import find

        def emptied(*args: Any) -> Any:
            planes, *rest = before(*args)
            planes.plane(name)[:] = 0
            return planes, *rest

        before = find.shadow_planes
        _set(find, "shadow_planes", emptied)

    return off


SHADOW_RULES: dict[str, Callable[[], None]] = {
    "classifiers": _network_alone(),
    "own-light": _empty_plane("cast"),
    "common-light": _empty_plane("common"),
    "ground-gaps": _shadow("GAP_PX", 1, "ground"),
    "grow-ambient": _shadow("grow_ambient_shadow", lambda rgbd, mask, *rest: np.zeros_like(mask)),
    "under-object": _shadow("grow_under_object", lambda rgbd, mask, *rest: np.zeros_like(mask)),
    "pixel-classifier": _no_pixel_classifier,
}
"""The same of `dlama.perception.shadows`, for `shadow_rules.py`."""


def _mask(name: str, value: Any, place: str = "rgbd") -> Callable[[], None]:
    return lambda: _replace(f"perception.masks.{place}", name, value)


def _salient_photo() -> None:
    from dlama.perception.masks.photo import PhotoMasker

    _set(PhotoMasker, "readings", lambda self, pixel: [])


def _no_own_mask() -> None:
    for name in ("AGREES", "AGREES_ESTIMATED", "AGREES_CAMERA"):
        _mask(name, 0.0, "choice")()


def _no_click_network() -> None:
    from dlama.perception.masks.choice import Masker
    from dlama.perception.masks.photo import name_masks

    def first_found(self: Masker, prompt: Any) -> Any:
        first, *others = self.find(prompt)
        return name_masks(first, others)

    _set(Masker, "masks_of_click", first_found)


MASK_RULES: dict[str, Callable[[], None]] = {
    "stands": _mask("find_stands", lambda measured, *rest: np.zeros(measured.rgbd.depth.shape, np.bool_)),
    "several-pieces": _mask("OBJECT_GAP", 0.0),
    "border-colors": _mask("snap_to_picture_edges", lambda rgbd, target, *rest: target),
    "click-network": _no_click_network,
    "networks-own-mask": _no_own_mask,
    "salient-photo": _salient_photo,
    "second-window": _mask("WINDOWS", (), "photo"),
    "photo-border": _mask("refine_border", lambda rgbd, mask, window_hw: mask, "photo"),
}
"""The same of `dlama.perception.masks`, for `clicks.py --rules`."""
RULES: dict[str, Callable[[], None]] = {
    "foliage": _foliage,
    "low-frequency": _low_frequency,
    "remaining-shadows": _remaining_shadows,
    "plane-edges": _plane_edges,
    "order": _of_coarse("out_of_order", lambda self: np.zeros((len(self.candidates) - 1, *self.hole.shape), np.bool_)),
    "relief": _of_coarse("with_relief", lambda self: self.label),
    "enclosed-sky": _of_coarse("enclosed_by_surfaces", lambda self: np.zeros_like(self.hole)),
    "floating": _of_coarse("floating", lambda self, label: np.zeros_like(self.hole)),
    "between": _between,
    "hanging": _hanging,
    "ending-cost": _ending_cost,
    "seams": _seams,
    "whole-occluders": _whole_occluders,
    "occluders": _occluders,
    "depth-camera": _depth_camera,
    "beyond-range": _beyond_range,
    "sky-without-depth": _sky_without_depth,
    "plain-infinity": _plain_infinity,
    "refined-disparity": _refined_disparity,
    "seen-past": _seen_past,
    "unlike-frames": _unlike_frames,
    "narrow-occluders": _narrow_occluders,
    "mixed-fills": _mixed_fills,
}
"""Name -> what turns the rule off."""
