"""MI-GAN: a picture with holes in; the same painted out. The network ships in the package.

Cracks are closed by diffusion first: the network collapses on them. The generator that ships (`benchmarks/migan_export.py`,
tuned by `benchmarks/painter.py`) fills crops of up to 512 x 512.
"""

from __future__ import annotations

from pathlib import Path

from dlama.errors import FileError
from dlama.geometry.holes import dilate_square, morphological_open, square
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.inpainters.filling import Painter
from dlama.inpainters.networks.engine import open_engine
from dlama.inpainters.networks.view_tensors import color_from_planes, color_planes
from dlama.inpainters.opencv import telea, with_diffused_depth


def migan_filler(model: str | Path) -> Painter:
    """A filler of MI-GAN: a file of its generator. It raises FileError where the file is another network's."""
    network = open_engine(model, budget=1024**2, memory_pattern=False)

    def paint(picture: UInt8Array, hole: BoolArray, seed: int) -> UInt8Array:
        kind = network.contract.network  # not before it runs: that loads the network, which many views do without
        if kind != "migan":
            raise FileError(f"{network.path}: is a network {kind!r} by its contract; MI-GAN is expected")
        wide = hole & morphological_open(hole, square(3))
        # and 12 px next to cracks, so that these are as if all of it were
        near = hole & dilate_square(hole & ~wide, 25)
        return color_from_planes(network.fill(color_planes(telea.paint(picture, near, seed))[None], wide)[0])

    return with_diffused_depth(paint, lambda: network.notes)
