"""Seeds of procedural worlds in; crops of planes with the true shadow out, for `benchmarks/shadow_classifier.py`.

An object of a world is chosen, its picture taken with and without it under one of three lights: the world's own sun or lamp, a
light of many directions whose penumbra grows with height, or none that casts the object's shadow. Sensor noise, JPEG, exposure,
masks that are a pixel off and bent depth are added afterwards. The ground of some worlds is replaced by blocks between joints:
cobbles, slabs, tiles and boards, whose own tones differ as much as a shadow's from the lit ground.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from dlama.evaluation.metrics.regions import darkened_by_shadow
from dlama.geometry.camera import Camera
from dlama.geometry.holes import dilate_mask, erode_mask
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.masks.supports import find_planes_of_picture
from dlama.perception.shadows.ground import EDGE_PX, find_ground
from dlama.perception.shadows.planes import ShadowPlanes, shadow_planes
from dlama.training.data.augment import add_depth_faults
from dlama.worlds.dataset import Textures, world
from dlama.worlds.layouts.random_scene import direction_to_light
from dlama.worlds.materials.textures import CLOUDY, FINE, GRAIN, ROUGH, color, courses
from dlama.worlds.raycast import shape_rows as k
from dlama.worlds.raycast.shape_rows import CASTS, GROUP, LIT
from dlama.worlds.scene_builder import SceneBuilder
from dlama.worlds.world import World
from dlama.writing.atomic_write import new_file
from sensors import add_photo_noise, stereo_matcher, structured_light

AS_IT_IS = 0.35
"""Share of crops of a world's own object, in its own light, by its own camera."""
NATIVE, SOFT = 0.4, 0.46
"""Of the others, share in a sun or lamp and in a soft light; the rest is without a shadow of the object."""
SIZES = (288, 336, 384)
FEWEST_PX, LARGEST_SHARE = 0.0015, 0.2
"""Of the picture: the size of a chosen object."""
WIDE_M, LOW_M, TILE_M = 1.0, 0.4, (0.8, 5.0)
"""What is paved is so wide and lies within LOW_M of the ground's height; the pattern comes again after TILE_M."""
FIFTH = 5
LIGHTS, DOME, LIGHT_PX = 12, 24, 128
"""Directions of a lobe and of the sky of a soft light, and the side of the pictures that they are looked at in."""


Crop = tuple[ShadowPlanes, Float32Array]
"""Planes, and the share of each pixel that is shadow (-1: does not count)."""


def shadow_crop(seed: int, textures: Textures = None, *, paved: bool = False) -> Crop | None:
    """Its planes and h x w: the share of each pixel that is shadow, -1 where it does not count (off the surface,
    outside the picture). None: nothing in that world stands on a surface. paved: `add_paving`."""
    case = shadow_case(seed, textures, paved=paved)
    if case is None:
        return None
    source, mask, true = case
    ground = find_ground(source, mask, find_planes_of_picture(source)) if mask.any() else None
    if ground is None:
        return None
    planes, crop, _ = shadow_planes(source, mask, ground)
    target = np.full(planes.surface.shape, -1, np.float32)
    wide, high = crop.size
    counts = crop.small(ground.surface & ~dilate_mask(mask, EDGE_PX)) > 0.5
    target[:high, :wide] = np.where(counts, crop.small(true), -1)
    return planes, target


def shadow_case(
    seed: int, textures: Textures = None, *, paved: bool = False
) -> tuple[RGBD, BoolArray, BoolArray] | None:
    """A frame as it is measured, the mask of an object, and its true shadow (H x W). None: no object is in sight."""
    rng = np.random.default_rng((seed, 12))
    made = world(seed, textures=textures)
    if paved:
        made = add_paving(made, np.random.default_rng((seed, 13)))
    as_it_is = bool(rng.random() < AS_IT_IS)
    if not as_it_is and rng.random() < 0.6:
        to_light = direction_to_light(float(rng.uniform(0, 360)), float(rng.uniform(18, 75)))
        made = dataclasses.replace(made, light=dataclasses.replace(made.light, to_light=to_light))
    camera = made.camera() if as_it_is else random_camera(made, rng)
    chosen = made.object_index if as_it_is else choose_object(made, camera, rng)
    if chosen is None:
        return None
    made = dataclasses.replace(made, object_index=chosen)
    source, without, mask = lit_pair(made, camera, rng, 0.0 if as_it_is else float(rng.random()))
    true = darkened_by_shadow(source.color, without, mask)
    return *simulate_measurement(source, mask, rng), true


def add_paving(made: World, rng: np.random.Generator) -> World:
    """The world with a new ground, floor and pavements: blocks of one material between joints."""
    shapes = made.shapes.copy()
    top = shapes[:, k.CENTRE + 1] - shapes[:, k.HALF + 1]  # y points down
    flat = (shapes[:, [k.HALF, k.HALF + 2]] > WIDE_M / 2).all(1) & (np.abs(shapes[:, k.TURN + 4]) > 0.999)
    ground = flat & (shapes[:, GROUP] == k.GROUND_GROUP) & (np.abs(top) < LOW_M)
    builder = SceneBuilder()
    builder.layer(paving_blocks(rng))
    shapes[ground, k.LAYER], shapes[ground, k.MODE] = len(made.textures), k.WRAP
    shapes[ground, k.TILE : k.TILE + 2] = np.exp(rng.uniform(*np.log(TILE_M)))
    shapes[ground, k.TINT : k.TINT + 3], shapes[ground, k.STAIN] = 1, rng.uniform(0, 0.4)
    return dataclasses.replace(made, shapes=shapes, textures=np.concatenate([made.textures, builder.texels()]))


def paving_blocks(rng: np.random.Generator) -> UInt8Array:
    """256 x 256 x 4: rows of blocks, of any size, with narrow or wide, dark or light joints, even or mixed in tone."""
    rows = int(rng.integers(3, 25))
    columns = max(1, int(rows * rng.choice([0.15, 0.33, 0.5, 0.7, 1.0])))
    base = color(rng, (0.0, 0.15) if rng.random() < 0.7 else (0.0, 1.0), (0.0, 0.35), (0.35, 0.85))
    joints = float(rng.uniform(0.2, 0.8) if rng.random() < 0.85 else rng.uniform(1.0, 1.4))
    mortar = base[0] * joints, base[1] * joints, base[2] * joints
    bond, spread = float(rng.choice([0.0, 0.33, 0.5])), float(rng.uniform(0.03, 0.3))
    wobble = float(rng.uniform(0, 0.05)) if rng.random() < 0.5 else 0.0
    grain = int(rng.choice([FINE, ROUGH, CLOUDY, GRAIN]))
    joint = float(rng.uniform(0.015, 0.15))
    return courses(rng, rows, columns, joint, base, mortar, bond=bond, spread=spread, wobble=wobble, grain=grain)


def random_camera(made: World, rng: np.random.Generator) -> Camera:
    """A camera of the orbit, at another height and pitch."""
    size = int(rng.choice(SIZES))
    camera = made.camera(float(rng.uniform(-60, 60)), size, float(rng.uniform(50, 95)))
    pose = camera.world_from_cam.copy()
    pose[1, 3] *= rng.uniform(0.7, 1.5)
    angle = np.radians(rng.uniform(-4, 22))  # downwards
    turn = np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    pose[:3, :3] = pose[:3, :3] @ turn
    return camera.at(pose)


def choose_object(made: World, camera: Camera, rng: np.random.Generator) -> int | None:
    """The group of an object in sight: mostly the object of interest, else any other of a fair size."""
    group = made.raycast(camera).group
    numbers, counts = np.unique(group[group > 0], return_counts=True)
    fair = numbers[(counts > FEWEST_PX * group.size) & (counts < LARGEST_SHARE * group.size)]
    if not len(fair):
        return None
    if made.object_index in fair and rng.random() < 0.65:
        return made.object_index
    return int(rng.choice(fair))


def lit_pair(made: World, camera: Camera, rng: np.random.Generator, kind: float) -> tuple[RGBD, UInt8Array, BoolArray]:
    """The picture with the object, the colours without it, and its mask. kind: 0..1, which light."""
    if kind < NATIVE:
        with_it, without = made.raycast(camera), made.raycast(camera, object=False)
        color, plain = with_it.color, without.color
    elif kind < NATIVE + SOFT:
        unlit = dataclasses.replace(made, light=dataclasses.replace(made.light, shadows=False))
        with_it, without = unlit.raycast(camera), unlit.raycast(camera, object=False)
        color, plain = soften_shadow(made, camera, with_it.color, without.color, rng)
    else:
        shapes = made.shapes.copy()
        shapes[shapes[:, GROUP] == made.object_index, CASTS] = 0
        shows = bool(rng.random() < 0.6)  # the shadows of the others
        bare = dataclasses.replace(made, shapes=shapes, light=dataclasses.replace(made.light, shadows=shows))
        with_it, without = bare.raycast(camera), bare.raycast(camera, object=False)
        color, plain = with_it.color, without.color
    levels = random_tone_curve(rng)
    noisy = levels[color]
    return RGBD(noisy, with_it.depth, camera), levels[plain], with_it.group == made.object_index


def soften_shadow(
    made: World, camera: Camera, color: UInt8Array, plain: UInt8Array, rng: np.random.Generator
) -> tuple[UInt8Array, UInt8Array]:
    """Both pictures darkened where part of a wide light is hidden, by a drawn depth and tint."""
    small = camera.resized(LIGHT_PX, LIGHT_PX)
    base, spread = np.array(made.light.to_light), float(np.exp(rng.uniform(np.log(0.03), np.log(0.7))))
    lobe = [base + spread * rng.standard_normal(3) for _ in range(LIGHTS)]
    dome = []
    for number in range(DOME):  # by the cosine to the vertical
        around, out = 2.4 * number + rng.uniform(0, 0.5), np.sqrt((number + rng.random()) / DOME)
        dome.append(np.array([out * np.cos(around), -np.sqrt(1 - out**2) - 0.02, out * np.sin(around)]))
    share = float(rng.choice([0.0, 1.0, rng.random()], p=[0.4, 0.2, 0.4]))
    weights = [share / LIGHTS] * LIGHTS + [(1 - share) / DOME] * DOME
    fast = dataclasses.replace(made, antialias=False)
    maps = np.zeros((2, LIGHT_PX, LIGHT_PX), np.float32)
    for weight, direction in zip(weights, lobe + dome):
        if weight == 0 or direction[1] >= -0.05:
            continue
        direction = direction / np.linalg.norm(direction)
        at = dataclasses.replace(fast, light=dataclasses.replace(made.light, to_light=tuple(direction)))
        for plane, shown in zip(maps, (True, False)):
            seen = at.raycast(small, object=shown)
            plane += weight * ((seen.light == LIT) | (seen.group < 0))
    maps = maps / max(sum(w for w, d in zip(weights, lobe + dome) if d[1] < -0.05), 1e-6)
    overcast = 1 - share  # there nearly all light comes from the sky
    depth = float(rng.uniform(0.12 + 0.38 * overcast, 0.85 + 0.15 * overcast)) * (1 + rng.uniform(-0.12, 0.12, 3))
    out = []
    for picture, plane in zip((color, plain), maps):
        soft = cv2.GaussianBlur(plane, (0, 0), 0.6 + 2 * (1 - share))
        lost = 1 - cv2.resize(soft, picture.shape[1::-1], interpolation=cv2.INTER_LINEAR)
        linear = (picture / np.float32(255)) ** 2.2 * np.maximum(1 - depth * np.clip(lost, 0, 1)[..., None], 0)
        out.append(np.clip(255 * linear ** (1 / 2.2), 0, 255).astype(np.uint8))
    return out[0], out[1]


def random_tone_curve(rng: np.random.Generator) -> UInt8Array:
    """256 levels: gain, gamma."""
    power, gain = 2.0 ** rng.uniform(-0.4, 0.4), rng.uniform(0.65, 1.25)
    return np.clip(255 * gain * np.linspace(0, 1, 256) ** power, 0, 255).astype(np.uint8)


def simulate_measurement(rgbd: RGBD, mask: BoolArray, rng: np.random.Generator) -> tuple[RGBD, BoolArray]:
    """The frame with a camera's noise and a sensor's depth, in a part of cases; the mask a pixel off."""
    color = add_photo_noise(rgbd.color, rng) if rng.random() < 0.5 else rgbd.color
    rgbd = dataclasses.replace(rgbd, color=color)
    kind = rng.random()
    if kind < 0.12:
        rgbd = structured_light(rgbd, rng)
    elif kind < 0.2:
        rgbd = stereo_matcher(rgbd, rng)
    elif kind < 0.35:
        rgbd = add_depth_faults(rgbd, rng)
    elif kind < 0.45:
        rgbd = bend_depth(rgbd, mask, rng)
    if rng.random() < 0.25:
        mask = np.asarray(dilate_mask(mask, 1) if rng.random() < 0.6 else erode_mask(mask, 1))
    return rgbd, mask


def bend_depth(rgbd: RGBD, mask: BoolArray, rng: np.random.Generator) -> RGBD:
    """Depth as a network estimates it: bent, the object tilted against the ground."""
    height, width = mask.shape
    waves = cv2.resize(rng.standard_normal((4, 4)).astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    w = np.where(rgbd.valid, 1 / np.maximum(rgbd.depth, 1e-3), 1e-3) * (1 + 0.04 * waves)
    smooth = cv2.GaussianBlur(w.astype(np.float32), (0, 0), width / 100)
    w = np.where(mask, 0.6 * w + 0.4 * smooth, smooth)
    return RGBD(rgbd.color, (1 / np.maximum(w, 1e-3)).astype(np.float32), rgbd.camera, {"estimator": "bent"})


def write_shadow_crops(folder: Path, count: int, seed: int, textures: Path | None, *, paved: bool = False) -> int:
    """`count` crops of the seeds from `seed` on as NAME.npz (`planes`, `target`, half precision); how many there are. Half of the
    worlds have photos as textures, where there are any; what is there already stays. paved: `add_paving`."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(seed, seed + count):
        file = folder / f"{number}.npz"
        if file.exists():
            continue
        made = shadow_crop(number, textures if number % 2 else None, paved=paved)
        if made is not None:
            planes, target = made
            with new_file(file) as draft, draft.open("wb") as stream:
                np.savez(stream, planes=planes.values.astype(np.float16), target=target.astype(np.float16))
    return len(list(folder.glob("*.npz")))


class ShadowCrops(Sequence[Crop]):
    """The crops of a folder by `write_shadow_crops`, in the order of their seeds, each read when it is asked for."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.files = list(files)

    @classmethod
    def of(cls, folder: Path) -> ShadowCrops:
        return cls(sorted(folder.glob("*.npz"), key=lambda file: int(file.stem)))

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, number: int) -> Crop:  # type: ignore[override]
        """Planes and target, as `shadow_crop`."""
        with np.load(self.files[number]) as file:
            return ShadowPlanes(file["planes"].astype(np.float32)), file["target"].astype(np.float32)

    def fifths(self) -> tuple[ShadowCrops, ShadowCrops]:
        """Four crops of five, for the network and the classifiers of shapes and pixels, and each fifth, for the verdict on their
        answers."""
        others = [file for number, file in enumerate(self.files) if number % FIFTH]
        return ShadowCrops(others), ShadowCrops(self.files[::FIFTH])
