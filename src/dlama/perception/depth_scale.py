"""Estimated depth up to scale and known metric values in; the scale (and shift) to metres out.

Relative inverse depth is known up to a factor and a shift, 1 / z = factor * value + shift; all else up to a factor, z = factor
* value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dlama.arguments import format_value, is_finite
from dlama.errors import DepthError, InputError, warn
from dlama.geometry.camera import Camera
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.perception.planes import ESTIMATED_NOISE, NOISE_FACTOR, find_planes, fit_plane, plane_normal

ASSUMED_MEDIAN_M = 3.0
"""Median depth of a picture of which nothing is known in metres."""
FARTHEST_M = 1000.0
"""Depth beyond this is far."""
RULES = {
    "metric model": "scale as the network says",
    "photo": "scale as the photo says",
    "metres_at": "scale from `metres_at`",
    "camera_height": "scale from `camera_height`",
    "assumed": "scale assumed",
}
"""`Scale.rule` -> where the scale comes from, in words, parameters by their names."""


def describe_depth_source(estimate: Mapping[str, Any]) -> str:
    """In words, of an RGBD's `estimate`: the network, or the photo that carries its depth."""
    if "file" in estimate:
        return f"of {estimate['file']}, as a network gave it"
    own = estimate.get("source")
    return f"of the photo ({own})" if own else f"estimated by {estimate['estimator']}"


@dataclass(frozen=True)
class Scale:
    """The scale to metres: 1 / z = factor * value + shift of inverse depth, z = factor * value of depth."""

    inverse: bool
    factor: float = 1.0
    shift: float = 0.0
    """1/m; only of inverse depth."""
    rule: str = "metric model"
    """A key of RULES."""
    about: Mapping[str, Any] = field(default_factory=dict)
    """What it follows from, JSON-ready."""

    def metres(self, values: Float32Array, far: BoolArray | None) -> Float32Array:
        """Depth in metres, inf where far: where `far` says so, or beyond FARTHEST_M."""
        if self.inverse:
            inverse = values * np.float32(self.factor) + np.float32(self.shift)
            known = inverse > 1 / FARTHEST_M
            depth = np.divide(1, inverse, out=np.full_like(values, np.inf), where=known)
        else:
            depth = values if self.factor == 1 else values * np.float32(self.factor)
            depth = np.where(depth < FARTHEST_M, depth, np.float32(np.inf))
        return depth if far is None else np.where(far, np.float32(np.inf), depth)

    @property
    def notes(self) -> dict[str, Any]:
        """For meta.json."""
        form = "1 / metres = factor * inverse depth + shift" if self.inverse else "metres = factor * depth"
        numbers = {"factor": self.factor} | ({"shift": self.shift} if self.inverse else {})
        return {"rule": self.rule, "form": form, **numbers, **self.about}


def estimate_scale(
    values: Float32Array,
    inverse: bool,
    metric: bool,
    camera: Camera,
    metres_at: Sequence[tuple[float, float, float]] = (),
    camera_height: float | None = None,
) -> Scale:
    """The scale of estimated depth, or inverse depth, H x W.

    metric: it is in metres (or 1/m), and stays so where nothing else is known. metres_at: (x, y, depth in metres) of pixels, x
    right, y down. camera_height: metres of the camera above the ground; at most one of the two (`check_known`). InputError where
    they contradict the picture, DepthError where nothing has depth.
    """
    usable = (values > 0) & np.isfinite(values)
    if not usable.any():
        raise DepthError("no pixel has an estimated depth; give depth")
    if len(metres_at):
        return fit_scale_to_points(values, inverse, inverse and not metric, metres_at)
    if camera_height is not None:
        return fit_scale_to_ground(values, inverse, camera, camera_height)
    if metric:
        return Scale(inverse)
    median = float(np.median(values[usable]))
    factor = 1 / (median * ASSUMED_MEDIAN_M) if inverse else ASSUMED_MEDIAN_M / median
    return Scale(inverse, factor, 0.0, "assumed", {"assumed_median_m": ASSUMED_MEDIAN_M})


def check_known(
    metres_at: Sequence[tuple[float, float, float]], camera_height: float | None, hw: tuple[int, ...] | None
) -> None:
    """Raise InputError for contradictions, values that are no distances, and pixels outside a picture of that size."""
    if len(metres_at) and camera_height is not None:
        raise InputError("`metres_at` and `camera_height` contradict each other; give one of them")
    if camera_height is not None and not (is_finite(camera_height) and camera_height > 0):
        raise InputError(f"`camera_height` is {format_value(camera_height)} m; a number above 0 is expected")
    depths: dict[tuple[int, int], float] = {}
    for x, y, metres in metres_at:
        _check_point(x, y, metres, hw)
        before = depths.setdefault((int(x), int(y)), metres)
        if before != metres:
            raise InputError(
                f"`metres_at` {x:g},{y:g}: is {before:g} m and {metres:g} m; one depth of a pixel is expected"
            )


def _check_point(x: float, y: float, metres: float, hw: tuple[int, ...] | None) -> None:
    """One of `metres_at`."""
    at = f"`metres_at` {x:g},{y:g}={metres:g}"
    if hw is not None and not (0 <= x < hw[1] and 0 <= y < hw[0]):
        raise InputError(
            f"{at}: lies outside the {hw[1]}x{hw[0]} picture; x of 0 to {hw[1] - 1}, y of 0 to {hw[0] - 1} are expected"
        )
    if not (metres > 0 and math.isfinite(metres)):
        raise InputError(f"{at}: {metres:g} m is no distance; a number above 0 is expected")


def fit_scale_to_points(
    values: Float32Array, inverse: bool, shifted: bool, metres_at: Sequence[tuple[float, float, float]]
) -> Scale:
    """Least squares over known pixels, relative to each distance: the factor, and with enough spread a shift."""
    found = np.array([median_value_at(values, x, y, metres) for x, y, metres in metres_at])
    metres = np.array([point[2] for point in metres_at], np.float64)
    target = 1 / metres if inverse else metres
    shifted = shifted and found.max() > 1.1 * found.min()  # else a shift says nothing
    design = np.stack([found, np.ones_like(found)] if shifted else [found], 1) / target[:, None]
    solved = np.linalg.lstsq(design, np.ones_like(target), rcond=None)[0]
    factor, shift = float(solved[0]), float(solved[1]) if shifted else 0.0
    if factor <= 0:
        raise InputError(
            "`metres_at` contradicts the picture: what is given as nearer was estimated to be farther; look the pixels up again"
        )
    fitted = factor * found + shift
    fitted = 1 / np.maximum(fitted, 1 / FARTHEST_M) if inverse else fitted
    off = np.abs(fitted / np.minimum(metres, FARTHEST_M) - 1)
    if off.max() > 1 / 3:  # estimates err by less
        (x, y, known), got = metres_at[int(off.argmax())], fitted[off.argmax()]
        warn(
            f"`metres_at` {x:g},{y:g}={known:g}: the depth fitted there is {got:.3g} m: it contradicts the other known depths, "
            "or the estimate; look the pixel up again"
        )
    lost = float((factor * values + shift <= 1 / FARTHEST_M).mean()) if shift < 0 else 0.0
    if lost > 0.5:
        warn(
            f"`metres_at` puts {lost:.0%} of the picture beyond {FARTHEST_M:g} m, where it counts as sky: if it is none, the "
            "known depths contradict the estimate; look the pixels up again, or give one alone"
        )
    points = [
        {"x": float(x), "y": float(y), "metres": float(given_m), "fitted_metres": round(float(got), 4)}
        for (x, y, given_m), got in zip(metres_at, fitted)
    ]
    return Scale(inverse, factor, shift, "metres_at", {"points": points, "shift_fitted": bool(shifted)})


def median_value_at(values: Float32Array, x: float, y: float, metres: float) -> float:
    """The value at a pixel, a median over those up to 2 px away. InputError: it is far."""
    row, column = int(y), int(x)
    patch = values[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3]
    patch = patch[(patch > 0) & np.isfinite(patch)]
    if not patch.size:
        raise InputError(
            f"`metres_at` {x:g},{y:g}={metres:g}: is sky by the estimated depth; give a pixel on a surface"
        )
    return float(np.median(patch))


def fit_scale_to_ground(values: Float32Array, inverse: bool, camera: Camera, camera_height: float) -> Scale:
    """The factor that puts the camera at a given height (m) above the largest ground-like plane. InputError where there is
    none."""
    w = values if inverse else inverse_depth(values)
    plane = ground_plane(w, camera)
    if plane is None:
        raise InputError(
            "`camera_height` is given and no ground is seen: no plane of the estimated depth lies level; give `metres_at`"
        )
    if camera_height > 50:  # m
        warn(
            f"`camera_height` is {camera_height:g} m above the ground: right for a picture from the air; if these are "
            f"centimetres, give `camera_height={camera_height / 100:g}`"
        )
    per_meter = camera_height * float(np.linalg.norm(plane))  # 1 / |plane| is the camera's distance from it
    about = {
        "camera_height_m": camera_height,
        "ground_tilt_deg": round(math.degrees(math.acos(plane[1] / float(np.linalg.norm(plane)))), 2),
    }
    return Scale(inverse, 1 / per_meter if inverse else per_meter, 0.0, "camera_height", about)


def ground_plane(w: Float32Array, camera: Camera) -> np.ndarray | None:
    """n / d of the ground n . X = d (camera axes) from inverse depth H x W: the level plane with most pixels in the lower
    half of the picture; None where there is none."""
    low = np.zeros(w.shape, np.bool_)
    low[w.shape[0] // 2 :] = True
    surface = low & (w > 0)
    if not surface.any():
        return None
    noise = ESTIMATED_NOISE * float(np.median(w[surface]))
    rows, columns = np.nonzero(surface[::4, ::4])
    u, v = 4 * columns + 0.5, 4 * rows + 0.5
    value = w[::4, ::4][rows, columns].astype(np.float64)
    best, most = None, 0
    for plane in find_planes(w, surface, seed=0, noise=noise):
        residual = np.abs(plane[0] * u + plane[1] * v + plane[2] - value)
        near = np.maximum(0.05 * value, NOISE_FACTOR * noise)
        inliers = residual < near
        if inliers.sum() < 12:
            continue
        normal = plane_normal(fit_plane(u[inliers], v[inliers], value[inliers], near[inliers]), camera)
        if normal[1] > math.cos(math.radians(40)) * np.linalg.norm(normal) and inliers.sum() > most:
            best, most = normal, int(inliers.sum())
    return best
