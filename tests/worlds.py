"""Closed-form worlds: planes, spheres and boxes in, RGBD for any camera out, with the true depth of every ray.

Nothing here uses dlama's own geometry beyond the nouns: rays are written out from the convention (first pixel's centre
at (0.5, 0.5), OpenCV axes, planar z), so a mistake in the package does not come back here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import RGBD

SEEN_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Plane:
    """All points p with normal . (p - point) = 0."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def hit(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """Smallest t > 0 with origin + t * ray on the surface, inf where there is none; rays: ... x 3."""
        normal = np.array(self.normal, float)
        facing = rays @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((np.array(self.point) - origin) @ normal) / facing
        return np.where((t > 0) & np.isfinite(t), t, np.inf)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Metres from each point (... x 3) to the surface."""
        normal = np.array(self.normal, float)
        return np.abs((points - np.array(self.point)) @ normal) / np.linalg.norm(normal)

    def face(self, camera: Camera) -> bool:
        """Which face the camera is before: True if the normal points to it."""
        return bool((camera.world_from_cam[:3, 3] - np.array(self.point)) @ np.array(self.normal) > 0)


@dataclass(frozen=True)
class Sphere:
    """A full sphere."""

    centre: tuple[float, float, float]
    radius: float

    def hit(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """As Plane.hit: roots of |origin + t ray - centre|^2 = radius^2."""
        to_origin = origin - np.array(self.centre)
        a = (rays**2).sum(-1)
        b = rays @ to_origin
        root = np.sqrt(np.maximum(b**2 - a * (to_origin @ to_origin - self.radius**2), 0))
        meets = b**2 >= a * (to_origin @ to_origin - self.radius**2)
        near, far = (-b - root) / a, (-b + root) / a
        t = np.where(near > 0, near, far)
        return np.where(meets & (t > 0), t, np.inf)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """As Plane.distance."""
        return np.abs(np.linalg.norm(points - np.array(self.centre), axis=-1) - self.radius)


@dataclass(frozen=True)
class Box:
    """A solid box along the axes of the world."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    def hit(self, origin: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """As Plane.hit, by slabs."""
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (np.array(self.low) - origin) / rays
            two = (np.array(self.high) - origin) / rays
        enter = np.nanmax(np.minimum(one, two), axis=-1)
        leave = np.nanmin(np.maximum(one, two), axis=-1)
        t = np.where(enter > 0, enter, leave)
        return np.where((enter <= leave) & (t > 0), t, np.inf)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """As Plane.distance."""
        low, high = np.array(self.low), np.array(self.high)
        outside = np.maximum(np.maximum(low - points, points - high), 0)
        inside = np.minimum(points - low, high - points).min(-1)
        return np.where(inside > 0, inside, np.linalg.norm(outside, axis=-1))


Shape = Plane | Sphere | Box


@dataclass(frozen=True)
class World:
    """Shapes before a sky; shape number i is drawn in colour family i, so that a picture tells what it shows."""

    shapes: tuple[Shape, ...]

    def trace(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """True planar depth (float64 H x W, inf = sky) and the number of the shape seen (-1 = sky)."""
        return self.cast(camera.world_from_cam[:3, 3], rays_of(camera))

    def cast(self, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As trace, for any rays (... x 3) from one origin."""
        hits = np.stack([shape.hit(origin, rays) for shape in self.shapes])
        depth = hits.min(0)
        return depth, np.where(np.isfinite(depth), hits.argmin(0), -1)

    def rgbd(self, camera: Camera) -> RGBD:
        """The frame this camera takes."""
        depth, number = self.trace(camera)
        points = points_of(camera, np.where(np.isfinite(depth), depth, 1.0))
        return RGBD(texture(points, number), depth.astype(np.float32), camera)

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Metres from each world point to the nearest surface."""
        return np.stack([shape.distance(points) for shape in self.shapes]).min(0)

    def seen_by(self, source: Camera, target: Camera) -> np.ndarray:
        """H x W of the target, True where what it sees (a finite surface) lies in the source's picture, unoccluded.

        Of a plane both must see the same face: the other one is another surface.
        """
        depth, number = self.trace(target)
        finite = np.isfinite(depth)
        points = points_of(target, np.where(finite, depth, 1.0))
        x, y, z = pixels_of(source, points)
        inside = finite & (z > 0) & (x >= 0) & (x < source.width) & (y >= 0) & (y < source.height)
        toward = points - source.world_from_cam[:3, 3]
        for n, shape in enumerate(self.shapes):
            if isinstance(shape, Plane) and shape.face(source) != shape.face(target):
                inside &= number != n
        first, _ = self.cast(source.world_from_cam[:3, 3], toward)  # 1.0 at the point itself
        return inside & (first > 1 - SEEN_TOLERANCE)


def rays_of(camera: Camera) -> np.ndarray:
    """World directions (H x W x 3) through the pixel centres; camera z is 1, so t along them is planar depth."""
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    rays = np.stack([*np.meshgrid(x, y), np.ones(camera.hw)], -1)
    return rays @ camera.world_from_cam[:3, :3].T


def points_of(camera: Camera, depth: np.ndarray) -> np.ndarray:
    """World points (H x W x 3) at planar depth (H x W) on the pixels' rays."""
    return camera.world_from_cam[:3, 3] + depth[..., None] * rays_of(camera)


def pixels_of(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixel x, y and planar z of world points (... x 3); x, y are garbage where z <= 0."""
    local = (points - camera.world_from_cam[:3, 3]) @ camera.world_from_cam[:3, :3]
    z = local[..., 2]
    safe = np.where(z > 0, z, 1.0)
    return camera.fx * local[..., 0] / safe + camera.cx, camera.fy * local[..., 1] / safe + camera.cy, z


def texture(points: np.ndarray, number: np.ndarray) -> np.ndarray:
    """uint8 colours: a smooth wave on each shape; green says which shape (40 * number + 0..20); the sky is blue."""
    wave = np.stack([np.sin(3 * points[..., 0] + 1), np.cos(2 * points[..., 1]), np.sin(2 * points[..., 2])], -1)
    color = np.stack([128 + 80 * wave[..., 0], 40 * number + 10 + 10 * wave[..., 1], 60 + 40 * wave[..., 2]], -1)
    return np.where((number < 0)[..., None], (90, 150, 250), color).round().astype(np.uint8)


def shape_shown(color: np.ndarray) -> np.ndarray:
    """Which shape a textured pixel shows, from its green channel."""
    return color[..., 1] // 40


Triple = tuple[float, float, float]


def moved(camera: Camera, turn: Triple = (0, 0, 0), shift: Triple = (0, 0, 0)) -> Camera:
    """The camera turned by a rotation vector (degrees, own axes) and shifted (metres, own axes)."""
    return camera.at(camera.world_from_cam @ pose_of(np.radians(turn), shift))


def drift(camera: Camera, rng: np.random.Generator) -> Camera:
    """The camera .8 degrees and 2 cm off, as hand-held ones are: standard deviations of each axis."""
    pose = camera.world_from_cam.copy()
    pose[:3, :3] = cv2.Rodrigues(np.radians(rng.normal(0, 0.8, 3)))[0] @ pose[:3, :3]
    pose[:3, 3] += rng.normal(0, 0.02, 3)
    return camera.at(pose)


def rotation(vector: np.ndarray) -> np.ndarray:
    """3x3 rotation about `vector` by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle == 0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def pose_of(vector: np.ndarray | Triple, shift: np.ndarray | Triple) -> np.ndarray:
    """4x4 motion from a rotation vector in radians and a translation in metres."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(np.asarray(vector)), shift
    return pose


def random_camera(rng: np.random.Generator, width: int, height: int) -> Camera:
    """Any small lens, somewhere in the world."""
    pose = pose_of(rng.normal(size=3), rng.uniform(-5, 5, 3))
    focal = rng.uniform(0.6, 1.5) * width
    fy, (cx, cy) = focal * rng.uniform(0.8, 1.2), rng.uniform(0.3, 0.7, 2) * (width, height)
    return Camera(width, height, focal, fy, cx, cy, pose)


def noisy_frames(world: World, cameras: Sequence[Camera], constant: float = 0.0, slope: float = 0.0) -> list[RGBD]:
    """The frames that these cameras take, with depth noise of hypot(constant, slope z^2) metres."""
    random, made = np.random.default_rng(0), []
    for frame in map(world.rgbd, cameras):
        noise = np.hypot(constant, slope * frame.depth**2) * random.standard_normal(frame.depth.shape)
        made.append(RGBD(frame.color, frame.depth + noise.astype(np.float32), frame.camera))
    return made


def rgbd_of(depth: np.ndarray, camera: Camera | None = None, color: object = 0) -> RGBD:
    """A frame of that depth (H x W metres) in one colour, or in those of a picture; by default through a lens of 60 degrees."""
    picture = np.broadcast_to(np.asarray(color, np.uint8), (*depth.shape, 3))
    return RGBD(picture, np.asarray(depth, np.float32), camera or Camera.from_fov(*depth.shape[::-1], 60))


def innermost_pixel(where: np.ndarray) -> tuple[int, int]:
    """x, y of the pixel farthest from where `where` (H x W, not empty) ends: where one clicks on what is seen."""
    distance = cv2.distanceTransform(np.pad(where.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
    row, column = np.unravel_index(int(distance.argmax()), distance.shape)
    return int(column), int(row)


def box_round(where: np.ndarray, margin: float = 0) -> tuple[float, float, float, float]:
    """x, y, width, height of the box of `where` (H x W, not empty), so many px larger on each side."""
    rows, columns = np.nonzero(where)
    wide, high = (float(np.ptp(each)) + 1 + 2 * margin for each in (columns, rows))
    return columns.min() - margin, rows.min() - margin, wide, high
