"""A builder at a place in; what one click finds badly out: crowded tables and trays, sheets and lids with hardly any relief,
boxes whose faces are flush. Each function gives the numbers of the objects that it drew."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from dlama.worlds.materials.palette import Palette
from dlama.worlds.props.furniture import legs, trinket
from dlama.worlds.props.street import LYING
from dlama.worlds.scene_builder import Material, SceneBuilder

Objects = Callable[[SceneBuilder, Palette, Generator], list[int]]
MOST_ON_TABLE, FREE_M = 14, 0.11
"""Objects on a table; radius in metres that most of them keep to themselves, the others touch."""


def printed(palette: Palette, rng: Generator) -> Material:
    """A printed or painted surface."""
    if rng.random() < 0.35:
        return palette.paint(saturation=(0, 0.9), value=(0.1, 0.97))
    return palette("poster", "poster", "sign", "books", "machine", "crate", "cloth", "metal", "wood", "bands")


def draw_flat(builder: SceneBuilder, palette: Palette, rng: Generator) -> list[int]:
    """A sheet, a book, a cloth, a plate or a lid that lies flat: 1 to 25 mm of relief."""
    material, height = printed(palette, rng), float(np.exp(rng.uniform(*np.log((0.001, 0.025)))))
    with builder.group() as number:
        if rng.random() < 0.65:
            w, d = (float(v) for v in rng.uniform((0.1, 0.08), (0.34, 0.26)))
            builder.box((0, 0, 0), (w, height, d), material)
        else:
            radius = float(rng.uniform(0.05, 0.14))
            builder.tube((0, 0, 0), height, radius, material, radius * float(rng.uniform(0.8, 1.1)))
    return [number]


def draw_boxes(builder: SceneBuilder, palette: Palette, rng: Generator) -> list[int]:
    """One to four boxes side by side; mostly they have one height and one front."""
    count, flush, numbers = int(rng.choice((1, 2, 2, 3, 4))), rng.random() < 0.7, []
    height, depth, x = float(rng.uniform(0.04, 0.3)), float(rng.uniform(0.04, 0.2)), 0.0
    kinds = [printed(palette, rng) for _ in range(2)]
    for _ in range(count):
        width = float(rng.uniform(0.05, 0.2))
        h, d = (height, depth) if flush else (v * float(rng.uniform(0.6, 1)) for v in (height, depth))
        material = kinds[int(rng.integers(2))].with_tint(float(rng.uniform(0.7, 1.2))) if rng.random() < 0.5 else None
        with builder.group() as number:
            builder.box((x + width / 2, 0, (d - depth) / 2), (width, h, d), material or printed(palette, rng))
        numbers.append(number)
        x += width
    return numbers


def draw_tool(builder: SceneBuilder, palette: Palette, rng: Generator) -> list[int]:
    """A long thin object that lies: a tool, a pen, a bottle, a torch."""
    length, radius = float(rng.uniform(0.12, 0.34)), float(rng.uniform(0.006, 0.04))
    with builder.group() as number:
        if rng.random() < 0.5:
            builder.box((0, 0, 0), (length, radius, 2 * radius), printed(palette, rng))
            builder.ball((length / 2, radius / 2, 0), (0.05, radius, 0.03), palette("metal", "plain"))
        else:
            builder.tube((0, radius - length / 2, 0), length, radius, printed(palette, rng), turn=LYING)
    return [number]


def draw_upright(builder: SceneBuilder, palette: Palette, rng: Generator) -> list[int]:
    """A bottle, a jar, a cup, or what rooms have on tables."""
    with builder.group() as number:
        if rng.random() < 0.5:
            trinket(builder, palette, rng)
        else:
            radius, height = float(rng.uniform(0.025, 0.08)), float(rng.uniform(0.05, 0.3))
            builder.tube((0, 0, 0), height, radius, printed(palette, rng), radius * float(rng.uniform(0.7, 1.1)))
            if rng.random() < 0.4:
                builder.tube((0, height, 0), 0.3 * height, 0.4 * radius, palette("metal", "plain"))
    return [number]


OBJECTS: tuple[Objects, ...] = (draw_flat, draw_flat, draw_boxes, draw_boxes, draw_tool, draw_upright)


def draw_crowded_table(builder: SceneBuilder, palette: Palette, rng: Generator) -> list[int]:
    """A table, desk or tray in the current object, and many objects on it."""
    w, d, height = (float(v) for v in rng.uniform((0.7, 0.5, 0.3), (1.5, 1.0, 0.85)))
    top = palette("wood", "plain", "cloth", "planks", "metal", "plaster")
    if rng.random() < 0.6:
        builder.box((0, height, 0), (w, 0.04, d), top)
        legs(builder, top.with_tint(0.8), w, d, height)
    else:
        builder.box((0, 0, 0), (w, height + 0.04, d), top)
    if rng.random() < 0.2:
        rim = float(rng.uniform(0.04, 0.25))
        for side in (-1, 1):
            builder.box((side * w / 2, height, 0), (0.02, rim + 0.04, d), top)
            builder.box((0, height, side * d / 2), (w, rim + 0.04, 0.02), top)
    numbers, taken = [], list[tuple[float, float]]()
    for _ in range(int(rng.integers(3, MOST_ON_TABLE + 1))):
        x, z = float(rng.uniform(-0.42, 0.42)) * w, float(rng.uniform(-0.4, 0.4)) * d
        if rng.random() < 0.7 and any(np.hypot(x - a, z - b) < FREE_M for a, b in taken):
            continue
        taken.append((x, z))
        with builder.at(x, z, float(rng.uniform(0, 360)), height + 0.04):
            numbers += OBJECTS[int(rng.integers(len(OBJECTS)))](builder, palette, rng)
    return numbers


def draw_on_floor(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """Sheets, lids or boxes that lie on the floor, larger than on tables."""
    with builder.at(0, 0, float(rng.uniform(0, 360)), scale=float(rng.uniform(2, 5))):
        for _ in range(int(rng.integers(1, 4))):
            with builder.at(*(float(v) for v in rng.uniform(-0.15, 0.15, 2)), float(rng.uniform(0, 360))):
                (draw_flat if rng.random() < 0.6 else draw_boxes)(builder, palette, rng)


def draw_poster(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A poster, a notice or a mirror on the wall behind z = 0, in the current object: hardly any relief."""
    for _ in range(int(rng.integers(1, 3))):
        w, h, up, x = (float(v) for v in rng.uniform((0.2, 0.2, 0.7, -0.3), (1.0, 1.0, 1.7, 0.3)))
        with builder.group():
            builder.box((x, up, 0), (w, h, float(rng.uniform(0.002, 0.03))), printed(palette, rng))
