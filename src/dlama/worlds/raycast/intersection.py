"""Ray geometry (numba): rows of shapes and a ray in, the first hit and its place on the texture out.

A shape is one row of numbers (columns in `shape_rows`) with a frame of its own: local = R (p - centre), y down as everywhere.
Rays have camera z = 1, so the parameter along them *is* planar depth. Light is squared texel value (gamma 2), which
makes decoding one multiplication. Every pixel is computed alone: the result does not depend on the number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined
from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.raycast.shape_rows import (
    BALL,
    BOX,
    CENTRE,
    CUT,
    FIT,
    GRID,
    GRID_X,
    GRID_Y,
    GROUP,
    HALF,
    KIND,
    LAYER,
    MODE,
    NEAR,
    OFFSET,
    PANEL,
    SIDE,
    TILE,
    TO_LIGHT,
    TUBE,
    TURN,
)


@inlined
def texture_place(
    shapes: Float64Array, i: Whole, face: Whole, x: Real, y: Real, z: Real
) -> tuple[Real, Real, Real, Real]:
    """Texture u, v in repeats, and repeats per metre along the two tangents, at a local point of a face."""
    kind, fit = np.int64(shapes[i, KIND]), shapes[i, MODE] == FIT
    if kind <= BOX:
        axis = face // 2
        a, b = (z, y) if axis == 0 else ((x, z) if axis == 1 else (x, y))
        ha, hb = (
            (shapes[i, HALF + 2], shapes[i, HALF + 1])
            if axis == 0
            else ((shapes[i, HALF], shapes[i, HALF + 2]) if axis == 1 else (shapes[i, HALF], shapes[i, HALF + 1]))
        )
        if face == 0 or face == 5:  # seen from outside u runs to the right on every side, or writing would be mirrored
            a = -a
        if fit:
            su, sv = 0.5 * shapes[i, TILE] / max(ha, 1e-9), 0.5 * shapes[i, TILE + 1] / max(hb, 1e-9)
            return (a + ha) * su, (b + hb) * sv, su, sv
        su, sv = 1 / shapes[i, TILE], 1 / shapes[i, TILE + 1]
        return a * su + shapes[i, OFFSET], b * sv + shapes[i, OFFSET + 1], su, sv
    if kind == TUBE and face >= 7:
        su, sv = (
            (1 / shapes[i, TILE], 1 / shapes[i, TILE + 1])
            if not fit
            else (0.5 / max(shapes[i, HALF], shapes[i, HALF + 2]), 0.5 / max(shapes[i, HALF], shapes[i, HALF + 2]))
        )
        return x * su + 0.5, z * sv + 0.5, su, sv
    turn = math.atan2(z, x) / (2 * math.pi) + 0.5
    radius = shapes[i, HALF] if kind == BALL else max(shapes[i, HALF], shapes[i, HALF + 2])
    around = shapes[i, TILE] if fit else max(1.0, np.floor(2 * math.pi * radius / shapes[i, TILE] + 0.5))
    su = around / (2 * math.pi * radius)
    if kind == TUBE:
        sv = 0.5 * shapes[i, TILE + 1] / shapes[i, HALF + 1] if fit else 1 / shapes[i, TILE + 1]
        return turn * around + shapes[i, OFFSET], (y + shapes[i, HALF + 1]) * sv + shapes[i, OFFSET + 1], su, sv
    down = shapes[i, TILE + 1] if fit else max(1.0, np.floor(math.pi * shapes[i, HALF + 1] / shapes[i, TILE + 1] + 0.5))
    polar = math.acos(max(-1.0, min(1.0, -y / shapes[i, HALF + 1]))) / math.pi
    return (
        turn * around + shapes[i, OFFSET],
        polar * down + shapes[i, OFFSET + 1],
        su,
        down / (math.pi * shapes[i, HALF + 1]),
    )


@inlined
def is_solid(shapes: Float64Array, i: Whole, texels: UInt8Array, face: Whole, x: Real, y: Real, z: Real) -> Flag:
    """False where the texture's alpha cuts a hole into the surface (nearest texel of the finest level)."""
    if shapes[i, CUT] == 0:
        return True
    u, v, _, _ = texture_place(shapes, i, face, x, y, z)
    column = math.floor(u * SIDE) % SIDE
    row = math.floor(v * SIDE) % SIDE
    return texels[np.int64(shapes[i, LAYER]), row * SIDE + column, 3] >= 128


@inlined
def hit_box(
    shapes: Float64Array, i: Whole, texels: UInt8Array, ox: Real, oy: Real, oz: Real, dx: Real, dy: Real, dz: Real
) -> tuple[Real, Whole]:
    """Slabs: where the ray enters (or, from inside, leaves) and through which face (2 axis + 1 for the positive one)."""
    enter, leave, first, last = -np.inf, np.inf, 0, 0
    for axis in range(3):
        o, d = (ox, dx) if axis == 0 else ((oy, dy) if axis == 1 else (oz, dz))
        h = shapes[i, HALF + axis]
        if d == 0:
            if abs(o) > h:
                return np.inf, 0
            continue
        one, two = (-h - o) / d, (h - o) / d
        positive = 0
        if one > two:
            one, two, positive = two, one, 1
        if one > enter:
            enter, first = one, 2 * axis + positive
        if two < leave:
            leave, last = two, 2 * axis + 1 - positive
    if enter > leave or leave <= NEAR:
        return np.inf, 0
    t, face = (enter, first) if enter > NEAR else (leave, last)
    if not is_solid(shapes, i, texels, face, ox + t * dx, oy + t * dy, oz + t * dz):
        return np.inf, 0
    return t, face


@inlined
def hit_round(
    shapes: Float64Array, i: Whole, texels: UInt8Array, ox: Real, oy: Real, oz: Real, dx: Real, dy: Real, dz: Real
) -> tuple[Real, Whole]:
    """Ellipsoid (faces 6 outside, 9 inside) and frustum (6 side, 7 upper cap, 8 lower cap, 9 side from inside)."""
    ball = shapes[i, KIND] == BALL
    hy = shapes[i, HALF + 1]
    if ball:
        sx, sy, sz = 1 / shapes[i, HALF], 1 / hy, 1 / shapes[i, HALF + 2]
        ax, ay, az, bx, by, bz = ox * sx, oy * sy, oz * sz, dx * sx, dy * sy, dz * sz
        a, b, c = bx * bx + by * by + bz * bz, ax * bx + ay * by + az * bz, ax * ax + ay * ay + az * az - 1
    else:
        k, middle = (shapes[i, HALF] - shapes[i, HALF + 2]) / (2 * hy), 0.5 * (shapes[i, HALF] + shapes[i, HALF + 2])
        r = middle + k * oy
        a, b, c = dx * dx + dz * dz - k * k * dy * dy, ox * dx + oz * dz - k * r * dy, ox * ox + oz * oz - r * r
    best, face = np.inf, 0
    square = b * b - a * c
    if square >= 0 and a != 0:
        root = math.sqrt(square)
        for side in range(2):
            t = (-b - root) / a if side == 0 else (-b + root) / a
            y = oy + t * dy
            if t <= NEAR or t >= best or (not ball and (abs(y) > hy or middle + k * y < 0)):
                continue
            x, z = ox + t * dx, oz + t * dz
            if is_solid(shapes, i, texels, 6, x, y, z):
                outside = c > 0 if ball else x * dx + z * dz - k * (middle + k * y) * dy < 0
                best, face = t, 6 if outside and (side == 0 or not ball) else 9
    if not ball and dy != 0:
        for cap in range(2):
            t = ((-hy if cap == 0 else hy) - oy) / dy
            x, z = ox + t * dx, oz + t * dz
            limit = shapes[i, HALF + 2] if cap == 0 else shapes[i, HALF]
            if t > NEAR and t < best and x * x + z * z <= limit * limit and shapes[i, CUT] == 0:
                best, face = t, 7 + cap
    return best, face


@inlined
def hit(
    shapes: Float64Array, i: Whole, texels: UInt8Array, px: Real, py: Real, pz: Real, dx: Real, dy: Real, dz: Real
) -> tuple[Real, Whole]:
    """The nearest t > 0 at which p + t d meets a shape, and the face; inf where it does not."""
    x, y, z = px - shapes[i, CENTRE], py - shapes[i, CENTRE + 1], pz - shapes[i, CENTRE + 2]
    oy = shapes[i, TURN + 3] * x + shapes[i, TURN + 4] * y + shapes[i, TURN + 5] * z
    ly = shapes[i, TURN + 3] * dx + shapes[i, TURN + 4] * dy + shapes[i, TURN + 5] * dz
    if shapes[i, KIND] == PANEL and (ly == 0 or -oy / ly <= NEAR):
        return np.inf, 0
    ox = shapes[i, TURN] * x + shapes[i, TURN + 1] * y + shapes[i, TURN + 2] * z
    oz = shapes[i, TURN + 6] * x + shapes[i, TURN + 7] * y + shapes[i, TURN + 8] * z
    lx = shapes[i, TURN] * dx + shapes[i, TURN + 1] * dy + shapes[i, TURN + 2] * dz
    lz = shapes[i, TURN + 6] * dx + shapes[i, TURN + 7] * dy + shapes[i, TURN + 8] * dz
    if shapes[i, KIND] == BOX:
        return hit_box(shapes, i, texels, ox, oy, oz, lx, ly, lz)
    if shapes[i, KIND] != PANEL:
        return hit_round(shapes, i, texels, ox, oy, oz, lx, ly, lz)
    t = -oy / ly
    x, z = ox + t * lx, oz + t * lz
    face = 2 if ly > 0 else 3
    if abs(x) > shapes[i, HALF] or abs(z) > shapes[i, HALF + 2] or not is_solid(shapes, i, texels, face, x, 0.0, z):
        return np.inf, 0
    return t, face


@inlined
def nearest(
    shapes: Float64Array,
    texels: UInt8Array,
    listed: NDArray[np.int32],
    count: Whole,
    near_z: Float64Array,
    skip: Whole,
    px: Real,
    py: Real,
    pz: Real,
    dx: Real,
    dy: Real,
    dz: Real,
) -> tuple[Real, Whole, Whole]:
    """First hit of a ray among the listed shapes (nearest possible first), leaving out one group: t, shape, face."""
    best, which = np.inf, -1
    face: Whole = 0
    for j in range(count):
        i = listed[j]
        if near_z[j] >= best:
            break
        if shapes[i, GROUP] == skip:
            continue
        t, f = hit(shapes, i, texels, px, py, pz, dx, dy, dz)
        if t < best:
            best, which, face = t, i, f
    return best, which, face


@inlined
def in_shadow(
    shapes: Float64Array,
    texels: UInt8Array,
    light: Float64Array,
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    gone: Whole,
    px: Real,
    py: Real,
    pz: Real,
) -> bool:
    """True if a shape stands between the point and the light; only the shapes of the point's cell can."""
    side = np.int64(light[GRID + 3])
    a = px * light[GRID_X] + py * light[GRID_X + 1] + pz * light[GRID_X + 2]
    b = px * light[GRID_Y] + py * light[GRID_Y + 1] + pz * light[GRID_Y + 2]
    column, row = math.floor((a - light[GRID]) * light[GRID + 2]), math.floor((b - light[GRID + 1]) * light[GRID + 2])
    if column < 0 or row < 0 or column >= side or row >= side:
        return False
    cell = row * side + column
    for j in range(starts[cell], starts[cell + 1]):
        i = items[j]
        if shapes[i, GROUP] != gone:
            t, _ = hit(shapes, i, texels, px, py, pz, light[TO_LIGHT], light[TO_LIGHT + 1], light[TO_LIGHT + 2])
            if t < np.inf:
                return True
    return False
