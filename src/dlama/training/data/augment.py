"""A clean RGB-D frame in -> one with sensor faults out; a sample in -> the sample mirrored, or with other light, out.

Faults are put into the source frame before it is rendered, so that holes and edges are those of run time. Strengths are drawn for
each frame from the ranges of real sensors; a third of the frames stays clean.
"""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np

from dlama.geometry.rgbd import RGBD, Float32Array, is_valid

CLEAN = 1 / 3
"""Share of frames without faults."""
NOISE = (0.0005, 0.01)
"""Standard deviation of inverse depth, relative, smooth over NOISE_GRAIN pixels: stereo and Kinect at 0.5 to 5 m."""
NOISE_GRAIN = 3
LEVELS = (200, 4000)
"""Steps of inverse depth that a sensor resolves, up to the nearest pixel: disparities of 1/8 px and coarser."""
FLYING = (0.1, 0.9)
"""Share of the pixels at edges whose depth is a mix of both sides."""
EDGE = 0.1
"""Relative step in inverse depth that is an edge."""
MOST_SENSOR_HOLES = 6
"""Ellipses without depth in a frame."""
HOLE_SIDE = (0.01, 0.1)
"""Of a sensor hole, as a share of the picture's width."""
GAIN, GAMMA, TINT, CONTRAST = 0.25, 0.3, 0.06, 0.15
"""Half the range of a picture's brightness, gamma (log2), of one channel's gain, and of contrast."""


def add_depth_faults(rgbd: RGBD, rng: np.random.Generator, sensor_holes: bool = False) -> RGBD:
    """The frame with flying pixels, noise and quantisation of depth, each with probability 1/2; with `sensor_holes` also some
    missing depth (0)."""
    depth, clean = rgbd.depth, rng.random() < CLEAN
    if not clean:
        for fault in (add_flying_pixels, add_depth_noise, quantise_depth):
            if rng.random() < 0.5:
                depth = fault(depth, rng)
    if sensor_holes:
        depth = add_depth_holes(depth, rng)
    return dataclasses.replace(rgbd, depth=depth)


def add_depth_noise(depth: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Depth (H x W m) with smooth noise, relative to inverse depth; far and missing stay."""
    strength = float(np.exp(rng.uniform(*np.log(NOISE))))
    white = rng.standard_normal(depth.shape, np.float32)
    smooth = cv2.GaussianBlur(white, (0, 0), NOISE_GRAIN / 2)
    factor = 1 + strength * smooth / max(float(smooth.std()), 1e-6)
    return (depth / np.maximum(factor, 0.5)).astype(np.float32)


def quantise_depth(depth: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Depth (H x W m) whose inverse has equal steps, like a disparity sensor's; what is below half a step becomes far."""
    near = depth[is_valid(depth)]
    if not near.size:
        return depth
    step = 1 / (float(near.min()) * float(np.exp(rng.uniform(*np.log(LEVELS)))))
    out = depth.copy()
    valid = is_valid(depth)
    steps = np.rint(1 / (depth[valid] * np.float32(step)))
    with np.errstate(divide="ignore"):
        out[valid] = np.float32(1) / (steps * np.float32(step))
    return out


def add_flying_pixels(depth: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Depth (H x W m) with flying pixels: some pixels next to an edge have a depth between both sides."""
    finite = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    valid = finite > 0
    kernel = np.ones((3, 3), np.uint8)
    farthest = cv2.dilate(finite, kernel)
    nearest = cv2.erode(np.where(valid, finite, np.float32(1e9)), kernel)
    edge = valid & (farthest > nearest * (1 + EDGE)) & (rng.random(depth.shape) < rng.uniform(*FLYING) / 2)
    share = rng.random(depth.shape, np.float32)
    return np.where(edge, nearest + share * (farthest - nearest), depth).astype(np.float32)


def add_depth_holes(depth: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Depth (H x W m) that is missing (0) in 1 to MOST_SENSOR_HOLES random ellipses."""
    missing = np.zeros(depth.shape, np.uint8)
    width = depth.shape[1]
    for _ in range(int(rng.integers(1, MOST_SENSOR_HOLES + 1))):
        at = int(rng.integers(width)), int(rng.integers(depth.shape[0]))
        axes = max(1, round(width * rng.uniform(*HOLE_SIDE))), max(1, round(width * rng.uniform(*HOLE_SIDE)))
        cv2.ellipse(missing, at, axes, float(rng.uniform(0, 180)), 0, 360, 1, -1)
    return np.where(missing > 0, np.float32(0), depth)


def mirror_at_random(sample: dict[str, np.ndarray], rng: np.random.Generator, views: int) -> dict[str, np.ndarray]:
    """The sample, mirrored with probability 1/2; the two views of a mirrored pair change places, or left would be right."""
    if rng.random() < 0.5:
        return sample
    flipped = {key: planes[..., ::-1] for key, planes in sample.items()}
    if views == 2:
        flipped = {key: _swap_views(planes) for key, planes in flipped.items()}
    return {key: np.ascontiguousarray(planes) for key, planes in flipped.items()}


def change_light(sample: dict[str, np.ndarray], rng: np.random.Generator, colors: int) -> dict[str, np.ndarray]:
    """The sample with another brightness, contrast, gamma and tint of its `colors` colour planes, in input and target alike; the
    hole stays 0."""
    gain = (1 + rng.uniform(-GAIN, GAIN)) * (1 + rng.uniform(-TINT, TINT, 3))
    power, contrast = 2.0 ** rng.uniform(-GAMMA, GAMMA), 1 + rng.uniform(-CONTRAST, CONTRAST)
    levels = np.linspace(0, 1, 256)[None] ** power * gain[:, None]
    table = np.clip((levels - 0.5) * contrast + 0.5, 0, 1).astype(np.float32)  # 3 x 256
    made, hole = dict(sample), sample["mask"].repeat(colors // len(sample["mask"]), 0)
    for key in ("input", "target"):
        planes = made[key].copy()
        codes = np.rint(planes[:colors] * 255).astype(np.uint8)
        for number in range(colors):
            planes[number] = table[number % 3][codes[number]]
        if key == "input":
            planes[:colors] *= 1 - hole
        made[key] = planes
    return made


def _swap_views(planes: np.ndarray) -> np.ndarray:
    """Left and right exchanged: of the 6 colour planes and of the one or two mask planes behind them."""
    color, masks = (planes[:6], planes[6:]) if len(planes) >= 6 else (planes[:0], planes)
    return np.concatenate([color[3:], color[:3], masks[::-1]])
