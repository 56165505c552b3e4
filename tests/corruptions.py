"""A good picture with depth, or frames with poses, in; the same spoilt as people spoil it, and the checks that name it, out.

Used by the tests of the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dlama.geometry.camera import Float64Array
from dlama.geometry.motion.poses import invert_pose
from dlama.geometry.rgbd import RGBD, BoolArray
from dlama.perception.diagnosis.finding import Observed
from dlama.perception.diagnosis.poses import BODY, GL, LEFT_HANDED, Undo, reorder_quaternion

FULL = 65535
MM = 1000.0
Spoil = Callable[[Observed], Observed]


def observed(rgbd: RGBD, mask: BoolArray | None = None) -> Observed:
    """As 16-bit millimetres, 65535 = far."""
    depth = np.where(rgbd.depth > 65.5, np.inf, rgbd.depth.astype(np.float64))
    return Observed(rgbd.color, np.round(depth * MM) / MM, rgbd.camera, mask, MM)


def stored(seen: Observed, values: np.ndarray) -> Observed:
    """The same with these 16-bit numbers in its file (rounded and cut off, far as it is), read as millimetres."""
    finite = np.isfinite(values)
    values = np.where(finite, np.minimum(np.round(np.where(finite, values, 0)), FULL - 1), np.inf)
    return replace(seen, depth=values / MM)


def in_units(per_metre: float) -> Spoil:
    """Depth in other units, read as millimetres."""
    return lambda seen: stored(seen, seen.depth * per_metre)


def read_as(units: float) -> Spoil:
    """Millimetres, and a wrong depth_scale."""
    return lambda seen: replace(seen, depth=seen.depth * MM / units, units=units)


def coded(curve: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """A curve of depth over its largest value (0..1), stretched to 16 bits."""

    def spoil(seen: Observed) -> Observed:
        valid = seen.valid
        share = np.clip(seen.depth[valid] / np.percentile(seen.depth[valid], 99), 0, 1)
        values = np.zeros_like(seen.depth)
        values[valid] = curve(share) * (FULL - 1)
        return stored(seen, values)

    return spoil


def inverse_of(seen: Observed) -> np.ndarray:
    """1/m, 0 = far or missing."""
    w = np.zeros_like(seen.depth)
    w[seen.valid] = 1 / seen.depth[seen.valid]
    return w


def inverse(seen: Observed) -> Observed:
    """Disparity: inverse depth, 0 = far."""
    w = inverse_of(seen)
    return stored(seen, w / w.max() * 50000)


def normalised_inverse(seen: Observed) -> Observed:
    """Inverse depth between its smallest and largest value, as networks for single pictures give it."""
    w = inverse_of(seen)
    lowest = w[seen.valid].min()
    return _top_is_far(seen, np.clip((w - lowest) / (w.max() - lowest), 0, 1))


def normalised(seen: Observed) -> Observed:
    """Depth between its smallest and largest value."""
    valid = seen.valid
    lowest, largest = seen.depth[valid].min(), seen.depth[valid].max()
    share = np.zeros_like(seen.depth)
    share[valid] = (seen.depth[valid] - lowest) / (largest - lowest)
    return _top_is_far(seen, share)


def radial(seen: Observed) -> Observed:
    """Distance along the ray."""
    camera = seen.camera
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    return stored(seen, seen.depth * MM * np.sqrt(1 + x**2 + y[:, None] ** 2))


def flipped(turn: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Depth mirrored or turned."""
    return lambda seen: replace(seen, depth=np.ascontiguousarray(turn(seen.depth)))


def shifted(right: float, down: float) -> Spoil:
    """Depth moved by shares of the width; nothing is known where it came from."""

    def spoil(seen: Observed) -> Observed:
        (h, w), by = seen.depth.shape, (round(down * seen.depth.shape[1]), round(right * seen.depth.shape[1]))
        padded = np.zeros((3 * h, 3 * w))
        padded[h + by[0] : 2 * h + by[0], w + by[1] : 2 * w + by[1]] = seen.depth
        return replace(seen, depth=padded[h : 2 * h, w : 2 * w])

    return spoil


def inverted_mask(seen: Observed) -> Observed:
    """White = keep."""
    return seen if seen.mask is None else replace(seen, mask=~seen.mask)


SPOILT: dict[str, tuple[Spoil, tuple[str, ...]]] = {
    "1/5000 m read as mm": (in_units(5000), ("depth-scale",)),
    "1/10000 m read as mm": (in_units(10000), ("depth-scale",)),
    "1/256 m read as mm": (in_units(256), ("depth-scale",)),
    "mm read as 1/5000 m": (read_as(5000.0), ("depth-scale",)),
    "mm read as metres": (read_as(1.0), ("depth-scale",)),
    "inverse": (inverse, ("inverse-depth",)),
    "normalised inverse": (normalised_inverse, ("inverse-depth", "normalised-depth")),
    "normalised": (normalised, ("normalised-depth",)),
    "gamma 1/2.2": (coded(lambda share: share ** (1 / 2.2)), ("gamma-depth",)),
    "radial": (radial, ("radial-depth",)),
    "mirrored": (flipped(np.fliplr), ("mirrored-depth",)),
    "upside down": (flipped(np.flipud), ("mirrored-depth",)),
    "turned by 180": (flipped(lambda values: values[::-1, ::-1]), ("mirrored-depth",)),
    "shifted right": (shifted(0.06, 0.0), ("shifted-depth",)),
    "shifted left and down": (shifted(-0.03, 0.02), ("shifted-depth",)),
    "inverted mask": (inverted_mask, ("inverted-mask",)),
}
"""How a good input is spoilt -> the function, and which checks name it."""


def _top_is_far(seen: Observed, share: np.ndarray) -> Observed:
    values = np.round(share * FULL)
    return stored(seen, np.where(values == FULL, np.inf, values))


def transposed(pose: Float64Array) -> Float64Array:
    """A pose whose rotation is the other way round."""
    out = pose.copy()
    out[:3, :3] = pose[:3, :3].T
    return out


def scaled(factor: float) -> Undo:
    """Translations in another unit."""
    return lambda pose: np.block([[pose[:3, :3], pose[:3, 3:] * factor], [pose[3:]]])


POSES: dict[str, tuple[Undo, str]] = {
    "opengl": (lambda p: p @ GL, "pose-axes"),
    "robot": (lambda p: p @ BODY, "pose-axes"),
    "world to camera": (invert_pose, "pose-direction"),
    "world to camera, read as opengl": (lambda p: invert_pose(p) @ GL, "pose-direction"),
    "left-handed": (lambda p: LEFT_HANDED @ p @ LEFT_HANDED, "pose-handedness"),
    "transposed": (transposed, "pose-rotation"),
    "quaternion w first": (lambda p: reorder_quaternion(p, (3, 0, 1, 2)), "quaternion-order"),
    "quaternion w last": (lambda p: reorder_quaternion(p, (1, 2, 3, 0)), "quaternion-order"),
    "millimetres": (scaled(1000.0), "pose-scale"),
    "centimetres": (scaled(100.0), "pose-scale"),
    "depth of TUM": (scaled(5.0), "pose-scale"),
}
"""How poses are spoilt -> the function, and the check that names it."""


def moved(frames: tuple[RGBD, ...] | list[RGBD], spoil: Undo) -> list[RGBD]:
    """Frames at spoilt poses."""
    return [
        RGBD(each.color, each.depth, each.camera.at(spoil(np.array(each.camera.world_from_cam)))) for each in frames
    ]


def with_depth(factor: float) -> Callable[[RGBD], RGBD]:
    """The depth of a frame is in another unit."""
    return lambda frame: RGBD(frame.color, frame.depth * np.float32(factor), frame.camera)


FRAMES: dict[str, tuple[Callable[[RGBD], RGBD], str]] = {
    "depth times 5": (with_depth(5.0), "depth by 0.2"),
    "depth over 5": (with_depth(0.2), "depth by 5"),
}
"""How one frame of many is spoilt -> the function, and what mends it."""
