"""World: shapes, textures, light and sky in; frames, masks, shadows and depth behind objects out, exact at every pixel."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from dlama.errors import InputError
from dlama.geometry.camera import Camera, Float64Array, StereoRig
from dlama.geometry.motion.trajectories import move_sideways, orbit
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array, make_read_only
from dlama.worlds.raycast.bounding_boxes import Int32Array, boxes_by_depth, shadow_cells
from dlama.worlds.raycast.shape_rows import BLOCKED, COLUMNS, GROUP, LIT, OBJECT_GROUP, TEXELS
from dlama.worlds.raycast.tiles import cast_rays

Kind = Literal["street", "room"]
BASELINE_M = 0.12
SIZE = 512
FOV_DEG = 90.0
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Light:
    """A sun and a sky that shines from all around; linear factors of r, g, b."""

    to_light: Rgb = (0.0, -1.0, 0.0)
    """Unit vector towards the sun, world axes (y down)."""
    sun: Rgb = (0.7, 0.68, 0.62)
    ambient_sky: Rgb = (0.5, 0.52, 0.56)
    """On surfaces that look up."""
    ambient_ground: Rgb = (0.25, 0.24, 0.22)
    """On surfaces that look down."""
    shadows: bool = True


@dataclass(frozen=True)
class Sky:
    """What lies at infinity: a gradient and clouds; linear r, g, b."""

    horizon: Rgb = (0.62, 0.7, 0.8)
    zenith: Rgb = (0.15, 0.3, 0.6)
    cloud: Rgb = (0.9, 0.9, 0.9)
    cover: float = 0.55
    """Noise above it is cloud: 0.3 overcast, 0.9 clear."""
    softness: float = 0.25
    scale: float = 0.12
    offset: tuple[float, float] = (0.0, 0.0)
    haze: float = 0.0
    """Share of the horizon's colour per metre of air."""


class Raycast(NamedTuple):
    """All that a camera sees; depth, group and light at pixel centres."""

    color: UInt8Array
    """H x W x 3, sRGB."""
    depth: Float32Array
    """H x W m, +inf = sky."""
    group: Int32Array
    """H x W int32, the object seen; -1 = sky."""
    light: UInt8Array
    """H x W: UNLIT, LIT or BLOCKED."""

    def frame(self, camera: Camera) -> RGBD:
        """The colour and depth of the camera that sees it."""
        return RGBD(self.color, self.depth, camera)


@dataclass(frozen=True, eq=False)
class World:
    """A closed world of textured shapes. All truth is in closed form, at the exact pixel centre; nothing is stored."""

    shapes: Float64Array
    """N rows, columns as `raycast.shape_rows` names them."""
    textures: UInt8Array
    """Layers x texels x 4: sRGB and alpha, all levels."""
    light: Light
    sky: Sky
    eye_m: float = 1.4
    """Height of the first camera above the ground (y = 0)."""
    antialias: bool = True
    """Colour edges are averaged over the pixel; depth never is."""
    object_index: int = OBJECT_GROUP
    """The group of the object of interest."""
    _lighting: tuple[Float64Array, Int32Array, Int32Array] = field(init=False, repr=False)
    """Numbers of light and sky, and which shapes may stand before the light, as `raycast` takes them."""

    def __post_init__(self) -> None:
        if self.shapes.ndim != 2 or self.shapes.shape[1] != COLUMNS:
            raise InputError(f"world.shapes is {self.shapes.shape}; N x {COLUMNS} is expected")
        if self.textures.ndim != 3 or self.textures.shape[1:] != (TEXELS, 4) or len(self.textures) < 2:
            raise InputError(f"world.textures is {self.textures.shape}; at least 2 layers x {TEXELS} x 4 are expected")
        grid, starts, items = shadow_cells(self.shapes, np.array(self.light.to_light))
        sky, light = self.sky, self.light
        numbers = [*light.to_light, *light.sun, *light.ambient_sky, *light.ambient_ground, *sky.horizon, *sky.zenith]
        numbers += [*sky.cloud, sky.cover, sky.softness, sky.scale, *sky.offset, sky.haze, light.shadows, *grid]
        object.__setattr__(self, "_lighting", (np.array(numbers, np.float64), starts, items))
        for name in ("shapes", "textures"):
            object.__setattr__(self, name, make_read_only(getattr(self, name)))

    def camera(self, yaw: float = 0.0, size: int = SIZE, fov: float = FOV_DEG) -> Camera:
        """The first camera (yaw 0) or one of its orbit about the point 2.5 m ahead; yaw and fov in degrees, size in pixels."""
        pose = np.eye(4)
        pose[1, 3] = -self.eye_m
        return orbit(Camera.from_fov(size, size, fov, pose), yaw)

    def rig(self, size: int = SIZE) -> StereoRig:
        """The first camera as the left one, and a right one BASELINE_M from it."""
        left = self.camera(0.0, size)
        return StereoRig(left, move_sideways(left, BASELINE_M))

    def frame(self, camera: Camera, *, object: bool = True) -> RGBD:
        """The frame this camera takes; without the object its shadow goes, too. Sky has depth +inf; nothing is missing."""
        return self.raycast(camera, object=object).frame(camera)

    def shadow_of(self, with_object: Raycast, without: Raycast) -> BoolArray:
        """H x W, True where the object, and nothing else, keeps the light from the surface seen (never on the object); from what
        one camera sees with and without it."""
        lit_without = (with_object.light == BLOCKED) & (without.light == LIT)
        return lit_without & (with_object.group != self.object_index)

    def raycast(self, camera: Camera, *, object: bool = True, through: Int32Array | None = None) -> Raycast:
        """All that a camera sees. `through`: H x W, the group that each pixel sees through (-1: none)."""
        gone = -1 if object else self.object_index
        skip = np.full(camera.hw, gone, np.int32) if through is None else np.ascontiguousarray(through, np.int32)
        pose = camera.world_from_cam
        numbers = np.array([*pose[:3, 3], *pose[:3, :3].ravel(), camera.fx, camera.fy, camera.cx, camera.cy])
        scene, boxes = (self.shapes, self.textures, *self._lighting), boxes_by_depth(self.shapes, camera)
        color, depth, keys, lights = cast_rays(scene, boxes, numbers, skip, gone, self.antialias)
        groups = np.append(self.shapes[:, GROUP], -1).astype(np.int32)
        return Raycast(color, depth, groups[keys >> 4], lights)


def yaw_order(yaws: tuple[float, ...]) -> tuple[float, ...]:
    """0, +10, -10, +20, -20 ...: the order of an orbit's frames."""
    return (0.0, *itertools.chain.from_iterable((float(yaw), -float(yaw)) for yaw in yaws))
