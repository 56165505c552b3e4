"""Fillers: a View with holes in; the same View without holes out. FILLERS, at the end, is the closed list of their names.

Begin with `filling` (the contract of a filler, and what `inpaint` guarantees). Then `layered/` (the default for exact depth),
`patchmatch/` (over `layered` for depth cameras, alone for estimated depth) and `networks/`. This file imports no filler: the
command line's help reads the names, and a filler's code is imported on first use.
"""

from __future__ import annotations

import pkgutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from dlama.errors import InputError

if TYPE_CHECKING:
    from dlama.inpainters.filling import Inpainter


Given = TypeVar("Given")
ASSETS = Path(__file__).parents[1] / "assets"


@dataclass(frozen=True)
class FillerRecord:
    """A filler's code and its requirements."""

    entry_point: str
    """`module:name` of the Inpainter; of a filler that runs a network, of the function that makes one of a model file."""
    needs_model: bool = False
    """Whether it runs a network file."""
    shipped: str | None = None
    """The network file that ships in the package, under assets/; the default."""
    source: str = "`dlama train` makes one"
    """Source of a network file, for a filler whose network does not ship."""


AUTO = "auto"
"""The default: the filler that suits the depth."""
EXACT, CAMERA, ESTIMATED = "layered", "layered-patches", "patchmatch"
"""Its choices: for depth that fits its picture (rendered, scanned); for depth cameras and removed objects; for estimated depth,
whose planes are bent and torn."""


def auto_filler(*, estimated: bool = False, misplaced: bool = False, removed: bool = False) -> str:
    """The filler that AUTO chooses.

    estimated: the depth is that of a network. misplaced: its edges are misaligned with the picture, as a depth camera's are.
    removed: an object is removed.
    """
    return ESTIMATED if estimated else CAMERA if misplaced or removed else EXACT


def find_filler(filler: str | Inpainter, model: str | Path | None = None) -> Inpainter:
    """The filler of that name, with its network file if it runs one; a function is returned as it is.

    InputError: an unknown name (the known ones are listed), or a model missing or given to a filler that takes none.
    """
    if not isinstance(filler, str):
        if model is not None:
            raise InputError(f"model is {model} and the filler a function; a model goes with a filler's name")
        if not callable(filler):
            raise InputError(f"filler is {filler!r}; one of {', '.join(FILLER_NAMES)} is expected, or a function")
        return filler
    file = model_file(filler, model)
    found: Any = pkgutil.resolve_name(FILLERS[filler].entry_point)
    return found if file is None else found(file)


def model_file(filler: str, model: str | Path | None = None) -> Path | None:
    """The network file that a filler runs: the given one, or the one that ships; None for a filler that runs none.

    InputError: an unknown name, or a model missing or given to a filler that takes none.
    """
    if filler not in FILLERS:
        raise InputError(f"filler is {filler!r}; one of {', '.join(FILLER_NAMES)} is expected")
    record = FILLERS[filler]
    if not record.needs_model and model is not None:
        raise InputError(f"model is {model} and filler {filler!r} runs no network; no model is expected")
    if record.needs_model and model is None and record.shipped is None:
        raise InputError(f"model is missing: filler {filler!r} runs a network file ({record.source})")
    if model is not None:
        return Path(model)
    return None if record.shipped is None else ASSETS / record.shipped


FILLERS: dict[str, FillerRecord] = {
    "layered": FillerRecord("dlama.inpainters.layered.filler:layered"),
    "layered-patches": FillerRecord(
        "dlama.inpainters.patchmatch.over_layers:layered_patches_filler", True, "migan/migan-512.onnx"
    ),
    "telea": FillerRecord("dlama.inpainters.opencv:telea"),
    "lama": FillerRecord(
        "dlama.inpainters.networks.lama:lama_filler", needs_model=True, source="`dlama models pull big-lama` gets one"
    ),
    "migan": FillerRecord("dlama.inpainters.networks.migan:migan_filler", True, "migan/migan-512.onnx"),
    "patchmatch": FillerRecord("dlama.inpainters.patchmatch.filler:patchmatch_filler", True, "migan/migan-512.onnx"),
    "choice": FillerRecord("dlama.inpainters.choice.filler:choice_filler", True, "choice/choice.onnx"),
    "joint": FillerRecord("dlama.inpainters.networks.joint:joint_filler", needs_model=True),
    "pair": FillerRecord("dlama.inpainters.networks.pair:pair_filler", needs_model=True),
}
"""Name -> record; the default for exact depth comes first."""

FILLER_NAMES = (AUTO, *FILLERS)
"""Names for users; the default comes first."""
