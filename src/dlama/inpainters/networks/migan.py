"""MI-GAN: a view with holes in; colour, and depth as a grey picture, out. The network ships in the package.

Cracks are closed by diffusion first: the network collapses on them. The generator that ships (`benchmarks/migan_export.py`,
tuned by `benchmarks/painter.py`) fills crops of up to 512 x 512. Depth is 8-bit inverse depth, and still better than diffusion's;
its steps are smoothed away by as much as a step cannot tell.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.errors import FileError
from dlama.geometry.holes import morphological_open, square
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import View
from dlama.inpainters.context import FillContext
from dlama.inpainters.filling import Fill, Painter
from dlama.inpainters.networks.engine import Engine, open_engine
from dlama.inpainters.networks.view_tensors import DepthPlane, color_from_planes, color_planes, levels_of
from dlama.inpainters.opencv import telea
from dlama.perception.resampling import smooth_quantised

CRACK_SIDE = 3
"""Holes that a square of this side does not fit into are cracks."""
NETWORK_SIDE = 512
"""The network's own size: every crop of up to this side costs the same."""


def migan_filler(model: str | Path) -> Painter:
    """A filler of MI-GAN: a file of its generator. It raises FileError where the file is another network's."""
    network = open_engine(model, budget=(2 * NETWORK_SIDE) ** 2, memory_pattern=False)

    def require_migan() -> None:  # not before it runs: that loads the network, which many views do without
        if network.contract.network != "migan":
            raise FileError(
                f"{network.path}: is a network {network.contract.network!r} by its contract; MI-GAN is expected"
            )

    def migan(view: View, context: FillContext, seed: int) -> Fill:
        require_migan()
        diffused = telea(view, context, seed)
        color = fill_picture(view.color, diffused.color, view.color_hole, network)
        return Fill(color, fill_depth(view, diffused.depth, network), notes=network.notes)

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        require_migan()
        return fill_picture(picture, telea.paint(picture, hole, seed), hole, network)

    return Painter(paint, migan, lambda: network.notes)


def fill_picture(known: UInt8Array, diffused: UInt8Array, hole: BoolArray, network: Engine) -> UInt8Array:
    """H x W x 3: cracks as diffused, wider holes by the network, known pixels as they are."""
    wide = hole & ~find_cracks(hole)
    start = np.where(hole[..., None], diffused, known)
    return color_from_planes(network.fill(color_planes(start)[None], wide)[0])


def fill_depth(view: View, diffused: Float32Array, network: Engine) -> Float32Array:
    """H x W metres by way of 256 grey levels of inverse depth, 255 = the nearest pixel, 0 = far."""
    plane = DepthPlane.of(view)
    start = np.where(view.hole, inverse_depth(diffused) / np.float32(plane.scale), plane.values)
    grey = np.repeat(levels_of(start)[..., None], 3, 2)
    levels = fill_picture(grey, grey, view.hole, network).astype(np.float32).mean(2)
    values = np.where(view.hole & ~find_cracks(view.hole), smooth_quantised(levels) / 255, start)
    if not view.far.any():  # level 0 is then no sky, only farther than a step can tell
        values = np.maximum(values, np.float32(0.25 / 255))
    return plane.metres(values.astype(np.float32))


def find_cracks(hole: BoolArray) -> BoolArray:
    """H x W, True in hole pixels that are on no CRACK_SIDE x CRACK_SIDE square of hole (beyond the border counts as hole)."""
    return hole & ~morphological_open(hole, square(CRACK_SIDE))
