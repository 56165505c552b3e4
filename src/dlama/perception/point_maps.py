"""A point map whose z is known up to a shift in; the shift and the field of view out.

Networks of this kind (MoGe, Wang et al. 2025) predict x, y and z of every pixel up to an affine change. The shift of z and the
focal length follow from the condition that each point lies on the ray of its pixel.
"""

from __future__ import annotations

import math

import numpy as np

from dlama.errors import DepthError
from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array

SAMPLES = 4096
STEPS = 60
GOLDEN = (math.sqrt(5) - 1) / 2


def fit_points(points: Float32Array, far: BoolArray | None, fov: float | None) -> tuple[float, float]:
    """(the shift of z, horizontal field of view in degrees) of points h x w x 3.

    far: h x w, True where points mean nothing. fov: degrees, where it is known. The shift minimises the distance, in the image
    plane, between points and the rays of their pixels; the best focal length for each shift has a closed form. DepthError where
    no shift puts all points in front.
    """
    height, width = points.shape[:2]
    good = np.ones((height, width), np.bool_) if far is None else ~far
    rows, columns = np.nonzero(good)
    if len(rows) < 3:
        raise DepthError("the network sees nothing but sky in this picture; give depth")
    chosen = np.linspace(0, len(rows) - 1, min(SAMPLES, len(rows))).astype(np.intp)
    rows, columns = rows[chosen], columns[chosen]
    image = np.stack([(columns + 0.5) / width - 0.5, ((rows + 0.5) - height / 2) / width], 1)
    cloud = points[rows, columns].astype(np.float64)
    known = None if fov is None else 0.5 / math.tan(math.radians(fov) / 2)
    shift = best_shift(cloud, image, known)
    focal = known or best_focal(cloud, image, shift)
    return shift, math.degrees(2 * math.atan(0.5 / focal))


def best_shift(cloud: np.ndarray, image: np.ndarray, focal: float | None) -> float:
    """The shift by a search over the nearest point's depth from 1/100 to 100 times the depth range, then golden section."""
    nearest, span = float(cloud[:, 2].min()), float(np.ptp(cloud[:, 2])) or 1.0

    def error(log_depth: float) -> float:
        shift = math.exp(log_depth) * span - nearest
        flat = cloud[:, :2] / (cloud[:, 2:] + shift)
        return float(np.square(flat * (focal or best_focal(cloud, image, shift)) - image).sum())

    grid = np.linspace(math.log(0.01), math.log(100), STEPS)
    place = int(np.argmin([error(one) for one in grid]))
    low, high = grid[max(0, place - 1)], grid[min(STEPS - 1, place + 1)]
    for _ in range(STEPS):
        one, two = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, two) if error(one) < error(two) else (one, high)
    return math.exp((low + high) / 2) * span - nearest


def best_focal(cloud: np.ndarray, image: np.ndarray, shift: float) -> float:
    """The focal length in picture widths, by least squares. DepthError where the points are mirrored or of no extent."""
    flat = cloud[:, :2] / (cloud[:, 2:] + shift)
    spread = float(np.square(flat).sum())
    focal = float((flat * image).sum()) / spread if spread > 0 else 0.0
    if focal <= 0:
        raise DepthError("the estimated points do not lie on the rays of a camera; give depth")
    return focal


def horizontal_fov(camera: Camera) -> float:
    """Degrees across the width of a camera's picture."""
    return math.degrees(2 * math.atan(0.5 * camera.width / camera.fx))
