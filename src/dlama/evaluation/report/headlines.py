"""A Summary in; a line a method with its main numbers, as `dlama evaluate` prints them, out."""

from __future__ import annotations

from dlama.errors import format_count
from dlama.evaluation.protocols.methods import NO_FILL
from dlama.evaluation.report.columns import column_title, format_value, list_columns
from dlama.evaluation.report.summary import ALL, Place, Summary
from dlama.evaluation.report.tables import variant_of

MAIN = {"rgb": "ssim lpips mse psnr", "depth_m": "mae"}


def headlines(summary: Summary) -> list[str]:
    """Of each protocol and data set its methods, variants left out: over all yaws in whole pictures, else in what was removed."""
    lines = []
    for place in summary.places():
        region = "mask" if place.of(region="mask") else "whole"
        lines += [_line(place, region, method) for method in place.values("method") if not variant_of(method)[1]]
    return lines


def _line(place: Place, region: str, method: str) -> str:
    """`vpi on street, dlama/telea, whole (3 frames): colour SSIM 0.8104, ...`; no depth of the baseline that fills nothing: where
    it has any, it was measured."""
    chosen = list_columns((region,), {"rgb": MAIN["rgb"]} if method.endswith(f"/{NO_FILL}") else MAIN)
    means = {which: one for which in chosen if (one := place.mean(ALL, method, which))}
    found = []
    for which, one in means.items():
        title, _, unit = column_title(*which).partition(", ")
        found.append(f"{title} {format_value(one.value, which[2])} {unit}".rstrip())
    frames = max((one.frames for one in means.values()), default=0)
    head = f"{place.protocol} on {place.dataset}, {method}, {region} ({format_count(frames, 'frame')})"
    return f"{head}: {', '.join(found) or 'nothing was measured'}"
