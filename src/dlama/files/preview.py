"""Captioned pictures in, one contact sheet out; and how depth, holes and origins are shown in colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dlama.errors import ShapeError
from dlama.files.atomic_write import PathLike
from dlama.files.pictures import save_picture
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import HoleType, Origin

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

RGB = tuple[int, int, int]
Panel = tuple[str, UInt8Array]

HOLE_PALETTE: tuple[RGB, ...] = (
    (0, 0, 0),
    (245, 245, 245),
    (213, 94, 0),
    (240, 228, 66),
    (0, 114, 178),
    (204, 121, 167),
    (0, 158, 115),
)
"""RGB by HoleType code: none, crack, disoccluded, flying, out of view, sensor, object (Okabe and Ito's colours, which
the colour-blind tell apart)."""
ORIGIN_PALETTE: tuple[RGB, ...] = ((0, 0, 0), (235, 235, 235), (86, 180, 233), (204, 121, 167), (213, 94, 0))
"""RGB by Origin code: unknown, measured, reprojected, depth filled, filled."""

SKY: RGB = (222, 231, 240)
HATCH: tuple[RGB, RGB] = ((46, 48, 52), (64, 67, 72))
HATCH_PERIOD = 12
"""Pixels across one dark and one light stripe."""

PAPER: RGB = (24, 26, 29)
INK: RGB = (236, 238, 240)
QUIET_INK: RGB = (168, 174, 181)
PANEL_WIDTH = 420
GAP = 20
CAPTION_GAP = 4
TITLE_SIZE, CAPTION_SIZE, LEGEND_SIZE = 26, 16, 15
LINE = 1.35
"""Line height over font size."""


def depth_picture(
    depth: Float32Array, hole: BoolArray | None = None, lo: float | None = None, hi: float | None = None
) -> UInt8Array:
    """Depth (H x W metres) as uint8 H x W x 3: near red, far blue, in equal steps of 1 / depth; sky pale, holes hatched.

    `lo` and `hi` are the depths in metres shown as the nearest and the farthest colour; by default the 2nd and 98th
    percentile of this picture, so give them where pictures are compared. `hole` adds to where depth is missing.
    """
    import cv2

    depth = np.nan_to_num(np.asarray(depth, np.float32), nan=0, posinf=np.inf)
    known = depth > 0 if hole is None else (depth > 0) & ~hole
    valid = known & (depth < np.inf)
    inverse = np.divide(1, depth, out=np.zeros_like(depth), where=valid)
    near, far = (1 / lo if lo else None), (1 / hi if hi else None)
    if valid.any():
        low, high = np.percentile(inverse[valid], (2, 98))
        near, far = float(high) if near is None else near, float(low) if far is None else far
    span = max((near or 1.0) - (far or 0.0), 1e-9)
    levels = np.rint(np.clip((inverse - (far or 0.0)) / span, 0, 1) * 255).astype(np.uint8)
    picture = np.array(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO)[..., ::-1], np.uint8)
    picture[known & ~valid] = SKY
    picture[~known] = hatch(depth.shape)[~known]
    return picture


def depth_limits(*depths: Float32Array) -> tuple[float, float]:
    """(lo, hi) for `depth_picture` that suit several depth maps at once; (1, 10) where none is valid."""
    valid = np.concatenate([depth[(depth > 0) & (depth < np.inf)].ravel() for depth in depths])
    if not valid.size:
        return 1.0, 10.0
    lo, hi = np.percentile(valid, (2, 98))
    return float(lo), float(max(hi, lo * 1.001))


def hole_picture(color: UInt8Array, hole_type: UInt8Array) -> UInt8Array:
    """uint8 H x W x 3: the colour where it was known, the hole types (H x W codes) in HOLE_PALETTE."""
    palette = np.array(HOLE_PALETTE, np.uint8)
    return np.where((hole_type > 0)[..., None], palette[hole_type], color)


def origin_picture(origin: UInt8Array) -> UInt8Array:
    """uint8 H x W x 3: Origin codes (H x W) in ORIGIN_PALETTE."""
    return np.array(ORIGIN_PALETTE, np.uint8)[origin]


def hatched(color: UInt8Array, hole: BoolArray) -> UInt8Array:
    """uint8 H x W x 3: the colour where it is known, holes (H x W, True) hatched."""
    return np.where(hole[..., None], hatch(hole.shape), color)


def hatch(hw: tuple[int, ...]) -> UInt8Array:
    """uint8 H x W x 3: quiet diagonal stripes, which no camera takes for a surface."""
    rows, columns = np.ogrid[: hw[0], : hw[1]]
    stripe = (rows + columns) % HATCH_PERIOD < HATCH_PERIOD // 2
    return np.where(stripe[..., None], np.array(HATCH[0], np.uint8), np.array(HATCH[1], np.uint8))


def hole_legend(hole_type: UInt8Array) -> list[tuple[str, RGB]]:
    """(name with its share of the picture, colour) of the hole types that occur, for a sheet's legend."""
    counts = np.bincount(hole_type.ravel(), minlength=len(HOLE_PALETTE))
    total = max(hole_type.size, 1)
    return [
        (f"{code.name.lower().replace('_', ' ')} {percent(counts[code] / total)}", HOLE_PALETTE[code])
        for code in HoleType
        if code and counts[code]
    ]


def origin_legend() -> list[tuple[str, RGB]]:
    """(name, colour) of every origin."""
    return [(code.name.lower().replace("_", " "), ORIGIN_PALETTE[code]) for code in Origin]


def percent(share: float) -> str:
    """0.1234 -> "12.3 %"; what is there but tiny is not called 0."""
    return f"{100 * share:.1f} %" if share >= 0.0005 or share == 0 else "<0.1 %"


def write_preview(path: PathLike, title: str, panels: Sequence[Panel], legend: Sequence[tuple[str, RGB]] = ()) -> None:
    """Write a contact sheet: a title, captioned panels (uint8 H x W x 3, any sizes) in balanced rows, and a legend.

    Texts in Latin letters: the font that ships with Pillow has no Greek.
    Raises ShapeError (no panel, or one that is no picture), OutputError.
    """
    from PIL import Image, ImageDraw

    if not panels:
        raise ShapeError(f"{path}: a preview of no panels; at least one is wanted")
    pictures = [scaled(caption, array) for caption, array in panels]
    captions = [wrapped(caption, PANEL_WIDTH, font(CAPTION_SIZE)) for caption, _ in panels]
    columns = columns_for(len(panels))
    rows = [range(first, min(first + columns, len(panels))) for first in range(0, len(panels), columns)]
    cell = max(max(picture.width for picture in pictures), PANEL_WIDTH // 2 if columns > 1 else PANEL_WIDTH)
    width = columns * cell + (columns + 1) * GAP
    heading = wrapped(title, width - 2 * GAP, font(TITLE_SIZE))
    entries = legend_rows(legend, width - 2 * GAP)
    row_heights = [
        max(line_height(CAPTION_SIZE) * len(captions[i]) for i in row)
        + CAPTION_GAP
        + max(pictures[i].height for i in row)
        for row in rows
    ]
    top = GAP + line_height(TITLE_SIZE) * len(heading) + GAP // 2
    foot = len(entries) * line_height(LEGEND_SIZE) + (GAP if entries else 0)
    sheet = Image.new("RGB", (width, top + sum(row_heights) + GAP * len(rows) + foot), PAPER)
    draw = ImageDraw.Draw(sheet)
    draw_lines(draw, (GAP, GAP), heading, TITLE_SIZE, INK)
    for row, height in zip(rows, row_heights):
        text_height = max(line_height(CAPTION_SIZE) * len(captions[i]) for i in row)
        for column, i in enumerate(row):
            left = GAP + column * (cell + GAP)
            draw_lines(draw, (left, top), captions[i], CAPTION_SIZE, QUIET_INK)
            sheet.paste(pictures[i], (left, top + text_height + CAPTION_GAP))
        top += height + GAP
    draw_legend(draw, entries, top)
    save_picture(path, sheet)


def columns_for(count: int) -> int:
    """Columns of a sheet: at most 4, rows as equal as can be (4 -> 2+2, 5 -> 3+2, 7 -> 4+3, 9 -> 3+3+3)."""
    rows = max(math.ceil(count / 4), round(math.sqrt(0.6 * count)))
    return math.ceil(count / rows)


def scaled(caption: str, array: UInt8Array) -> Image.Image:
    """A panel that fits PANEL_WIDTH x 1.5 PANEL_WIDTH: large ones averaged down, tiny ones in whole-number blocks."""
    from PIL import Image

    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or 0 in array.shape:
        raise ShapeError(f"preview panel '{caption}' is {array.dtype} {array.shape}; uint8 H x W x 3 is wanted")
    picture = Image.fromarray(np.ascontiguousarray(array))
    factor = min(PANEL_WIDTH / picture.width, 1.5 * PANEL_WIDTH / picture.height)
    if factor >= 2:
        factor = math.floor(factor)
    elif factor >= 1:
        return picture
    size = (max(1, round(picture.width * factor)), max(1, round(picture.height * factor)))
    return picture.resize(size, Image.Resampling.NEAREST if factor > 1 else Image.Resampling.LANCZOS)


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own scalable font: the same on every machine."""
    from PIL import ImageFont

    return ImageFont.load_default(size=size)


def line_height(size: int) -> int:
    """Pixels from one line to the next."""
    return round(size * LINE)


def wrapped(text: str, width: float, face: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> list[str]:
    """The words of a text in lines that fit a width; a word that is too long alone is cut with three dots."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and face.getlength(longer) <= width:
            lines[-1] = longer
            continue
        whole = word
        while word and face.getlength(word if word == whole else word + "...") > width:
            word = word[:-1]
        lines.append(word if word == whole else word + "...")
    return lines or [""]


def legend_rows(legend: Sequence[tuple[str, RGB]], width: int) -> list[list[tuple[str, RGB, int]]]:
    """Legend entries with their x, broken into rows that fit a width."""
    face = font(LEGEND_SIZE)
    rows: list[list[tuple[str, RGB, int]]] = []
    x = width + 1
    for name, color in legend:
        needed = round(LEGEND_SIZE * 1.5 + face.getlength(name))
        if x + needed > width:
            rows.append([])
            x = 0
        rows[-1].append((name, color, GAP + x))
        x += needed + round(1.5 * LEGEND_SIZE)
    return rows


def draw_lines(draw: ImageDraw.ImageDraw, at: tuple[int, int], lines: Sequence[str], size: int, ink: RGB) -> None:
    """Lines of text, the first one's top left at `at`."""
    for number, line in enumerate(lines):
        draw.text((at[0], at[1] + number * line_height(size)), line, fill=ink, font=font(size))


def draw_legend(draw: ImageDraw.ImageDraw, rows: Sequence[Sequence[tuple[str, RGB, int]]], top: int) -> None:
    """A swatch and a name for each entry."""
    side = LEGEND_SIZE
    for row in rows:
        for name, color, x in row:
            draw.rectangle((x, top + 2, x + side - 1, top + 1 + side), fill=color, outline=QUIET_INK)
            draw.text((x + round(side * 1.5), top), name, fill=INK, font=font(LEGEND_SIZE))
        top += line_height(LEGEND_SIZE)
