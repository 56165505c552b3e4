"""An empty floor plan in; a room on it out: walls, furniture and the object of interest."""

from __future__ import annotations

from dlama.worlds.layouts.floor_plan import FloorPlan
from dlama.worlds.props.buildings import row
from dlama.worlds.props.furniture import ROOM_OBJECTS, ROOM_PROPS, WALL_PROPS, picture
from dlama.worlds.raycast.shape_rows import GROUND_GROUP
from dlama.worlds.scene_builder import Material

THICK_M = 0.25


def wall(plan: FloorPlan, length: float, height: float, material: Material, window: bool) -> None:
    """A wall along x, centred, its inner face z = 0; at times with a window in it, an opening through which one sees the sky."""
    builder, rng = plan.builder, plan.rng
    middle = THICK_M / 2
    if not window:
        builder.box((0, 0, middle), (length, height, THICK_M), material)
        return
    w, h, up = (rng.uniform(*span) for span in ((0.9, min(2.6, 0.6 * length)), (1.0, height - 1.3), (0.6, 1.0)))
    x = rng.uniform(-0.5, 0.5) * (length - w - 0.6)
    left, right = length / 2 + x - w / 2, length / 2 - x - w / 2
    builder.box((-length / 2 + left / 2, 0, middle), (left, height, THICK_M), material)
    builder.box((length / 2 - right / 2, 0, middle), (right, height, THICK_M), material)
    builder.box((x, 0, middle), (w, up, THICK_M), material)
    builder.box((x, up + h, middle), (w, height - up - h, THICK_M), material)
    frame = plan.palette.paint(saturation=(0, 0.2), value=(0.7, 0.97))
    builder.box((x, up - 0.05, 0), (w + 0.2, 0.05, 0.35), frame)
    panes = rng.integers(1, 4)
    for n in range(panes + 1):
        builder.box((x - w / 2 + w * n / panes, up, middle), (0.06, h, 0.07), frame)
    for level in (up, up + 0.5 * h, up + h - 0.05):
        builder.box((x, level, middle), (w, 0.05, 0.06), frame)
    if rng.random() < 0.5:
        for side in (-1, 1):
            builder.box((x + side * (w / 2 + 0.1), up - 0.3, -0.1), (0.4, h + 0.5, 0.06), plan.palette("cloth"))


def furnish_wall(plan: FloorPlan, length: float, height: float) -> None:
    """Furniture, pictures and perhaps a door along a wall of which z = 0 is the face; nothing stands in anything."""
    builder, palette, rng = plan.builder, plan.palette, plan.rng
    x = -length / 2 + 0.35
    while x < length / 2 - 0.8:
        kind = rng.random()
        if kind < 0.55:
            prop, need = WALL_PROPS[str(rng.choice(list(WALL_PROPS)))]
            if x + need < length / 2 - 0.3:
                with builder.at(x + need / 2, -0.03), builder.group():
                    prop(builder, palette, rng)
                x += need
        elif kind < 0.7 and x + 1.1 < length / 2:
            with builder.at(x + 0.55, 0), builder.group():
                builder.box((0, 0, 0), (0.9, 2.05, 0.08), palette("door"))
                builder.box((0, 2.05, 0), (1.06, 0.1, 0.1), palette("wood"))
            x += 1.2
        elif x + 1.2 < length / 2:
            with builder.at(x + 0.6, 0), builder.group():
                picture(builder, palette, rng)
            x += 1.2
        x += rng.uniform(0.1, 0.7)


def ceiling(plan: FloorPlan, left: float, right: float, far: float, height: float) -> None:
    """A ceiling, with beams and a hanging lamp at times."""
    builder, palette, rng = plan.builder, plan.palette, plan.rng
    middle, width = (left + right) / 2, right - left
    with builder.group(casts=False):
        boards = palette("planks") if rng.random() < 0.2 else palette.paint(saturation=(0, 0.08), value=(0.85, 1.0))
        builder.panel((middle, height, far / 2 - 1), (width, far + 2), boards)
        if rng.random() < 0.35:
            beam = palette("wood")
            for n in range(int(far) + 1):
                builder.box((middle, height - 0.16, 0.4 + n), (width, 0.16, 0.14), beam)
        if rng.random() < 0.6:
            x, z = rng.uniform(-1, 1), rng.uniform(3, far - 1)
            builder.tube((x, height - 0.6, z), 0.6, 0.01, palette.paint(value=(0.1, 0.2)))
            builder.tube((x, height - 0.85, z), 0.25, 0.28, palette("cloth", "metal").with_tint(1.2), 0.1)


def window_view(plan: FloorPlan, far: float) -> None:
    """What one sees through a window: ground some metres below, houses and the sky."""
    builder, rng = plan.builder, plan.rng
    with builder.group(casts=False), builder.at(0, 0, 0, -rng.choice((0.4, 3.0, 6.0))):
        builder.panel((0, 0, 0), (800, 800), plan.palette("grass", "asphalt"))
        if rng.random() < 0.7:
            with builder.at(0, far + rng.uniform(10, 25)):
                row(builder, plan.palette, rng, -20, 20)


def lay_rug(plan: FloorPlan) -> None:
    """A rug in the middle, at times."""
    rng = plan.rng
    if rng.random() < 0.6:
        x = rng.uniform(-0.8, 0.8)
        size = (rng.uniform(1.5, 2.6), 0.012, rng.uniform(1.2, 2))
        plan.builder.box((x, 0, 3), size, plan.palette("cloth"))


def stand_pillar(plan: FloorPlan, left: float, right: float, far: float, height: float) -> None:
    """A pillar from floor to ceiling, at times, where there is room for one."""
    builder, rng = plan.builder, plan.rng
    if not rng.integers(0, 2):
        return
    x, z = rng.uniform(left + 0.4, right - 0.4), rng.uniform(3.8, far - 0.6)
    if plan.is_free(x, z, 0.3):
        with builder.group():
            builder.tube((x, 0, z), height, 0.17, plan.palette("plaster", "stones", "wood"))


def room(plan: FloorPlan) -> None:
    """Four walls, a floor, furniture along the walls and objects between, with the object of interest."""
    builder, palette, rng = plan.builder, plan.palette, plan.rng
    spans = ((2.9, 4.3), (2.9, 4.3), (4.4, 7.5), (2.45, 3.1))
    left, right, far, height = (rng.uniform(*span) for span in spans)
    left, near = -left, -1.3
    middle, width, depth = (left + right) / 2, right - left, far - near
    paper = palette("plaster", "plaster", "cloth", "bricks", "planks", "stones")
    other = palette("plaster", "bricks", "tiles") if rng.random() < 0.3 else paper
    boards = palette("planks", "planks", "tiles", "cloth", "stones")
    with builder.group(GROUND_GROUP, casts=False):
        builder.panel((middle, 0, (far + near) / 2), (width + 0.4, depth + 0.4), boards)
    ceiling(plan, left, right, far, height)
    sides = ((middle, far, 0, width), (left, (far + near) / 2, 90, depth), (right, (far + near) / 2, -90, depth))
    skirting = palette.paint(saturation=(0, 0.3), value=(0.4, 0.95))
    for n, (x, z, yaw, length) in enumerate((*sides, (middle, near, 180, width))):
        window = rng.random() < (0.5, 0.4, 0.4, 0)[n]
        with builder.at(x, z, yaw), builder.group(casts=False):  # walls let the light in, or every room would be dark
            wall(plan, length + 2 * THICK_M, height, other if n == 0 else paper, window)
            builder.box((0, 0, 0), (length, 0.1, 0.04), skirting)
        plan.building_row(x, z, yaw, -length / 2, length / 2)
        if n < 3 and not window:
            with builder.at(x, z, yaw), builder.at((0.0, 1.2, -1.2)[n], 0):
                furnish_wall(plan, length - (0.6, 3.2, 3.2)[n], height)
        elif window and n == 0:
            window_view(plan, far)
    lay_rug(plan)
    stand_pillar(plan, left, right, far, height)
    names = [*ROOM_PROPS, "table", "chair", "chair", "divider"]
    plan.scatter(ROOM_PROPS, names, (5, 12), (left + 0.4, right - 0.4), (2.4, far - 0.7))
    plan.place_object(ROOM_OBJECTS, (1.0, 1.6))
