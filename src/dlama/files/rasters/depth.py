"""Depth and disparity files in, float32 arrays in metres and pixels out, and back; units are converted here.

Depth in the package: metres, planar z, 0 = missing, +inf = far. Disparity: pixels, 0 = missing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlama.arguments import is_finite
from dlama.errors import DepthError, FileError, system_errors, warn
from dlama.files.rasters.depth_checks import warn_of_codes, warn_of_inverse, warn_of_millimetres
from dlama.files.rasters.exr_files import read_exr, write_exr
from dlama.files.rasters.float_files import read_array, read_pfm, write_pfm
from dlama.files.rasters.images import SUFFIXES, existing_file, read_stored
from dlama.files.rasters.pcd_files import read_pcd
from dlama.files.rasters.pictures import DEPTH_PNG, ROWS_AT_ONCE, write_png
from dlama.geometry.projection import depth_from_inverse
from dlama.geometry.rgbd import PLAUSIBLE_M, Float32Array, is_valid, mark_far
from dlama.perception.resampling import smooth_quantised
from dlama.writing.atomic_write import PathLike

FAR_CODE = 65535
"""In 16-bit depth pictures: far, at or beyond what the file can say."""
MILLIMETRES = 1000.0
"""A metre."""
FAR_METRES = 1e6
"""A stored depth beyond this is a renderer's word for infinity (Blender writes 1e10 behind everything)."""
EIGHT_BIT = {
    "disparity": "; say how many of them make a pixel (`disparity_scale`, Middlebury 2003: 4)",
    "depth": ", too coarse for depth (256 steps) and often gamma-encoded or only a picture of depth; save depth as 16-bit PNG in "
    "millimetres, or as EXR; `inverse_depth` takes what a network gave",
}
"""What to do where 8-bit numbers were found."""


@system_errors(FileError)
def read_depth(
    path: PathLike,
    *,
    depth_scale: float | None = None,
    depth_range: float | None = None,
    channel: str | None = None,
    far: float | None = None,
    inverse: bool = False,
) -> Float32Array:
    """A depth file as float32 H x W: metres, 0 = missing, +inf = far.

    16-bit PNG, TIFF or PGM and integer arrays: metres = value / depth_scale (default 1000; TUM 5000, KITTI 256), 65535 = far.
    EXR, PFM, float TIFF, NPY, NPZ (key `depth`), organised PCD: metres, unless `depth_scale` divides them or `depth_range`
    (EasySynth) multiplies values normalised to 0..1, where 1 is far. NaN and -infinity (too close: REP 118, ZED) are missing;
    infinity, and depth >= `far` metres, is far. inverse: values are 1 / depth, as Nuke renders it, 0 = far.
    Raises FileError, or DepthError: 8-bit, colour, negative, nothing valid, a median outside 0.05..500 m (not of floats at 1).
    """
    check_depth_options(depth_scale, depth_range, far)
    values = read_stored_numbers(path, "depth", channel)
    _check_not_negative(path, values)
    if inverse:
        values = np.where(values >= 0, depth_from_inverse(values.astype(np.float32)), np.float32(0))
    is_float = values.dtype.kind == "f"
    scale = depth_scale or (1.0 if is_float else MILLIMETRES)
    depth = (_metres_from_floats if is_float else _metres_from_codes)(path, values, depth_scale, depth_range)
    depth[~(depth >= 0)] = 0
    median = _check_plausible(path, depth, scale, depth_range, stated=is_float and depth_scale == 1)
    depth[depth > FAR_METRES] = np.inf
    if depth_range is None:
        warn_of_inverse(path, depth, inverse)
    if is_float and (depth_scale or depth_range) is None:
        warn_of_millimetres(path, depth, median)
    return depth if far is None else mark_far(depth, far, f"{path}: ")


@system_errors(FileError)
def read_inverse_depth(path: PathLike, *, channel: str | None = None) -> Float32Array:
    """A file of relative inverse depth, as Depth Anything and MiDaS give it, as float32 H x W: larger is nearer, 0 is far.

    8- or 16-bit PNG, JPEG or TIFF, one channel or three alike, EXR, PFM, NPY, NPZ (key `depth`), in any unit. What is not finite
    is far. Negative numbers, as MiDaS gives them, shift all so that the least is 0; one negative number alone is a code, and far.
    Steps of 8 bits are smoothed by as much as a step cannot tell. Raises FileError or DepthError: colours, nothing near.
    """
    stored = read_stored_numbers(path, "depth", channel, eight_bit=True)
    values = stored.astype(np.float32)
    negative = values[np.isfinite(values) & (values < 0)]
    if negative.size and (least := negative.min()) < negative.max():
        warn(f"{path}: {negative.size / values.size:.0%} of the values are negative; all are raised by {-least:.4g}")
        values -= least
    values[~(np.isfinite(values) & (values > 0))] = 0
    if not values.any():
        raise DepthError(f"{path}: no pixel has an inverse depth above 0")
    if stored.dtype.itemsize > 1:
        return values
    warn(f"{path}: has 8 bits, 256 steps of inverse depth: what is far is terraced; 16 bits are not")
    return smooth_quantised(values)


@system_errors(FileError)
def read_disparity(path: PathLike, *, scale: float | None = None) -> Float32Array:
    """A disparity file as float32 H x W: pixels, 0 = missing (0 or not finite in the file); negative numbers are kept.

    PFM, EXR, NPY, NPZ (key `disparity`): pixels, divided by `scale` where given. 16-bit PNG: value / scale (default 256,
    KITTI); of 8-bit PNG and signed whole numbers `scale` must be given. Raises FileError or DepthError.
    """
    check_positive(disparity_scale=scale)
    values = read_stored_numbers(path, "disparity", None, eight_bit=scale is not None)
    if values.dtype.kind == "f":
        values = np.where(np.isfinite(values), values, 0)
    elif scale is None:
        if values.dtype.kind == "i":
            raise DepthError(
                f"{path}: holds {values.dtype}; say how many of them make a pixel (`disparity_scale`, OpenCV's matchers: 16)"
            )
        scale = 256.0  # KITTI
    disparity = (values / (scale or 1.0)).astype(np.float32)
    if not disparity.any():
        raise DepthError(f"{path}: every disparity is missing (0, NaN or infinite)")
    return disparity


def mm_from_depth(depth: Float32Array) -> tuple[NDArray[np.uint16], int]:
    """16-bit millimetres of H x W metres: 0 = missing, 65535 = far; and how many pixels were too deep and got 65534. A valid
    depth is at least 1, so that it does not read as missing."""
    depth = np.asarray(depth)
    codes, clipped = np.empty(depth.shape, np.uint16), 0
    for first in range(0, len(depth), ROWS_AT_ONCE):
        some = depth[first : first + ROWS_AT_ONCE].astype(np.float64)
        steps = np.rint(some * MILLIMETRES)
        clipped += int(np.count_nonzero((steps >= FAR_CODE) & (steps < np.inf)))
        found = np.clip(steps, 1, FAR_CODE - 1, out=steps)
        found[~(some > 0)] = 0
        found[some == np.inf] = FAR_CODE
        codes[first : first + ROWS_AT_ONCE] = found
    return codes, clipped


def depth_from_mm(codes: np.ndarray, units: float = MILLIMETRES) -> Float32Array:
    """H x W metres of whole numbers, `units` of them a metre: 0 = missing; 65535 = far (+inf) where none is larger."""
    depth = (codes / units).astype(np.float32)
    if codes.dtype == np.uint16 or codes.max(initial=0) == FAR_CODE:
        depth[codes == FAR_CODE] = np.inf
    return depth


def write_depth_png(path: PathLike, depth: Float32Array) -> int:
    """Write H x W metres as 16-bit millimetres (`mm_from_depth`); returns how many pixels were too deep and got 65534.

    Raises OutputError.
    """
    codes, clipped = mm_from_depth(depth)
    write_png(path, codes, DEPTH_PNG)
    return clipped


def write_depth_exr(path: PathLike, depth: Float32Array) -> None:
    """Write metres as float32 channel Z of an OpenEXR file: far is infinity, missing 0. Raises OutputError."""
    depth = np.asarray(depth, np.float32)
    write_exr(path, {"Z": np.where(np.isnan(depth), np.float32(0), depth)})


def write_disparity_pfm(path: PathLike, disparity: Float32Array) -> None:
    """Write pixels as PFM, unknown (0, NaN) as infinity, as Middlebury does. Raises OutputError."""
    known = np.isfinite(disparity) & (disparity != 0)
    write_pfm(path, np.where(known, disparity, np.inf).astype(np.float32))


def read_stored_numbers(path: PathLike, what: str, channel: str | None, eight_bit: bool = False) -> np.ndarray:
    """The numbers of any depth or disparity file (`what`), H x W, as stored. Raises FileError; DepthError: colour, or 8 bits
    unless they are asked for."""
    suffix = existing_file(path).suffix.lower()
    if suffix == ".exr":
        return read_exr(path, channel)
    if channel is not None:
        raise FileError(f"{path}: has no named channels; `channel` is for EXR files")
    if suffix == ".pfm":
        return read_pfm(path)
    if suffix == ".pcd" and what == "depth":
        return read_pcd(path)
    if suffix in (".npy", ".npz"):
        values = read_array(path, what)
    elif suffix in SUFFIXES:
        values = _one_channel(path, read_stored(path).values, what, eight_bit)
    else:
        known = "16-bit PNG, TIFF or PGM, EXR, PFM, NPY (numpy.save) or NPZ"
        raise FileError(f"{path}: {what} is no '{suffix}', but {known}")
    if values.dtype.itemsize == 1 and not eight_bit:
        raise DepthError(f"{path}: holds 8-bit numbers{EIGHT_BIT[what]}")
    return values


def _one_channel(path: PathLike, values: np.ndarray, what: str, eight_bit: bool) -> np.ndarray:
    if values.ndim == 2:
        return values
    if values.dtype == np.uint8 and not eight_bit:
        raise DepthError(
            f"{path}: is an 8-bit colour picture; {what} in one channel of 16-bit or float numbers is expected "
            "(are the picture and the depth given in the wrong order?)"
        )
    colours = values[..., :3] if values.shape[2] >= 3 else values[..., :1]
    if (colours != colours[..., :1]).any():
        drawn = " (a picture of it in false colours?)" if values.dtype == np.uint8 else ""
        raise DepthError(f"{path}: has three channels that differ{drawn}; {what} in one channel is expected")
    return np.ascontiguousarray(colours[..., 0])


def _metres_from_floats(
    path: PathLike, values: np.ndarray, depth_scale: float | None, depth_range: float | None
) -> Float32Array:
    if depth_range is not None:
        return np.where(values >= 1, np.inf, values * np.float32(depth_range)).astype(np.float32)
    if depth_scale is not None:
        return (values / depth_scale).astype(np.float32)
    at_one = np.count_nonzero(values == 1)
    if at_one and np.nanmax(values) == 1 and ((values > 0) & (values < 1)).any():
        raise DepthError(
            f"{path}: looks normalised to 0..1 ({at_one} values are exactly 1, none is larger): give `depth_range` "
            "in metres (EasySynth), `inverse_depth` if a network gave inverse depth (Depth Anything), or `depth_scale=1` "
            "if these are metres"
        )
    return values.astype(np.float32)


def _metres_from_codes(
    path: PathLike, codes: np.ndarray, depth_scale: float | None, depth_range: float | None
) -> Float32Array:
    """Of whole numbers. Warns of normalised depth, and of rotated bits."""
    if depth_range is not None:
        raise DepthError(f"{path}: holds whole numbers; `depth_range` is for depth normalised to 0..1 (EXR)")
    depth = depth_from_mm(codes, depth_scale or MILLIMETRES)
    if depth_scale is None and codes.dtype == np.uint16:
        warn_of_codes(path, depth, MILLIMETRES)
    return depth


def _check_plausible(
    path: PathLike, depth: Float32Array, scale: float, depth_range: float | None, stated: bool
) -> float:
    """The median depth of what is not beyond FAR_METRES. DepthError of an unlikely one, unless they were stated to be metres."""
    valid = depth[is_valid(depth)]
    near = valid[valid <= FAR_METRES]
    if not valid.size:
        far = int(np.isposinf(depth).sum())
        raise DepthError(f"{path}: no pixel has a depth ({depth.size - far} of {depth.size} missing, {far} far)")
    if not near.size:
        beyond = f"{path}: every depth lies beyond {FAR_METRES:g} m with"
        raise DepthError(
            f"{beyond} `depth_scale={scale:g}` (the nearest at {valid.min():.4g} m); is it the number of units that make a "
            "metre, 1000 for millimetres?"
            if depth_range is None
            else f"{beyond} `depth_range={depth_range:g}`; metres are expected"
        )
    median = float(np.median(near))
    if stated or PLAUSIBLE_M[0] <= median <= PLAUSIBLE_M[1]:
        return median
    mend = "; if these are metres: `depth_scale=1`" * (scale == 1 and depth_range is None)
    raise DepthError(f"{path}: the median depth is {median:.4g} m, {_scale_advice(median, scale, depth_range)}{mend}")


def _scale_advice(median: float, scale: float, depth_range: float | None) -> str:
    """What the scale probably is, in words that can be typed."""
    if depth_range is not None:
        return f"which no room or street has; is `depth_range={depth_range:g}` in metres?"
    if PLAUSIBLE_M[0] <= median / 1000 <= PLAUSIBLE_M[1]:
        centimetres = PLAUSIBLE_M[0] <= median / 100 <= PLAUSIBLE_M[1]
        millimetres = f"it looks like millimetres read as metres: `depth_scale={scale * 1000:g}`"
        return millimetres + f", or centimetres: `depth_scale={scale * 100:g}`" * centimetres
    if PLAUSIBLE_M[0] <= median * 1000 <= PLAUSIBLE_M[1]:
        return f"it looks like metres read as millimetres: `depth_scale={scale / 1000:g}`"
    return f"{PLAUSIBLE_M[0]:g} to {PLAUSIBLE_M[1]:g} m is expected; `depth_scale` says how many units make a metre"


def _check_not_negative(path: PathLike, values: np.ndarray) -> None:
    negative = np.isfinite(values) & (values < 0)
    if negative.any():
        advice = ""
        if not (values > 0).any():
            advice = "; where the camera looks along -z, save -z"
        elif values[negative].min() > -1e-3:  # no measurements
            advice = "; lossy compression does that (B44, or DWA in R, G and B): save it as ZIP, or in a channel Z"
        raise DepthError(
            f"{path}: {int(negative.sum())} of {values.size} depth values are negative (smallest {values[negative].min():.6g}); "
            f"values >= 0 are expected, 0 = missing{advice}"
        )


def check_depth_options(depth_scale: float | None, depth_range: float | None, far: float | None) -> None:
    """Raise DepthError for an option of `read_depth` that is no number > 0, and for two that contradict each other."""
    check_positive(depth_scale=depth_scale, depth_range=depth_range, far=far)
    if depth_scale is not None and depth_range is not None:
        raise DepthError("`depth_scale` and `depth_range` contradict each other; give one")


def check_positive(**options: float | None) -> None:
    """Raise DepthError for an option that is given and no number > 0."""
    for name, value in options.items():
        if value is not None and not (is_finite(value) and value > 0):
            raise DepthError(f"`{name}` is {value!r}; a number > 0 is expected")
