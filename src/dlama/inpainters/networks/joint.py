"""Joint: a view with holes and any 5 -> 4 network file in; colour and depth, filled in one pass, out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.geometry.view import View
from dlama.geometry.visibility import Law
from dlama.inpainters.filling import Fill, Inpainter
from dlama.inpainters.networks.contract import Contract, require_planes
from dlama.inpainters.networks.engine import Engine, open_engine
from dlama.inpainters.networks.view_tensors import DepthPlane, color_from_planes, color_planes, robust_scale


def joint_filler(model: str | Path | Engine, contract: Contract | None = None) -> Inpainter:
    """A filler of a network file (or of an engine) that takes red, green, blue, depth, mask.

    Depth is inverse depth on the scale of `contract.DEPTH_PLANE`. In a sensor hole the
    network sees neither colour nor depth; only its depth is used there. FileError where there is no file.
    """
    network = open_engine(model, contract)

    def joint(view: View, law: Law, seed: int) -> Fill:
        require_planes(network.contract, 4, str(network.path), "joint")
        depth = DepthPlane.of(view, robust_scale)
        filled = network.fill(np.concatenate([color_planes(view.color), depth.values[None]])[None], view.hole)[0]
        return Fill(color_from_planes(filled[:3]), depth.metres(filled[3]), notes=network.notes)

    return joint
