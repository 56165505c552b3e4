"""Stored depth and a camera in; its coding out: linear, inverse, gamma-coded, normalised with an offset, or along the ray.

Floors, walls and fronts are planes, and a plane is affine in inverse depth over pixels; under a wrong coding it bends. Planes
are fitted to many square parts of the picture under each coding; the smallest residuals win. Residuals are relative errors of
the stored value, whose noise does not depend on the coding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.depth_scale import check_depth_unit
from dlama.perception.diagnosis.finding import Finding, Observed, certainty

Floats = NDArray[np.float64]
SIDE = 20
"""Samples across one part."""
PARTS = (2, 3, 4, 6)
"""Parts have the shorter side of the picture divided by these; each overlaps the next by half."""
MOST_ALONG = 48
"""Most parts in a row, evenly spread: strips would have thousands."""
KNOWN_SHARE = 0.8
"""Least share of a part's samples with depth."""
OUTLIERS = 4.0
"""Residuals beyond this multiple of their median are left out of a fit."""
EXACT = 2e-4
"""Relative residuals below this are taken as this (rounding of 16 bits)."""
PLANAR = 0.01
"""A part counts if some code fits it by a plane with a smaller relative residual."""
FEWEST_PARTS = 8
GAMMA = 2.2
OFFSETS = (0.02, 0.05, 0.1, 0.3)
"""Normalised depth: the nearest depth over the range, tried as these."""
LEAST_T = 2.5
"""By how many standard errors a code must fit better than plain depth (parts overlap: a quarter of them count)."""
LEAST_GAIN = 0.035
"""And least gain in the logarithm of the mean residuals."""
DOUBTED = (1.3, 0.012)
"""Both limits where the unit of depth makes no likely scene, and for the codings that never fit plain depth best."""
NEVER_PLAIN = ("inverse", "radial", "gamma")
"""None of 256 good inputs (68 real, 104 streets, 84 worlds) was fitted best by these."""


class Parts(NamedTuple):
    """Samples of square parts of the picture."""

    values: Floats
    """T x N stored values; some other of the part where nothing is known."""
    known: Floats
    """T x N, 1 where a value is known, else 0."""
    ray: Floats
    """T x N, length of the ray with z = 1."""


CODES: dict[str, str] = {
    "linear": "depth",
    "inverse": "inverse depth (or disparity): the larger the value, the nearer",
    "radial": "the distance along the ray, not depth along the optical axis",
    "gamma": "depth coded with a gamma of 1/2.2 (a picture of depth)",
    "ungamma": "depth squeezed by a gamma of 2.2 (a curve for pictures was taken off it)",
    **{f"offset {share:g}": "depth normalised between its nearest and farthest value" for share in OFFSETS},
}
"""Name -> description."""
CHECKS = {"inverse": "inverse-depth", "radial": "radial-depth", "gamma": "gamma-depth", "ungamma": "gamma-depth"}
MENDS = {
    "inverse": "convert it to metres before: a / value, where a is the focal length times the baseline of a disparity",
    "radial": "divide each value by sqrt(1 + ((u - cx) / fx)^2 + ((v - cy) / fy)^2) before",
    "gamma": "save depth anew without a gamma (metres ~ value^2.2), as EXR or 16-bit millimetres",
    "ungamma": "save depth anew without a curve (metres ~ value^(1/2.2)), as EXR or 16-bit millimetres",
}
NORMALISED = "save metres: value * (farthest - nearest) / largest value + nearest"


def check_depth_code(seen: Observed) -> list[Finding]:
    """Reports a coding other than plain depth; nothing where too little of the picture is planar."""
    fits = fit_codes(seen)
    if fits is None:
        return []
    best = min(fits, key=lambda name: float(fits[name].mean()))
    gain, t = advantage(fits["linear"], fits[best])
    if best == "linear" or t < DOUBTED[0] or gain < DOUBTED[1]:
        return []
    least_t, least_gain = DOUBTED if best in NEVER_PLAIN or check_depth_unit(seen) else (LEAST_T, LEAST_GAIN)
    if t < least_t or gain < least_gain:
        return []
    check = CHECKS.get(best, "normalised-depth")
    what = f"{seen.names[1]}: holds {CODES[best]}; planes of the scene are flat so, and bent as depth"
    return [Finding(check, "fault", certainty(t - least_t + 1, 0.8), what, MENDS.get(best, NORMALISED))]


def advantage(plain: Floats, other: Floats) -> tuple[float, float]:
    """Gain of `other` in mean log residual, and the same in standard errors."""
    gain = plain - other
    error = gain.std() / np.sqrt(max(gain.size / 4, 1)) + 1e-6
    return float(gain.mean()), float(gain.mean() / error)


def fit_codes(seen: Observed) -> dict[str, Floats] | None:
    """Logarithm of the relative residuals of each planar part under each code; None where there are too few parts."""
    parts = square_parts(seen.values, seen.camera)
    if len(parts.values) < FEWEST_PARTS:
        return None
    codes = inverse_depths(parts, float(np.percentile(seen.values[seen.valid], 99)))
    first = {name: trimmed_residuals(parts, w, slope) for name, (w, slope) in codes.items()}
    medians = np.stack([np.median(each, 1) for each in first.values()])
    best = np.stack(list(first.values()))[medians.argmin(0), np.arange(len(parts.values))]
    kept = parts.known * (best < OUTLIERS * np.median(best, 1, keepdims=True) + EXACT)
    rms = {name: _rms(residuals(w, slope, kept), kept) for name, (w, slope) in codes.items()}
    planar = np.stack(list(rms.values())).min(0) < PLANAR
    if planar.sum() < FEWEST_PARTS:
        return None
    return {name: np.log(np.maximum(each[planar], EXACT)) for name, each in rms.items()}


def inverse_depths(parts: Parts, largest: float) -> dict[str, tuple[Floats, Floats]]:
    """For each coding: inverse depth up to a factor, and its derivative for a relative change of the value."""
    v = parts.values
    codes = {"linear": (1 / v, 1 / v), "inverse": (v, v), "radial": (parts.ray / v, parts.ray / v)}
    for name, power in (("gamma", GAMMA), ("ungamma", 1 / GAMMA)):
        w = (v / largest) ** -power
        codes[name] = (w, power * w)
    for share in OFFSETS:
        depth = v + share * largest
        codes[f"offset {share:g}"] = (1 / depth, v / depth**2)
    return codes


def square_parts(values: Floats, camera: Camera) -> Parts:
    """The parts with enough known samples."""
    rows, columns = (np.concatenate(each) for each in zip(*(_grid(values.shape, n) for n in PARTS)))
    known = (values > 0) & np.isfinite(values)
    there = known[rows, columns]
    enough = there.mean(1) > KNOWN_SHARE
    rows, columns, there = rows[enough], columns[enough], there[enough]
    found = np.where(known, values, np.nan)[rows, columns]
    found = np.where(there, found, np.nanmedian(found, axis=1, keepdims=True) if len(found) else 1.0)
    x = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    y = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    return Parts(found, there.astype(np.float64), np.sqrt(1 + x[columns] ** 2 + y[rows] ** 2))


def _grid(hw: tuple[int, ...], parts: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (T x N) of the samples of all parts of one size."""
    side = min(hw) // parts
    if side < 2:
        return np.empty((0, SIDE * SIDE), np.intp), np.empty((0, SIDE * SIDE), np.intp)
    within = np.linspace(0, side - 1, SIDE).round().astype(np.intp)
    starts = [np.arange(0, n - side + 1, max(side // 2, 1)) for n in hw]
    spread = (each[np.linspace(0, len(each) - 1, min(len(each), MOST_ALONG)).astype(np.intp)] for each in starts)
    y, x = (each.ravel() for each in np.meshgrid(*spread, indexing="ij"))
    return y[:, None] + np.repeat(within, SIDE), x[:, None] + np.tile(within, SIDE)


def trimmed_residuals(parts: Parts, w: Floats, slope: Floats) -> Floats:
    """T x N relative residuals of a plane in each part, fitted again without outliers."""
    kept = parts.known
    for _ in range(2):
        off = residuals(w, slope, kept)
        kept = parts.known * (off < OUTLIERS * np.median(off, 1, keepdims=True) + 1e-9)
    return residuals(w, slope, kept)


def residuals(w: Floats, slope: Floats, kept: Floats) -> Floats:
    """T x N relative residuals of the stored value from the plane through the `kept` samples (least squares)."""
    across = np.linspace(-1, 1, SIDE)
    design = np.stack([np.ones(SIDE * SIDE), np.repeat(across, SIDE), np.tile(across, SIDE)], 1)
    squares = (design[:, :, None] * design[:, None, :]).reshape(-1, 9)
    weight = kept / slope**2
    normal = (weight @ squares).reshape(-1, 3, 3)
    normal += np.eye(3) * 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None]
    plane = np.linalg.solve(normal, ((weight * w) @ design)[..., None])[..., 0]
    return np.asarray(np.abs((w - plane @ design.T) / slope), np.float64)


def _rms(off: Floats, kept: Floats) -> Floats:
    return np.asarray(np.sqrt((np.minimum(off, 0.1) ** 2 * kept).sum(1) / np.maximum(kept.sum(1), 1)), np.float64)
