"""Ways of filling: View with holes -> View without. One file per way; the closed set of names is the dict below."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dlama.errors import InputError
from dlama.inpainters.filling import Fill, FillReport, Inpainter, inpaint
from dlama.inpainters.layered.layered import layered
from dlama.inpainters.networks.joint import joint_filler
from dlama.inpainters.networks.lama import lama_filler
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.networks.pair import pair_filler
from dlama.inpainters.opencv import navier_stokes, telea

__all__ = ["INPAINTERS", "MODEL_INPAINTERS", "Fill", "FillReport", "Inpainter", "inpaint", "inpainter"]

INPAINTERS: dict[str, Inpainter] = {
    "layered": layered,
    "telea": telea,
    "navier-stokes": navier_stokes,
}

MODEL_INPAINTERS: dict[str, Callable[[str | Path], Inpainter]] = {
    "lama": lama_filler,
    "migan": migan_filler,
    "joint": joint_filler,
    "pair": pair_filler,
}
"""Fillers that run a network file: file -> filler."""


def inpainter(name: str, model: str | Path | None = None) -> Inpainter:
    """The filler of that name, with its network file if it runs one.

    InputError: an unknown name (the known ones are listed), a file missing, or given to a filler that takes none.
    """
    if name in MODEL_INPAINTERS:
        if model is None:
            raise InputError(f"filler {name!r} runs a network: --model FILE is wanted (`dlama models pull` gets one)")
        return MODEL_INPAINTERS[name](model)
    if name not in INPAINTERS:
        raise InputError(f"filler is {name!r}; one of {', '.join([*INPAINTERS, *MODEL_INPAINTERS])} is wanted")
    if model is not None:
        raise InputError(f"filler {name!r} runs no network, so --model {model} has no use")
    return INPAINTERS[name]
