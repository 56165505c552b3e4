"""Objects of rooms: a builder at a place, a palette and a random generator in; shapes added to the builder out.

Furniture of `WALL_PROPS` has its back at z = 0 of the builder's current place and looks towards -z.
"""

from __future__ import annotations

from numpy.random import Generator

from dlama.worlds.materials.palette import Palette
from dlama.worlds.props.street import LYING, STANDING, Prop, planter
from dlama.worlds.scene_builder import Material, SceneBuilder


def legs(builder: SceneBuilder, leg: Material, w: float, d: float, height: float, radius: float = 0.03) -> None:
    """Four legs under a top of w x d."""
    for x in (-w / 2 + 0.06, w / 2 - 0.06):
        for z in (-d / 2 + 0.06, d / 2 - 0.06):
            builder.tube((x, 0, z), height, radius, leg, 0.8 * radius)


def table(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A table, square or round, with a few objects on it."""
    top, height = palette("wood"), rng.uniform(0.45, 0.78)
    w, d = rng.uniform(0.8, 1.5), rng.uniform(0.6, 0.9)
    if rng.random() < 0.3:
        builder.tube((0, 0, 0), height, 0.05, top)
        builder.tube((0, height, 0), 0.04, 0.5, top)
    else:
        builder.box((0, height, 0), (w, 0.04, d), top)
        legs(builder, top.with_tint(0.8), w, d, height)
    for _ in range(rng.integers(1, 5)):
        with builder.at(rng.uniform(-0.28, 0.28), rng.uniform(-0.2, 0.2), rng.uniform(0, 90), height + 0.04):
            trinket(builder, palette, rng)


def trinket(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A vase, a ball, a book or a cup."""
    paint, kind = palette.paint(saturation=(0.2, 0.9), value=(0.3, 0.95)), rng.integers(4)
    if kind == 0:
        builder.tube((0, 0, 0), 0.12, 0.05, paint, 0.09)
        builder.tube((0, 0.12, 0), 0.12, 0.09, paint, 0.04)
    elif kind == 1:
        builder.ball((0, 0.1, 0), (0.1, 0.1, 0.1), palette("cloth") if rng.random() < 0.5 else paint)
    elif kind == 2:
        builder.box((0, 0, 0), (0.24, 0.05, 0.17), paint)
        builder.box((0.01, 0.05, 0), (0.2, 0.04, 0.15), palette.paint(saturation=(0.2, 0.9)), (15, 0, 0))
    else:
        builder.tube((0, 0, 0), 0.1, 0.04, paint)


def chair(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A chair with a back of rails."""
    timber = palette("wood", "plain")
    seat = palette("cloth") if rng.random() < 0.5 else timber
    legs(builder, timber, 0.46, 0.44, 0.44, 0.025)
    builder.box((0, 0.44, 0), (0.46, 0.05, 0.44), seat)
    for x in (-0.2, 0.2):
        builder.box((x, 0.47, 0.2), (0.04, 0.5, 0.03), timber)
    for up in (0.6, 0.74, 0.88):
        builder.box((0, up, 0.2), (0.38, 0.08, 0.02), timber)


def stool(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A round stool or a pouffe."""
    if rng.random() < 0.5:
        builder.tube((0, 0, 0), 0.42, 0.3, palette("cloth"), 0.27)
    else:
        legs(builder, palette("wood"), 0.36, 0.36, 0.45, 0.02)
        builder.tube((0, 0.45, 0), 0.05, 0.2, palette("wood", "cloth"))


def sofa(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A sofa or an armchair with cushions; its back at z = 0."""
    cloth, seats = palette("cloth"), rng.integers(1, 4)
    w = 0.7 * seats + 0.3
    builder.box((0, 0.08, -0.45), (w, 0.32, 0.85), cloth)
    builder.box((0, 0.35, -0.12), (w, 0.5, 0.22), cloth)
    for side in (-1, 1):
        builder.box((side * (w / 2 - 0.08), 0.1, -0.45), (0.18, 0.52, 0.88), cloth)
    for n in range(seats):
        x = 0.7 * (n - (seats - 1) / 2)
        builder.ball((x, 0.46, -0.5), (0.34, 0.1, 0.34), cloth.with_tint(1.1))
        if rng.random() < 0.6:
            builder.ball((x, 0.66, -0.3), (0.22, 0.2, 0.1), palette("cloth"), (0, 15, rng.uniform(-30, 30)))


def shelf(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """An open shelf with books and small objects; its back at z = 0."""
    board, w, height = palette("wood"), rng.uniform(0.7, 1.3), rng.uniform(1.2, 2.1)
    for side in (-1, 1):
        builder.box((side * w / 2, 0, -0.15), (0.03, height, 0.3), board)
    builder.box((0, 0, -0.01), (w, height, 0.02), board.with_tint(0.6))
    count = round(height / 0.36)
    for n in range(count + 1):
        builder.box((0, n * (height - 0.03) / count, -0.15), (w, 0.03, 0.3), board)
    for n in range(count):
        up = n * (height - 0.03) / count + 0.03
        x = -w / 2 + 0.03
        while x < w / 2 - 0.12:
            width = rng.uniform(0.1, 0.4)
            if x + width < w / 2 and rng.random() < 0.75:
                h = rng.uniform(0.16, 0.28)
                cover = palette("books") if width > 0.2 else palette.paint()
                builder.box((x + width / 2, up, -0.15), (width, h, 0.2), cover)
            x += width + 0.03


def cupboard(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A cupboard, chest or kitchen block with fronts; its back at z = 0."""
    body, front = palette("wood", "plain"), palette("door", "machine", "wood")
    w, h, d = rng.uniform((0.8, 0.6, 0.4), (1.8, 2.1, 0.6))
    builder.box((0, 0, -d / 2), (w, h, d), body)
    count = max(1, round(w / 0.55))
    for n in range(count):
        x = w * ((n + 0.5) / count - 0.5)
        builder.box((x, 0.06, -d), (w / count - 0.03, h - 0.1, 0.03), front)
        builder.ball((x + 0.3 * w / count, 0.5 * h, -d - 0.03), (0.02, 0.02, 0.02), palette("metal"))
    if h < 1.2:
        with builder.at(rng.uniform(-0.3, 0.3), -d / 2, 0, h):
            trinket(builder, palette, rng)


def bed(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A bed, its head at z = 0."""
    timber, w = palette("wood"), rng.uniform(0.9, 1.6)
    builder.box((0, 0.1, -1.0), (w, 0.2, 2.0), timber)
    builder.box((0, 0.3, -1.0), (w - 0.04, 0.2, 1.96), palette.paint(saturation=(0, 0.1), value=(0.8, 0.95)))
    builder.box((0, 0.32, -1.25), (w, 0.2, 1.5), palette("cloth"))
    builder.box((0, 0, -0.03), (w + 0.1, 0.95, 0.06), timber)
    for x in (-0.22 * w, 0.22 * w):
        builder.ball((x, 0.56, -0.3), (0.2 * w, 0.1, 0.22), palette.paint(saturation=(0, 0.2), value=(0.75, 0.95)))


def screen(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A low board with a television; its back at z = 0."""
    builder.box((0, 0, -0.22), (1.5, 0.45, 0.44), palette("wood", "plain"))
    builder.box((0, 0.45, -0.22), (0.4, 0.06, 0.2), palette.paint(value=(0.05, 0.15)))
    builder.box((0, 0.5, -0.2), (1.15, 0.68, 0.05), palette("poster"))


def floor_lamp(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A lamp on a stand under a shade."""
    iron, height = palette("metal").with_tint(0.6), rng.uniform(1.1, 1.6)
    builder.tube((0, 0, 0), 0.03, 0.16, iron)
    builder.tube((0, 0, 0), height, 0.018, iron)
    builder.tube((0, height - 0.05, 0), 0.3, 0.24, palette("cloth").with_tint(1.2), 0.14)


def basket(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A basket or a bin, a ball at times in it."""
    builder.tube((0, 0, 0), 0.4, 0.16, palette("wood", "cloth", "metal"), 0.22)
    if rng.random() < 0.5:
        builder.ball((0, 0.42, 0), (0.16, 0.16, 0.16), palette("cloth"))


def ball(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A ball on the floor."""
    r = rng.uniform(0.12, 0.34)
    builder.ball((0, r, 0), (r, r, r), palette("cloth", "bands", "planks"), (rng.uniform(0, 360), 30, 20))


def toy(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A figure of balls on a block."""
    fur = palette("cloth")
    builder.ball((0, 0.3, 0), (0.22, 0.3, 0.2), fur)
    builder.ball((0, 0.7, 0), (0.17, 0.17, 0.16), fur)
    for side in (-1, 1):
        builder.ball((0.13 * side, 0.86, 0), (0.06, 0.06, 0.04), fur.with_tint(0.7))
        builder.ball((0.22 * side, 0.36, -0.05), (0.07, 0.2, 0.07), fur, (0, 0, 30 * side))
        builder.ball((0.13 * side, 0.07, -0.14), (0.09, 0.07, 0.2), fur.with_tint(0.8))


def picture(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A framed picture on the wall behind z = 0."""
    w, h, up = rng.uniform(0.4, 1.1), rng.uniform(0.4, 0.9), rng.uniform(1.2, 1.6)
    builder.box((0, up - 0.04, 0), (w + 0.08, h + 0.08, 0.05), palette("wood"))
    builder.box((0, up, 0), (w, h, 0.07), palette("poster"))


def folding_screen(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A folding screen of two wings."""
    cloth = palette("cloth", "wood", "poster")
    for side in (-1, 1):
        builder.panel((0.3 * side, 0.8, 0.1), (0.62, 1.6), cloth, (25 * side, *STANDING[1:]))


def suitcase(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A case on wheels with a handle."""
    builder.box((0, 0.05, 0), (0.45, 0.65, 0.25), palette("machine", "cloth"))
    builder.tube((0, 0.02, -0.08), 0.06, 0.04, palette.paint(value=(0.1, 0.2)), turn=LYING)
    for x in (-0.12, 0.12):
        builder.box((x, 0.7, 0.08), (0.02, 0.35, 0.02), palette("metal"))
    builder.box((0, 1.04, 0.08), (0.28, 0.03, 0.04), palette.paint(value=(0.1, 0.2)))


def divider(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """A shelf or a chest that stands free in the room."""
    with builder.at(0, 0.2):
        (shelf if rng.random() < 0.5 else cupboard)(builder, palette, rng)


ROOM_PROPS: dict[str, tuple[Prop, float]] = {
    "table": (table, 0.85), "chair": (chair, 0.36), "stool": (stool, 0.32), "floor_lamp": (floor_lamp, 0.28),
    "basket": (basket, 0.25), "ball": (ball, 0.3), "toy": (toy, 0.3), "planter": (planter, 0.5),
    "folding_screen": (folding_screen, 0.65), "suitcase": (suitcase, 0.3), "divider": (divider, 0.75),
}  # fmt: skip
"""Name -> what stands free, and the radius in metres of the circle it needs."""
WALL_PROPS: dict[str, tuple[Prop, float]] = {
    "sofa": (sofa, 2.5), "shelf": (shelf, 1.4), "cupboard": (cupboard, 1.9), "bed": (bed, 1.8), "screen": (screen, 1.6),
}  # fmt: skip
"""Name -> what stands against a wall, and the length of wall it needs."""
ROOM_OBJECTS: tuple[Prop, ...] = (table, chair, stool, floor_lamp, basket, toy, planter, suitcase, ball, folding_screen)
"""What may stand before the camera as the object of interest."""
