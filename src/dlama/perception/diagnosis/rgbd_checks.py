"""A picture with depth and a mask in; the findings of all checks out."""

from __future__ import annotations

from dlama.perception.diagnosis.depth_code import check_depth_code
from dlama.perception.diagnosis.depth_scale import check_depth_unit, check_far_plane, check_value_range
from dlama.perception.diagnosis.finding import Finding, Observed
from dlama.perception.diagnosis.lens import check_lens
from dlama.perception.diagnosis.masks import check_mask_coverage
from dlama.perception.diagnosis.registration import check_mask_registration, check_registration

EXACT_CODES = ("inverse-depth", "radial-depth")
"""Codes that depth which spans its range exactly may have; a range that begins at the nearest depth resembles a gamma."""


def run_checks(seen: Observed) -> list[Finding]:
    """The findings of all checks. One that depends on what another found to be wrong is skipped: what is no depth has no unit."""
    lens, registration = check_lens(seen.camera), check_registration(seen)
    code, normalised = check_depth_code(seen), check_value_range(seen)
    if normalised:
        code = [each for each in code if each.check in EXACT_CODES]
        normalised = [] if code else normalised
    unit = [] if lens or code or normalised else check_depth_unit(seen)
    masks = check_mask_coverage(seen) + ([] if registration else check_mask_registration(seen))
    return [*lens, *registration, *code, *normalised, *unit, *check_far_plane(seen), *masks]
