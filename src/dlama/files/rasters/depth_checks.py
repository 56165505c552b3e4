"""Depth as read in; one-line warnings where it looks like something else than metric depth out."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dlama.errors import warn
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.perception.diagnosis.depth_code import looks_inverse
from dlama.perception.diagnosis.depth_scale import (
    ROTATED_BITS,
    UNROTATE,
    begins_at_camera,
    check_depth_unit,
    fills_16_bits,
    find_far_plane,
    has_rotated_bits,
)
from dlama.perception.diagnosis.finding import CERTAIN, Observed
from dlama.perception.diagnosis.lens import check_lens
from dlama.perception.sky import OUTDOORS_M
from dlama.writing.atomic_write import PathLike

_plain: set[tuple[str, int, bool]] = set()
"""Files, when they were written and whether they were read as inverse depth, that hold what they were read as: a sequence reads
its frames again and again."""


def warn_of_inverse(path: PathLike, depth: Float32Array, inverted: bool = False) -> None:
    """Warn (UserWarning) where depth (H x W, 0 = missing, inf = far), as read, is inverse depth; inverted: where it is 1 / the
    file's values, that they are depth."""
    file = str(path), Path(path).stat().st_mtime_ns, inverted
    if file in _plain:
        return
    if not looks_inverse(depth):
        _plain.add(file)
    elif inverted:
        warn(
            f"{path}: looks like depth, not like inverse depth (planes of the scene are flat so), and near and far are swapped: "
            "leave out `inverse_depth`"
        )
    else:
        warn(
            f"{path}: looks like inverse depth or disparity (planes of the scene are flat so, and bent as depth): metric depth "
            "is expected, such as depth = scale / value; `inverse_depth` takes what a network gave, in no unit, and with "
            "`depth_scale=1` 1 / metres, as Nuke renders it"
        )


def warn_of_codes(path: PathLike, depth: Float32Array, units: float) -> None:
    """Warn (UserWarning) where depth (H x W metres; a metre is `units` of the file's 16-bit numbers) was normalised, or bits of
    its numbers were rotated."""
    if has_rotated_bits(depth, units):
        warn(f"{path}: {ROTATED_BITS}: {UNROTATE}")
    if fills_16_bits(depth, units) and begins_at_camera(depth):
        warn(
            f"{path}: values span 0..65535 exactly, as normalised depth does, so they are no millimetres: give `depth_scale`, or "
            "`inverse_depth` if a network gave inverse depth (Depth Anything)"
        )


def warn_of_millimetres(path: PathLike, depth: Float32Array, median: float) -> None:
    """Warn (UserWarning) of floats read as metres that begin far away and end not much farther, as a close-range scanner's
    millimetres do."""
    if found := close_range(depth, median):
        near, far = found
        warn(
            f"{path}: nearly all of the depth is {near:.3g} to {far:.3g} m: if these are millimetres, give `depth_scale=1000`, "
            "if centimetres `depth_scale=100`; `depth_scale=1` says that they are metres"
        )


def close_range(depth: Float32Array, median: float) -> tuple[float, float] | None:
    """Where depth (H x W metres) begins and ends, if it begins far away and ends not much farther, as no room or street does."""
    if median < 50 or np.isposinf(depth).any():
        return None
    near, far = np.percentile(depth[depth > 0], (2, 98))
    return (near, far) if far < 5 * near else None


def warn_of_unit(path: PathLike, rgbd: RGBD) -> None:
    """Warn (UserWarning) where an EXR or PFM file, read as metres, certainly makes a likely scene in another unit alone, such as
    the centimetres of Maya and Unreal. Not where the lens is unlikely: the height of the ground depends on it."""
    if (
        check_lens(rgbd.camera)
        or Path(path).suffix.lower() not in (".exr", ".pfm")
        or close_range(rgbd.depth, float(np.median(rgbd.depth[rgbd.valid])))
    ):
        return
    for found in check_depth_unit(Observed.of(rgbd, ("image", str(path), "mask"), units=1.0)):
        if found.confidence >= CERTAIN:
            warn(f"{found.what}: {found.mend}; `depth_scale=1` says that they are metres")


def warn_of_far_plane(path: PathLike, depth: Float32Array) -> None:
    """Warn (UserWarning) where a renderer wrote sky at its camera's far plane (depth: H x W metres): it would be a wall."""
    found = find_far_plane(depth)
    if found is not None:
        warn(
            f"{path}: {found[1]:.1%} of the depth is exactly {found[0]:.9g} m, far behind all else; if that is sky, give "
            f"`far={found[0]:.9g}`"
        )


def warn_of_missing_code(path: PathLike, depth: Float32Array) -> None:
    """Warn (UserWarning) where an integer file has the code of the sky (depth: H x W metres), but nothing as far as outdoors."""
    finite, share = depth[np.isfinite(depth) & (depth > 0)], float(np.isposinf(depth).mean())
    if Path(path).suffix.lower() in (".exr", ".pfm", ".npy", ".npz") or share < 0.01 or not finite.size:
        return
    farthest = float(np.quantile(finite, 0.99))
    if farthest < OUTDOORS_M:
        warn(
            f"{path}: {share:.1%} of the depth is 65535, which is sky, though the rest ends at {farthest:.2g} m; if it means "
            "missing (as in files of 7-Scenes), write 0 there"
        )
