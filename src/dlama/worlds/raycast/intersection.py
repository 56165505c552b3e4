"""Ray geometry (numba): rows of shapes and a ray in, the first hit and its place on the texture out.

A shape is one row of numbers (columns in `shape_rows`) with a frame of its own: local = R (p - centre), y down as everywhere.
Rays have camera z = 1, so the parameter along them *is* planar depth.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Float64Array
from dlama.geometry.kernels.jit import Flag, Real, Whole, inlined
from dlama.geometry.rgbd import UInt8Array
from dlama.worlds.raycast import shape_rows as k

Vector = tuple[Real, Real, Real]
"""A place or direction: x, y, z."""
Scene = tuple[Float64Array, UInt8Array, Float64Array, NDArray[np.int32], NDArray[np.int32]]
"""Shapes, texels, the light's numbers, and the grid's lists of what may stand before the light: starts and items."""


@inlined
def dot(one: Vector, other: Vector) -> Real:
    """Scalar product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@inlined
def along(p: Vector, t: Real, d: Vector) -> Vector:
    """p + t d."""
    return p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]


@inlined
def from_centre(shapes: Float64Array, i: Whole, p: Vector) -> Vector:
    """A place in the world, from a shape's centre."""
    return p[0] - shapes[i, k.CENTRE], p[1] - shapes[i, k.CENTRE + 1], p[2] - shapes[i, k.CENTRE + 2]


@inlined
def local_axis(shapes: Float64Array, i: Whole, axis: Whole, v: Vector) -> Real:
    """One component, in a shape's frame, of a direction in the world."""
    first = k.TURN + 3 * axis
    return shapes[i, first] * v[0] + shapes[i, first + 1] * v[1] + shapes[i, first + 2] * v[2]


@inlined
def to_local(shapes: Float64Array, i: Whole, v: Vector) -> Vector:
    """A world direction in a shape's frame."""
    return local_axis(shapes, i, 0, v), local_axis(shapes, i, 1, v), local_axis(shapes, i, 2, v)


@inlined
def texture_place(shapes: Float64Array, i: Whole, face: Whole, at: Vector) -> tuple[Real, Real, Real, Real]:
    """Texture u, v in repeats, and repeats per metre along the two tangents, at a local point of a face."""
    kind = np.int64(shapes[i, k.KIND])
    return place_on_box(shapes, i, face, at) if kind <= k.BOX else place_on_round(shapes, i, kind, face, at)


@inlined
def place_on_box(shapes: Float64Array, i: Whole, face: Whole, at: Vector) -> tuple[Real, Real, Real, Real]:
    """As `texture_place`, on a face of a box, or on a panel."""
    x, y, z = at
    axis = face // 2
    a, b = z if axis == 0 else x, z if axis == 1 else y
    ha, hb = shapes[i, k.HALF + 2 if axis == 0 else k.HALF], shapes[i, k.HALF + 2 if axis == 1 else k.HALF + 1]
    if face == 0 or face == 5:  # seen from outside u runs to the right on every side, or writing would be mirrored
        a = -a
    if shapes[i, k.MODE] == k.FIT:
        su, sv = 0.5 * shapes[i, k.TILE] / max(ha, 1e-9), 0.5 * shapes[i, k.TILE + 1] / max(hb, 1e-9)
        return (a + ha) * su, (b + hb) * sv, su, sv
    su, sv = 1 / shapes[i, k.TILE], 1 / shapes[i, k.TILE + 1]
    return a * su + shapes[i, k.OFFSET], b * sv + shapes[i, k.OFFSET + 1], su, sv


@inlined
def place_on_round(
    shapes: Float64Array, i: Whole, kind: Whole, face: Whole, at: Vector
) -> tuple[Real, Real, Real, Real]:
    """As `texture_place`, on a ball, or on the side or a cap of a tube."""
    x, y, z = at
    fit = shapes[i, k.MODE] == k.FIT
    radius = shapes[i, k.HALF] if kind == k.BALL else max(shapes[i, k.HALF], shapes[i, k.HALF + 2])
    if kind == k.TUBE and face >= 7:
        su, sv = (0.5 / radius, 0.5 / radius) if fit else (1 / shapes[i, k.TILE], 1 / shapes[i, k.TILE + 1])
        return x * su + 0.5, z * sv + 0.5, su, sv
    turn = math.atan2(z, x) / (2 * math.pi) + 0.5
    around = shapes[i, k.TILE] if fit else max(1.0, np.floor(2 * math.pi * radius / shapes[i, k.TILE] + 0.5))
    u, su = turn * around + shapes[i, k.OFFSET], around / (2 * math.pi * radius)
    half = shapes[i, k.HALF + 1]
    if kind == k.TUBE:
        sv = 0.5 * shapes[i, k.TILE + 1] / half if fit else 1 / shapes[i, k.TILE + 1]
        return u, (y + half) * sv + shapes[i, k.OFFSET + 1], su, sv
    down = shapes[i, k.TILE + 1] if fit else max(1.0, np.floor(math.pi * half / shapes[i, k.TILE + 1] + 0.5))
    polar = math.acos(max(-1.0, min(1.0, -y / half))) / math.pi
    return u, polar * down + shapes[i, k.OFFSET + 1], su, down / (math.pi * half)


@inlined
def is_solid(shapes: Float64Array, i: Whole, texels: UInt8Array, face: Whole, at: Vector) -> Flag:
    """False where the texture's alpha cuts a hole into the surface (nearest texel of the finest level)."""
    if shapes[i, k.CUT] == 0:
        return True
    u, v, _, _ = texture_place(shapes, i, face, at)
    column = math.floor(u * k.SIDE) % k.SIDE
    row = math.floor(v * k.SIDE) % k.SIDE
    return texels[np.int64(shapes[i, k.LAYER]), row * k.SIDE + column, 3] >= 128


@inlined
def hit_box(shapes: Float64Array, i: Whole, texels: UInt8Array, o: Vector, d: Vector) -> tuple[Real, Whole]:
    """Slabs: where the ray enters (or, from inside, leaves) and through which face (2 axis + 1 for the positive one)."""
    enter, leave, first, last = -np.inf, np.inf, 0, 0
    for axis in range(3):
        start, step, h = o[axis], d[axis], shapes[i, k.HALF + axis]
        if step == 0:
            if abs(start) > h:
                return np.inf, 0
            continue
        one, two = (-h - start) / step, (h - start) / step
        positive = int(one > two)
        if min(one, two) > enter:
            enter, first = min(one, two), 2 * axis + positive
        if max(one, two) < leave:
            leave, last = max(one, two), 2 * axis + 1 - positive
    if enter > leave or leave <= k.NEAR:
        return np.inf, 0
    t, face = (enter, first) if enter > k.NEAR else (leave, last)
    if not is_solid(shapes, i, texels, face, along(o, t, d)):
        return np.inf, 0
    return t, face


@inlined
def hit_ball(shapes: Float64Array, i: Whole, texels: UInt8Array, o: Vector, d: Vector) -> tuple[Real, Whole]:
    """Ellipsoid: face 6 outside, 9 inside."""
    sx, sy, sz = 1 / shapes[i, k.HALF], 1 / shapes[i, k.HALF + 1], 1 / shapes[i, k.HALF + 2]
    p, q = (o[0] * sx, o[1] * sy, o[2] * sz), (d[0] * sx, d[1] * sy, d[2] * sz)
    a, b, c = dot(q, q), dot(p, q), dot(p, p) - 1
    square = b * b - a * c
    if square >= 0 and a != 0:
        root = math.sqrt(square)
        for side in range(2):
            t = (-b - root) / a if side == 0 else (-b + root) / a
            if t > k.NEAR and is_solid(shapes, i, texels, 6, along(o, t, d)):
                return t, 6 if c > 0 and side == 0 else 9
    return np.inf, 0


@inlined
def hit_tube(shapes: Float64Array, i: Whole, texels: UInt8Array, o: Vector, d: Vector) -> tuple[Real, Whole]:
    """Frustum: face 6 side, 7 upper cap, 8 lower cap, 9 side from inside."""
    below, hy, above = shapes[i, k.HALF], shapes[i, k.HALF + 1], shapes[i, k.HALF + 2]
    slope, middle = (below - above) / (2 * hy), 0.5 * (below + above)
    r = middle + slope * o[1]
    a = d[0] * d[0] + d[2] * d[2] - slope * slope * d[1] * d[1]
    b, c = o[0] * d[0] + o[2] * d[2] - slope * r * d[1], o[0] * o[0] + o[2] * o[2] - r * r
    best, face = np.inf, 0
    square = b * b - a * c
    if square >= 0 and a != 0:
        root = math.sqrt(square)
        for side in range(2):
            t = (-b - root) / a if side == 0 else (-b + root) / a
            x, y, z = along(o, t, d)
            inside = k.NEAR < t < best and abs(y) <= hy and middle + slope * y >= 0
            if inside and is_solid(shapes, i, texels, 6, (x, y, z)):
                best, face = t, 6 if x * d[0] + z * d[2] - slope * (middle + slope * y) * d[1] < 0 else 9
    return nearer_cap(shapes, i, o, d, best, face)


@inlined
def nearer_cap(shapes: Float64Array, i: Whole, o: Vector, d: Vector, best: Real, face: Whole) -> tuple[Real, Whole]:
    """A hit of a frustum's side, or that of one of its caps, if it has any, where it is nearer."""
    hy = shapes[i, k.HALF + 1]
    if d[1] != 0 and shapes[i, k.CUT] == 0:
        for cap in range(2):
            t = ((-hy if cap == 0 else hy) - o[1]) / d[1]
            x, _, z = along(o, t, d)
            limit = shapes[i, k.HALF + 2] if cap == 0 else shapes[i, k.HALF]
            if t > k.NEAR and t < best and x * x + z * z <= limit * limit:
                best, face = t, 7 + cap
    return best, face


@inlined
def hit(shapes: Float64Array, i: Whole, texels: UInt8Array, p: Vector, d: Vector) -> tuple[Real, Whole]:
    """The nearest t > 0 at which p + t d meets a shape, and the face; inf where it does not."""
    v = from_centre(shapes, i, p)
    oy, dy = local_axis(shapes, i, 1, v), local_axis(shapes, i, 1, d)
    kind = shapes[i, k.KIND]
    if kind == k.PANEL and (dy == 0 or -oy / dy <= k.NEAR):
        return np.inf, 0
    o = local_axis(shapes, i, 0, v), oy, local_axis(shapes, i, 2, v)
    e = local_axis(shapes, i, 0, d), dy, local_axis(shapes, i, 2, d)
    if kind == k.BOX:
        return hit_box(shapes, i, texels, o, e)
    if kind == k.BALL:
        return hit_ball(shapes, i, texels, o, e)
    if kind == k.TUBE:
        return hit_tube(shapes, i, texels, o, e)
    return hit_panel(shapes, i, texels, o, e)


@inlined
def hit_panel(shapes: Float64Array, i: Whole, texels: UInt8Array, o: Vector, d: Vector) -> tuple[Real, Whole]:
    """A rectangle in y = 0, which the ray is known to meet in front: its upper face is 2, its lower one 3."""
    t = -o[1] / d[1]
    x, z = o[0] + t * d[0], o[2] + t * d[2]
    face = 2 if d[1] > 0 else 3
    if abs(x) > shapes[i, k.HALF] or abs(z) > shapes[i, k.HALF + 2]:
        return np.inf, 0
    return (t, face) if is_solid(shapes, i, texels, face, (x, 0.0, z)) else (np.inf, 0)


@inlined
def nearest(
    scene: Scene, listed: NDArray[np.int32], near_z: Float64Array, count: Whole, skip: Whole, p: Vector, d: Vector
) -> tuple[Real, Whole, Whole]:
    """First hit of a ray among the listed shapes (nearest possible first), leaving out one group: t, shape, face."""
    shapes, texels, _, _, _ = scene
    best, which = np.inf, -1
    face: Whole = 0
    for j in range(count):
        i = listed[j]
        if near_z[j] >= best:
            break
        if shapes[i, k.GROUP] == skip:
            continue
        t, f = hit(shapes, i, texels, p, d)
        if t < best:
            best, which, face = t, i, f
    return best, which, face


@inlined
def in_shadow(scene: Scene, gone: Whole, p: Vector) -> bool:
    """True if a shape stands between the point and the light; only the shapes of the point's cell can."""
    shapes, texels, light, starts, items = scene
    side = np.int64(light[k.GRID + 3])
    a = dot(p, (light[k.GRID_X], light[k.GRID_X + 1], light[k.GRID_X + 2]))
    b = dot(p, (light[k.GRID_Y], light[k.GRID_Y + 1], light[k.GRID_Y + 2]))
    column = math.floor((a - light[k.GRID]) * light[k.GRID + 2])
    row = math.floor((b - light[k.GRID + 1]) * light[k.GRID + 2])
    if column < 0 or row < 0 or column >= side or row >= side:
        return False
    cell = row * side + column
    for j in range(starts[cell], starts[cell + 1]):
        i = items[j]
        if shapes[i, k.GROUP] != gone:
            t, _ = hit(shapes, i, texels, p, (light[k.TO_LIGHT], light[k.TO_LIGHT + 1], light[k.TO_LIGHT + 2]))
            if t < np.inf:
                return True
    return False
