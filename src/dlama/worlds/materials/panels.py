"""Textures that fill a face once: a random generator in, 256 x 256 x 4 uint8 pictures out (sRGB, alpha 255).

Windows, doors, shop fronts, posters, signs, book shelves, crates, and photos made fit.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator

from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.materials.textures import (
    CLOUDY,
    FINE,
    GRAIN,
    ROUGH,
    SOFT,
    Rgb,
    color,
    metal,
    noise,
    rgba,
    shade,
    wood,
)
from dlama.worlds.raycast.shape_rows import SIDE

LETTERS = "ABCDEFGHIKLMNOPRSTUVWZ0123456789"


def box(canvas: UInt8Array, x: float, y: float, w: float, h: float, ink: Rgb) -> None:
    """A filled rectangle in shares of the picture."""
    low, high = (round(SIDE * x), round(SIDE * y)), (round(SIDE * (x + w)) - 1, round(SIDE * (y + h)) - 1)
    cv2.rectangle(canvas, low, high, (*ink, 255), -1)


def paint_color(rng: Generator) -> Rgb:
    """A colour that frames and doors are painted in."""
    if rng.random() < 0.5:
        return color(rng, (0, 1), (0.0, 0.08), (0.75, 0.97))
    return color(rng, (0, 1), (0.2, 0.7), (0.15, 0.6))


def glass(rng: Generator) -> UInt8Array:
    """Dark panes that mirror a little sky and the house across the street."""
    ramp = np.linspace(1.3, 0.55, SIDE, dtype=np.float32)[:, None]
    base = color(rng, (0.52, 0.62), (0.1, 0.35), (0.2, 0.5))
    picture = shade(base, ramp * (0.75 + 0.5 * noise(rng, SOFT)))
    skyline = (0.35 + 0.5 * noise(rng, SOFT)[0]) * SIDE
    picture[np.arange(SIDE)[:, None] > skyline] *= rng.uniform(0.5, 0.85)
    return rgba(picture)


def window(rng: Generator) -> UInt8Array:
    """A frame, panes, and at times curtains or a blind."""
    canvas = glass(rng)
    frame, width = paint_color(rng), rng.uniform(0.035, 0.07)
    kind = rng.random()
    if kind < 0.35:
        drape, share = color(rng, (0, 1), (0.05, 0.5), (0.5, 0.9)), rng.uniform(0.12, 0.3)
        folds = (0.75 + 0.25 * np.sin(np.arange(SIDE) * 0.35))[None, :, None] * np.array(drape)
        for left in (0, int((1 - share) * SIDE)):
            canvas[:, left : left + int(share * SIDE), :3] = folds[:, left : left + int(share * SIDE)]
    elif kind < 0.55:
        height = int(SIDE * rng.uniform(0.2, 0.7))
        slats = (0.8 + 0.2 * (np.arange(height) % 12 < 9))[:, None, None]
        canvas[:height, :, :3] = slats * np.array(color(rng, (0, 1), (0, 0.15), (0.6, 0.9)))
    across, down = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    for k in range(across + 1):
        bar = width if k in (0, across) else 0.6 * width
        box(canvas, np.clip(k / across - bar / 2, 0, 1 - bar), 0, bar, 1, frame)
    for k in range(down + 1):
        bar = width if k in (0, down) else 0.6 * width
        box(canvas, 0, np.clip(k / down - bar / 2, 0, 1 - bar), 1, bar, frame)
    return canvas


def door(rng: Generator) -> UInt8Array:
    """A panelled door with a handle, at times with glass above."""
    base = paint_color(rng)
    canvas = rgba(shade(base, 0.85 + 0.25 * noise(rng, GRAIN).T))
    dark: Rgb = (0.6 * base[0], 0.6 * base[1], 0.6 * base[2])
    rows = int(rng.integers(2, 5))
    for column in range(2):
        for row in range(rows):
            x, y, h = 0.1 + 0.44 * column, 0.06 + 0.92 * row / rows, 0.8 / rows
            box(canvas, x, y, 0.36, h, dark)
            inner: Rgb = base if row or rng.random() < 0.6 else (60, 75, 85)
            box(canvas, x + 0.03, y + 0.015, 0.3, h - 0.03, inner)
    box(canvas, 0.9, 0.5, 0.06, 0.07, (190, 180, 150))
    return canvas


def shutter(rng: Generator) -> UInt8Array:
    """A garage door: horizontal slats."""
    base = paint_color(rng)
    slats = 0.7 + 0.3 * ((np.arange(SIDE) * int(rng.choice((10, 16, 24))) // 4 % 64) > 8).astype(np.float32)
    return rgba(shade(base, slats[:, None] * (0.85 + 0.3 * noise(rng, ROUGH))))


def poster(rng: Generator) -> UInt8Array:
    """A print: a ground, some shapes, a headline and lines of text."""
    canvas = rgba(shade(color(rng, (0, 1), (0.05, 0.8), (0.35, 0.97)), 0.85 + 0.3 * noise(rng, SOFT)))
    for _ in range(int(rng.integers(3, 8))):
        ink = (*color(rng, (0, 1), (0.2, 0.9), (0.2, 1.0)), 255)
        x, y, r, q = (int(n) for n in rng.integers((0, 60, 10, 10), (SIDE, 200, 70, 70)))
        if rng.random() < 0.5:
            cv2.ellipse(canvas, (x, y), (r, q), rng.uniform(0, 180), 0, 360, ink, -1, cv2.LINE_AA)
        else:
            corners = np.array([(x, y)]) + rng.integers(-70, 70, (int(rng.integers(3, 6)), 2))
            cv2.fillPoly(canvas, [corners.astype(np.int32)], ink, cv2.LINE_AA)
    letters(rng, canvas, 46, 1.6)
    for y in range(214, 246, 10):
        box(canvas, 0.1, y / SIDE, rng.uniform(0.4, 0.8), 0.014, (40, 40, 45))
    return canvas


def letters(rng: Generator, canvas: UInt8Array, baseline: int, size: float) -> None:
    """A word of random letters across the picture."""
    word = "".join(rng.choice(list(LETTERS), int(rng.integers(3, 6))))
    ink = (*color(rng, (0, 1), (0.0, 0.8), (0.05, 0.3) if canvas[..., :3].mean() > 110 else (0.85, 1)), 255)
    (width, _), _ = cv2.getTextSize(word, cv2.FONT_HERSHEY_DUPLEX, size, 4)
    scale = size * min(1.0, 230 / width)
    left = (SIDE - int(width * scale / size)) // 2
    cv2.putText(canvas, word, (left, baseline), cv2.FONT_HERSHEY_DUPLEX, scale, ink, 4, cv2.LINE_AA)


def sign(rng: Generator) -> UInt8Array:
    """A shop's or a street's sign: a word in a frame."""
    canvas = np.full((SIDE, SIDE, 4), 255, np.uint8)
    box(canvas, 0, 0, 1, 1, color(rng, (0, 1), (0.3, 0.9), (0.25, 0.9)))
    cv2.rectangle(canvas, (8, 8), (SIDE - 9, SIDE - 9), (*color(rng, (0, 1), (0, 0.2), (0.8, 1)), 255), 6)
    letters(rng, canvas, 160, 3.2)
    return canvas


def shop(rng: Generator) -> UInt8Array:
    """A shop window: goods of many colours behind glass."""
    canvas = glass(rng)
    for shelf in (0.35, 0.62, 0.9):
        x = 0.06
        while x < 0.9:
            w, h = rng.uniform(0.03, 0.12), rng.uniform(0.06, 0.22)
            box(canvas, x, shelf - h, w, h, color(rng, (0, 1), (0.2, 0.8), (0.25, 0.85)))
            x += w + rng.uniform(0.01, 0.08)
        box(canvas, 0.04, shelf, 0.92, 0.02, (90, 80, 70))
    cv2.rectangle(canvas, (0, 0), (SIDE - 1, SIDE - 1), (*paint_color(rng), 255), 14)
    return canvas


def books(rng: Generator) -> UInt8Array:
    """Four shelves of books."""
    canvas = wood(rng)
    canvas[..., :3] //= 2
    for shelf in range(4):
        x = 0.03
        while x < 0.93:
            w, h = rng.uniform(0.015, 0.05), rng.uniform(0.13, 0.2)
            if rng.random() < 0.9:
                box(canvas, x, 0.235 + 0.245 * shelf - h, w, h, color(rng, (0, 1), (0.1, 0.75), (0.2, 0.85)))
            x += w + 0.004
        box(canvas, 0, 0.235 + 0.245 * shelf, 1, 0.02, (120, 90, 60))
    return canvas


def crate(rng: Generator) -> UInt8Array:
    """A wooden crate's or a cardboard box's side."""
    if rng.random() < 0.5:
        canvas = wood(rng)
        for x, y, w, h in ((0, 0, 1, 0.12), (0, 0.88, 1, 0.12), (0, 0, 0.12, 1), (0.88, 0, 0.12, 1)):
            box(canvas, x, y, w, h, (0.55 * canvas[9, 9, 0], 0.55 * canvas[9, 9, 1], 0.55 * canvas[9, 9, 2]))
        return canvas
    canvas = rgba(shade(color(rng, (0.07, 0.1), (0.3, 0.5), (0.55, 0.75)), 0.85 + 0.3 * noise(rng, CLOUDY)))
    box(canvas, 0.42, 0, 0.16, 1, (200, 180, 140))
    box(canvas, 0.08, 0.6, 0.24, 0.25, (235, 235, 230))
    letters(rng, canvas, 220, 0.9)
    return canvas


def bands(rng: Generator) -> UInt8Array:
    """Barrels, cones and barriers: bright bands; fits a tube."""
    one, two = color(rng, (0.0, 0.15), (0.75, 1), (0.75, 1)), color(rng, (0, 1), (0, 0.1), (0.8, 1))
    stripe = (np.arange(SIDE) * int(rng.choice((4, 5, 6))) // SIDE) % 2 == 0
    picture = np.where(stripe[:, None, None], np.array(one), np.array(two))
    return rgba(picture * (0.85 + 0.3 * noise(rng, FINE))[..., None] * (0.85 + 0.3 * noise(rng, SOFT))[..., None])


def machine(rng: Generator) -> UInt8Array:
    """A side of a container, postbox, cabinet or vehicle: painted sheet with seams and a label."""
    canvas = metal(rng)
    dark = canvas[..., :3].mean((0, 1)) * 0.5
    ink: Rgb = (float(dark[0]), float(dark[1]), float(dark[2]))
    for k in range(1, int(rng.integers(2, 4))):
        box(canvas, 0, k / 3, 1, 0.012, ink)
    cv2.rectangle(canvas, (3, 3), (SIDE - 4, SIDE - 4), (*ink, 255), 4)
    x, y = rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.6)
    box(canvas, x, y, 0.28, 0.18, color(rng, (0, 1), (0.0, 0.8), (0.6, 1)))
    box(canvas, x + 0.03, y + 0.05, 0.2, 0.03, (30, 30, 30))
    box(canvas, x + 0.03, y + 0.1, 0.14, 0.03, (30, 30, 30))
    return canvas


def photo(picture: UInt8Array) -> UInt8Array:
    """A photo's centre square (H x W x 3, RGB) as a texture."""
    rows, columns = picture.shape[:2]
    side = min(rows, columns)
    top, left = (rows - side) // 2, (columns - side) // 2
    square = np.ascontiguousarray(picture[top : top + side, left : left + side])
    how = cv2.INTER_AREA if side > SIDE else cv2.INTER_LINEAR
    canvas = np.full((SIDE, SIDE, 4), 255, np.uint8)
    canvas[..., :3] = cv2.resize(square, (SIDE, SIDE), interpolation=how)
    return canvas
