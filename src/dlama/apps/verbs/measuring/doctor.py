"""`dlama doctor`: inputs in; what is wrong with them, and the option that mends it, in lines, out."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

import dlama
from dlama.apps.options import Lens, Masking, Reading, Report, given_options, option
from dlama.apps.terminal.output import FAILED, WITH_FLAGS, report_result


def doctor(
    first: Positional[Annotated[Path, option("IMAGE|LEFT|DATASET|SCENE.npz", None)]],
    second: Positional[Annotated[Path | None, option("[DEPTH|RIGHT]")]] = None,
    mask: Positional[Annotated[Path | None, option("[MASK]")]] = None,
    /,
    *,
    lens: Lens,
    reading: Reading,
    masking: Masking,
    report: Report,
    calib: Annotated[Path | None, option("CALIB")] = None,
    layout: Annotated[str | None, option("NAME", "recognised")] = None,
) -> None:
    """Reports what is wrong with inputs, with what confidence, and the option that mends it. Exit code 1 where something is.

    Args:
        first: The colour picture; with --calib the left one of a stereo pair; or the folder of a data set, or a scene.npz.
        second: The picture's depth, or the right picture; without it, the depth that a photo's file carries is looked at.
        mask: The object to remove: black and white, 255 = remove.
        calib: The inputs are a stereo pair, and this its calibration.
        layout: How the data set lies on disk, as for dlama evaluate.
    """
    with report_result("doctor", report) as result:
        options = given_options(lens, reading, masking)
        found = dlama.diagnose(first, second, mask, calib=calib, layout=layout, **options)
        for finding in found:
            result.add(WITH_FLAGS.get()(finding.line))
        result.values["findings"] = [dataclasses.asdict(finding) for finding in found]
    if any(finding.severity == "fault" for finding in found):
        raise SystemExit(FAILED)
