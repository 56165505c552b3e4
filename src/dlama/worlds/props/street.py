"""Objects of streets: a builder at a place, a palette and a random generator in; shapes added to the builder out.

Every prop stands on the ground at the builder's current place and fits into the circle that its table gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from numpy.random import Generator

from dlama.worlds.materials.palette import Palette
from dlama.worlds.scene_builder import SceneBuilder

Prop = Callable[[SceneBuilder, Palette, Generator], None]
LYING = (0.0, 90.0, 0.0)
"""Turn of a tube whose axis then runs along z."""
ACROSS = (90.0, 90.0, 0.0)
"""Turn of a tube whose axis then runs along x."""
STANDING = (0.0, -90.0, 0.0)
"""Turn of a panel that then stands upright and looks along z."""


def tree(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A trunk and a crown of leafy balls, one sees the sky through."""
    height, radius = rng.uniform(1.5, 2.8), rng.uniform(0.08, 0.2)
    bark, leaf = palette("wood").with_tint(0.35), palette("leaves")
    builder.tube((0, 0, 0), height + 0.8, radius, bark, 0.5 * radius)
    spread = rng.uniform(0.7, 1.2)
    for _ in range(rng.integers(5, 10)):
        x, y, z = rng.normal(0, (0.5 * spread, 0.35, 0.5 * spread))
        r = rng.uniform(0.45, 0.85) * spread
        builder.ball((x, height + 0.8 + y, z), (r, 0.85 * r, r), leaf, (rng.uniform(0, 360), 0, 0))


def conifer(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A trunk under cones of needles."""
    height = rng.uniform(2.2, 4.5)
    builder.tube((0, 0, 0), 0.6, 0.1, palette("wood").with_tint(0.35))
    leaf = palette("hedge").with_tint(0.7, 0.8, 0.75)
    for n in range(4):
        low = 0.4 + 0.22 * n * height
        builder.tube((0, low, 0), 0.36 * height, (1 - 0.2 * n) * 0.24 * height, leaf, 0.02)


def bush(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A few leafy balls on the ground."""
    leaf = palette("leaves", "hedge")
    for _ in range(rng.integers(2, 5)):
        r = rng.uniform(0.25, 0.5)
        x, z = rng.uniform(-0.35, 0.35, 2)
        builder.ball((x, 0.7 * r, z), (r, r, r), leaf, (rng.uniform(0, 360), 0, 0))


def hedge(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A clipped hedge."""
    height = rng.uniform(0.5, 1.3)
    builder.box((0, 0, 0), (rng.uniform(1.4, 2.4), height, 0.6), palette("hedge"))


def planter(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A pot or a trough with a plant."""
    pot = palette("concrete", "stones", "wood", "plaster")
    if rng.random() < 0.5:
        builder.tube((0, 0, 0), 0.5, 0.22, pot, 0.34)
    else:
        builder.box((0, 0, 0), (0.8, 0.45, 0.45), pot)
    leaf = palette("leaves", "hedge")
    for _ in range(3):
        x, z = rng.uniform(-0.15, 0.15, 2)
        r = rng.uniform(0.2, 0.38)
        builder.ball((x, 0.45 + 0.7 * r, z), (r, r, r), leaf, (rng.uniform(0, 360), 0, 0))


def lamp(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A street lamp: an arm with a head, or a globe."""
    iron, height = palette.paint((0.3, 0.6), (0, 0.3), (0.15, 0.4)), rng.uniform(2.8, 5)
    builder.tube((0, 0, 0), 0.4, 0.09, iron, 0.06)
    builder.tube((0, 0, 0), height, 0.05, iron, 0.035)
    if rng.random() < 0.5:
        builder.ball((0, height + 0.16, 0), (0.18, 0.18, 0.18), palette.paint((0.1, 0.15), (0, 0.1), (0.9, 1)))
    else:
        builder.tube((0.4, height - 0.45, 0), 0.9, 0.03, iron, turn=ACROSS)
        builder.box((0.75, height - 0.08, 0), (0.5, 0.1, 0.18), iron)


def road_sign(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A post with a plate."""
    height = rng.uniform(1.9, 2.6)
    builder.tube((0, 0, 0), height, 0.035, palette("metal", spread=0).with_tint(0.6))
    if rng.random() < 0.5:
        builder.box((0, height - 0.65, -0.05), (0.6, 0.6, 0.02), palette("sign"))
    else:
        builder.tube((0, height - 0.3, -0.06), 0.02, 0.32, palette("sign", "bands"), turn=LYING)


def advert(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A pillar or a board with posters."""
    if rng.random() < 0.4:
        builder.tube((0, 0, 0), 2.4, 0.5, palette("poster"))
        builder.tube((0, 2.4, 0), 0.25, 0.58, palette.paint(value=(0.2, 0.4)), 0.2)
    else:
        builder.box((0, 0.55, 0), (1.2, 1.6, 0.12), palette("poster"))
        for x in (-0.5, 0.5):
            builder.tube((x, 0, 0), 0.6, 0.04, palette("metal").with_tint(0.4))


def bin_(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A litter bin."""
    body = palette("metal", "machine")
    builder.tube((0, 0, 0), 0.8, 0.24, body, 0.28)
    builder.tube((0, 0.8, 0), 0.1, 0.3, palette.paint(value=(0.1, 0.35)), 0.22)


def barrel(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A construction barrel on its base, with a lamp."""
    builder.tube((0, 0, 0), 0.07, 0.38, palette.paint((0, 1), (0, 0.2), (0.1, 0.2)))
    builder.tube((0, 0.07, 0), 0.95, 0.3, palette("bands"), 0.23)
    builder.ball((0, 1.12, 0), (0.1, 0.1, 0.06), palette.paint((0.05, 0.1), (0.8, 1), (0.8, 1)))


def cone(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A traffic cone."""
    builder.box((0, 0, 0), (0.42, 0.04, 0.42), palette.paint((0, 1), (0, 0.2), (0.1, 0.25)))
    builder.tube((0, 0.04, 0), 0.7, 0.16, palette("bands"), 0.03)


def hydrant(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A hydrant: a tube, a dome and two outlets."""
    paint = palette.paint((0.95, 1.15), (0.6, 0.9), (0.5, 0.85))
    builder.tube((0, 0, 0), 0.1, 0.2, paint)
    builder.tube((0, 0.1, 0), 0.5, 0.14, paint)
    builder.ball((0, 0.6, 0), (0.16, 0.16, 0.16), paint)
    builder.tube((0, 0.28, 0), 0.46, 0.06, paint, turn=ACROSS)


def postbox(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A postbox on legs with a rounded top."""
    body = palette("machine")
    for x in (-0.2, 0.2):
        for z in (-0.18, 0.18):
            builder.tube((x, 0, z), 0.25, 0.03, body.with_tint(0.5))
    builder.box((0, 0.22, 0), (0.5, 0.8, 0.46), body)
    builder.tube((0, 0.79, 0), 0.46, 0.25, body, turn=LYING)


def bench(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A bench: slats for the seat and the back, two feet."""
    slat, base = palette("wood"), palette("concrete", "metal").with_tint(0.6)
    for n in range(3):
        builder.box((0, 0.42, -0.16 + 0.16 * n), (1.5, 0.04, 0.12), slat)
        builder.box((0, 0.52 + 0.13 * n, 0.24 + 0.03 * n), (1.5, 0.09, 0.03), slat)
    for x in (-0.6, 0.6):
        builder.box((x, 0, 0), (0.07, 0.42, 0.42), base)
        builder.box((x, 0.42, 0.27), (0.05, 0.45, 0.04), base)


def crates(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A heap of crates and cardboard boxes."""
    top = 0.0
    for n in range(rng.integers(2, 5)):
        w, h, d = rng.uniform((0.35, 0.25, 0.35), (0.75, 0.55, 0.65))
        x = rng.uniform(-0.12, 0.12)
        builder.box((x, top, 0), (w, h, d), palette("crate"), (rng.uniform(-25, 25), 0, 0))
        if n == 0 and rng.random() < 0.6:
            builder.box((0.55, 0, -0.1), (0.4, 0.4, 0.4), palette("crate"), (rng.uniform(-40, 40), 0, 0))
        top += h
        if top > 1.2:
            break


def pallet(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """Pallets with a load."""
    board = palette("wood")
    for n in range(rng.integers(1, 4)):
        for x in (-0.4, -0.2, 0, 0.2, 0.4):
            builder.box((x, 0.14 * n + 0.09, 0), (0.13, 0.03, 0.9), board)
        for z in (-0.4, 0, 0.4):
            builder.box((0, 0.14 * n, z), (1, 0.09, 0.09), board)


def bollard(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A post with a ball."""
    iron = palette("metal", "concrete", "bands")
    builder.tube((0, 0, 0), 0.8, 0.07, iron)
    builder.ball((0, 0.84, 0), (0.09, 0.09, 0.09), iron)


def barrier(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """Concrete or plastic barriers in a row."""
    skin = palette("concrete", "plaster", "metal")
    builder.box((0, 0, 0), (2.0, 0.25, 0.5), skin)
    builder.box((0, 0.25, 0), (2.0, 0.55, 0.22), skin)


def dumpster(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A container with a slanted lid."""
    body = palette("machine", "metal")
    builder.box((0, 0.12, 0), (1.7, 0.9, 0.95), body)
    builder.box((0, 0.98, 0.02), (1.74, 0.06, 1.05), palette.paint(value=(0.1, 0.25)), (0, 7, 0))
    for x in (-0.7, 0.7):
        builder.box((x, 0.6, -0.5), (0.2, 0.12, 0.12), body.with_tint(0.6))
        builder.tube((x, 0.0, -0.36), 0.1, 0.08, palette.paint(value=(0.1, 0.2)), turn=ACROSS)


def statue(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A pedestal with stacked round stones, or a ball."""
    stone = palette("stones", "concrete", "plaster")
    builder.box((0, 0, 0), (0.7, 0.25, 0.7), stone)
    builder.box((0, 0.25, 0), (0.5, rng.uniform(0.2, 0.7), 0.5), stone)
    top = 0.7
    for r in sorted(rng.uniform(0.12, 0.34, rng.integers(1, 4)), reverse=True):
        builder.ball((0, top + r, 0), (r, 1.15 * r, r), stone)
        top += 2 * r


def bicycle(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A bicycle's frame, spokes and tyres, as tubes."""
    frame, dark = palette.paint(saturation=(0.4, 0.9), value=(0.3, 0.8)), palette.paint(value=(0.1, 0.2))
    for x in (-0.5, 0.5):
        for degrees in range(0, 360, 30):
            angle = math.radians(degrees)
            rim = (x + 0.32 * math.sin(angle), 0.32 + 0.32 * math.cos(angle), 0.0)
            builder.box(rim, (0.18, 0.04, 0.04), dark, (0, 0, degrees))
            if degrees < 180:
                builder.box((x, 0.02, 0), (0.01, 0.64, 0.01), dark, (0, 0, degrees))
    for x, up, length, roll in (
        (-0.12, 0.33, 0.6, -15),
        (0.2, 0.35, 0.72, 40),
        (0.03, 0.6, 0.62, 85),
        (-0.32, 0.3, 0.55, 35),
    ):
        builder.tube((x, up, 0), length, 0.02, frame, turn=(0, 0, roll))
    builder.tube((0.45, 0.33, 0), 0.68, 0.02, frame, turn=(0, 0, -12))
    builder.box((-0.22, 0.9, 0), (0.26, 0.05, 0.14), dark)
    builder.tube((0.38, 0.75, 0), 0.5, 0.015, dark, turn=LYING)


def car(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A parked car or van along x."""
    body = palette.paint(saturation=(0, 0.85), value=(0.15, 0.95))
    glass, tyre = palette("window"), palette.paint((0, 1), (0, 0.1), (0.08, 0.14))
    length, van = rng.uniform(3.6, 4.4), rng.random() < 0.35
    builder.box((0, 0.3, 0), (length, 0.55, 1.65), body)
    if van:
        builder.box((-0.2, 0.85, 0), (length - 0.7, 1.0, 1.6), body)
        builder.box((0.62, 1.1, 0), (0.9, 0.5, 1.64), glass.with_tint(0.4))
    else:
        builder.box((-0.15, 0.85, 0), (0.52 * length, 0.5, 1.45), glass.with_tint(0.4))
        builder.box((-0.15, 1.33, 0), (0.5 * length, 0.06, 1.42), body)
        for x in (-0.27, -0.02, 0.22):
            builder.box((x * length - 0.05, 0.85, 0), (0.08, 0.5, 1.47), body)
    for x in (-0.32, 0.32):
        for z in (-0.72, 0.72):
            builder.tube((x * length, 0.2, z), 0.24, 0.32, tyre, turn=LYING)
            builder.tube((x * length, 0.19, z), 0.26, 0.17, palette("metal").with_tint(0.9), turn=LYING)
    for z in (-0.6, 0.6):
        builder.box((length / 2, 0.55, z), (0.03, 0.14, 0.3), palette.paint((0.1, 0.16), (0, 0.2), (0.9, 1)))
        builder.box((-length / 2, 0.55, z), (0.03, 0.14, 0.3), palette.paint((0, 0.02), (0.7, 0.9), (0.5, 0.8)))


STREET_PROPS: dict[str, tuple[Prop, float]] = {
    "tree": (tree, 0.9), "conifer": (conifer, 1.0), "bush": (bush, 0.7), "hedge": (hedge, 1.2), "planter": (planter, 0.5),
    "lamp": (lamp, 0.3), "road_sign": (road_sign, 0.35), "advert": (advert, 0.7), "bin": (bin_, 0.35),
    "barrel": (barrel, 0.4), "cone": (cone, 0.3), "bench": (bench, 0.85), "crates": (crates, 0.8), "pallet": (pallet, 0.7),
    "bollard": (bollard, 0.15), "barrier": (barrier, 1.1), "dumpster": (dumpster, 1.1), "statue": (statue, 0.5),
    "bicycle": (bicycle, 0.9), "car": (car, 2.3),
}  # fmt: skip
"""Name -> the prop and the radius in metres of the circle it needs."""
STREET_OBJECTS: tuple[Prop, ...] = (
    barrel, cone, hydrant, postbox, bench, crates, bin_, dumpster, statue, planter, bicycle, road_sign, advert, bollard,
)  # fmt: skip
"""What may stand before the camera as the object of interest."""
