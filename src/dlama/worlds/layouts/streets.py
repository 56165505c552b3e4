"""An empty floor plan in; a street, square, park, yard or corner on it out, with the object of interest."""

from __future__ import annotations

from collections.abc import Callable

from dlama.worlds.layouts.floor_plan import FloorPlan
from dlama.worlds.props.buildings import house, pavement, row, yard_wall
from dlama.worlds.props.street import STREET_OBJECTS, STREET_PROPS
from dlama.worlds.raycast.shape_rows import GROUND_GROUP


def ground(plan: FloorPlan, *kinds: str) -> None:
    """The ground, to the horizon; below everything, it shades nothing."""
    with plan.builder.group(GROUND_GROUP, casts=False):
        plan.builder.panel((0, 0, 0), (1600, 1600), plan.palette(*kinds))


def facade(plan: FloorPlan, x: float, z: float, yaw: float, left: float, right: float, walk: float) -> None:
    """A row of houses behind a pavement."""
    plan.building_row(x, z, yaw, left, right, walk)
    with plan.builder.at(x, z, yaw):
        row(plan.builder, plan.palette, plan.rng, left, right)
        if walk > 0:
            pavement(plan.builder, plan.palette, left, right, walk, plan.palette("concrete", "stones"))


def markings(plan: FloorPlan, z: float) -> None:
    """Lines on the road, 3 mm thick: a dashed middle line, a zebra crossing or parking bays."""
    builder, rng, paint = plan.builder, plan.rng, plan.palette("plain").with_tint(0.9)
    kind = rng.integers(4)
    if kind == 0:
        for n in range(-6, 7):
            builder.box((2.4 * n + rng.uniform(0, 0.1), 0, z), (1.3, 0.003, 0.12), paint)
    elif kind == 1:
        x = rng.uniform(-4, 4)
        for n in range(7):
            builder.box((x + 0.75 * (n - 3), 0, z), (0.42, 0.003, 2.4), paint)
    elif kind == 2:
        for n in range(-4, 5):
            builder.box((2.4 * n, 0, z), (0.1, 0.003, 3.6), paint.with_tint(1.0, 0.85, 0.4))


def square(plan: FloorPlan) -> None:
    """Houses across the street, at times round three sides."""
    rng = plan.rng
    ground(plan, "asphalt", "paving", "paving", "gravel")
    far, walk = rng.uniform(6, 11.5), rng.uniform(1.0, 2.4)
    sides = [rng.uniform(5.5, 11) if rng.random() < 0.65 else 0.0 for _ in range(2)]
    left, right = sides[0] or 22.0, sides[1] or 22.0
    facade(plan, 0, far, 0, -left - 1, right + 1, walk)
    if sides[0]:
        facade(plan, -left, 0, 90, -7, far - rng.choice((0, 4)), 0)
    if sides[1]:
        facade(plan, right, 0, -90, -far + rng.choice((0, 4)), 7, 0)
    markings(plan, rng.uniform(3.5, max(3.6, far - walk - 0.5)))
    names = [*STREET_PROPS, "tree", "lamp", "planter", "bench", "bin", "bollard"]
    plan.scatter(STREET_PROPS, names, (6, 14), (-min(left, 9) + 0.5, min(right, 9) - 0.5), (3.2, far))


def canyon(plan: FloorPlan) -> None:
    """A street between two rows of houses, closed at its far end or open to the sky."""
    rng = plan.rng
    ground(plan, "asphalt", "asphalt", "paving")
    left, right, end = (rng.uniform(*span) for span in ((3.6, 7), (3.6, 7), (14, 34)))
    walk = rng.uniform(0.9, 1.5)
    facade(plan, -left, 0, 90, -8, end, walk)
    facade(plan, right, 0, -90, -end, 8, walk)
    if rng.random() < 0.6:
        facade(plan, 0, end + 3, 0, -12, 12, 0)
    with plan.builder.at(rng.uniform(-0.5, 0.5), 0, 90):
        markings(plan, 0.0)
    names = [*STREET_PROPS, "lamp", "tree", "bin", "bollard", "planter", "car"]
    plan.scatter(STREET_PROPS, names, (8, 18), (-left + 0.3, right - 0.3), (3.0, 14))


def park(plan: FloorPlan) -> None:
    """A lawn with a path, trees and benches; houses far behind."""
    rng, builder, palette = plan.rng, plan.builder, plan.palette
    ground(plan, "grass", "grass", "gravel")
    with builder.at(rng.uniform(-1.5, 1.5), 3, rng.uniform(-70, 70)):
        builder.box((0, 0, 0), (rng.uniform(1.6, 3), 0.012, 60), palette("gravel", "paving", "asphalt"))
    far = rng.uniform(11, 26)
    facade(plan, 0, far, rng.uniform(-15, 15), -26, 26, 1.5)
    if rng.random() < 0.7:
        z = rng.uniform(5.5, 10)
        with builder.at(0, z, rng.uniform(-12, 12)), builder.group():
            yard_wall(builder, palette, rng, -14, 14)
        plan.building_row(0, z, 0, -14, 14)
    names = 3 * ["tree"] + ["conifer", "bush", "bush", "hedge", "bench", "lamp", "statue", "planter", "bin", "bicycle"]
    plan.scatter(STREET_PROPS, names, (10, 20), (-10, 10), (1.5, min(far - 1, 13)))


def yard(plan: FloorPlan) -> None:
    """A yard between a house and walls, with containers and goods."""
    rng, builder, palette = plan.rng, plan.builder, plan.palette
    ground(plan, "asphalt", "paving", "gravel")
    far, left, right = (rng.uniform(*span) for span in ((5.5, 9), (4.2, 8), (4.2, 8)))
    facade(plan, 0, far, 0, -left - 0.5, right + 0.5, 0)
    for x, yaw, low, high in ((-left, 90, -7.0, far), (right, -90, -far, 7.0)):
        plan.building_row(x, 0, yaw, low, high)
        with builder.at(x, 0, yaw), builder.group():
            if rng.random() < 0.4:
                row(builder, palette, rng, low, high)
            else:
                yard_wall(builder, palette, rng, low, high)
    facade(plan, 0, rng.uniform(24, 34), 0, -34, 34, 0)
    markings(plan, rng.uniform(3.2, far - 1))
    names = [
        "dumpster", "crates", "pallet", "barrel", "cone", "barrier", "car", "bicycle", "bin", "planter", "advert", "crates",
    ]  # fmt: skip
    plan.scatter(STREET_PROPS, names, (7, 14), (-left, right), (3, far))


def corner(plan: FloorPlan) -> None:
    """The corner of a block between two streets."""
    rng, builder = plan.rng, plan.builder
    ground(plan, "asphalt", "paving")
    x, z, yaw = (rng.uniform(*span) for span in ((-2.5, 2.5), (6, 9), (30, 60)))
    walk = rng.uniform(1, 1.6)
    facade(plan, x, z, yaw, 0, 16, walk)
    facade(plan, x, z, yaw - 90, -16, 0, walk)
    facade(plan, -rng.uniform(9, 13), 0, 90, -6, 26, 0)
    facade(plan, rng.uniform(9, 13), 0, -90, -26, 6, 0)
    with builder.at(rng.uniform(-4, 4), 3, rng.uniform(-50, 50)):
        markings(plan, 0.0)
    plan.scatter(STREET_PROPS, [*STREET_PROPS, "lamp", "tree", "car"], (7, 15), (-9, 9), (3, 10))


def shed(plan: FloorPlan) -> None:
    """One free-standing house on open ground, few objects round it, much sky."""
    rng, builder = plan.rng, plan.builder
    ground(plan, "grass", "gravel", "asphalt")
    far, width = rng.uniform(6, 10), rng.uniform(5, 9)
    x, yaw = rng.uniform(-2, 2), rng.uniform(-25, 25)
    plan.building_row(x, far, yaw, -width / 2, width / 2)
    with builder.at(x, far, yaw), builder.group():
        house(builder, plan.palette, rng, width)
    for side in (-1, 1):
        if rng.random() < 0.6:
            facade(plan, side * rng.uniform(14, 20), 8, -90.0 * side, -14, 14, 0)
    plan.scatter(STREET_PROPS, [*STREET_PROPS, "tree", "bush", "hedge"], (8, 16), (-10, 10), (1.5, 14))


LAYOUTS: tuple[Callable[[FloorPlan], None], ...] = (square, square, canyon, park, yard, corner, shed)


def street(plan: FloorPlan) -> None:
    """One of the layouts, with the object of interest."""
    LAYOUTS[plan.rng.integers(len(LAYOUTS))](plan)
    plan.place_object(STREET_OBJECTS, (0.95, 1.35))
