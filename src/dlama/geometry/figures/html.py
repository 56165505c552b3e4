"""Captioned pictures in; one small, self-contained piece of HTML, or one PNG, for notebooks out."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Panel = tuple[str, NDArray[np.uint8]]
"""Caption, and uint8 H x W x 3, RGB."""

LARGEST_SIDE = 300
"""Pixels; larger pictures are averaged down, so that a saved notebook stays small."""
GAP = 8
"""Pixels between the pictures of a strip."""


class Figured:
    """What notebooks show as captioned pictures."""

    def _panels(self) -> list[Panel]:
        raise NotImplementedError

    def _repr_html_(self) -> str:
        return figure(repr(self), self._panels())

    def _repr_png_(self) -> bytes:
        return strip(self._panels())


def figure(title: str, panels: Sequence[Panel]) -> str:
    """HTML that shows a title and captioned pictures side by side; it loads nothing and suits light and dark pages."""
    cells = ""
    for caption, picture in panels:
        data = base64.b64encode(_encode(shrink(picture, LARGEST_SIDE), ".jpg")).decode()
        cells += (
            '<figure style="margin:0"><img style="display:block;max-width:100%" '
            f'alt="{html.escape(caption, quote=True)}" src="data:image/jpeg;base64,{data}">'
            f'<figcaption style="font-size:smaller;opacity:.75">{html.escape(caption)}</figcaption></figure>'
        )
    return (
        f'<div><div style="margin-bottom:{GAP}px"><code>{html.escape(title)}</code></div>'
        f'<div style="display:flex;flex-wrap:wrap;gap:{GAP}px">{cells}</div></div>'
    )


def strip(panels: Sequence[Panel]) -> bytes:
    """A PNG file of the same pictures side by side, without their captions."""
    pictures = [shrink(picture, LARGEST_SIDE) for _, picture in panels]
    height = max(picture.shape[0] for picture in pictures)
    width = sum(picture.shape[1] for picture in pictures) + GAP * (len(pictures) - 1)
    sheet = np.full((height, width, 3), 255, np.uint8)
    left = 0
    for picture in pictures:
        sheet[: picture.shape[0], left : left + picture.shape[1]] = picture
        left += picture.shape[1] + GAP
    return _encode(sheet, ".png")


def shrink(picture: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    """The picture, shrunk so that its larger side is at most so many px."""
    import cv2  # here, so that the nouns cost no more than numpy

    height, width = picture.shape[:2]
    factor = side / max(height, width)
    if factor >= 1:
        return picture
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encode(picture: NDArray[np.uint8], suffix: str) -> bytes:
    """The bytes of a JPEG or PNG file of an RGB picture."""
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, 88] if suffix == ".jpg" else []
    return bytes(cv2.imencode(suffix, np.ascontiguousarray(picture[..., ::-1]), options)[1])
