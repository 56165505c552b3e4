"""The ray caster, literally: every ray against every shape, in plain numpy; no tiles, no lists, no footprints.

Shapes are read from the rows that `dlama.worlds.raycast.shape_rows` describes; the formulas are written anew.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dlama.geometry.camera import Camera
from dlama.worlds.raycast import shape_rows as k
from dlama.worlds.world import World
from worlds import rays_of


@dataclass(frozen=True)
class Traced:
    """What the rays of a camera meet, H x W."""

    depth: np.ndarray
    """inf = nothing."""
    shape: np.ndarray
    """Row number, -1 = nothing."""
    group: np.ndarray
    light: np.ndarray
    """0 turned away, 1 lit, 2 blocked."""
    normal: np.ndarray
    """H x W x 3 in the world, towards the camera."""


def trace(world: World, camera: Camera, without: int = -1, through: np.ndarray | None = None) -> Traced:
    """First hits; `without`: a group that is not there; `through` (H x W): the group that each pixel does not see."""
    rays = rays_of(camera)
    eye = np.broadcast_to(camera.world_from_cam[:3, 3], rays.shape)
    depth, number = np.full(camera.hw, np.inf), np.full(camera.hw, -1)
    for n, row in enumerate(world.shapes):
        t = first_hit(row, world.textures, eye, rays)
        t[(row[k.GROUP] == without) | (False if through is None else through == row[k.GROUP])] = np.inf
        number[t < depth] = n
        depth = np.minimum(depth, t)
    points = eye + np.where(np.isfinite(depth), depth, 0)[..., None] * rays
    normal = normals(world.shapes, number, points, rays)
    group = np.where(number >= 0, world.shapes[number, k.GROUP], -1).astype(int)
    return Traced(depth, number, group, lights(world, points, normal, number, without), normal)


def lights(world: World, points: np.ndarray, normal: np.ndarray, number: np.ndarray, without: int) -> np.ndarray:
    """A ray to the light from every point that faces it, against everything that casts shadows."""
    sun = np.broadcast_to(np.array(world.light.to_light), points.shape)
    facing = (number >= 0) & ((normal * sun).sum(-1) > 0)
    blocked = np.zeros(number.shape, bool)
    for row in world.shapes:
        if row[k.CASTS] and row[k.GROUP] != without:
            blocked |= np.isfinite(first_hit(row, world.textures, points + 1e-4 * normal, sun))
    return np.where(facing, np.where(blocked & world.light.shadows, 2, 1), 0)


def first_hit(row: np.ndarray, texels: np.ndarray, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Smallest t > 0 with origin + t ray on the shape: all its surfaces are met, and the nearest solid one counts."""
    turn = row[k.TURN : k.TURN + 9].reshape(3, 3)
    o, d = (origin - row[k.CENTRE : k.CENTRE + 3]) @ turn.T, rays @ turn.T
    half = row[k.HALF : k.HALF + 3]
    with np.errstate(all="ignore"):
        found = {k.PANEL: panel, k.BOX: box, k.BALL: ball, k.TUBE: tube}[int(row[k.KIND])](half, o, d, bool(row[k.CUT]))
        best = np.full(o.shape[:-1], np.inf)
        for t, uv_face in found:
            p = o + t[..., None] * d
            good = np.isfinite(t) & (t > 1e-9) & solid(row, texels, p, uv_face)
            best = np.where(good & (t < best), t, best)
    return best


def panel(half, o, d, cut):
    """The plane y = 0 within the rectangle."""
    t = -o[..., 1] / d[..., 1]
    p = o + t[..., None] * d
    return [(np.where((abs(p[..., 0]) <= half[0]) & (abs(p[..., 2]) <= half[2]), t, np.inf), "y")]


def box(half, o, d, cut):
    """Six rectangles."""
    found = []
    for axis in range(3):
        others = [n for n in range(3) if n != axis]
        for side in (-half[axis], half[axis]):
            t = (side - o[..., axis]) / d[..., axis]
            p = o + t[..., None] * d
            inside = np.all([abs(p[..., n]) <= half[n] for n in others], 0)
            found.append((np.where(inside, t, np.inf), "xyz"[axis]))
    return found


def ball(half, o, d, cut):
    """Both roots of |(o + t d) / half| = 1."""
    o, d = o / half, d / half
    return [(t, "round") for t in roots((d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1)]


def tube(half, o, d, cut):
    """Both roots of x^2 + z^2 = r(y)^2 with r affine from half[2] at -half[1] to half[0] at half[1], and the two caps."""
    low, h, high = half[0], half[1], half[2]
    slope, middle = (low - high) / (2 * h), (low + high) / 2
    r, dr = middle + slope * o[..., 1], slope * d[..., 1]
    a = d[..., 0] ** 2 + d[..., 2] ** 2 - dr**2
    b = o[..., 0] * d[..., 0] + o[..., 2] * d[..., 2] - r * dr
    c = o[..., 0] ** 2 + o[..., 2] ** 2 - r**2
    found = []
    for t in roots(a, b, c):
        y = o[..., 1] + t * d[..., 1]
        found.append((np.where((abs(y) <= h) & (middle + slope * y >= 0), t, np.inf), "round"))
    for y, radius in ((-h, high), (h, low)):
        t = (y - o[..., 1]) / d[..., 1]
        p = o + t[..., None] * d
        if not cut:
            found.append((np.where(np.hypot(p[..., 0], p[..., 2]) <= radius, t, np.inf), "cap"))
    return found


def roots(a, b, c):
    """Both real roots of a t^2 + 2 b t + c = 0, NaN where there are none."""
    square = np.sqrt(b * b - a * c)
    return (-b - square) / a, (-b + square) / a


def solid(row: np.ndarray, texels: np.ndarray, p: np.ndarray, face: str) -> np.ndarray:
    """Alpha of the nearest texel, for materials that are cut: balls and upright panels are all the worlds use."""
    if not row[k.CUT]:
        return np.ones(p.shape[:-1], bool)
    assert row[k.MODE] == k.WRAP
    if face == "y":
        u, v = p[..., 0] / row[k.TILE], p[..., 2] / row[k.TILE + 1]
    else:
        assert row[k.KIND] == k.BALL
        u = (np.arctan2(p[..., 2], p[..., 0]) / (2 * np.pi) + 0.5) * max(
            1, round(2 * np.pi * row[k.HALF] / row[k.TILE])
        )
        down = max(1, round(np.pi * row[k.HALF + 1] / row[k.TILE + 1]))
        v = np.arccos(np.clip(-p[..., 1] / row[k.HALF + 1], -1, 1)) / np.pi * down
    u, v = u + row[k.OFFSET], v + row[k.OFFSET + 1]
    ok = np.isfinite(u) & np.isfinite(v)
    column = np.floor(np.where(ok, u, 0) * k.SIDE).astype(int) % k.SIDE
    line = np.floor(np.where(ok, v, 0) * k.SIDE).astype(int) % k.SIDE
    return texels[int(row[k.LAYER]), line * k.SIDE + column, 3] >= 128


def normals(shapes: np.ndarray, number: np.ndarray, points: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Unit normals at the hits by what surface they lie on, turned to the camera."""
    out = np.zeros(points.shape)
    for n in np.unique(number[number >= 0]):
        row, at = shapes[n], number == n
        turn, half = row[k.TURN : k.TURN + 9].reshape(3, 3), row[k.HALF : k.HALF + 3]
        p = (points[at] - row[k.CENTRE : k.CENTRE + 3]) @ turn.T
        out[at] = local_normals(int(row[k.KIND]), half, p) @ turn
    out /= np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-12)
    return out * np.where((out * rays).sum(-1, keepdims=True) > 0, -1, 1)


def local_normals(kind: int, half: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Gradients of the surfaces at points on them."""
    if kind == k.PANEL:
        return np.broadcast_to((0.0, 1.0, 0.0), p.shape)
    if kind == k.BALL:
        return p / half**2
    if kind == k.BOX:
        return np.eye(3)[np.argmax(np.abs(p) - half, -1)]
    slope = (half[0] - half[2]) / (2 * half[1])
    radius = (half[0] + half[2]) / 2 + slope * p[:, 1]
    off_side = abs(np.hypot(p[:, 0], p[:, 2]) - radius) / np.hypot(1, slope)
    cap = half[1] - abs(p[:, 1]) < off_side
    side = np.stack([p[:, 0], -slope * radius, p[:, 2]], -1)
    return np.where(cap[:, None], (0.0, 1.0, 0.0), side)


def shade(world: World, traced: Traced, height: np.ndarray) -> np.ndarray:
    """Colours 0..255 (float) of hits on textures of one colour each; `height`: y of the hits. No haze, no stains; sky: 0.

    Light from all around fades to 1 - CONTACT at the floor by exp(4 y).
    """
    rows = world.shapes[traced.shape]
    texel = world.textures[rows[..., k.LAYER].astype(int), 0, :3] / 255.0
    facing = np.maximum((traced.normal * np.array(world.light.to_light)).sum(-1), 0) * (traced.light == 1)
    up = (1 - traced.normal[..., 1:2]) / 2
    around = up * np.array(world.light.ambient_sky) + (1 - up) * np.array(world.light.ambient_ground)
    fade = 1 - rows[..., k.CONTACT] * np.exp(np.minimum(4 * height, 0))
    light = facing[..., None] * np.array(world.light.sun) + fade[..., None] * around
    linear = texel**2 * rows[..., k.TINT : k.TINT + 3] * light
    return 255 * np.sqrt(np.clip(linear, 0, 1)) * (traced.shape >= 0)[..., None]
