"""A picture with depth and a mask in; the findings of all checks out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dlama.perception.diagnosis.depth_code import check_depth_code
from dlama.perception.diagnosis.depth_scale import FLOOR, MIDDLE, check_depth_unit, measure_extent
from dlama.perception.diagnosis.finding import Finding, Observed
from dlama.perception.diagnosis.masks import check_mask_coverage
from dlama.perception.diagnosis.registration import check_mask_registration, check_registration

FULL = 65535
RARE = 0.004
"""Largest share of pixels at the maximum: more are a code (far) or a clip."""
LOWEST = 0.008
"""Least value over the largest: no camera sees a wider range."""


def check_value_range(seen: Observed) -> list[Finding]:
    """Reports values that fill 0..65535 or 0..1 exactly, as normalising leaves them."""
    known = seen.values[seen.values > 0]
    if not known.size:
        return []
    largest = FULL if seen.whole else 1.0
    at_top = np.isposinf(known) if seen.whole else known == largest
    rest = known[~at_top]
    if not at_top.any() or not rest.size or rest.max() > largest:
        return []
    if seen.whole and (at_top.mean() > RARE or rest.min() > LOWEST * largest or rest.max() < 0.8 * largest):
        return []
    extent = measure_extent(seen)
    if extent is None:
        return []
    read, typical = (extent.middle, MIDDLE[0]) if extent.floor is None else (extent.floor, FLOOR[0])
    metres = largest / seen.units * typical / read
    span = f"{'0..65535' if seen.whole else '0..1'} exactly"
    what = f"{seen.names[1]}: values span {span}, as normalised depth does; its unit is lost"
    option = f"depth_scale={largest / metres:.3g}" if seen.whole else f"depth_range={metres:.2g}"
    mend = f"save metres; {option} would make this a usual scene, a guess ({metres:.2g} m at most)"
    return [Finding("normalised-depth", "fault", 0.85, what, mend)]


CHECKS: dict[str, Callable[[Observed], list[Finding]]] = {
    "registration": check_registration,
    "depth code": check_depth_code,
    "normalised depth": check_value_range,
    "depth unit": check_depth_unit,
    "mask coverage": check_mask_coverage,
    "mask registration": check_mask_registration,
}
"""Checks of a picture with depth and a mask, in the order in which findings are reported."""
BEFORE: dict[str, tuple[str, ...]] = {
    "depth unit": ("depth code", "normalised depth"),
    "mask registration": ("registration",),
}
"""A check is skipped where one of these reported a fault: what is no depth has no unit."""


def run_checks(seen: Observed, skip: tuple[str, ...] = ()) -> list[Finding]:
    """The findings of all checks except `skip`."""
    found: dict[str, list[Finding]] = {}
    for name, check in CHECKS.items():
        if name not in skip and not any(found.get(other) for other in BEFORE.get(name, ())):
            found[name] = check(seen)
    if found.get("normalised depth"):  # a range that begins at the nearest depth resembles a gamma
        found["depth code"] = [each for each in found["depth code"] if each.check in ("inverse-depth", "radial-depth")]
        if found["depth code"]:
            found["normalised depth"] = []
    return [finding for each in found.values() for finding in each]
