"""Procedural worlds: a seed in; frames with and without an object, orbits, stereo pairs and their exact truth out.

world(7).frame(world(7).camera(yaw_deg=30))      one frame
worlds(4)                                        a data set with the cases of all three protocols
write_worlds(Path("out"))                        the same as folders in EasySynth's layout
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset, Frame, RemovalTruth, StereoTruth, ViewTruth
from dlama.errors import FileError, InputError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.worlds.frames import BASELINE_M, SIZE, Cast, Kind, Light, Sky, World, yaw_order

__all__ = ["Cast", "Kind", "Light", "Sky", "World", "world", "worlds", "write_worlds"]

YAWS = (10, 20, 30, 40, 50, 60)
KINDS = ("street", "room")
PHOTOS = 12
"""How many pictures of a folder one world uses at most."""
PICTURES = (".jpg", ".jpeg", ".png", ".webp", ".bmp")
LAYOUT = "worlds"

Textures = Path | Sequence[np.ndarray] | None


def world(
    seed: int, *, kind: Kind | None = None, textures: Textures = None, shadows: bool = True, antialias: bool = True
) -> World:
    """The world of a seed (>= 0): the same bytes in every process, whatever the number of threads.

    `textures`: a folder of pictures (searched through) or pictures (H x W x 3 uint8 RGB), a dozen of which, drawn by the
    seed, take the place of most procedural textures. `kind`: "street" or "room", drawn by the seed where None.
    Raises InputError, FileError (no pictures, or one that cannot be read), ShapeError.
    """
    if seed < 0:
        raise InputError(f"seed is {seed}; a whole number >= 0 is wanted")
    if kind is not None and kind not in KINDS:
        raise InputError(f"kind is '{kind}'; {' or '.join(KINDS)} is wanted")
    if textures is None or isinstance(textures, str | Path):
        return _from_seed(seed, kind, None if textures is None else Path(textures), shadows, antialias)
    return _built(seed, kind, textures, shadows, antialias)


@lru_cache(maxsize=4)
def _from_seed(seed: int, kind: Kind | None, folder: Path | None, shadows: bool, antialias: bool) -> World:
    """Kept a while, because the cases of a world are mostly asked for one after another."""
    return _built(seed, kind, _pictures(folder) if folder is not None else (), shadows, antialias)


def _built(
    seed: int, kind: Kind | None, pictures: Sequence[np.ndarray | Path], shadows: bool, antialias: bool
) -> World:
    from dlama.worlds.layouts.random_scene import build

    chosen = np.random.default_rng((seed, 1)).permutation(len(pictures))[:PHOTOS]
    return build(seed, kind, [pictures[int(n)] for n in chosen], shadows=shadows, antialias=antialias)


@lru_cache(maxsize=4)
def _pictures(folder: Path) -> tuple[Path, ...]:
    """All pictures below a folder, in the order of their names."""
    if not folder.is_dir():
        raise FileError(f"{folder}: is no folder; a folder of pictures is wanted for textures")
    found = tuple(sorted(each for each in folder.rglob("*") if each.suffix.lower() in PICTURES))
    if not found:
        raise FileError(f"{folder}: holds no pictures ({', '.join(PICTURES)}); textures are taken from them")
    return found


@dataclass(frozen=True)
class _Recipe:
    """All it takes to make a world again, in another process, too."""

    seed: int
    kind: Kind | None
    textures: Path | tuple[np.ndarray, ...] | None
    shadows: bool
    antialias: bool
    size: int

    @property
    def scene(self) -> str:
        return f"w{self.seed:03d}"

    def world(self) -> World:
        return world(self.seed, kind=self.kind, textures=self.textures, shadows=self.shadows, antialias=self.antialias)

    def camera(self, yaw_deg: float) -> Camera:
        return self.world().camera(yaw_deg, self.size)


def worlds(
    count: int = 4,
    *,
    seed: int = 0,
    size: int = SIZE,
    yaws: Sequence[float] = YAWS,
    kind: Kind | None = None,
    shadows: bool = True,
    antialias: bool = True,
    textures: Textures = None,
) -> Dataset:
    """`count` worlds, of the seeds `seed`, `seed` + 1 ...; nothing is built until a frame or a case is loaded.

    Frames: yaw 0 and both signs of every yaw, with the object. Cases: VPI from yaw 0 to every other yaw, ORI at every
    yaw (with the cast shadow as a region), SII at yaw 0 with a baseline of 0.12 m and the object removed in both views.
    Raises InputError.
    """
    recipes = _recipes(count, seed, size, kind, shadows, antialias, textures)
    if not all(0 < yaw < 180 for yaw in yaws):
        raise InputError(f"yaws are {tuple(yaws)}; degrees between 0 and 180 are wanted, each is used with both signs")
    orbit = yaw_order(tuple(yaws))
    frames, cases = [], []
    for each in recipes:
        scene = each.scene
        frames += [Frame(scene, _yaw_name(yaw), partial(_frame, each, yaw), yaw) for yaw in orbit]
        cases += [Case("vpi", LAYOUT, scene, _yaw_name(y), partial(_view_truth, each, y), y) for y in orbit[1:]]
        cases += [Case("ori", LAYOUT, scene, _yaw_name(y), partial(_removal_truth, each, y), y) for y in orbit]
        cases.append(Case("sii", LAYOUT, scene, "stereo", partial(_stereo_truth, each)))
    return Dataset(LAYOUT, LAYOUT, None, tuple(frames), tuple(cases))


def _recipes(
    count: int, seed: int, size: int, kind: str | None, shadows: bool, antialias: bool, textures: Textures
) -> list[_Recipe]:
    if count < 1 or seed < 0 or size < 1:
        raise InputError(f"count is {count}, seed {seed}, size {size}; count >= 1, seed >= 0 and size >= 1 are wanted")
    if kind is not None and kind not in KINDS:
        raise InputError(f"kind is '{kind}'; {' or '.join(KINDS)} is wanted")
    held = textures if textures is None or isinstance(textures, Path) else tuple(textures)
    if isinstance(held, Path):
        _pictures(held)
    return [_Recipe(seed + n, kind, held, shadows, antialias, size) for n in range(count)]  # type: ignore[arg-type]


def _yaw_name(yaw: float) -> str:
    return "yaw0" if yaw == 0 else f"yaw{yaw:+g}"


def _frame(recipe: _Recipe, yaw: float) -> RGBD:
    return recipe.world().frame(recipe.camera(yaw))


def _view_truth(recipe: _Recipe, yaw: float) -> ViewTruth:
    made, source, target = recipe.world(), recipe.camera(0.0), recipe.camera(yaw)
    seen = made.cast(source)
    return ViewTruth(
        source=RGBD(seen.color, seen.depth, source),
        target=made.frame(target),
        object_mask=seen.group == made.object_index,
        target_without=made.frame(target, object=False),
    )


def _removal_truth(recipe: _Recipe, yaw: float) -> RemovalTruth:
    made, camera = recipe.world(), recipe.camera(yaw)
    there, gone = made.cast(camera), made.cast(camera, object=False)
    return RemovalTruth(
        source=RGBD(there.color, there.depth, camera),
        without=RGBD(gone.color, gone.depth, camera),
        mask=there.group == made.object_index,
        shadow=made.shadow_of(there, gone),
    )


def _stereo_truth(recipe: _Recipe) -> StereoTruth:
    made = recipe.world()
    rig = made.rig(BASELINE_M, recipe.size)
    left, right = made.cast(rig.left), made.cast(rig.right)
    reach = rig.left.fx * rig.baseline_m
    return StereoTruth(
        left=left.color,
        right=right.color,
        rig=rig,
        disparity_left=_disparity(left.depth, reach),
        disparity_right=_disparity(right.depth, reach),
        mask_left=left.group == made.object_index,
        mask_right=right.group == made.object_index,
        without_left=made.frame(rig.left, object=False),
        without_right=made.frame(rig.right, object=False),
    )


def _disparity(depth: Float32Array, reach: float) -> Float32Array:
    """fx baseline / Z in px; the sky's is 0."""
    return (reach / depth.astype(np.float64)).astype(np.float32)


def write_worlds(
    folder: Path,
    *,
    count: int = 4,
    seed: int = 0,
    size: int = SIZE,
    kind: str | None = None,
    shadows: bool = True,
    antialias: bool = True,
    textures: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Write worlds in EasySynth's layout, depth range 10 m: scene folders `wNNN` with with, without, stereo_with, stereo_without.

    Each scene also gets poses.json (intrinsics, yaw and world_from_cam of every frame). `progress` is called with frames
    done and all frames. A scene is written whole or not at all. Returns the scenes' folders. Raises InputError, OutputError
    (a scene's folder is not empty, or the place cannot be written).
    """
    from dlama.worlds.folders import FRAMES, write_world

    recipes = _recipes(count, seed, size, kind, shadows, antialias, textures)
    written: list[Path] = []
    for each in recipes:
        before = FRAMES * len(written)
        step = None if progress is None else partial(_step, progress, before, FRAMES * count)
        written.append(write_world(Path(folder), each.scene, each.world(), size, YAWS, step))
    return written


def _step(progress: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    progress(before + done, total)
