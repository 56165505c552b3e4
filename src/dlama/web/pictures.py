"""What was read, marked, rendered or completed in; pictures that a browser shows, and what one pixel holds, out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np

import dlama
from dlama.completion.verbs import target_camera
from dlama.files.results.completion import views_by_folder
from dlama.files.results.preview import name_code
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.figures.false_color import (
    HOLE_PALETTE,
    ORIGIN_PALETTE,
    depth_limits,
    depth_picture,
    hatch_holes,
    hole_picture,
    origin_picture,
)
from dlama.geometry.holes import shrink_mask, smaller_size
from dlama.geometry.projection import lift
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.perception.resampling import shrink_rgbd
from dlama.web.answers import Blob, PageError

PREVIEW_PX = 256
MAP_PX = 2048
"""The longer side of a map (depth, origin, ...) at most: the page shows it no larger."""


def png(values: np.ndarray, headers: Mapping[str, str] | None = None) -> Blob:
    """H x W (grey) or H x W x 3 RGB uint8 as PNG; quick rather than small."""
    picture = values[..., ::-1] if values.ndim == 3 else values
    done, data = cv2.imencode(".png", np.ascontiguousarray(picture), [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return Blob(bytes(data), "image/png", headers=headers)


def thin(values: np.ndarray) -> np.ndarray:
    """Every so many-th row and column of a map; codes are not mixed."""
    step = -(-max(values.shape[:2]) // MAP_PX)
    return values[::step, ::step]


class Preview:
    """The scene at 256 pixels: what the source shows of it from any camera, holes in the colours of their types."""

    def __init__(self, rgbd: RGBD, mask: BoolArray | None) -> None:
        self.rgbd = shrink_rgbd(rgbd, smaller_size(rgbd.camera.hw, PREVIEW_PX))
        self.scene = Scene((View.from_rgbd(self.rgbd),))
        if mask is not None and mask.any() and not mask.all():
            gone = shrink_mask(mask, self.rgbd.camera.wh) > 0.5
            if not gone.all():
                self.scene = self.scene.without(gone, dilate=0)

    def show(self, move: Mapping[str, Any]) -> tuple[UInt8Array, list[dict[str, Any]]]:
        """From where a move (yaw, pitch, dolly, pivot) puts the camera: H x W x 3, and its hole types, as of `legends`."""
        view = render(self.scene, target_camera(self.rgbd, **move), fine=False)
        codes = np.where(view.color_hole, view.hole_type, 0).astype(np.uint8)
        return hole_picture(view.color, codes), shares(codes, HoleType, HOLE_PALETTE, skip=0)


def result_views(done: dlama.Completion, right: bool) -> tuple[View, View]:
    """The completed view that is looked at, and the same before filling. PageError."""
    chosen = views_by_folder(done).get("right/" if right else "")
    if chosen is None:
        raise PageError("there is no right view; the result is no stereo pair")
    before = next(warped for view, warped in zip(done.views, done.warped) if view is chosen)
    return chosen, before


def result_picture(done: dlama.Completion, kind: str, right: bool = False) -> UInt8Array:
    """The picture of that kind, H x W x 3. PageError."""
    view, before = result_views(done, right)
    lo, hi = limits(done)
    drawn: dict[str, Callable[[], UInt8Array]] = {
        "image": lambda: hatch_holes(view.color, view.color_hole),
        "known": lambda: hatch_holes(before.color, before.color_hole),
        "hole_type": lambda: hole_picture(thin(view.color), thin(view.hole_type)),
        "origin": lambda: origin_picture(thin(view.origin)),
        "confidence": lambda: np.repeat(np.rint(thin(view.confidence) * 255).astype(np.uint8)[..., None], 3, 2),
        "depth": lambda: depth_picture(thin(view.depth), thin(view.hole), lo, hi),
        "depth_known": lambda: depth_picture(thin(before.depth), thin(before.hole), lo, hi),
        "source": lambda: done.source.color,
    }
    if kind not in drawn:
        raise PageError(f"kind is {kind[:20]!r}; one of {', '.join(drawn)} is expected")
    return drawn[kind]()


def limits(done: dlama.Completion) -> tuple[float, float]:
    """The nearest and the farthest depth of the colours, metres."""
    return depth_limits(done.source.depth, *(view.depth for view in done.views))


def legends(done: dlama.Completion, right: bool = False) -> dict[str, Any]:
    """What the colours mean: hole types and origins that occur with their shares, and the depth scale."""
    view, _ = result_views(done, right)
    return {
        "hole_type": shares(view.hole_type, HoleType, HOLE_PALETTE, skip=0),
        "origin": shares(view.origin, Origin, ORIGIN_PALETTE),
        "depth": depth_ramp(*limits(done)),
    }


def scene_origins(done: dlama.Completion) -> list[dict[str, Any]]:
    """Name and colour of each origin that occurs in the scene."""
    layers = (layer.load() for layer in done.scene.layers)
    found = {int(code) for layer in layers for code in np.unique(layer.origin[~layer.hole])}
    return [{"name": name_code(code), "color": list(ORIGIN_PALETTE[code])} for code in Origin if code in found]


def shares(codes: UInt8Array, names: Any, palette: Any, skip: int = -1) -> list[dict[str, Any]]:
    """Name, colour and share of each code that occurs."""
    counts = np.bincount(codes.ravel(), minlength=len(palette)) / max(codes.size, 1)
    return [
        {"name": name_code(code), "color": list(palette[code]), "share": float(counts[code])}
        for code in names
        if counts[code] and int(code) != skip
    ]


def depth_ramp(lo: float, hi: float) -> dict[str, Any]:
    """The colours from the nearest to the farthest depth, in equal steps of 1 / depth, and metres along them."""
    inverse = np.linspace(1 / lo, 1 / hi, 24)
    colors = depth_picture((1 / inverse).astype(np.float32)[None], None, lo, hi)[0]
    marks = [float(f"{1 / value:.2g}") for value in np.linspace(1 / lo, 1 / hi, 5)]
    return {"colors": colors.tolist(), "metres": marks}


def pixel(view: View, x: int, y: int) -> dict[str, Any]:
    """What a pixel of a view holds: depth (m), point (world, m), origin, confidence, hole type. PageError."""
    width, height = view.camera.wh
    if not (0 <= x < width and 0 <= y < height):
        raise PageError(f"{x},{y} lies outside the picture, which is {width}x{height}")
    depth = float(view.depth[y, x])
    found: dict[str, Any] = {
        "x": x,
        "y": y,
        "color": view.color[y, x].tolist(),
        "origin": name_code(Origin(int(view.origin[y, x]))),
        "hole_type": name_code(HoleType(int(view.hole_type[y, x]))),
        "confidence": round(float(view.confidence[y, x]), 3),
        "depth": None if depth <= 0 else "sky" if np.isinf(depth) else round(depth, 4),
        "point": None,
    }
    if 0 < depth < np.inf:
        one = RGBD(view.color[y : y + 1, x : x + 1], view.depth[y : y + 1, x : x + 1], view.camera.cropped(x, y, 1, 1))
        found["point"] = [round(float(value), 4) for value in lift(one).points[0]]
    return found


def source_depth(rgbd: RGBD) -> tuple[UInt8Array, dict[str, Any]]:
    """The depth that was read, in colours, and their scale."""
    lo, hi = depth_limits(rgbd.depth)
    return depth_picture(thin(rgbd.depth), None, lo, hi), depth_ramp(lo, hi)
