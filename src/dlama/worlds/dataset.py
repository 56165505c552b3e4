"""A seed, or a name with a count, in; procedural worlds as a data set with exact truth out.

world(7).frame(world(7).camera(yaw=30))      one frame
worlds(4)                                    a data set with the cases of all three protocols
open_dataset_or_worlds("worlds:4")           the same by name; or the data set in a folder
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from dlama.arguments import check_count, check_word, is_finite
from dlama.completion.options import Unpack
from dlama.datasets.frames import Case, Dataset, Frame, RemovalTruth, StereoTruth, ViewTruth, true_disparity
from dlama.datasets.layouts import DatasetOptions, open_dataset, refuse_unused, select_cases
from dlama.errors import FileError, InputError, system_errors
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD
from dlama.worlds.layouts.random_scene import build
from dlama.worlds.materials.palette import Photo
from dlama.worlds.world import SIZE, Kind, World, yaw_order

YAWS = (10, 20, 30, 40, 50, 60)
KINDS = ("street", "room")
PHOTOS = 12
"""How many of the pictures one world uses at most."""
LAYOUT = "worlds"
"""Name of generated data sets, and of their layout."""
MOST_WORLDS, MOST_PX = 10_000, 8192
"""The longest list of worlds, and the longest side of their pictures; more would be listed or drawn for minutes or hours."""
DEFAULT_COUNT = 4
"""How many worlds the bare name generates."""

Textures = Sequence[Photo] | None


def world(seed: int, *, kind: Kind | None = None, textures: Textures = None) -> World:
    """The world of a seed (>= 0): the same bytes in every process, for any number of threads.

    `textures`: pictures (H x W x 3 uint8 RGB) or files of such, a dozen of which, drawn by the seed, take the place of most
    procedural textures. `kind`: "street" or "room", drawn by the seed where None.
    Raises InputError, FileError (a picture that cannot be read), ShapeError.
    """
    _check_world(seed, kind)
    if textures is None:
        return _from_seed(seed, kind)
    chosen = np.random.default_rng((seed, 1)).permutation(len(textures))[:PHOTOS]
    return build(seed, kind, [textures[int(n)] for n in chosen])


def _check_world(seed: int, kind: Kind | None) -> None:
    check_count(seed, "seed", 0)
    if kind is not None:
        check_word(kind, "kind", KINDS)


@lru_cache(maxsize=4)
def _from_seed(seed: int, kind: Kind | None) -> World:
    """Four worlds are kept, because the cases of a world are mostly loaded one after another."""
    return build(seed, kind, ())


@dataclass(frozen=True)
class WorldSettings:
    """All it takes to build one world, in another process as well."""

    seed: int
    kind: Kind | None
    textures: tuple[Path, ...] | None
    size: int

    @property
    def scene(self) -> str:
        """Name of the scene."""
        return f"w{self.seed:03d}"

    def world(self) -> World:
        """The world, built anew."""
        return world(self.seed, kind=self.kind, textures=self.textures)

    def camera(self, yaw: float) -> Camera:
        """The camera at a yaw (degrees) of its orbit."""
        return self.world().camera(yaw, self.size)


def worlds(
    count: int = DEFAULT_COUNT,
    *,
    seed: int = 0,
    size: int = SIZE,
    yaws: Sequence[float] = YAWS,
    kind: Kind | None = None,
) -> Dataset:
    """`count` worlds, of the seeds `seed`, `seed` + 1 ...; nothing is built until a frame or a case is loaded.

    Frames: yaw 0 and both signs of every yaw, with the object. Cases: VPI from yaw 0 to every other yaw, ORI at every
    yaw (with the cast shadow as a region), SII at yaw 0 with a baseline of 0.12 m and the object removed in both views.
    Raises InputError.
    """
    every = world_settings(count, seed, size, kind)
    if not all(is_finite(yaw) and 0 < yaw < 180 for yaw in yaws):
        raise InputError(
            f"yaws are {tuple(yaws)}; degrees between 0 and 180 are expected, each is used with both signs"
        )
    orbit = yaw_order(tuple(yaws))
    frames, cases = [], []
    for each in every:
        scene = each.scene
        frames += [Frame(scene, _yaw_name(yaw), partial(_frame, each, yaw), yaw) for yaw in orbit]
        cases += [Case("vpi", LAYOUT, scene, _yaw_name(y), partial(_view_truth, each, y), y) for y in orbit[1:]]
        cases += [Case("ori", LAYOUT, scene, _yaw_name(y), partial(_removal_truth, each, y), y) for y in orbit]
        cases.append(Case("sii", LAYOUT, scene, "stereo", partial(_stereo_truth, each)))
    return Dataset(LAYOUT, LAYOUT, None, tuple(frames), tuple(cases))


def world_settings(
    count: int, seed: int, size: int, kind: Kind | None, textures: tuple[Path, ...] | None = None
) -> list[WorldSettings]:
    """The settings of `count` worlds of the seeds `seed`, `seed` + 1 ...; raises InputError."""
    check_count(count, "count", 1, MOST_WORLDS)
    check_count(size, "size", 1, MOST_PX)
    _check_world(seed, kind)
    return [WorldSettings(seed + n, kind, textures, size) for n in range(count)]


def _yaw_name(yaw: float) -> str:
    return "yaw0" if yaw == 0 else f"yaw{yaw:+g}"


def _frame(settings: WorldSettings, yaw: float) -> RGBD:
    return settings.world().frame(settings.camera(yaw))


def _view_truth(settings: WorldSettings, yaw: float) -> ViewTruth:
    made, source, target = settings.world(), settings.camera(0.0), settings.camera(yaw)
    seen = made.raycast(source)
    return ViewTruth(
        source=seen.frame(source),
        target=made.frame(target),
        object_mask=seen.group == made.object_index,
        target_without=made.frame(target, object=False),
    )


def _removal_truth(settings: WorldSettings, yaw: float) -> RemovalTruth:
    made, camera = settings.world(), settings.camera(yaw)
    with_object, without = made.raycast(camera), made.raycast(camera, object=False)
    return RemovalTruth(
        source=with_object.frame(camera),
        without=without.frame(camera),
        mask=with_object.group == made.object_index,
        shadow=made.shadow_of(with_object, without),
    )


def _stereo_truth(settings: WorldSettings) -> StereoTruth:
    made = settings.world()
    rig = made.rig(settings.size)
    left, right = made.raycast(rig.left), made.raycast(rig.right)
    return StereoTruth(
        left=left.color,
        right=right.color,
        rig=rig,
        disparity_left=true_disparity(rig, left.depth),
        disparity_right=true_disparity(rig, right.depth),
        mask_left=left.group == made.object_index,
        mask_right=right.group == made.object_index,
        without_left=made.frame(rig.left, object=False),
        without_right=made.frame(rig.right, object=False),
    )


@system_errors(FileError)
def open_dataset_or_worlds(path: Path | str, layout: str | None = None, **options: Unpack[DatasetOptions]) -> Dataset:
    """The data set in a folder, or a generated one where no folder has that name.

    The options are those of `open_dataset`; generated worlds take `scenes` and `limit` alone. Raises InputError (a malformed
    name, an option that worlds do not take) and what `open_dataset` raises.
    """
    if Path(path).is_dir() or not (str(path) == LAYOUT or str(path).startswith(f"{LAYOUT}:")):
        return open_dataset(path, layout, **options)
    check_count(options.get("limit"), "limit")
    refuse_unused(LAYOUT, frozenset(), options)
    if layout is not None:
        raise InputError(f"'{path}' is generated and has no layout; layout {layout} is for folders")
    _, *numbers = str(path).split(":")
    if len(numbers) > 2 or not all(number.isdecimal() for number in numbers) or numbers[:1] == ["0"]:
        raise InputError(
            f"'{path}' is no name of generated worlds; worlds, worlds:COUNT or worlds:COUNT:SEED is expected"
        )
    count = int(numbers[0]) if numbers else DEFAULT_COUNT
    seed = int(numbers[1]) if len(numbers) > 1 else 0
    return select_cases(worlds(count, seed=seed), options.get("scenes"), options.get("limit"))
