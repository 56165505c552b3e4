"""A picture with depth and a mask in; the findings of all checks out."""

from __future__ import annotations

import numpy as np

from dlama.geometry.drawing.picture_edges import MapGrid
from dlama.geometry.holes import looks_inverted
from dlama.geometry.rgbd import RGBD, describe_depth_range, percent
from dlama.perception.diagnosis.depth_code import check_depth_code
from dlama.perception.diagnosis.depth_scale import (
    check_depth_unit,
    check_far_plane,
    check_rotated_bits,
    check_value_range,
)
from dlama.perception.diagnosis.finding import Finding, Observed, certainty
from dlama.perception.diagnosis.lens import check_lens
from dlama.perception.diagnosis.registration import check_mask_registration, check_registration


def check_mask_coverage(seen: Observed) -> list[Finding]:
    """Reports a mask of wrong polarity, or with hardly any pixels."""
    if seen.mask is None:
        return []
    if not looks_inverted(seen.mask):
        covered = int(seen.mask.sum())
        what = f"{seen.names[2]}: removes only {covered} pixels of the picture"
        return [Finding("tiny-mask", "note", 0.8, what)] if covered < 12 else []
    what = f"{seen.names[2]}: would remove {percent(seen.mask)} of the picture and most of its border; white seems to mean keep"
    mend = "give the other `mask_polarity` (known: white stays)"
    return [Finding("inverted-mask", "fault", certainty(seen.mask.mean() - 0.4, 0.15), what, mend)]


def run_checks(seen: Observed) -> list[Finding]:
    """The findings of all checks. One that depends on what another found to be wrong is skipped: what is no depth has no unit."""
    lens, registration = check_lens(seen.camera), check_registration(seen)
    code, normalised = check_depth_code(seen), check_value_range(seen)
    if normalised:
        # a range that begins at the nearest depth resembles a gamma
        code = [each for each in code if each.check in ("inverse-depth", "radial-depth")]
        normalised = [] if code else normalised
    unit = check_rotated_bits(seen) or ([] if lens or code or normalised else check_depth_unit(seen))
    masks = check_mask_coverage(seen) + ([] if registration else check_mask_registration(seen))
    return [*lens, *registration, *code, *normalised, *unit, *check_far_plane(seen), *masks]


def check_terraces(seen: Observed) -> list[Finding]:
    """Reports a small depth map that was enlarged by the nearest pixel: a view tears its steps. Of a picture alone: a data set is
    read as it is."""
    grid = MapGrid.of(seen.depth.astype(np.float32))
    if not grid.enlarged:
        return []
    size = "x".join(map(str, grid.wh))
    what = f"{seen.names[1]}: a map of {size} pixels, enlarged by the nearest pixel, so surfaces are terraced"
    return [Finding("terraces", "fault", 0.95, what, "give `resize_depth=guided`")]


def describe_frame(rgbd: RGBD) -> list[str]:
    """Size, field of view and depth, in words."""
    camera = rgbd.camera
    return [
        f"{camera.width}x{camera.height}",
        f"{camera.fov:.3g} degrees wide",
        f"depth {describe_depth_range(rgbd.depth)}",
    ]
