"""A picture in; the mask of its salient object out, by U2-Net-p (Qin et al. 2020), which ships in the package. No prompt.

The network's contract: input 1 x 3 x 320 x 320, RGB over the picture's largest value, with ImageNet's mean and deviation. Its
first output is 1 x 1 x 320 x 320, high on the object, stretched to 0..1.
"""

from __future__ import annotations

import cv2
import numpy as np

from dlama.errors import MaskError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.models.network_file import ASSETS, make_room, shipped_network
from dlama.perception.depth_networks import IMAGENET
from dlama.perception.masks.prompt import Pixel, Pointed, Prompt
from dlama.perception.monocular import LEAST_CONTRAST, contrast
from dlama.perception.resampling import interpolate

MODEL = ASSETS / "u2netp" / "u2netp.onnx"
SIDE = 320
Window = tuple[slice, slice]
"""Rows and columns."""


def salient_masker(color: UInt8Array, model: None) -> Pointed:
    """The masker of one picture (H x W x 3): the network runs once."""
    make_room(color[..., 0].size)
    level = saliency(color)
    return lambda prompt: salient_candidates(level, prompt)


def saliency(color: UInt8Array) -> Float32Array:
    """H x W saliency in 0..1 of a picture (H x W x 3, RGB). MaskError: no salient object."""
    return interpolate(small_saliency(color), color.shape)


def small_saliency(color: UInt8Array) -> Float32Array:
    """As `saliency`, SIDE x SIDE."""
    if contrast(color) < LEAST_CONTRAST:
        raise MaskError(
            "the picture has nearly one colour all over: it has no salient object; another picture is expected"
        )
    small = cv2.resize(color, (SIDE, SIDE), interpolation=cv2.INTER_AREA).astype(np.float32)
    mean, deviation = np.array(IMAGENET, np.float32)
    planes = (small / max(float(small.max()), 1e-6) - mean) / deviation
    net = shipped_network(MODEL, memory_pattern=False)  # no slower, and 200 MB less
    name = next(iter(net.inputs))
    out = net.run({name: np.ascontiguousarray(planes.transpose(2, 0, 1)[None], np.float32)})[0, 0]
    low, high = float(out.min()), float(out.max())
    if high - low < 0.05:
        raise MaskError("no salient object was found in the picture; click on an object, or give a box round it")
    return np.asarray((out - low) / (high - low), np.float32)


def window_side(hw: tuple[int, ...], share: float) -> int:
    """Side in px of a window, as a share of the root of the picture's area."""
    return round(share * float(np.sqrt(hw[0] * hw[1])))


def window_around(pixel: Pixel, side: int, hw: tuple[int, ...]) -> Window:
    """Rows and columns of the square about a pixel, shifted and clipped to the picture."""
    lengths = [min(side, length) for length in hw]
    starts = [int(np.clip(at - n / 2, 0, length - n)) for at, n, length in zip(pixel, lengths, hw)]
    return slice(starts[0], starts[0] + lengths[0]), slice(starts[1], starts[1] + lengths[1])


class WindowSaliency:
    """Saliency in windows of one picture; the network runs once for each."""

    def __init__(self, color: UInt8Array) -> None:
        self.color = color
        self.known: dict[tuple[int, ...], Float32Array | None] = {}

    def level(self, window: Window) -> Float32Array | None:
        """Saliency of a window, of its height and width; None where nothing is salient in it."""
        key = tuple(edge for side in window for edge in (side.start, side.stop))
        part = self.color[window]
        if key not in self.known:
            try:
                self.known[key] = small_saliency(np.ascontiguousarray(part))
            except MaskError:
                self.known[key] = None
        small = self.known[key]
        return None if small is None else interpolate(small, part.shape)


def salient_candidates(level: Float32Array, prompt: Prompt) -> tuple[dict[str, BoolArray], tuple[str, ...]]:
    """The H x W mask of the salient object, as `object`; within the box, and the pieces with a click, where there are any.

    Pieces that contain a negative click are left out. MaskError: no salient object there.
    """
    mask = (level > 0.5) & prompt.inside
    if not mask.any():
        raise MaskError("box holds no salient object; another box, or clicks on the object, are expected")
    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    for column, row in prompt.clicks:
        if not labels[int(row), int(column)]:
            raise MaskError(
                f"`clicks` holds {column:g},{row:g}, where there is no salient object; click on one, "
                "or choose another masker"
            )
    if prompt.clicks:
        mask &= np.isin(labels, [labels[pixel] for pixel in prompt.on])
    away = {int(labels[pixel]) for pixel in prompt.away} - {0}
    return {"object": np.asarray(mask & ~np.isin(labels, list(away)))}, ()
