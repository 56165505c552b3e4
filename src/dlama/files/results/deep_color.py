"""A completion and its 16-bit input in; the colours of a view in 16 bits, measured pixels as the file has them, out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dlama.completion.completion import Completion, StereoCompletion
from dlama.files.rasters.images import read_stored
from dlama.files.rasters.pictures import rgb_of
from dlama.geometry.codes import Origin, from_source, has_code
from dlama.geometry.rgbd import UInt16Array
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike


def find_plate(completion: Completion, view: View, place: str, plates: Mapping[str, PathLike]) -> PathLike | None:
    """The input with 16 bits a channel that a view shows from its own camera; None: there is none.

    place: the sub-folder that the view is written to; plates: role -> file of the inputs with 16 bits a channel.
    """
    pair = isinstance(completion, StereoCompletion)
    role = ("right" if place else "left") if pair else "image"
    own = pair or view.camera.same_view_as(completion.source.camera)
    return plates.get(role) if own else None


def deep_color(view: View, plate: PathLike) -> UInt16Array | None:
    """H x W x 3 of the view: where it was measured the 16 bits of its file, else 257 times the 8 bits.

    None where the view's measured colours are not those of the file, as where a colour profile was applied. Raises FileError.
    """
    stored = rgb_of(read_stored(plate).values)
    if stored.shape != view.color.shape:
        return None
    same, measured = (stored >> 8 == view.color).all(axis=2), from_source(view.origin)
    if not same[measured].all():
        return None
    measured |= has_code(view.origin, Origin.DEPTH_FILLED) & same  # of a pair some come from the other picture
    return np.where(measured[..., None], stored, view.color * np.uint16(257))  # 255 becomes 65535
