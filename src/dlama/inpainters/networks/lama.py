"""LaMa: a view with holes and any 4 -> 3 network file in; colour, and depth as a grey picture, out.

Joint: the same with any 5 -> 4 network file, which fills colour and depth in one pass.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Inpainter, Painter
from dlama.inpainters.grey_depth import channel_spread
from dlama.inpainters.networks.contract import require_planes
from dlama.inpainters.networks.engine import open_engine
from dlama.inpainters.networks.view_tensors import DepthPlane, color_from_planes, color_planes, robust_scale


def lama_filler(model: str | Path) -> Inpainter:
    """A filler of a network file. FileError where there is no file.

    Depth goes in as three equal planes of inverse depth on the scale of the view's nearest pixel, 0 = infinity, and
    comes back as their mean: float all the way.
    """
    network = open_engine(model)

    def lama(view: View, context: FillContext, seed: int) -> Fill:
        color, depth = paint(view.color, view.color_hole, seed), DepthPlane.of(view)
        grey = network.fill(np.repeat(depth.values[None], 3, 0)[None], view.hole)[0]
        spread = channel_spread(grey.transpose(1, 2, 0) * 255, view.hole)
        return Fill(color, depth.metres(grey.mean(0)), notes=network.notes | {"depth_channel_spread": spread})

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        require_planes(network.contract, 3, str(network.path), "lama")
        return color_from_planes(network.fill(color_planes(picture)[None], hole)[0])

    return Painter(paint, lama, lambda: network.notes)


def joint_filler(model: str | Path) -> Inpainter:
    """A filler of a network file that takes red, green, blue, depth, mask.

    Depth is inverse depth on the scale of `contract.DEPTH_PLANE`. In a sensor hole the
    network sees neither colour nor depth; only its depth is used there. FileError where there is no file.
    """
    network = open_engine(model)

    def joint(view: View, context: FillContext, seed: int) -> Fill:
        require_planes(network.contract, 4, str(network.path), "joint")
        depth = DepthPlane.of(view, robust_scale)
        filled = network.fill(np.concatenate([color_planes(view.color), depth.values[None]])[None], view.hole)[0]
        return Fill(color_from_planes(filled[:3]), depth.metres(filled[3]), notes=network.notes)

    return joint
