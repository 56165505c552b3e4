"""`dlama stereo`: a rectified pair in; its depth, and with a mask both pictures without the object, as files, out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from dlama.apps.command import command
from dlama.apps.options import (
    Masking,
    Matching,
    Method,
    Metres,
    Output,
    Pointing,
    Report,
    Results,
    check_of_object,
    given_options,
    option,
)


def stereo(
    left: Positional[Annotated[Path, option("LEFT", None)]],
    right: Positional[Annotated[Path, option("RIGHT", None)]],
    /,
    calib: Annotated[Path, option("CALIB", None)],
    output: Output,
    masking: Masking,
    pointing: Pointing,
    matching: Matching,
    method: Method,
    results: Results,
    report: Report,
    mask: Annotated[Path | None, option("MASK")] = None,
    mask_right: Annotated[Path | None, option("MASK", "--mask carried over by disparity")] = None,
    disparity: Annotated[Path | None, option("FILE", "found")] = None,
    far: Metres = None,
) -> None:
    """Depth from a rectified stereo pair, and with --mask or --click both pictures without an object, so that they agree.

    Args:
        left: The left picture.
        right: The right picture, rectified: same size, same rows.
        calib: calib.txt of Middlebury or KITTI, or JSON with left_K, right_K, baseline_m, doffs, pixel_center.
        output: Directory for the results, made if need be: the left view at the top, the right one in right/.
        mask: The object in the left picture: black and white, 255 = remove; --click or --box say it in place of that file.
        mask_right: The object in the right picture.
        disparity: The left picture's disparity, in pixels: PFM, NPY, NPZ, EXR or PNG; 0 and infinity are missing.
        far: What is measured at or beyond this is far (sky).
    """
    with command("stereo", report) as this:
        files = {"left": left, "right": right, "mask": mask, "mask_right": mask_right, "disparity": disparity}
        check_of_object(given_options(masking, pointing), mask, mask_right)
        this.run("stereo", output, files, masking, pointing, matching, method, results, calib=calib, far=far)
