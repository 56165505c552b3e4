"""One ray in; linear colour, planar depth, what was hit and whether it is lit out (numba).

The parts are inlined: as calls, with all their arrays as arguments, they would take twice as long.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, inlined
from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.raycast.intersection import in_shadow, nearest, texture_place
from dlama.worlds.raycast.shape_rows import (
    AMBIENT_GROUND,
    AMBIENT_SKY,
    BALL,
    BLOCKED,
    CENTRE,
    CONTACT,
    HALF,
    HAZE,
    HORIZON,
    KIND,
    LAYER,
    LIFT,
    LIT,
    MODE,
    SHADOWS,
    STAIN,
    SUN,
    TINT,
    TO_LIGHT,
    TURN,
    UNLIT,
    WRAP,
)
from dlama.worlds.raycast.texture_lookup import filter_texture, sky

STAINS_PER_M = 0.19
"""Repeats per metre of the grey noise that keeps a repeated texture from looking repeated."""


@inlined
def tangents(
    shapes: Float64Array, i: Whole, face: Whole, x: Real, y: Real, z: Real
) -> tuple[Real, Real, Real, Real, Real, Real, Real, Real, Real]:
    """Local unit vectors at a point of a face: outward normal, and the directions in which u and v grow."""
    if face < 6:
        axis, sign = face // 2, 1.0 if face % 2 else -1.0
        if axis == 0:
            return sign, 0.0, 0.0, 0.0, 0.0, sign, 0.0, 1.0, 0.0
        if axis == 1:
            return 0.0, sign, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0
        return 0.0, 0.0, sign, -sign, 0.0, 0.0, 0.0, 1.0, 0.0
    if face == 7 or face == 8:
        return 0.0, -1.0 if face == 7 else 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0
    flat = math.sqrt(x * x + z * z) + 1e-12
    if shapes[i, KIND] == BALL:
        nx, ny, nz = x / shapes[i, HALF] ** 2, y / shapes[i, HALF + 1] ** 2, z / shapes[i, HALF + 2] ** 2
    else:
        nx, ny, nz = x / flat, -(shapes[i, HALF] - shapes[i, HALF + 2]) / (2 * shapes[i, HALF + 1]), z / flat
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / n, ny / n, nz / n
    down = math.sqrt(max(1 - ny * ny, 1e-12))
    return nx, ny, nz, -z / flat, 0.0, x / flat, -ny * nx / down, (1 - ny * ny) / down, -ny * nz / down


@inlined
def to_local(shapes: Float64Array, i: Whole, x: Real, y: Real, z: Real) -> tuple[Real, Real, Real]:
    """A world direction in a shape's frame."""
    return (
        shapes[i, TURN] * x + shapes[i, TURN + 1] * y + shapes[i, TURN + 2] * z,
        shapes[i, TURN + 3] * x + shapes[i, TURN + 4] * y + shapes[i, TURN + 5] * z,
        shapes[i, TURN + 6] * x + shapes[i, TURN + 7] * y + shapes[i, TURN + 8] * z,
    )


@inlined
def to_world(shapes: Float64Array, i: Whole, x: Real, y: Real, z: Real) -> tuple[Real, Real, Real]:
    """A direction of a shape's frame in the world."""
    return (
        shapes[i, TURN] * x + shapes[i, TURN + 3] * y + shapes[i, TURN + 6] * z,
        shapes[i, TURN + 1] * x + shapes[i, TURN + 4] * y + shapes[i, TURN + 7] * z,
        shapes[i, TURN + 2] * x + shapes[i, TURN + 5] * y + shapes[i, TURN + 8] * z,
    )


@inlined
def step(
    t: Real, dx: Real, dy: Real, dz: Real, ex: Real, ey: Real, ez: Real, nx: Real, ny: Real, nz: Real
) -> tuple[Real, Real, Real]:
    """From the hit t d to where the neighbouring ray (d + e) meets the tangent plane; tamed at grazing rays."""
    facing, other = dx * nx + dy * ny + dz * nz, (dx + ex) * nx + (dy + ey) * ny + (dz + ez) * nz
    ratio = facing / other if other != 0 else 8.0
    if not 0 < ratio < 8:
        ratio = 8.0
    t2 = t * ratio
    return t2 * (dx + ex) - t * dx, t2 * (dy + ey) - t * dy, t2 * (dz + ez) - t * dz


@inlined
def surface(
    shapes: Float64Array,
    i: Whole,
    texels: UInt8Array,
    face: Whole,
    t: Real,
    px: Real,
    py: Real,
    pz: Real,
    dx: Real,
    dy: Real,
    dz: Real,
    camera: Float64Array,
    width: Real,
) -> tuple[Real, Real, Real, Real, Real, Real]:
    """Linear colour of the surface at a hit over a footprint `width` pixels wide, and its normal towards the viewer."""
    x, y, z = to_local(shapes, i, px - shapes[i, CENTRE], py - shapes[i, CENTRE + 1], pz - shapes[i, CENTRE + 2])
    nx, ny, nz, ux, uy, uz, vx, vy, vz = tangents(shapes, i, face, x, y, z)
    nx, ny, nz = to_world(shapes, i, nx, ny, nz)
    if nx * dx + ny * dy + nz * dz > 0:
        nx, ny, nz = -nx, -ny, -nz
    e, f = width / camera[12], width / camera[13]
    ax, ay, az = step(t, dx, dy, dz, e * camera[3], e * camera[6], e * camera[9], nx, ny, nz)
    bx, by, bz = step(t, dx, dy, dz, f * camera[4], f * camera[7], f * camera[10], nx, ny, nz)
    ax, ay, az = to_local(shapes, i, ax, ay, az)
    bx, by, bz = to_local(shapes, i, bx, by, bz)
    u, v, su, sv = texture_place(shapes, i, face, x, y, z)
    ua, va = su * (ax * ux + ay * uy + az * uz), sv * (ax * vx + ay * vy + az * vz)
    ub, vb = su * (bx * ux + by * uy + bz * uz), sv * (bx * vx + by * vy + bz * vz)
    r, g, b = filter_texture(texels, np.int64(shapes[i, LAYER]), np.int64(shapes[i, MODE]), u, v, ua, va, ub, vb)
    stain = 1.0
    if shapes[i, STAIN] > 0:
        k, m = STAINS_PER_M / su, STAINS_PER_M / sv
        grey, _, _ = filter_texture(texels, 0, WRAP, u * k, v * m, ua * k, va * m, ub * k, vb * m)
        stain = 1 + shapes[i, STAIN] * (2 * grey - 1)
    return (
        r * r * shapes[i, TINT] * stain,
        g * g * shapes[i, TINT + 1] * stain,
        b * b * shapes[i, TINT + 2] * stain,
        nx,
        ny,
        nz,
    )


@inlined
def ray(
    shapes: Float64Array,
    texels: UInt8Array,
    listed: NDArray[np.int32],
    count: Whole,
    near_z: Float64Array,
    skip: Whole,
    gone: Whole,
    camera: Float64Array,
    light: Float64Array,
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    column: Real,
    row: Real,
    width: Real,
) -> tuple[Real, Real, Real, Real, Whole, Whole]:
    """One ray through picture point (column, row): linear r, g, b, planar depth (inf: sky), key of the hit, light state.

    The key is 16 shape + face, -1 for the sky: neighbours with other keys show another surface.
    """
    x, y = (column - camera[14]) / camera[12], (row - camera[15]) / camera[13]
    dx = camera[3] * x + camera[4] * y + camera[5]
    dy = camera[6] * x + camera[7] * y + camera[8]
    dz = camera[9] * x + camera[10] * y + camera[11]
    t, which, face = nearest(shapes, texels, listed, count, near_z, skip, camera[0], camera[1], camera[2], dx, dy, dz)
    if which < 0:
        r, g, b = sky(texels, light, dx, dy, dz, width / camera[12])
        return r, g, b, np.inf, -1, UNLIT
    px, py, pz = camera[0] + t * dx, camera[1] + t * dy, camera[2] + t * dz
    r, g, b, nx, ny, nz = surface(shapes, which, texels, face, t, px, py, pz, dx, dy, dz, camera, width)
    facing = nx * light[TO_LIGHT] + ny * light[TO_LIGHT + 1] + nz * light[TO_LIGHT + 2]
    state = LIT if facing > 0 else UNLIT
    if state == LIT and light[SHADOWS] > 0:
        qx, qy, qz = px + LIFT * nx, py + LIFT * ny, pz + LIFT * nz
        if in_shadow(shapes, texels, light, starts, items, gone, qx, qy, qz):
            state = BLOCKED
    sun = facing if state == LIT else 0.0
    up = 0.5 - 0.5 * ny
    near_floor = 1.0
    if shapes[which, CONTACT] > 0:
        near_floor = 1 - shapes[which, CONTACT] * math.exp(min(0.0, 4 * py))
    haze = 1 - math.exp(-light[HAZE] * t)
    a, h = AMBIENT_SKY, AMBIENT_GROUND
    r *= sun * light[SUN] + near_floor * (up * light[a] + (1 - up) * light[h])
    g *= sun * light[SUN + 1] + near_floor * (up * light[a + 1] + (1 - up) * light[h + 1])
    b *= sun * light[SUN + 2] + near_floor * (up * light[a + 2] + (1 - up) * light[h + 2])
    r += haze * (light[HORIZON] - r)
    g += haze * (light[HORIZON + 1] - g)
    b += haze * (light[HORIZON + 2] - b)
    return r, g, b, t, 16 * which + face, state
