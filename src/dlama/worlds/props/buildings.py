"""Houses and walls: a builder at a place, a palette and a random generator in; shapes added to the builder out.

A house's front lies in z = 0 of the builder's current place and looks towards -z; the house stands behind it.
"""

from __future__ import annotations

from numpy.random import Generator

from dlama.worlds.materials.palette import Palette
from dlama.worlds.scene_builder import Material, SceneBuilder, Triple

FLOOR_M = 2.9


def house(builder: SceneBuilder, palette: Palette, rng: Generator, width: float) -> float:
    """A house with windows, a door or shops, a cornice and a roof; returns its height in metres."""
    floors = rng.integers(1, 5)
    height = 0.4 + FLOOR_M * floors
    wall = palette("bricks", "bricks", "plaster", "stones", "concrete", "planks")
    stone = rng.random() < 0.6
    trim = palette("concrete", "plaster", "stones") if stone else palette.paint(saturation=(0, 0.3), value=(0.5, 0.95))
    depth = 6.0
    builder.box((0, 0, depth / 2), (width, height, depth), wall)
    if rng.random() < 0.7:
        builder.box((0, 0, depth / 2), (width + 0.08, rng.uniform(0.35, 0.8), depth + 0.08), trim)
    if rng.random() < 0.7:
        builder.box((0, height - 0.3, depth / 2), (width + 0.3, 0.32, depth + 0.3), trim)
    shops = rng.random() < 0.3
    ground_floor(builder, palette, rng, width, trim, shops)
    columns = max(1, round(width / rng.uniform(1.7, 3.2)))
    size = (rng.uniform(0.8, 1.3), rng.uniform(1.1, 1.7))
    shutters = palette.paint(saturation=(0.2, 0.7), value=(0.2, 0.6)) if rng.random() < 0.3 else None
    glass = palette("window", spread=0.05)
    for floor in range(1, floors):
        for column in range(columns):
            x = width * ((column + 0.5) / columns - 0.5)
            opening(builder, (x, 0.9 + FLOOR_M * floor, 0), size, glass, trim, shutters)
        if rng.random() < 0.25:
            builder.box((0, FLOOR_M * floor + 0.2, 0), (width + 0.1, 0.12, 0.2), trim)
        if rng.random() < 0.15:
            balcony(builder, palette, width * rng.uniform(-0.25, 0.25), FLOOR_M * floor + 0.25)
    roof(builder, palette, rng, width, depth, height)
    if rng.random() < 0.5:
        at = (0.48 * width * rng.choice((-1, 1)), 0, -0.06)
        builder.tube(at, height - 0.3, 0.06, palette("metal").with_tint(0.6))
    return height


def opening(
    builder: SceneBuilder,
    at: Triple,
    size: tuple[float, float],
    glass: Material,
    trim: Material,
    shutters: Material | None,
) -> None:
    """A window with its sill, lintel and, where given, shutters."""
    (x, up, _), (w, h) = at, size
    builder.box((x, up, 0), (w, h, 0.1), glass)
    builder.box((x, up - 0.1, 0), (w + 0.25, 0.1, 0.3), trim)
    builder.box((x, up + h, 0), (w + 0.2, 0.16, 0.18), trim)
    if shutters is not None:
        for side in (-1, 1):
            builder.box((x + side * 0.76 * w, up, 0), (0.5 * w, h, 0.12), shutters)


def ground_floor(
    builder: SceneBuilder, palette: Palette, rng: Generator, width: float, trim: Material, shops: bool
) -> None:
    """Shops under awnings, or a door between windows."""
    bays = max(1, round(width / rng.uniform(2.2, 3.6)))
    entrance = rng.integers(bays)
    for bay in range(bays):
        x, w = width * ((bay + 0.5) / bays - 0.5), 0.8 * width / bays
        if bay == entrance:
            porch(builder, palette, rng, x, trim)
        elif shops:
            builder.box((x, 0.35, 0), (w, 1.9, 0.1), palette("shop"))
            builder.box((x, 2.35, 0), (w, 0.5, 0.2), palette("sign"))
            if rng.random() < 0.5:
                builder.box((x, 2.2, -0.5), (w, 0.04, 1.1), palette("cloth"), (0, 22, 0))
        elif rng.random() < 0.12:
            builder.box((x, 0, 0), (w, 2.3, 0.12), palette("shutter"))
        elif rng.random() < 0.9:
            opening(builder, (x, 0.95, 0), (min(w, 1.3), 1.35), palette("window", spread=0.05), trim, None)
    if rng.random() < 0.35:
        builder.box((width * rng.uniform(-0.4, 0.4), 1.4, 0), (0.6, 0.8, 0.06), palette("poster"))


def porch(builder: SceneBuilder, palette: Palette, rng: Generator, x: float, trim: Material) -> None:
    """A door in its frame on steps, at times under a roof on columns."""
    builder.box((x, 0.25, 0), (0.95, 2.05, 0.12), palette("door"))
    for side in (-1, 1):
        builder.box((x + 0.54 * side, 0.25, 0), (0.12, 2.15, 0.22), trim)
    builder.box((x, 2.3, 0), (1.3, 0.18, 0.3), trim)
    for n in range(2):
        builder.box((x, 0, -0.3 + 0.15 * n), (1.5, 0.125 * (n + 1), 0.6), palette("concrete", "stones"))
    if rng.random() < 0.3:
        for side in (-1, 1):
            builder.tube((x + 0.85 * side, 0, -0.95), 2.5, 0.12, trim, 0.1)
        builder.box((x, 2.5, -0.55), (2.1, 0.22, 1.2), trim)


def balcony(builder: SceneBuilder, palette: Palette, x: float, up: float) -> None:
    """A slab with a railing."""
    builder.box((x, up, -0.5), (2.2, 0.14, 1.0), palette("concrete"))
    rail = palette("metal").with_tint(0.4)
    for n in range(9):
        builder.box((x - 1.05 + 0.2625 * n, up + 0.14, -0.97), (0.03, 0.85, 0.03), rail)
    builder.box((x, up + 0.98, -0.97), (2.2, 0.05, 0.06), rail)


def roof(builder: SceneBuilder, palette: Palette, rng: Generator, width: float, depth: float, height: float) -> None:
    """A pitched roof with a chimney, or a flat one with a parapet."""
    if rng.random() < 0.55:
        tile = palette("stones", "planks", "metal").with_tint(*palette.paint((0.98, 1.1), (0.2, 0.6), (0.5, 0.85)).tint)
        rise = rng.uniform(25, 42)
        builder.box((0, height + 0.2, 0.22 * depth), (width + 0.4, 0.14, 0.75 * depth), tile, (0, rise, 0))
        if rng.random() < 0.6:
            x = width * rng.uniform(-0.35, 0.35)
            builder.box((x, height, 0.35 * depth), (0.7, rng.uniform(1.8, 2.6), 0.6), palette("bricks"))
    else:
        builder.box((0, height, 0.15), (width, rng.uniform(0.2, 0.6), 0.3), palette("concrete", "bricks"))


def row(builder: SceneBuilder, palette: Palette, rng: Generator, left: float, right: float) -> None:
    """Houses side by side from x = left to x = right, fronts near z = 0, at times with a gap between them."""
    x = left
    while x < right - 1.5:
        width = min(rng.uniform(4, 9), right - x)
        if rng.random() < 0.12 and left < x < right - 6:
            x += rng.uniform(1.2, 3)
            continue
        with builder.at(x + width / 2, rng.choice((0, 0, 0.25, -0.2, 0.6))), builder.group():
            house(builder, palette, rng, width - 0.02)
        x += width


def yard_wall(builder: SceneBuilder, palette: Palette, rng: Generator, left: float, right: float) -> None:
    """A garden or yard wall with a coping and pillars, or a fence one sees through, along z = 0."""
    height, length = rng.uniform(0.9, 2.3), right - left
    if rng.random() < 0.35:
        panel = palette("fence")
        builder.panel(((left + right) / 2, 0.65, 0), (length, 1.3), panel, (0, -90, 0))
        return
    wall = palette("bricks", "stones", "concrete", "plaster")
    builder.box(((left + right) / 2, 0, 0), (length, height, 0.22), wall)
    builder.box(((left + right) / 2, height, 0), (length, 0.08, 0.34), palette("concrete"))
    count = max(1, round(length / 3))
    for n in range(count + 1):
        builder.box((left + length * n / count, 0, 0), (0.36, height + 0.15, 0.36), wall)


def pavement(builder: SceneBuilder, palette: Palette, left: float, right: float, depth: float, kerb: Material) -> None:
    """A raised walk in front of houses (z from -depth to 0.5) with its kerb stones."""
    middle, length = (left + right) / 2, right - left
    size = length, 0.12, depth + 0.34
    builder.box((middle, 0, 0.25 - depth / 2 + 0.08), size, palette("paving", "concrete", "asphalt"))
    builder.box((middle, 0, -depth), (length, 0.125, 0.16), kerb)
