"""Fillers: a View with holes in; the same View without holes out. FILLERS, at the end, is the closed list of their names.

Begin with `filling` (the contract of a filler, and what `inpaint` guarantees) and `context` (what a filler knows besides the
view). Then `layered/` (the default where depth was measured), `patchmatch/` (where it was estimated) and `networks/`. A filler's
code is imported when it is asked for, since the command line's help reads the names.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from dlama.errors import InputError

if TYPE_CHECKING:
    from dlama.inpainters.filling import Inpainter


ASSETS = Path(__file__).parents[1] / "assets"


@dataclass(frozen=True)
class FillerRecord:
    """Where a filler is, and its requirements."""

    module: str
    """The module that has it."""
    function: str
    """The filler there; of one that runs a network the function that makes it of the file."""
    needs_model: bool = False
    """Whether it runs a network file."""
    shipped: str | None = None
    """The network file that ships in the package, under assets/; the default."""
    source: str = "`dlama train` makes one"
    """Source of a network file, for a filler whose network does not ship."""


AUTO = "auto"
"""The default: the filler that suits the depth."""
MEASURED, ESTIMATED = "layered-patches", "patchmatch"
"""Its choices: for measured and rendered depth; for estimated depth, whose planes are bent and torn."""


def find_filler(filler: str | Inpainter, model: str | Path | None = None) -> Inpainter:
    """The filler of that name, with its network file if it runs one; a function is returned as it is.

    InputError: an unknown name (the known ones are listed), or a model missing or given to a filler that takes none.
    """
    if not isinstance(filler, str):
        if model is not None:
            raise InputError(f"`model` is {model} and the filler a function; a model goes with a filler's name")
        if not callable(filler):
            raise InputError(f"`filler` is {filler!r}; one of {', '.join(FILLER_NAMES)} is expected, or a function")
        return filler
    file, record = model_file(filler, model), FILLERS[filler]
    found = getattr(import_module(record.module), record.function)
    return found if file is None else found(file)


def model_file(filler: str, model: str | Path | None = None) -> Path | None:
    """The network file that a filler runs: the given one, or the one that ships; None for a filler that runs none.

    InputError: an unknown name, or a model missing or given to a filler that takes none.
    """
    if filler not in FILLERS:
        raise InputError(f"`filler` is {filler!r}; one of {', '.join(FILLER_NAMES)} is expected")
    record = FILLERS[filler]
    if not record.needs_model and model is not None:
        raise InputError(f"`model` is {model} and filler {filler!r} runs no network; no model is expected")
    if record.needs_model and model is None and record.shipped is None:
        raise InputError(f"`model` is missing: filler {filler!r} runs a network file ({record.source})")
    if model is not None:
        return Path(model)
    return None if record.shipped is None else ASSETS / record.shipped


MIGAN = "migan/migan-512-tuned.onnx"
FILLERS: dict[str, FillerRecord] = {
    "layered": FillerRecord(f"{__name__}.layered.filler", "layered"),
    "layered-patches": FillerRecord(f"{__name__}.layered.filler", "layered_patches_filler", True, MIGAN),
    "telea": FillerRecord(f"{__name__}.opencv", "telea"),
    "lama": FillerRecord(
        f"{__name__}.networks.lama", "lama_filler", True, source="`dlama models pull big-lama` gets one"
    ),
    "migan": FillerRecord(f"{__name__}.networks.migan", "migan_filler", True, MIGAN),
    "patchmatch": FillerRecord(f"{__name__}.patchmatch.filler", "patchmatch_filler", True, MIGAN),
    "joint": FillerRecord(f"{__name__}.networks.lama", "joint_filler", True),
    "pair": FillerRecord(f"{__name__}.networks.pair", "pair_filler", True),
}
"""Name -> record."""

FILLER_NAMES = (AUTO, *FILLERS)
"""Names for users; the default comes first."""
