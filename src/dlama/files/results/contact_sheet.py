"""Captioned pictures in; one contact sheet with title and legend out."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dlama.files.rasters.pictures import save_picture
from dlama.geometry.figures.false_color import RGB
from dlama.geometry.rgbd import UInt8Array
from dlama.writing.atomic_write import PathLike

Panel = tuple[str, UInt8Array]
"""Caption, and uint8 H x W x 3."""

INK: RGB = (236, 238, 240)
QUIET_INK: RGB = (168, 174, 181)
PANEL_WIDTH = 420
GAP = 20
TITLE_SIZE, CAPTION_SIZE, LEGEND_SIZE = 26, 16, 15


def write_contact_sheet(
    path: PathLike, title: str, panels: Sequence[Panel], legend: Sequence[tuple[str, RGB]] = ()
) -> None:
    """Write a contact sheet: a title, captioned panels (uint8 H x W x 3, any sizes) in balanced rows, and a legend.

    Texts in Latin letters: the font that ships with Pillow has no Greek.
    Raises OutputError.
    """
    fitted = [(fit_panel(array), wrap_text(name, PANEL_WIDTH, CAPTION_SIZE)) for name, array in panels]
    columns = columns_for(len(panels))
    rows = [fitted[first : first + columns] for first in range(0, len(panels), columns)]
    texts = [line_height(CAPTION_SIZE) * max(len(caption) for _, caption in row) + 4 for row in rows]
    heights = [text + max(picture.height for picture, _ in row) + GAP for text, row in zip(texts, rows)]
    cell = max(PANEL_WIDTH // 2 if columns > 1 else PANEL_WIDTH, *(picture.width for picture, _ in fitted))
    width = columns * cell + (columns + 1) * GAP
    heading = wrap_text(title, width - 2 * GAP, TITLE_SIZE)
    entries = place_legend(legend, width - 2 * GAP)
    top = GAP + line_height(TITLE_SIZE) * len(heading) + GAP // 2
    bottom = entries[-1][3] + line_height(LEGEND_SIZE) + GAP if entries else 0
    sheet = Image.new("RGB", (width, top + sum(heights) + bottom), (24, 26, 29))
    draw = ImageDraw.Draw(sheet)
    draw_lines(draw, (GAP, GAP), heading, TITLE_SIZE, INK)
    for row, text, height in zip(rows, texts, heights):
        for column, (picture, caption) in enumerate(row):
            left = GAP + column * (cell + GAP)
            draw_lines(draw, (left, top), caption, CAPTION_SIZE, QUIET_INK)
            sheet.paste(picture, (left, top + text))
        top += height
    for name, color, x, y in entries:
        draw.rectangle((x, top + y + 2, x + LEGEND_SIZE - 1, top + y + 1 + LEGEND_SIZE), fill=color, outline=QUIET_INK)
        draw_lines(draw, (x + round(LEGEND_SIZE * 1.5), top + y), [name], LEGEND_SIZE, INK)
    save_picture(path, sheet)


def columns_for(count: int) -> int:
    """Columns of a sheet: at most 4, rows as equal as can be (4 -> 2+2, 5 -> 3+2, 7 -> 4+3, 9 -> 3+3+3)."""
    rows = max(math.ceil(count / 4), round(math.sqrt(0.6 * count)))
    return math.ceil(count / rows)


def fit_panel(array: UInt8Array) -> Image.Image:
    """A panel that fits PANEL_WIDTH x 1.5 PANEL_WIDTH: large ones averaged down, tiny ones in whole-number blocks."""
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
    return ImageFont.load_default(size=size)


def line_height(size: int) -> int:
    """Pixels from one line to the next."""
    return round(size * 1.35)


def wrap_text(text: str, width: float, size: int) -> list[str]:
    """A text in lines that fit a width in pixels, of letters as wide as an n."""
    return textwrap.wrap(text, int(width / font(size).getlength("n")), break_long_words=False) or [""]


def place_legend(legend: Sequence[tuple[str, RGB]], width: int) -> list[tuple[str, RGB, int, int]]:
    """Legend entries with the x and y of their swatches, in rows that fit a width."""
    places, x, y = list[tuple[str, RGB, int, int]](), 0, 0
    for name, color in legend:
        needed = round(LEGEND_SIZE * 1.5 + font(LEGEND_SIZE).getlength(name))
        if x and x + needed > width:
            x, y = 0, y + line_height(LEGEND_SIZE)
        places.append((name, color, GAP + x, y))
        x += needed + round(1.5 * LEGEND_SIZE)
    return places


def draw_lines(draw: ImageDraw.ImageDraw, at: tuple[int, int], lines: Sequence[str], size: int, ink: RGB) -> None:
    """Lines of text, the first one's top left at `at`."""
    for number, line in enumerate(lines):
        draw.text((at[0], at[1] + number * line_height(size)), line, fill=ink, font=font(size))
