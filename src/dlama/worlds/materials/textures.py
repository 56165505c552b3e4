"""Textures that repeat: a random generator in, 256 x 256 x 4 uint8 pictures out (sRGB, alpha 0 = cut away).

Ground, walls, wood, cloth, leaves and fences, drawn from a bank of noise that wraps round at its borders.
"""

from __future__ import annotations

import colorsys
from functools import lru_cache

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from dlama.geometry.rgbd import Float32Array, UInt8Array
from dlama.worlds.raycast.shape_rows import SIDE

FINE, ROUGH, CLOUDY, SOFT, GRAIN = range(5)
"""Kinds of noise, from sand to clouds; GRAIN is stretched along the rows."""
BANK_EACH = 3

Rgb = tuple[float, float, float]
Range = tuple[float, float]


@lru_cache(maxsize=1)
def noise_bank() -> Float32Array:
    """Fifteen fields 256 x 256 (three of each kind), mean 0.5, standard deviation 0.2, periodic. Made once a process."""
    rng = np.random.default_rng(20240229)
    y, x = np.meshgrid(np.fft.fftfreq(SIDE), np.fft.rfftfreq(SIDE), indexing="ij")
    fields = []
    for exponent, squeeze in ((0.5, 1), (1.0, 1), (1.6, 1), (2.2, 1), (1.1, 14)):
        radius = np.hypot(y, squeeze * x)
        radius[0, 0] = np.inf
        for _ in range(BANK_EACH):
            phase = np.exp(2j * np.pi * rng.random(radius.shape))
            field = np.fft.irfft2(phase * radius**-exponent, s=(SIDE, SIDE))
            fields.append(0.5 + 0.2 * field / field.std())
    return np.clip(np.array(fields), 0, 1).astype(np.float32)


def noise(rng: Generator, kind: int) -> Float32Array:
    """A field of the bank, rolled and flipped at random: 256 x 256 in 0..1, periodic."""
    field = noise_bank()[BANK_EACH * kind + int(rng.integers(BANK_EACH))]
    field = field[:: int(rng.choice((-1, 1))), :: int(rng.choice((-1, 1)))]
    return np.roll(field, (int(rng.integers(SIDE)), int(rng.integers(SIDE))), (0, 1))


def color(rng: Generator, hue: Range, saturation: Range, value: Range) -> Rgb:
    """A random sRGB colour (0..255) from ranges of hue (0..1, may pass 1), saturation and value."""
    h, s, v = (rng.uniform(*span) for span in (hue, saturation, value))
    red, green, blue = colorsys.hsv_to_rgb(h % 1, s, v)
    return 255 * red, 255 * green, 255 * blue


def rgba(picture: NDArray[np.floating], alpha: NDArray | None = None) -> UInt8Array:
    """An H x W x 3 picture of 0..255 and an alpha of 0..255 (255 without) as uint8 H x W x 4."""
    out = cv2.cvtColor(cv2.convertScaleAbs(picture), cv2.COLOR_RGB2RGBA)
    if alpha is not None:
        out[..., 3] = alpha
    return np.asarray(out, np.uint8)


def shade(base: Rgb, value: Float32Array) -> Float32Array:
    """One colour, brighter and darker by a field round 1."""
    value = np.ascontiguousarray(np.broadcast_to(value, (SIDE, SIDE)), np.float32)
    return np.asarray(cv2.merge([value * np.float32(part) for part in base]))


def mix(one: Float32Array, two: Float32Array, share: Float32Array) -> Float32Array:
    """H x W x 3: the second picture's share (H x W, 0..1) over the first."""
    return np.asarray(cv2.blendLinear(one, two, 1 - share, share))


def rough_surface(rng: Generator, base: Rgb, fine: float = 0.2, broad: float = 0.2, kind: int = FINE) -> UInt8Array:
    """Plaster, concrete, asphalt, sand: one colour under fine and broad noise."""
    value = 1 + fine * (noise(rng, kind) - 0.5) * 2 + broad * (noise(rng, SOFT) - 0.5) * 2
    return rgba(shade(base, value))


def asphalt(rng: Generator) -> UInt8Array:
    """Dark grey with light stones, at times with a patch or a crack."""
    picture = shade(color(rng, (0.05, 0.7), (0, 0.08), (0.3, 0.5)), 0.75 + 0.5 * noise(rng, FINE))
    picture *= (0.8 + 0.4 * noise(rng, CLOUDY))[..., None]
    crack = np.abs(noise(rng, SOFT) - 0.5) < 0.004 * rng.integers(0, 3)
    picture[crack] *= 0.5
    return rgba(picture)


def grass(rng: Generator) -> UInt8Array:
    """Blades of several greens, some dry."""
    green, dry = color(rng, (0.19, 0.29), (0.3, 0.55), (0.3, 0.5)), color(rng, (0.11, 0.16), (0.25, 0.45), (0.45, 0.6))
    share = np.clip(1.6 * noise(rng, ROUGH) - 0.5, 0, 1) * np.float32(rng.uniform(0.2, 0.9))
    blades = 0.45 + 1.1 * noise(rng, FINE)
    return rgba(mix(shade(green, blades), shade(dry, blades), share))


def gravel(rng: Generator) -> UInt8Array:
    """Small stones: bright and dark spots of two colours."""
    one, two = color(rng, (0.04, 0.14), (0.1, 0.4), (0.5, 0.8)), color(rng, (0.0, 0.6), (0.0, 0.15), (0.3, 0.7))
    share = (noise(rng, FINE) > 0.55).astype(np.float32)
    grain = 0.6 + 0.8 * noise(rng, FINE)
    return rgba(mix(shade(one, grain), shade(two, grain), share))


def courses(
    rng: Generator,
    rows: int,
    columns: int,
    joint: float,
    base: Rgb,
    mortar: Rgb,
    *,
    bond: float = 0.5,
    spread: float = 0.15,
    wobble: float = 0.0,
    grain: int = ROUGH,
) -> UInt8Array:
    """Bricks, blocks, slabs, tiles, cobbles, planks: rows x columns pieces of varied colour between joints.

    `joint`: share of a row's height; `bond`: shift of every other row in pieces; `spread`: how much pieces differ;
    `wobble`: how uneven the joints are.
    """
    u = v = (np.arange(SIDE, dtype=np.float32) + np.float32(0.5)) / SIDE
    v = v[:, None]
    if wobble:
        u, v = u + wobble * (noise(rng, CLOUDY) - 0.5), v + wobble * (noise(rng, CLOUDY) - 0.5)
    v = v * rows
    row = np.floor(v).astype(np.int32)
    u = u * columns + bond * (row % 2).astype(np.float32)
    column = np.floor(u).astype(np.int32)
    edge = (np.abs(u - column - 0.5) - 0.5) * (rows / columns)
    edge = np.maximum(edge, np.abs(v - row - 0.5) - 0.5)
    pieces = rng.normal(1, spread, (rows, columns, 1)) + rng.normal(0, 0.3 * spread, (rows, columns, 3))
    pieces = pieces.astype(np.float32)
    index = row % rows * columns + column % columns
    share = np.clip((edge + joint) / 0.06 + 0.5, 0, 1).astype(np.float32)
    value = 0.72 + 0.56 * noise(rng, grain)
    picture = cv2.merge([(base[n] * pieces[..., n].ravel())[index] * value for n in range(3)])
    return rgba(mix(np.asarray(picture, np.float32), shade(mortar, 0.8 + 0.4 * noise(rng, FINE)), share))


def bricks(rng: Generator) -> UInt8Array:
    """A brick wall: red, brown, yellow or painted; two metres a side."""
    hue, saturation, value = [
        ((0.98, 1.04), (0.45, 0.7), (0.45, 0.65)),
        ((0.05, 0.09), (0.3, 0.5), (0.35, 0.6)),
        ((0.09, 0.13), (0.25, 0.45), (0.65, 0.8)),
        ((0.0, 1.0), (0.03, 0.15), (0.6, 0.85)),
    ][int(rng.choice(4, p=(0.5, 0.2, 0.15, 0.15)))]
    mortar = color(rng, (0.05, 0.15), (0, 0.15), (0.35, 0.8))
    return courses(rng, 24, 8, 0.1, color(rng, hue, saturation, value), mortar, spread=rng.uniform(0.08, 0.22))


def stones(rng: Generator) -> UInt8Array:
    """Hewn blocks of grey, sand or brown stone."""
    base = color(rng, (0.05, 0.13), (0.05, 0.35), (0.5, 0.78))
    rows = int(rng.choice((6, 8, 10)))
    shift = rng.uniform(0.3, 0.5)
    return courses(rng, rows, rows // 2, 0.05, base, tuple(0.6 * c for c in base), bond=shift, spread=0.12, wobble=0.03)  # type: ignore[arg-type]


def paving(rng: Generator) -> UInt8Array:
    """Slabs, setts or cobbles."""
    base = color(rng, (0.02, 0.15), (0.0, 0.22), (0.45, 0.75))
    dark: Rgb = (0.45 * base[0], 0.45 * base[1], 0.45 * base[2])
    kinds = (4, 4, 0.02, 0.0), (4, 2, 0.02, 0.0), (10, 5, 0.06, 0.01), (14, 14, 0.1, 0.06)
    rows, columns, joint, wobble = kinds[rng.integers(4)]
    bond = float(rng.choice((0.0, 0.5)))
    return courses(rng, rows, columns, joint, base, dark, bond=bond, spread=0.07 + 0.5 * wobble, wobble=wobble)


def tiles(rng: Generator) -> UInt8Array:
    """Floor or bathroom tiles, plain or checkered."""
    count = int(rng.choice((4, 6, 8)))
    base = color(rng, (0.0, 1.0), (0.0, 0.3), (0.6, 0.9))
    plain = courses(rng, count, count, 0.04, base, (150, 148, 145), bond=0, spread=0.03, grain=SOFT)
    if rng.random() < 0.5:
        other = color(rng, (0.0, 1.0), (0.05, 0.5), (0.2, 0.6))
        index = np.arange(SIDE) * count // SIDE
        odd = (index[:, None] + index) % 2 == 1
        plain[odd, :3] = plain[odd, :3] * (other / np.array(base, np.float32)).clip(0, 1)
    return plain


def planks(rng: Generator) -> UInt8Array:
    """Floor boards or cladding, running along the rows."""
    base = color(rng, (0.05, 0.1), (0.25, 0.65), (0.35, 0.75))
    rows = int(rng.choice((6, 8, 12)))
    return courses(rng, rows, 1, 0.03, base, (50, 38, 30), bond=0.4, spread=0.12, grain=GRAIN)


def wood(rng: Generator) -> UInt8Array:
    """Furniture: grain without joints."""
    base = color(rng, (0.04, 0.11), (0.2, 0.65), (0.25, 0.8))
    return rgba(shade(base, 0.65 + 0.5 * noise(rng, GRAIN) + 0.2 * noise(rng, SOFT)))


def metal(rng: Generator) -> UInt8Array:
    """Painted or bare sheet: corrugated at times, with rust at times."""
    base = color(rng, (0.0, 1.0), (0.1, 0.75), (0.3, 0.75))
    value = 0.9 + 0.2 * noise(rng, SOFT)
    if rng.random() < 0.5:
        waves = np.sin(2 * np.pi * int(rng.choice((8, 12, 16))) * np.arange(SIDE) / SIDE)
        value = value * (1 + 0.22 * waves).astype(np.float32)
    rust = np.clip(5 * (noise(rng, CLOUDY) - np.float32(rng.uniform(0.6, 1.0))), 0, 1)
    return rgba(mix(shade(base, value), shade((120, 72, 42), 0.6 + 0.8 * noise(rng, FINE)), rust))


def cloth(rng: Generator) -> UInt8Array:
    """Fabric, carpet or wallpaper: plain, striped, checked or with a motif, over a weave."""
    one, two = color(rng, (0, 1), (0.1, 0.7), (0.3, 0.85)), color(rng, (0, 1), (0.05, 0.5), (0.4, 0.95))
    wave = np.sin(2 * np.pi * int(rng.choice((2, 4, 6, 8))) * np.arange(SIDE) / SIDE)
    pattern = [
        np.zeros((SIDE, SIDE)),
        np.broadcast_to(wave, (SIDE, SIDE)) > rng.uniform(-0.5, 0.9),
        (wave > 0)[:, None] * 0.5 + (wave > 0) * 0.5,
        wave[:, None] * wave + 0.4 * wave[:, None] > rng.uniform(0.3, 0.8),
    ][int(rng.integers(4))]
    share = np.ascontiguousarray(pattern, np.float32)
    weave = 0.8 + 0.2 * noise(rng, FINE) + 0.2 * noise(rng, SOFT)
    return rgba(mix(shade(one, weave), shade(two, weave), share))


def leaves(rng: Generator, *, gaps: bool) -> UInt8Array:
    """Foliage: leaves over each other, the lower ones darker; with gaps one sees through (alpha 0)."""
    hue, autumn = rng.uniform(0.2, 0.36), rng.random() < 0.15
    count = 420 if gaps else 700
    at, angle = rng.integers(0, SIDE, (count, 2)), rng.uniform(0, 360, count)
    length = rng.uniform(5, 13, count)
    canvas = np.zeros((SIDE, SIDE, 4), np.uint8)
    canvas[..., :3] = color(rng, (hue, hue), (0.4, 0.6), (0.12, 0.2))
    canvas[..., 3] = 0 if gaps else 255
    for k in range(count):
        shade = 0.25 + 0.75 * k / count
        h = hue + rng.normal(0, 0.02) - (0.15 if autumn else 0)
        red, green, blue = colorsys.hsv_to_rgb(h % 1, 0.55, 0.65 * shade)
        ink = (255 * red, 255 * green, 255 * blue, 255)
        axes = (int(length[k]), max(2, int(0.45 * length[k])))
        cv2.ellipse(canvas, (int(at[k, 0]), int(at[k, 1])), axes, float(angle[k]), 0, 360, ink, -1)
    return canvas


def fence(rng: Generator) -> UInt8Array:
    """Bars, pickets or wire mesh: all but them is cut away."""
    v, u = np.meshgrid(*(2 * [np.arange(SIDE) / SIDE]), indexing="ij")
    kind = int(rng.integers(3))
    if kind == 0:
        solid = ((u * 10) % 1 < 0.2) | (np.abs(v - 0.1) < 0.03) | (np.abs(v - 0.9) < 0.03)
    elif kind == 1:
        solid = ((u * 8) % 1 < 0.68) | (np.abs(v - 0.22) < 0.05) | (np.abs(v - 0.78) < 0.05)
    else:
        solid = (((u + v) * 12) % 1 < 0.16) | (((u - v) * 12) % 1 < 0.16) | (v < 0.04) | (v > 0.96)
    base = [(50, 55, 58), color(rng, (0.04, 0.12), (0.1, 0.5), (0.4, 0.9)), (150, 155, 155)][kind]
    return rgba(shade(base, 0.75 + 0.5 * noise(rng, ROUGH)), np.where(solid, 255, 0))
