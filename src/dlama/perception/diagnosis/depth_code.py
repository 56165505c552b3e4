"""Depth and a camera in; its coding out: linear, inverse, gamma-coded, or along the ray.

Floors, walls and fronts are planes, and a plane is affine in inverse depth over pixels; under a wrong coding it bends. Planes
are fitted to many square parts of the picture under each coding; the smallest residuals win. Residuals are relative errors of
the stored value, whose noise does not depend on the coding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlama.geometry.camera import Camera
from dlama.geometry.projection import ray_lengths
from dlama.perception.diagnosis.finding import Finding, Observed, certainty

Floats = NDArray[np.float64]
SIDE = 20
"""Samples across one part."""
EXACT = 2e-4
"""Relative residuals below this are taken as this (rounding of 16 bits)."""
FEWEST_PARTS = 8
GAMMA = 2.2


class Lead(NamedTuple):
    """How much better a code fits than plain depth."""

    t: float
    """Standard errors (parts overlap: a quarter of them count)."""
    gain: float
    """Mean difference of the logarithms of residuals."""

    def reaches(self, least: Lead) -> bool:
        """Whether both are at least so large."""
        return self.t >= least.t and self.gain >= least.gain


LEAST, CLEAR = Lead(1.3, 0.012), Lead(2.5, 0.035)
"""Least lead that is reported: none of 256 good inputs (68 real, 104 streets, 84 worlds) was fitted best by another code; and the
least one that is warned of when depth is read."""
CODES = {
    "inverse": (
        "inverse-depth",
        "inverse depth (or disparity): the larger the value, the nearer",
        "convert it to metres before: a / value, where a is the focal length times the baseline of a disparity; or give "
        "`inverse_depth`, where a network gave it in no unit",
    ),
    "radial": (
        "radial-depth",
        "the distance along the ray, not depth along the optical axis",
        "`radial_depth` converts it",
    ),
    "planar": (
        "radial-depth",
        "depth along the optical axis, read as the distance along the ray",
        "leave out `radial_depth`",
    ),
    "gamma": (
        "gamma-depth",
        "depth coded with a gamma of 1/2.2 (a picture of depth)",
        "save depth anew without a gamma (metres ~ value^2.2), as EXR or 16-bit millimetres",
    ),
}
"""Coding other than plain depth -> name of the check, what it is, what fixes it; planar: of what was read as radial."""


def check_depth_code(seen: Observed) -> list[Finding]:
    """Reports a coding other than plain depth; nothing where too little of the picture is planar."""
    as_read = "radial" if seen.radial else "planar"
    best, lead = find_best_code(seen.depth, seen.camera, tuple(code for code in CODES if code != as_read))
    if best not in CODES or not lead.reaches(LEAST):
        return []
    check, holds, mend = CODES[best]
    what = f"holds {holds}; planes of the scene are flat so, and bent as depth"
    if seen.inverted and best == "inverse":
        what, mend = "holds depth, read as inverse depth, so that near and far are swapped", "leave out `inverse_depth`"
    confidence = min(certainty(lead.t - LEAST.t + 1, 0.8), 0.99 if lead.reaches(CLEAR) else 0.65)
    return [Finding(check, "fault", confidence, f"{seen.names[1]}: {what}", mend)]


def looks_inverse(depth: NDArray[np.floating]) -> bool:
    """Whether H x W values that were read as depth (0 = missing, inf = far) are clearly inverse depth."""
    camera = Camera.from_fov(depth.shape[1], depth.shape[0], 60)  # neither of the two codes depends on the lens
    best, lead = find_best_code(depth, camera, ("inverse",))
    return best == "inverse" and lead.reaches(CLEAR)


def find_best_code(depth: NDArray[np.floating], camera: Camera, others: tuple[str, ...]) -> tuple[str, Lead]:
    """Which of the codes `linear` and `others` fits best, and how far it leads `linear`; that where too little is planar."""
    fits = fit_codes(depth, camera, ("linear", *others))
    if fits is None:
        return "linear", Lead(0.0, 0.0)
    best = min(fits, key=lambda name: float(fits[name].mean()))
    gain = fits["linear"] - fits[best]
    return best, Lead(gain.mean() / (gain.std() / np.sqrt(max(gain.size / 4, 1)) + 1e-6), gain.mean())


def fit_codes(depth: NDArray[np.floating], camera: Camera, names: tuple[str, ...]) -> dict[str, Floats] | None:
    """Logarithm of the relative residuals of each planar part under each code; None where there are too few parts."""
    values, known, ray = square_parts(depth, camera)
    if len(values) < FEWEST_PARTS:
        return None
    every = inverse_depths(values / np.median(values), ray)
    codes = {name: every[name] for name in names}
    first = np.stack([residuals(*code, known) for code in codes.values()])
    best = first[np.median(first, 2).argmin(0), np.arange(len(values))]
    kept = known * (best < 4 * np.median(best, 1, keepdims=True) + EXACT)  # without outliers
    off = np.minimum(np.stack([residuals(*code, kept) for code in codes.values()]), 0.1)
    rms = np.sqrt((off**2 * kept).sum(2) / np.maximum(kept.sum(1), 1))
    planar = rms.min(0) < 0.01
    if planar.sum() < FEWEST_PARTS:
        return None
    return dict(zip(codes, np.log(np.maximum(rms[:, planar], EXACT))))


def inverse_depths(v: Floats, ray: Floats) -> dict[str, tuple[Floats, Floats]]:
    """For each coding of v: inverse depth up to a factor, and its derivative for a relative change of the value."""
    curve = v**-GAMMA
    return {
        "linear": (1 / v, 1 / v),
        "inverse": (v, v),
        "radial": (ray / v, ray / v),
        "planar": (1 / (ray * v), 1 / (ray * v)),
        "gamma": (curve, GAMMA * curve),
    }


def square_parts(values: NDArray[np.floating], camera: Camera) -> tuple[Floats, Floats, Floats]:
    """Samples of the parts with enough known ones, each T x N: depth (the part's median where it is not known), 1 where it is
    known and 0 elsewhere, length of the ray with z = 1. Sides of parts are 1/2 to 1/6 of the picture's shorter one."""
    rows, columns = (np.concatenate(each) for each in zip(*(_grid(values.shape, n) for n in (2, 3, 4, 6))))
    sampled = values[rows, columns].astype(np.float64)
    known = (sampled > 0) & np.isfinite(sampled)
    enough = known.mean(1) > 0.8
    rows, columns, there = rows[enough], columns[enough], known[enough]
    found = np.where(there, sampled[enough], np.nan)
    if len(found):
        found = np.where(there, found, np.nanmedian(found, axis=1, keepdims=True))
    return found, there.astype(np.float64), ray_lengths(camera)[rows, columns].astype(np.float64)


def _grid(hw: tuple[int, ...], parts: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (T x N) of the samples of all parts of one size; each overlaps the next by half."""
    side = min(hw) // parts
    if side < 2:
        return np.empty((0, SIDE * SIDE), np.intp), np.empty((0, SIDE * SIDE), np.intp)
    within = np.linspace(0, side - 1, SIDE).round().astype(np.intp)
    starts = [np.arange(0, n - side + 1, max(side // 2, 1)) for n in hw]
    # 48 parts in a row at most: strips would have thousands
    spread = (each[np.linspace(0, len(each) - 1, min(len(each), 48)).astype(np.intp)] for each in starts)
    y, x = (each.ravel() for each in np.meshgrid(*spread, indexing="ij"))
    return y[:, None] + np.repeat(within, SIDE), x[:, None] + np.tile(within, SIDE)


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
