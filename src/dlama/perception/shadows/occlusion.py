"""An object's points over its supporting surface in; the ambient occlusion of the surface out.

The light of an overcast sky comes from all directions above, weighted by the cosine law; a surface point loses the share that
the object covers. The object's points are projected on the surface along directions of equal light. Its hidden side is assumed
half the object's width behind the visible one.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.holes import square
from dlama.geometry.rgbd import Float32Array
from dlama.perception.shadows.crop import Crop
from dlama.perception.shadows.ground import StandingObject, light_offsets, surface_axes

DIRECTIONS = 64
"""Number of directions, each with the same share of the sky's light."""
POINTS = 2000
"""Most points of the object in each of LAYERS of its thickness."""
THICK, LAYERS = 0.5, 5
"""Assumed thickness of an object, in its widths."""
COARSE = 2
"""Pixels of the crop (`crop.SIDE`) in one of the map."""


def ambient_occlusion(caster: StandingObject, camera: Camera, crop: Crop) -> Float32Array:
    """H x W occluded share of the sky, 0..1, on the supporting plane; 0 outside the crop round the object."""
    wide, high = (-(-side // COARSE) for side in crop.size)
    total = np.zeros((high, wide), np.float32)
    caster, scale = thicken(caster), crop.scale / COARSE
    for over in sky_directions(caster.up):
        points = caster.base + caster.rise[:, None] * over
        front = points[points[:, 2] > 1e-3]
        u = (front[:, 0] / front[:, 2] * camera.fx + camera.cx - crop.columns.start) * scale
        v = (front[:, 1] / front[:, 2] * camera.fy + camera.cy - crop.rows.start) * scale
        seen = (u >= 0) & (u < wide) & (v >= 0) & (v < high)
        shape = np.zeros((high, wide), np.uint8)
        shape[v[seen].astype(int), u[seen].astype(int)] = 1
        total += cv2.morphologyEx(shape, cv2.MORPH_CLOSE, square(5))
    smooth = cv2.GaussianBlur(total / DIRECTIONS, (0, 0), 1.5)  # against steps between directions
    return crop.place(np.asarray(smooth, np.float32), camera.hw)


def thicken(caster: StandingObject) -> StandingObject:
    """The object with copies of its points behind the visible ones, along the surface, over half of its width."""
    if not len(caster.base):
        return caster
    keep = slice(None, None, max(1, len(caster.base) // POINTS))
    across, behind = surface_axes(caster.up)
    place = caster.base @ across
    width = float(np.quantile(place, 0.98) - np.quantile(place, 0.02))
    layers = [caster.base[keep] + back * behind for back in np.linspace(0, THICK * width, LAYERS)]
    return StandingObject(np.concatenate(layers), np.tile(caster.rise[keep], LAYERS), caster.up)


def sky_directions(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """DIRECTIONS x 3: metres over the surface for each metre of height, in camera axes; as dense as the cosine to `up`, the
    golden angle from one to the next."""
    number = np.arange(DIRECTIONS)
    sine2, turn = (number + 0.5) / DIRECTIONS, 2.39996 * number
    return light_offsets(up, np.sqrt(sine2 / (1 - sine2)), turn)
