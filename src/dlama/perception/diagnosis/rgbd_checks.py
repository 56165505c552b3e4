"""A picture with depth and a mask in; the findings of all checks out."""

from __future__ import annotations

from collections.abc import Callable

from dlama.perception.diagnosis.depth_code import check_depth_code
from dlama.perception.diagnosis.depth_scale import check_depth_unit
from dlama.perception.diagnosis.finding import Finding, Observed
from dlama.perception.diagnosis.masks import check_mask_coverage
from dlama.perception.diagnosis.normalised import check_value_range
from dlama.perception.diagnosis.registration import check_mask_registration, check_registration

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
