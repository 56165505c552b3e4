"""Ways of filling: View with holes -> View without. One file per way; the closed set of names is the dict below."""

from __future__ import annotations

from dlama.errors import InputError
from dlama.inpainters.diffusion import navier_stokes, telea
from dlama.inpainters.filling import Fill, FillReport, Inpainter, inpaint
from dlama.inpainters.layered import layered

__all__ = ["INPAINTERS", "Fill", "FillReport", "Inpainter", "inpaint", "inpainter"]

INPAINTERS: dict[str, Inpainter] = {
    "layered": layered,
    "telea": telea,
    "navier-stokes": navier_stokes,
}


def inpainter(name: str) -> Inpainter:
    """The filler of that name; an unknown name lists the known ones (InputError)."""
    if name not in INPAINTERS:
        raise InputError(f"filler is {name!r}; one of {', '.join(INPAINTERS)} is wanted")
    return INPAINTERS[name]
