"""Depth and a camera in; whether its unit makes a likely scene, and which unit does, or whether the unit is lost, out.

A camera is carried 0.5 to 2.5 m above the floor or street, ceilings are 2.2 to 3.5 m high, and the nearest objects are about a
metre away. Floors and ceilings are the largest planes that face up and down.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dlama.geometry.camera import Camera
from dlama.geometry.rgbd import BoolArray, Float32Array, is_valid
from dlama.perception.diagnosis.finding import Finding, Observed, certainty
from dlama.perception.planes import TOLERANCE, find_planes, plane_normal

UNITS = {1.0: "metres", 1000.0: "millimetres", 5000.0: "1/5000 m (TUM)", 256.0: "1/256 m (KITTI)", 10000.0: "1/10000 m",
         100.0: "centimetres"}  # fmt: skip
"""Values per metre -> what they are called: the usual ones."""
FLOOR = (1.25, 0.35)
"""Height of the camera above the floor: typical metres, and standard deviation of its logarithm."""
ROOM = (2.8, 0.15)
"""Height of rooms."""
NEAREST = (1.4, 0.45)
"""2nd percentile of depth."""
MIDDLE = (3.2, 0.8)
"""Median depth."""
UNLIKELY = 2.9
"""Least unlikeliness of a unit that is doubted; typical scenes have 0 to 2.7."""
FULL = 65535
RARE = 0.004
"""Largest share of pixels at the maximum of depth that was stretched to 0..FULL: more are a code, far, or a clip."""
ROTATED_BITS = "its numbers are multiples of 8, as SUN RGB-D and SUN3D store millimetres (bits rotated by three)"
UNROTATE = "give `depth_scale=8000`, or, where something is beyond 8.19 m, save (d >> 3) | (d << 13) of 16 bits"


class Extent(NamedTuple):
    """How large a scene is as it was read, metres."""

    nearest: float
    middle: float
    floor: float | None
    """Height of the camera above it."""
    ceiling: float | None
    """Its height above the camera."""


def check_depth_unit(seen: Observed) -> list[Finding]:
    """Reports which of the usual units depth is in, where the given one makes no likely scene."""
    extent, units = measure_extent(seen), seen.units or 1.0
    if extent is None:
        return []
    odds = {unit: unlikeliness(extent, units / unit) for unit in UNITS if unit != units}
    as_read, best = unlikeliness(extent, 1.0), min(odds, key=lambda unit: odds[unit])
    margin = as_read - odds[best] - 1.5  # the least gain in log likelihood
    if as_read < UNLIKELY or margin < 0:
        return []
    factor = units / best
    if extent.floor is not None:
        shows = f"ground {extent.floor * factor:.3g} m below the camera, {extent.floor:.3g} m as read"
    else:
        shows = f"half of it within {extent.middle * factor:.3g} m, {extent.middle:.3g} m as read"
    what = f"{seen.names[1]}: values look like {UNITS[best]} ({shows})"
    confidence = certainty(margin, 2.0)
    if seen.units is None:
        return [Finding("depth-scale", "fault", confidence, what, "check the unit of depth")]
    mend = f"give `depth_scale={best:g}`" + ", or 1000 of a close-range scanner" * (units == 1 and 1 < best != 1000)
    if cut_off := share_cut_off(seen):
        what += f"; they end at {FULL}, which {cut_off:.1%} have"
        mend += f", or {FULL} over the metres at which depth was cut off (10 m: `depth_scale={FULL / 10:g}`)"
        confidence = min(confidence, 0.65)  # it may have been stretched from any range
    elif units == 1000 and 0.1 <= extent.middle <= 1:
        mend += ", unless the scene is that near, as a close-range camera's"
        confidence = min(confidence, 0.65)
    return [Finding("depth-scale", "fault", confidence, what, mend)]


def share_cut_off(seen: Observed) -> float:
    """Share of the pixels with depth that are at FULL, where the others reach up to it, so that depth was cut off; else 0."""
    known, far = seen.valid, np.isposinf(seen.depth)
    reaches = known.any() and seen.depth[known].max() * (seen.units or 1.0) / FULL
    return float(far.sum() / (known | far).sum()) if 0.99 <= reaches <= 1 else 0.0


def check_value_range(seen: Observed) -> list[Finding]:
    """Reports 16-bit values that fill 0..65535 exactly, as normalising leaves them: they begin at the camera, or make no likely
    scene (floats of 0..1 are refused when they are read)."""
    if seen.units in (None, 1.0) or not fills_16_bits(seen.depth, seen.units):
        return []
    extent = measure_extent(seen)
    if extent is None:
        return []
    if not begins_at_camera(seen.depth) and unlikeliness(extent, 1.0) < UNLIKELY:
        return []
    read, typical = (extent.middle, MIDDLE[0]) if extent.floor is None else (extent.floor, FLOOR[0])
    scale = seen.units * read / typical
    what = f"{seen.names[1]}: values span 0..{FULL} exactly, as normalised depth does; its unit is lost"
    mend = f"save metres; depth_scale={scale:.3g} would make this a usual scene, a guess ({FULL / scale:.2g} m at most)"
    return [Finding("normalised-depth", "fault", 0.85, what, mend)]


def fills_16_bits(depth: np.ndarray, units: float) -> bool:
    """Whether depth (H x W metres) fills 0..FULL of the file's numbers, `units` a metre, as normalising leaves it."""
    far = np.count_nonzero(np.isposinf(depth))
    if not 0 < far <= RARE * depth.size:
        return False
    known = is_valid(depth)
    if far > RARE * (np.count_nonzero(known) + far):
        return False
    share = depth[known] * units / FULL
    return bool(share.min() <= 0.008 and 0.8 <= share.max() <= 1)


def check_rotated_bits(seen: Observed) -> list[Finding]:
    """Reports millimetres whose bits were rotated, as SUN RGB-D and SUN3D store them."""
    found = Finding("rotated-depth", "fault", 0.95, f"{seen.names[1]}: {ROTATED_BITS}", UNROTATE)
    return [found] if has_rotated_bits(seen.depth, seen.units) else []


def has_rotated_bits(depth: np.ndarray, units: float | None) -> bool:
    """Whether the file's 16-bit numbers, read as millimetres (`units` is 1000), are those rotated by three bits."""
    known = depth[is_valid(depth)]
    if units != 1000 or not known.size:
        return False
    codes = np.rint(known[:: max(1, known.size // 2**16)] * 1000).astype(np.int64)
    numbers = np.unique(codes // 8)
    # many multiples of 8 (beyond 8.19 m 1 more; of others a quarter is either), but not all of 16
    return bool((codes % 8 < 2).mean() >= 0.95 and len(numbers) >= 64 and 0.25 < (numbers % 2).mean() < 0.75)


def begins_at_camera(depth: np.ndarray) -> bool:
    """Whether some depth (H x W metres) is nearer than 0.1 m, which hardly a camera measures: even a likely scene that begins
    there was stretched."""
    return bool(depth[is_valid(depth)].min() <= 0.1)


def find_far_plane(depth: np.ndarray) -> tuple[float, float] | None:
    """Metres at which a renderer put all that it does not show, and the share (0..1) of the pixels with depth (H x W metres) that
    are exactly there; None: all seems measured. Of 240 depth maps of sensors, scanners and renderers without such a plane none
    has a thousandth of its pixels at one depth twice as far as all else, but for level ground seen by a level camera: one row."""
    known = depth[is_valid(depth)]
    farthest = known.max(initial=0)
    rest = known[known < farthest]
    share = 1 - rest.size / max(1, known.size)
    if farthest < 100 or share < 0.001 or not rest.size or farthest < 2 * rest.max():
        return None
    if min(len(np.unique(places)) for places in np.nonzero(depth == farthest)) == 1:
        return None
    return float(farthest), share


def check_far_plane(seen: Observed) -> list[Finding]:
    """Reports sky that was written at the far plane of a renderer's camera."""
    found = find_far_plane(seen.depth)
    if found is None:
        return []
    what = f"{seen.names[1]}: {found[1]:.1%} of the depth is exactly {found[0]:.9g} m, far behind all else, as sky is rendered"
    return [Finding("far-plane", "fault", 0.95, what, f"give `far={found[0]:.9g}`")]


def measure_extent(seen: Observed) -> Extent | None:
    """Distances in metres as read; None where fewer than 50 pixels have depth."""
    valid = seen.valid
    if valid.sum() < 50:
        return None
    nearest, middle = np.percentile(seen.depth[valid], (2, 50))
    step = max(1, max(valid.shape) // 200)  # planes are searched in about so many pixels
    known = valid[::step, ::step]
    w = np.where(known, 1 / np.where(known, seen.depth[::step, ::step], 1), 0).astype(np.float32)
    floor, ceiling = floor_and_ceiling(w, known, seen.camera, step)
    return Extent(float(nearest), float(middle), floor, ceiling)


def floor_and_ceiling(
    w: Float32Array, known: BoolArray, camera: Camera, step: int
) -> tuple[float | None, float | None]:
    """Metres to the farthest plane below and to the nearest above; `w` is 1/m at every `step`-th pixel of the camera's."""
    rows, columns = np.nonzero(known)
    u, v = columns * step + 0.5, rows * step + 0.5
    below: list[float] = []
    above: list[float] = []
    for a, b, c in find_planes(w, known, 0):
        a, b, c = a / step, b / step, c + (a + b) * 0.5 * (1 - 1 / step)
        normal = plane_normal(np.array([a, b, c]), camera)
        far = 1 / max(float(np.linalg.norm(normal)), 1e-9)
        on_plane = np.abs(a * u + b * v + c - w[known]) < TOLERANCE * w[known]
        if on_plane.mean() > 0.06 and abs(normal[1]) * far > 0.8:  # normals within 37 degrees of the vertical
            (below if normal[1] > 0 else above).append(far)
    return max(below, default=None), min(above, default=None)


def unlikeliness(extent: Extent, factor: float) -> float:
    """Negative log likelihood of a scene `factor` times as large as read (0 = typical)."""
    lengths = [(extent.nearest, NEAREST), (extent.middle, MIDDLE)]
    if extent.floor is not None:
        lengths.append((extent.floor, FLOOR))
        if extent.ceiling is not None:
            lengths.append((extent.floor + extent.ceiling, ROOM))
    off = [np.log(max(length * factor, 1e-9) / typical) / spread for length, (typical, spread) in lengths]
    return float(sum(np.sqrt(1 + each**2) - 1 for each in off))  # heavier tails than a Gaussian's
