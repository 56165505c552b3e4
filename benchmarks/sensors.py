"""A clean RGB-D frame in -> the frame as a structured-light camera, a stereo matcher, a phone or a LIDAR would measure it, out.

Coarser than `augment.add_depth_faults`: depth is missing next to edges and beyond the range, is shifted against the colours, and
objects are dilated. Strengths are drawn from ranges that cover the first Kinect and semi-global matching.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.projection import depth_from_inverse, inverse_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.perception.resampling import upsample_depth
from dlama.training.data.augment import add_depth_holes, add_flying_pixels

EDGE = 0.06
"""Relative step of inverse depth between neighbours that is an edge."""
STRUCTURED_NOISE, STRUCTURED_STEP = (0.001, 0.015), (0.001, 0.012)
"""Standard deviation and steps of inverse depth, relative to its median, of structured light."""
MATCHER_NOISE, MATCHER_GRAIN = (0.002, 0.02), (3.0, 9.0)
"""Of a matcher: noise likewise, smooth over so many pixels (sigma)."""
SHADOW, FATTENING, MISALIGNED = (2, 9), (1, 4), 2.0
"""Pixels: depth missing next to an edge, foreground dilated, largest shift of depth against colour."""
OUT_OF_REACH = 0.35
"""Probability that what is far (the last twentieth to fifth of the depths, and the sky) has no depth."""
FLIGHT_NOISE, FLIGHT_GRAIN = (0.002, 0.02), (0.3, 1.0)
"""Standard deviation of the noise of a time-of-flight camera, as a share of the distance, and its sigma in pixels."""
RINGS, POINTS, LOST = (3.0, 7.0), (1.0, 3.0), 0.1
"""Pixels, in a picture 640 wide, between the rings of a LIDAR and between points of one; share of points that do not return."""
MAP_PX, BLURRED_PX, UNEVEN = 256, (0.5, 1.0), 0.004
"""A phone's depth: pixels of its longer side; sigma of its blur, in these; standard deviation of its noise, relative."""
TILT, BENT, NOISE_M, RANGE_M = 0.02, 1e-4, 0.015, 100.0
"""Of its rings: largest slope, and curvature (1/px); its noise and its range."""


def structured_light(rgbd: RGBD, rng: np.random.Generator) -> RGBD:
    """Noise and steps of inverse depth, shadows next to edges, holes, a limited range, depth shifted against colour."""
    w = inverse_depth(rgbd.depth)
    far, middle = rgbd.far, _median(w)
    w = _shift(w, rng)
    w = _add_noise(w, middle * _draw_log_uniform(rng, STRUCTURED_NOISE), rng.uniform(0.5, 1.5), rng)
    step = np.float32(middle * _draw_log_uniform(rng, STRUCTURED_STEP))
    w = np.where(w > 0, np.maximum(np.rint(w / step), 1) * step, 0).astype(np.float32)
    depth = np.where(far, np.inf, depth_from_inverse(w)).astype(np.float32)
    depth[_occlusion_band(w, int(rng.integers(*SHADOW)), bool(rng.random() < 0.5))] = 0
    if rng.random() < OUT_OF_REACH:
        depth[far | (w < np.quantile(w, rng.uniform(0.05, 0.2)))] = 0
    return _replace_depth(rgbd, add_depth_holes(depth, rng))


def stereo_matcher(rgbd: RGBD, rng: np.random.Generator) -> RGBD:
    """Fat foregrounds, smooth noise, a border strip without depth."""
    w = inverse_depth(rgbd.depth)
    far, middle = rgbd.far, _median(w)
    reach = 2 * int(rng.integers(*FATTENING)) + 1
    w = np.asarray(cv2.dilate(w, np.ones((reach, reach), np.uint8)), np.float32)
    w = _add_noise(w, middle * _draw_log_uniform(rng, MATCHER_NOISE), rng.uniform(*MATCHER_GRAIN), rng)
    depth = np.where(far & (w < 0.05 * middle), np.inf, depth_from_inverse(w)).astype(np.float32)
    strip = int(rng.uniform(0, 0.1) * depth.shape[1])
    depth[:, :strip] = 0
    return _replace_depth(rgbd, depth)


def phone(rgbd: RGBD, rng: np.random.Generator) -> RGBD:
    """A small, smooth map, in which edges are mixed of their two sides, enlarged as a recording's is; no range, no holes."""
    by = MAP_PX / max(rgbd.depth.shape)
    far = np.float32(RANGE_M)
    metres = fill_with_nearest(np.minimum(rgbd.depth, far), rgbd.depth > 0)
    height, width = rgbd.depth.shape
    small = cv2.resize(metres, (round(by * width), round(by * height)), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), rng.uniform(*BLURRED_PX))
    noise = cv2.GaussianBlur(rng.standard_normal(small.shape, np.float32), (0, 0), 3)
    small = np.asarray(small * (1 + noise * np.float32(UNEVEN / noise.std())), np.float32)
    return dataclasses.replace(rgbd, depth=upsample_depth(small, rgbd.color))


def time_of_flight(rgbd: RGBD, rng: np.random.Generator) -> RGBD:
    """Noise that is a share of the distance, mixed pixels at edges, holes, no depth of what is far."""
    share = np.float32(_draw_log_uniform(rng, FLIGHT_NOISE))
    noise = cv2.GaussianBlur(rng.standard_normal(rgbd.depth.shape, np.float32), (0, 0), rng.uniform(*FLIGHT_GRAIN))
    depth = add_flying_pixels(np.where(rgbd.far, 0, rgbd.depth), rng)
    return _replace_depth(rgbd, add_depth_holes(depth * (1 + share / noise.std() * noise), rng))


def scanning_lidar(rgbd: RGBD, rng: np.random.Generator) -> RGBD:
    """Depth in the points of tilted, curved rings alone, of every second one none in the upper part of the picture."""
    height, width = rgbd.depth.shape
    rings, points = (rng.uniform(*each) * width / 640 for each in (RINGS, POINTS))
    top = 0.0 if rng.random() < 0.5 else rng.uniform(0.2, 0.45) * height
    row, column = np.meshgrid(np.arange(top, height, rings), np.arange(0, width, points), indexing="ij")
    aside, slope, bent = column - width / 2, rng.uniform(-TILT, TILT), rng.uniform(0, BENT)
    row = row + slope * aside + bent * aside**2 * (row / height - 0.5)
    y, x = np.rint(row).astype(int), np.rint(column).astype(int)
    hit = (y >= 0) & (y < height) & (x < width) & (rng.random(y.shape) > LOST)
    y, x = y[hit], x[hit]
    metres = rgbd.depth[y, x] + rng.normal(0, NOISE_M, y.shape).astype(np.float32)
    there = (rgbd.depth[y, x] > 0) & (metres > NOISE_M) & (metres < RANGE_M)
    depth = np.zeros_like(rgbd.depth)
    depth[y[there], x[there]] = metres[there]
    return dataclasses.replace(rgbd, depth=depth)


def add_photo_noise(color: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Colours (H x W x 3) with the noise and the JPEG blocks of a small camera."""
    noise = rng.normal(0, rng.uniform(0, 5), color.shape).astype(np.float32)
    noisy = np.clip(color + noise, 0, 255).astype(np.uint8)
    code = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(60, 97))])[1]
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), np.uint8)


def _replace_depth(rgbd: RGBD, depth: Float32Array) -> RGBD:
    """The frame with that depth; as it was where hardly any depth would be left."""
    enough = ((depth > 0) & np.isfinite(depth)).mean() > 0.2
    return dataclasses.replace(rgbd, depth=depth) if enough else rgbd


def _median(w: Float32Array) -> float:
    return float(np.median(w[w > 0])) if (w > 0).any() else 1.0


def _draw_log_uniform(rng: np.random.Generator, span: tuple[float, float]) -> float:
    """Log-uniform."""
    return float(np.exp(rng.uniform(*np.log(span))))


def _add_noise(w: Float32Array, sigma: float, grain: float, rng: np.random.Generator) -> Float32Array:
    """Inverse depth with noise of standard deviation sigma (1/m), smooth over `grain` pixels; what is far stays far."""
    smooth = cv2.GaussianBlur(rng.standard_normal(w.shape, np.float32), (0, 0), grain)
    noise = smooth * np.float32(sigma / max(float(smooth.std()), 1e-6))
    return np.where(w > 0, np.maximum(w + noise, 0.02 * np.maximum(w, 1e-6)), 0).astype(np.float32)


def _shift(w: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Moved by up to MISALIGNED pixels."""
    move = np.array([[1, 0, rng.uniform(-1, 1) * MISALIGNED], [0, 1, rng.uniform(-0.5, 0.5) * MISALIGNED]], np.float32)
    size = w.shape[1], w.shape[0]
    moved = cv2.warpAffine(w, move, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def _occlusion_band(w: Float32Array, reach: int, left: bool) -> BoolArray:
    """H x W, True within `reach` pixels behind the left (or right) side of what stands before something."""
    step = np.zeros(w.shape, np.uint8)
    before, after = w[:, :-1], w[:, 1:]
    if left:
        step[:, :-1] = after > before * (1 + EDGE) + 1e-6
    else:
        step[:, 1:] = before > after * (1 + EDGE) + 1e-6
    kernel = np.zeros((3, 2 * reach + 1), np.uint8)
    kernel[:, reach:] = 1
    return np.asarray(cv2.dilate(step, kernel if not left else kernel[:, ::-1]) > 0)
