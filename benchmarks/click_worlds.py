"""Seeds in; procedural worlds whose objects also stand on objects, and what each pixel shows, out: the truth of a click.

What lies on a table is an object of its own here, and some objects stand on an island, a plinth or a table top. Crowded worlds
have what one click finds badly, too (`click_clutter`).
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from click_clutter import draw_crowded_table, draw_on_floor, draw_poster
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.worlds.dataset import Textures, world
from dlama.worlds.layouts import rooms, streets
from dlama.worlds.materials.palette import Palette
from dlama.worlds.props import furniture
from dlama.worlds.props.street import Prop, bicycle
from dlama.worlds.raycast.shape_rows import CASTS, GROUND_GROUP, GROUP
from dlama.worlds.scene_builder import SceneBuilder
from dlama.worlds.world import World

STAND_SHARE = 0.4
"""Of the scattered objects that stand on an object, where stands are asked for."""
LOW_M, HIGH_M, WIDE_M = (0.06, 0.3), (0.3, 0.8), (0.7, 2.2)
"""Heights of islands and of plinths or tables, and their width."""
TABLE_SHARE, FLOOR_SHARE, THIN_SHARE, TWICE_SHARE, POSTER_SHARE = 0.2, 0.15, 0.1, 0.15, 0.6
"""Of the objects of crowded worlds: crowded tables, what lies on the floor, chairs or bicycles, objects that touch another of
their kind; of the pictures on walls, those without relief."""
NEAR_M, NEAR_PITCH_DEG, NEAR_YAW_DEG, FREE_M, NEAR_SHARES = (0.5, 2.0), (5, 65), 60, 0.2, (0.0003, 0.1)
"""Distance of a near camera from the object that it looks at, from where it looks, how much room is before it, and the object's
share of the picture."""


@dataclasses.dataclass(frozen=True, eq=False)
class ClickScene:
    """A frame, and which object and which shape of it each pixel shows."""

    frame: RGBD
    group: NDArray[np.int32]
    """H x W number of the object; -1 sky."""
    shape: NDArray[np.int32]
    """H x W number of the shape, a part of an object; -1 sky."""
    stands_on: dict[int, int]
    """Object -> the object that it stands on."""
    casts: frozenset[int]
    """Objects; the others are ground, walls and ceilings."""

    @property
    def background(self) -> BoolArray:
        """H x W, True on ground, walls, ceilings and the sky."""
        return ~np.isin(self.group, list(self.casts))

    def mask(self, number: int) -> BoolArray:
        """H x W, True where the object is seen."""
        return np.asarray(self.group == number)

    def on_it(self, number: int) -> BoolArray:
        """H x W, True on what stands on the object."""
        return np.isin(self.group, [each for each, base in self.stands_on.items() if base == number])

    def with_stand(self, number: int) -> BoolArray:
        """H x W, True on the object, on what it stands on if that is an object, and on all that stands there, too."""
        base = self.stands_on.get(number, number)
        return np.isin(self.group, [base, *(each for each, under in self.stands_on.items() if under == base)])


class ClickWorld:
    """A world whose objects on objects are apart. stands: with islands and plinths; crowded: with `click_clutter`."""

    def __init__(self, seed: int, textures: Textures = None, *, stands: bool = False, crowded: bool = False) -> None:
        self.stands_on: dict[int, int] = {}
        with standing_apart(self.stands_on, stands, crowded):
            self.world: World = world(seed, textures=textures if textures is not None else ())
        shapes = self.world.shapes.copy()
        self.groups = shapes[:, GROUP].astype(np.int32)
        self.casts = frozenset(int(n) for n in self.groups[shapes[:, CASTS] > 0]) - {GROUND_GROUP}
        shapes[:, GROUP] = np.arange(len(shapes))
        self._numbered = dataclasses.replace(self.world, shapes=shapes, object_index=-2)

    def scene(self, camera: Camera) -> ClickScene:
        """What a camera sees."""
        seen = self._numbered.raycast(camera)
        groups = np.append(self.groups, -1)[seen.group]
        return ClickScene(RGBD(seen.color, seen.depth, camera), groups, seen.group, self.stands_on, self.casts)

    def near_scene(self, scene: ClickScene, rng: Generator) -> ClickScene:
        """An object of the scene seen from near; the scene itself where there is none, or the camera would be in something."""
        camera = near_camera(scene, rng)
        near = scene if camera is None else self.scene(camera)
        return near if np.quantile(near.frame.depth, 0.05) > FREE_M else scene


@contextlib.contextmanager
def standing_apart(stands_on: dict[int, int], stands: bool, crowded: bool) -> Iterator[None]:
    """Worlds built inside note in `stands_on` which object stands on which."""
    trinket = furniture.trinket

    def own_trinket(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
        below = builder._group
        with builder.group() as number:
            trinket(builder, palette, rng)
        stands_on[number] = below

    def on_stand(prop: Prop, share: float) -> Prop:
        def placed(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
            if rng.random() >= share:
                return prop(builder, palette, rng)
            own, low = builder._group, rng.random() < 0.6
            height = float(rng.uniform(*(LOW_M if low else HIGH_M)))
            with builder.group() as number:
                draw_stand(builder, palette, rng, height)
            stands_on[own] = number
            with builder.at(0, 0, 0, height):
                prop(builder, palette, rng)
            return None

        return placed

    def among_others(prop: Prop, thin: Prop) -> Prop:
        def placed(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
            own, kind = builder._group, int(rng.choice(5, p=shares))
            if kind == 0:
                stands_on.update(dict.fromkeys(draw_crowded_table(builder, palette, rng), own))
            elif kind == 1:
                draw_on_floor(builder, palette, rng)
            else:
                (thin if kind == 2 else prop)(builder, palette, rng)
            if kind == 3:
                with builder.at(*(float(v) for v in rng.uniform(-0.5, 0.5, 2))), builder.group():
                    prop(builder, palette, rng)

        return placed

    shares = np.array((TABLE_SHARE, FLOOR_SHARE, THIN_SHARE, TWICE_SHARE, 0))
    shares[-1] = 1 - shares.sum()
    replaced: list[tuple[Any, str, Any]] = [(furniture, "trinket", own_trinket)]
    for room, props, objects, thin in (
        (streets, "STREET_PROPS", "STREET_OBJECTS", bicycle),
        (rooms, "ROOM_PROPS", "ROOM_OBJECTS", furniture.chair),
    ):
        free, central = dict(getattr(room, props)), tuple(getattr(room, objects))
        if crowded:
            free = {name: (among_others(prop, thin), r) for name, (prop, r) in free.items()}
            central = tuple(among_others(prop, thin) for prop in central)
        if stands:
            free = {name: (on_stand(prop, STAND_SHARE), r) for name, (prop, r) in free.items()}
            central = tuple(on_stand(prop, 0.7) for prop in central)
        replaced += [(room, props, free), (room, objects, central)]
    if crowded:
        replaced.append((rooms, "picture", picture_or_poster))
    before = [(place, name, getattr(place, name)) for place, name, _ in replaced]
    try:
        for place, name, value in replaced:
            setattr(place, name, value)
        yield
    finally:
        for place, name, value in before:
            setattr(place, name, value)


def picture_or_poster(builder: SceneBuilder, palette: Palette, rng: Generator) -> None:
    """What hangs on a wall."""
    (draw_poster if rng.random() < POSTER_SHARE else furniture.picture)(builder, palette, rng)


def near_camera(scene: ClickScene, rng: Generator) -> Camera | None:
    """A camera of the same lens that looks at an object of the scene from near; None where there is none."""
    camera, seen = scene.frame.camera, objects_in_sight(scene, *NEAR_SHARES, cut_off=True)
    if not seen:
        return None
    row, column = rng.choice(np.argwhere(scene.mask(int(rng.choice(seen)))))
    z = float(scene.frame.depth[row, column])
    pose = camera.world_from_cam
    at = pose[:3, :3] @ ((column - camera.cx) / camera.fx * z, (row - camera.cy) / camera.fy * z, z) + pose[:3, 3]
    away = pose[:3, 3] - at
    yaw = np.arctan2(away[0], away[2]) + np.radians(rng.uniform(-NEAR_YAW_DEG, NEAR_YAW_DEG))
    pitch, distance = np.radians(rng.uniform(*NEAR_PITCH_DEG)), rng.uniform(*NEAR_M)
    back = np.array((np.sin(yaw) * np.cos(pitch), -np.sin(pitch), np.cos(yaw) * np.cos(pitch)))
    right = np.cross((0, 1, 0), -back)
    right /= np.linalg.norm(right)
    near = np.eye(4)
    near[:3, :3] = np.stack([right, np.cross(-back, right), -back], 1)
    near[:3, 3] = at + distance * back
    return camera.at(near)


def draw_stand(builder: SceneBuilder, palette: Palette, rng: Generator, height: float) -> None:
    """An island, a plinth or a table of a height (m)."""
    w, d = (float(rng.uniform(*WIDE_M)) for _ in range(2))
    kind = rng.random()
    if kind < 0.35:
        builder.tube((0, 0, 0), height, w / 2, palette("concrete", "stones", "wood", "plain"))
    elif kind < 0.8 or height < LOW_M[1]:
        builder.box((0, 0, 0), (w, height, d), palette("concrete", "stones", "bricks", "planks", "plaster", "cloth"))
    else:
        top = palette("wood", "plain")
        builder.box((0, height - 0.04, 0), (w, 0.04, d), top)
        furniture.legs(builder, top.with_tint(0.8), w, d, height - 0.04)


def objects_in_sight(scene: ClickScene, least: float, most: float, *, cut_off: bool = False) -> list[int]:
    """Numbers of the objects of a size (share of the picture), mostly in one piece; cut_off: also those that the rim cuts."""
    numbers, counts = np.unique(scene.group, return_counts=True)
    fair = counts >= least * scene.group.size
    fair &= counts <= most * scene.group.size
    rim = np.concatenate([scene.group[0], scene.group[-1], scene.group[:, 0], scene.group[:, -1]])
    found = []
    for number in numbers[fair].tolist():
        if number in scene.casts and (cut_off or number not in rim):
            found.append(number)
    return found
