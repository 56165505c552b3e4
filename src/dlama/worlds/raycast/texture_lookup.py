"""Texture lookups and the sky (numba): texels and a footprint or a direction in, linear colour out.

Light is squared texel value (gamma 2), which makes decoding one multiplication.
"""

from __future__ import annotations

import math

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, inlined
from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.raycast.shape_rows import CLOUD, COVER, HORIZON, LEVELS, MIRROR, SIDE, WRAP, ZENITH


@inlined
def texel(texels: UInt8Array, layer: Whole, level: Whole, u: Real, v: Real) -> tuple[Real, Real, Real]:
    """Bilinear colour 0..1 of one level, repeated."""
    size = SIDE >> level
    base = (4 * SIDE * SIDE - 4 * size * size) // 3
    x, y = u * size - 0.5, v * size - 0.5
    fx, fy = math.floor(x), math.floor(y)
    wx, wy = np.float32(x - fx), np.float32(y - fy)
    x0, y0 = fx & (size - 1), fy & (size - 1)
    x1, y1 = (x0 + 1) & (size - 1), (y0 + 1) & (size - 1)
    one, k = np.float32(1), np.float32(1 / 255)
    w00, w01, w10, w11 = (one - wx) * (one - wy), wx * (one - wy), (one - wx) * wy, wx * wy
    a, b, c, d = base + y0 * size + x0, base + y0 * size + x1, base + y1 * size + x0, base + y1 * size + x1
    w00, w01, w10, w11 = k * w00, k * w01, k * w10, k * w11
    return (
        w00 * texels[layer, a, 0] + w01 * texels[layer, b, 0] + w10 * texels[layer, c, 0] + w11 * texels[layer, d, 0],
        w00 * texels[layer, a, 1] + w01 * texels[layer, b, 1] + w10 * texels[layer, c, 1] + w11 * texels[layer, d, 1],
        w00 * texels[layer, a, 2] + w01 * texels[layer, b, 2] + w10 * texels[layer, c, 2] + w11 * texels[layer, d, 2],
    )


@inlined
def filter_texture(
    texels: UInt8Array,
    layer: Whole,
    mode: Whole,
    at: tuple[Real, Real],
    one: tuple[Real, Real],
    other: tuple[Real, Real],
) -> tuple[Real, Real, Real]:
    """Texture at u, v over the pixel's footprint, whose sides are `one` and `other` (repeats): up to four trilinear probes."""
    (u, v), (ax, ay), (bx, by) = at, one, other
    la, lb = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
    if la < lb:
        la, lb, ax, ay = lb, la, bx, by
    probes = np.int64(min(4.0, math.ceil(la / max(lb, 1e-12) - 0.2)))
    probes = max(probes, np.int64(1))
    lod = max(0.0, min(LEVELS - 1.001, math.log2(max(la / probes * SIDE, 1e-6))))
    level = np.int64(lod)
    share = np.float32(lod - level)
    red, green, blue = np.float32(0), np.float32(0), np.float32(0)
    for k in range(probes):
        share_along = (k + 0.5) / probes - 0.5
        uu, vv = u + share_along * ax, v + share_along * ay
        if mode == MIRROR:
            uu, vv = abs(uu - 2 * math.floor(0.5 * uu) - 1), abs(vv - 2 * math.floor(0.5 * vv) - 1)
        r, g, b = texel(texels, layer, level, uu, vv)
        if share > 0:
            r2, g2, b2 = texel(texels, layer, level + 1, uu, vv)
            r, g, b = r + share * (r2 - r), g + share * (g2 - g), b + share * (b2 - b)
        red, green, blue = red + r, green + g, blue + b
    return red / probes, green / probes, blue / probes


@inlined
def sky(texels: UInt8Array, light: Float64Array, d: tuple[Real, Real, Real], pixel: Real) -> tuple[Real, Real, Real]:
    """Linear colour of the sky in a direction: horizon to zenith, with a layer of clouds that thins at the horizon."""
    dx, dy, dz = d
    n = math.sqrt(dx * dx + dy * dy + dz * dz)
    up = max(-dy / n, 0.0)
    share = 1 - (1 - up) ** 3
    cloud = 0.0
    if up > 0.01:
        far = light[COVER + 2] / (up + 0.12)
        u, v = dx / n * far + light[COVER + 3], dz / n * far + light[COVER + 4]
        spread = pixel * far
        value, _, _ = filter_texture(texels, 1, WRAP, (u, v), (spread, 0.0), (0.0, spread / (up + 0.12)))
        cloud = max(0.0, min(1.0, (value - light[COVER]) / light[COVER + 1]))
        cloud = cloud * cloud * (3 - 2 * cloud) * min(1.0, 5 * up)
    r = light[HORIZON] + share * (light[ZENITH] - light[HORIZON])
    g = light[HORIZON + 1] + share * (light[ZENITH + 1] - light[HORIZON + 1])
    b = light[HORIZON + 2] + share * (light[ZENITH + 2] - light[HORIZON + 2])
    return (
        r + cloud * (light[CLOUD] - r),
        g + cloud * (light[CLOUD + 1] - g),
        b + cloud * (light[CLOUD + 2] - b),
    )
