"""A camera in; whether a camera could have such intrinsics, and the likely correction, out."""

from __future__ import annotations

import math

from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.finding import Finding

RADIANS = (0.05, math.pi)
"""A field of view between these is meant in radians, not in degrees."""
NARROWEST, WIDEST = 8.0, 125.0
"""Degrees; few cameras see less or more."""
OFF_CENTRE = 0.12
"""Share of the size by which the principal point may lie off the middle."""
SAME_ANGLE = 1.25
"""Largest ratio of the widths of view (tangents) of a camera and of its picture's EXIF data."""
SHARE = 5.0
"""A focal length up to so many px is meant as a share of the picture's width."""
MILLIMETRES = 150.0
"""Degrees from which a focal length is that of a lens in millimetres; cameras of so wide a view have no such pictures."""
SQUARE = 1.1
"""Ratio of fx and fy beyond which pixels are not square."""
OTHER_SIZES = (0.25, 1 / 3, 0.5, 2 / 3, 1.5, 2.0, 3.0, 4.0)
"""Intrinsics are often for a picture so many times as large."""


def looks_like_radians(fov: float) -> bool:
    """True for a field of view in degrees that no camera but a telescope has, and many in radians."""
    return RADIANS[0] < fov < RADIANS[1]


def check_lens(camera: Camera) -> list[Finding]:
    """Findings on focal length, field of view, principal point and pixel shape."""
    for times in OTHER_SIZES:
        if all(abs(c / (times * n / 2) - 1) < 0.08 for c, n in ((camera.cx, camera.width), (camera.cy, camera.height))):
            fx, fy, cx, cy = (value / times for value in (camera.fx, camera.fy, camera.cx, camera.cy))
            what = f"`cx` and `cy`, {camera.cx:.5g} and {camera.cy:.5g}, are the middle of a picture {times:.3g} times as large"
            mend = f"give `fx={fx:.6g}` `fy={fy:.6g}` `cx={cx:.6g}` `cy={cy:.6g}`"
            return [Finding("intrinsics-size", "fault", 0.95, what, mend)]
    wide, high = camera.wh
    if camera.fx <= SHARE < 0.1 * wide:
        what = f"`fx` is {camera.fx:.3g} px, wider than any lens; it looks like a share of the picture's width"
        return [Finding("focal-length", "fault", 0.95, what, f"give `fx={camera.fx * wide:.5g}`")]
    if camera.fov_deg > MILLIMETRES:
        what = (
            f"`fx` is {camera.fx:.3g} px, a view of {camera.fov_deg:.3g} degrees; it looks like a lens in millimetres"
        )
        of_film = f"`fx={camera.fx * wide / 36:.5g}` of a sensor 36 mm wide"
        mend = f"give `fx` = millimetres / width of the sensor in millimetres x {wide}, {of_film}"
        return [Finding("focal-length", "fault", 0.95, what, mend)]
    swapped = abs(camera.cx - high / 2) < 0.05 * high and abs(camera.cy - wide / 2) < 0.05 * wide
    if swapped and abs(wide / high - 1) >= 0.15:
        what = f"`cx` is {camera.cx:.5g} and `cy` {camera.cy:.5g} in a {wide}x{high} picture: they look swapped"
        return [Finding("principal-point", "fault", 0.95, what, f"give `cx={camera.cy:.6g}` `cy={camera.cx:.6g}`")]
    return [*_check_width(camera), *_check_shape(camera)]


def check_exif(camera: Camera, exif: Camera) -> list[Finding]:
    """Reports a camera that sees much more or less than the EXIF data of its picture say."""
    if 1 / SAME_ANGLE < exif.fx / camera.fx < SAME_ANGLE:
        return []
    seen, recorded = camera.fov_deg, exif.fov_deg
    what = f"the camera sees {seen:.3g} degrees, the picture's EXIF data say {recorded:.3g}"
    return [Finding("field-of-view", "fault", 0.75, what, "leave `fov` away, or keep it if the picture is a crop")]


def _check_width(camera: Camera) -> list[Finding]:
    wide = camera.fov_deg
    if looks_like_radians(wide):
        what = f"the camera sees {wide:.3g} degrees, as narrow as a telescope; that looks like radians"
        return [Finding("fov-radians", "fault", 0.97, what, f"give `fov={math.degrees(wide):.4g}`")]
    if not NARROWEST <= wide <= WIDEST:
        what = f"the camera sees {wide:.3g} degrees, which few do (phones 65, Kinect 57 to 63, EasySynth 90)"
        return [Finding("field-of-view", "fault", 0.8, what, "check `fov`, or `fx` and the size it is for")]
    return []


def _check_shape(camera: Camera) -> list[Finding]:
    found = []
    off = max(abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5))
    if off > OFF_CENTRE:
        what = f"the principal point ({camera.cx:.5g}, {camera.cy:.5g}) lies {off:.0%} of the size off the middle"
        found.append(Finding("principal-point", "fault", 0.75, what, "right for a crop, else check `cx` and `cy`"))
    if not 1 / SQUARE < camera.fx / camera.fy < SQUARE:
        what = f"`fx` is {camera.fx:.5g} and `fy` {camera.fy:.5g}, so pixels are not square"
        mend = "leave `fy` away, or check for what size `fx` and `fy` are"
        found.append(Finding("pixel-shape", "fault", 0.75, what, mend))
    return found
