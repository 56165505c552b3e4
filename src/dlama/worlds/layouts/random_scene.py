"""Random worlds: a seed, a kind and photos in; shapes, textures, light and sky out. The same seed, the same bytes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from dlama.worlds.layouts.floor_plan import FloorPlan
from dlama.worlds.layouts.rooms import room
from dlama.worlds.layouts.streets import street
from dlama.worlds.materials.palette import Palette, Photo
from dlama.worlds.materials.textures import CLOUDY, SOFT, noise, rgba, shade
from dlama.worlds.scene_builder import SceneBuilder
from dlama.worlds.world import Kind, Light, Rgb, Sky, World

WHITE = (255.0, 255.0, 255.0)


def build(seed: int, kind: Kind | None, photos: Sequence[Photo]) -> World:
    """The world of a seed; `photos` take the place of some textures. A street in 60 % without a kind."""
    rng = np.random.default_rng(seed)
    is_street = rng.random() < 0.6
    is_street = kind == "street" if kind is not None else is_street
    builder = SceneBuilder()
    builder.layer(rgba(shade(WHITE, noise(rng, CLOUDY))))
    builder.layer(rgba(shade(WHITE, noise(rng, SOFT))))
    plan = FloorPlan(builder, Palette(builder, rng, photos), rng)
    (street if is_street else room)(plan)
    light, sky = (daylight(rng) if is_street else lamplight(rng)), random_sky(rng)
    return World(builder.shapes(), builder.texels(), light, sky, rng.uniform(1.2, 1.6))


def direction_to_light(azimuth_deg: float, elevation_deg: float) -> Rgb:
    """Unit vector to a light: azimuth 0 is behind the first camera, 90 at its right."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return math.sin(a) * math.cos(e), -math.sin(e), -math.cos(a) * math.cos(e)


def daylight(rng: Generator) -> Light:
    """From high noon to a low warm sun to an overcast day; mostly from behind the camera."""
    azimuth = rng.normal(0, 60) if rng.random() < 0.75 else rng.uniform(0, 360)
    elevation, bright = rng.uniform(22, 65), rng.uniform(0.85, 1.2)
    warm = max(0.0, (40 - elevation) / 40)
    share = rng.uniform(0.55, 0.8) if rng.random() < 0.75 else rng.uniform(0.1, 0.3)
    sun = 1.65 * bright * share
    rest = bright * (1.15 - share)
    blue = rng.uniform(0, 0.15)
    return Light(
        direction_to_light(azimuth, elevation),
        (sun, sun * (0.96 - 0.2 * warm), sun * (0.9 - 0.4 * warm)),
        (rest * (1 - blue), rest, rest * (1 + blue)),
        (0.55 * rest, 0.53 * rest, 0.5 * rest),
    )


def lamplight(rng: Generator) -> Light:
    """A steep, soft light in a room; the walls do not stop it."""
    bright, warm = rng.uniform(0.8, 1.1), rng.uniform(-0.05, 0.12)
    sun, rest = bright * rng.uniform(0.3, 0.55), bright * rng.uniform(0.62, 0.85)
    return Light(
        direction_to_light(rng.uniform(0, 360), rng.uniform(48, 78)),
        (sun * (1 + warm), sun, sun * (1 - warm)),
        (rest * (1 + warm), rest, rest * (1 - warm)),
        (0.85 * rest * (1 + warm), 0.85 * rest, 0.85 * rest * (1 - warm)),
    )


def random_sky(rng: Generator) -> Sky:
    """Clear, cloudy or overcast; haze that takes far houses into the horizon's colour."""
    grey, warm = rng.random(), rng.uniform(-0.02, 0.1)
    zenith = np.array((0.1, 0.24, 0.55)) * rng.uniform(0.7, 1.3)
    zenith = zenith + 0.6 * (grey > 0.75) * (np.array((0.5, 0.53, 0.57)) - zenith)
    horizon = np.array((0.62 + warm, 0.7, 0.8 - warm)) * rng.uniform(0.85, 1.1)
    cloud = rng.uniform(0.7, 0.95)
    return Sky(
        tuple(map(float, horizon)),  # type: ignore[arg-type]
        tuple(map(float, zenith)),  # type: ignore[arg-type]
        (cloud, cloud, cloud * rng.uniform(0.94, 1.02)),
        cover=rng.uniform(0.25, 0.85),
        softness=rng.uniform(0.12, 0.35),
        scale=rng.uniform(0.06, 0.2),
        offset=(rng.random(), rng.random()),
        haze=rng.uniform(0.0005, 0.006),
    )
