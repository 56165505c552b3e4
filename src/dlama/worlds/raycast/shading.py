"""One ray in; linear colour, planar depth, what was hit and whether it is lit out (numba).

The parts are inlined: as calls, with all their arrays as arguments, they would take twice as long.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Real, Whole, inlined
from dlama.worlds.raycast import shape_rows as k
from dlama.worlds.raycast.intersection import (
    Scene,
    Vector,
    along,
    dot,
    from_centre,
    in_shadow,
    nearest,
    texture_place,
    to_local,
)
from dlama.worlds.raycast.texture_lookup import filter_texture, sky

STAINS_PER_M = 0.19
"""Repeats per metre of the grey noise that keeps a repeated texture from looking repeated."""


@inlined
def tangents(shapes: Float64Array, i: Whole, face: Whole, at: Vector) -> tuple[Vector, Vector, Vector]:
    """Local unit vectors at a point of a face: outward normal, and the directions in which u and v grow."""
    x, y, z = at
    if face < 6:
        axis, sign = face // 2, 1.0 if face % 2 else -1.0
        if axis == 0:
            return (sign, 0.0, 0.0), (0.0, 0.0, sign), (0.0, 1.0, 0.0)
        if axis == 1:
            return (0.0, sign, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
        return (0.0, 0.0, sign), (-sign, 0.0, 0.0), (0.0, 1.0, 0.0)
    if face == 7 or face == 8:
        return (0.0, -1.0 if face == 7 else 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    flat = math.sqrt(x * x + z * z) + 1e-12
    if shapes[i, k.KIND] == k.BALL:
        nx, ny, nz = x / shapes[i, k.HALF] ** 2, y / shapes[i, k.HALF + 1] ** 2, z / shapes[i, k.HALF + 2] ** 2
    else:
        nx, ny, nz = x / flat, -(shapes[i, k.HALF] - shapes[i, k.HALF + 2]) / (2 * shapes[i, k.HALF + 1]), z / flat
    n = math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / n, ny / n, nz / n
    down = math.sqrt(max(1 - ny * ny, 1e-12))
    return (nx, ny, nz), (-z / flat, 0.0, x / flat), (-ny * nx / down, (1 - ny * ny) / down, -ny * nz / down)


@inlined
def to_world(shapes: Float64Array, i: Whole, v: Vector) -> Vector:
    """A direction of a shape's frame in the world."""
    return (
        shapes[i, k.TURN] * v[0] + shapes[i, k.TURN + 3] * v[1] + shapes[i, k.TURN + 6] * v[2],
        shapes[i, k.TURN + 1] * v[0] + shapes[i, k.TURN + 4] * v[1] + shapes[i, k.TURN + 7] * v[2],
        shapes[i, k.TURN + 2] * v[0] + shapes[i, k.TURN + 5] * v[1] + shapes[i, k.TURN + 8] * v[2],
    )


@inlined
def step(t: Real, d: Vector, e: Vector, normal: Vector) -> Vector:
    """From the hit t d to where the neighbouring ray (d + e) meets the tangent plane; tamed at grazing rays."""
    other_ray = d[0] + e[0], d[1] + e[1], d[2] + e[2]
    facing, other = dot(d, normal), dot(other_ray, normal)
    ratio = facing / other if other != 0 else 8.0
    if not 0 < ratio < 8:
        ratio = 8.0
    t2 = t * ratio
    return t2 * other_ray[0] - t * d[0], t2 * other_ray[1] - t * d[1], t2 * other_ray[2] - t * d[2]


@inlined
def surface(
    scene: Scene, hit: tuple[Real, Whole, Whole], p: Vector, d: Vector, camera: Float64Array, width: Real
) -> tuple[Vector, Vector]:
    """Linear colour of the surface at a hit (t, shape, face) over `width` pixels, and its normal towards the viewer."""
    shapes, texels, _, _, _ = scene
    t, i, face = hit
    at = to_local(shapes, i, from_centre(shapes, i, p))
    normal, along_u, along_v = tangents(shapes, i, face, at)
    normal = to_world(shapes, i, normal)
    if dot(normal, d) > 0:
        normal = -normal[0], -normal[1], -normal[2]
    e, f = width / camera[12], width / camera[13]
    a = to_local(shapes, i, step(t, d, (e * camera[3], e * camera[6], e * camera[9]), normal))
    b = to_local(shapes, i, step(t, d, (f * camera[4], f * camera[7], f * camera[10]), normal))
    u, v, su, sv = texture_place(shapes, i, face, at)
    ua, va, ub, vb = su * dot(a, along_u), sv * dot(a, along_v), su * dot(b, along_u), sv * dot(b, along_v)
    red, green, blue = filter_texture(
        texels, np.int64(shapes[i, k.LAYER]), np.int64(shapes[i, k.MODE]), (u, v), (ua, va), (ub, vb)
    )
    stain = 1.0
    if shapes[i, k.STAIN] > 0:
        n, m = STAINS_PER_M / su, STAINS_PER_M / sv  # repeats of the noise for one of the texture
        grey, _, _ = filter_texture(texels, 0, k.WRAP, (u * n, v * m), (ua * n, va * m), (ub * n, vb * m))
        stain = 1 + shapes[i, k.STAIN] * (2 * grey - 1)
    return (
        red * red * shapes[i, k.TINT] * stain,
        green * green * shapes[i, k.TINT + 1] * stain,
        blue * blue * shapes[i, k.TINT + 2] * stain,
    ), normal


@inlined
def ray(
    scene: Scene,
    sight: tuple[NDArray[np.int32], Float64Array, Whole],
    skip: Whole,
    gone: Whole,
    camera: Float64Array,
    at: tuple[Real, Real],
    width: Real,
) -> tuple[Vector, Real, Whole, Whole]:
    """One ray through a point (column, row) of the picture: linear colour, planar depth (inf: sky), key of the hit, light state.

    sight: shapes that the ray may meet, their nearest depths, and how many there are. The key is 16 shape + face, -1 for the
    sky: neighbours with other keys show another surface.
    """
    light = scene[2]
    x, y = (at[0] - camera[14]) / camera[12], (at[1] - camera[15]) / camera[13]
    d = (
        camera[3] * x + camera[4] * y + camera[5],
        camera[6] * x + camera[7] * y + camera[8],
        camera[9] * x + camera[10] * y + camera[11],
    )
    eye = camera[0], camera[1], camera[2]
    t, which, face = nearest(scene, sight[0], sight[1], sight[2], skip, eye, d)
    if which < 0:
        return sky(scene[1], light, d, width / camera[12]), np.inf, -1, k.UNLIT
    p = along(eye, t, d)
    (r, g, b), normal = surface(scene, (t, which, face), p, d, camera, width)
    facing = dot(normal, (light[k.TO_LIGHT], light[k.TO_LIGHT + 1], light[k.TO_LIGHT + 2]))
    state = k.LIT if facing > 0 else k.UNLIT
    if state == k.LIT and light[k.SHADOWS] > 0 and in_shadow(scene, gone, along(p, k.LIFT, normal)):
        state = k.BLOCKED
    sun = facing if state == k.LIT else 0.0
    up = 0.5 - 0.5 * normal[1]
    near_floor = 1.0
    if scene[0][which, k.CONTACT] > 0:
        near_floor = 1 - scene[0][which, k.CONTACT] * math.exp(min(0.0, 4 * p[1]))
    haze = 1 - math.exp(-light[k.HAZE] * t)
    a, h = k.AMBIENT_SKY, k.AMBIENT_GROUND
    r *= sun * light[k.SUN] + near_floor * (up * light[a] + (1 - up) * light[h])
    g *= sun * light[k.SUN + 1] + near_floor * (up * light[a + 1] + (1 - up) * light[h + 1])
    b *= sun * light[k.SUN + 2] + near_floor * (up * light[a + 2] + (1 - up) * light[h + 2])
    r += haze * (light[k.HORIZON] - r)
    g += haze * (light[k.HORIZON + 1] - g)
    b += haze * (light[k.HORIZON + 2] - b)
    return (r, g, b), t, 16 * which + face, state
