"""The name of a filler in; the function that makes it out. Importing this loads the code of all fillers, but no network."""

from __future__ import annotations

from collections.abc import Callable

from dlama.inpainters.filling import Inpainter
from dlama.inpainters.layered.filler import layered, layered_patches_filler
from dlama.inpainters.networks.engine import open_engine
from dlama.inpainters.networks.lama import joint_filler, lama_filler
from dlama.inpainters.networks.migan import migan_filler
from dlama.inpainters.networks.pair import PairFiller
from dlama.inpainters.opencv import telea
from dlama.inpainters.patchmatch.filler import patchmatch_filler

MAKE: dict[str, Callable[..., Inpainter]] = {
    "layered": lambda: layered,
    "layered-patches": layered_patches_filler,
    "telea": lambda: telea,
    "lama": lama_filler,
    "migan": migan_filler,
    "patchmatch": patchmatch_filler,
    "joint": joint_filler,
    "pair": lambda model: PairFiller(open_engine(model)),
}
"""Name -> makes the filler; one that runs a network, of its model file."""
