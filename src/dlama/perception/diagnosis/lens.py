"""Intrinsics, as options or a file give them, in; whether a camera could have them, and the likely correction, out."""

from __future__ import annotations

import math
from collections.abc import Mapping

from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.finding import Finding

RADIANS = (0.05, math.pi)
"""A field of view between these is meant in radians, not in degrees."""
NARROWEST, WIDEST = 8.0, 125.0
"""Degrees; few cameras see less or more."""
OFF_CENTRE = 0.12
"""Share of the size by which the principal point may lie off the middle."""
SQUARE = 1.1
"""Ratio of fx and fy beyond which pixels are not square."""
OTHER_SIZES = (0.25, 1 / 3, 0.5, 2 / 3, 1.5, 2.0, 3.0, 4.0)
"""Intrinsics are often for a picture so many times as large."""


def looks_like_radians(fov: float) -> bool:
    """True for a field of view in degrees that no camera but a telescope has, and many in radians."""
    return RADIANS[0] < fov < RADIANS[1]


def check_lens_options(given: Mapping[str, float | None], width: int) -> tuple[list[Finding], dict[str, float]]:
    """Faults of the options fov and fx, and their likely values."""
    fov, fx = given.get("fov"), given.get("fx")
    if fov is not None and looks_like_radians(fov):
        meant = math.degrees(fov)
        what = f"`fov` is {fov:g} degrees, as narrow as a telescope's; it looks like radians"
        return [Finding("fov-radians", "fault", 0.97, what, f"give `fov={meant:.4g}`")], {"fov": meant}
    if fx is not None and 0.2 <= fx <= 5:
        what = f"`fx` is {fx:g} px, wider than any lens; it looks like a share of the picture's width"
        return [Finding("focal-length", "fault", 0.95, what, f"give `fx={fx * width:.5g}`")], {"fx": fx * width}
    return [], {}


def check_lens(camera: Camera, exif_fov: float | None = None) -> list[Finding]:
    """Findings on field of view, principal point and pixel shape; `exif_fov`: degrees, from the picture's EXIF data."""
    other = _find_scaled(camera) or _find_swapped(camera)
    if other:
        return other
    found = []
    wide = 2 * math.degrees(math.atan(0.5 * camera.width / camera.fx))
    if not NARROWEST <= wide <= WIDEST:
        what = f"the camera sees {wide:.3g} degrees, which few do (phones 65, Kinect 57 to 63, EasySynth 90)"
        found.append(Finding("field-of-view", "fault", 0.8, what, "check `fov`, or `fx` and the size it is for"))
    elif (
        exif_fov is not None
        and not 0.8 < math.tan(math.radians(wide) / 2) / math.tan(math.radians(exif_fov) / 2) < 1.25
    ):
        what = f"the camera sees {wide:.3g} degrees, the picture's EXIF data say {exif_fov:.3g}"
        found.append(
            Finding("field-of-view", "fault", 0.75, what, "leave `fov` away, or keep it if the picture is a crop")
        )
    off = abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5)
    if max(off) > OFF_CENTRE:
        what = f"the principal point ({camera.cx:.5g}, {camera.cy:.5g}) lies {max(off):.0%} of the size off the middle"
        found.append(Finding("principal-point", "fault", 0.75, what, "right for a crop, else check `cx` and `cy`"))
    if not 1 / SQUARE < camera.fx / camera.fy < SQUARE:
        what = f"`fx` is {camera.fx:.5g} and `fy` {camera.fy:.5g}, so pixels are not square"
        found.append(
            Finding("pixel-shape", "fault", 0.75, what, "leave `fy` away, or check for what size `fx` and `fy` are")
        )
    return found


def _find_scaled(camera: Camera) -> list[Finding]:
    for times in OTHER_SIZES:
        if all(abs(c / (times * n / 2) - 1) < 0.08 for c, n in ((camera.cx, camera.width), (camera.cy, camera.height))):
            fx, fy, cx, cy = (value / times for value in (camera.fx, camera.fy, camera.cx, camera.cy))
            what = f"`cx` and `cy`, {camera.cx:.5g} and {camera.cy:.5g}, are the middle of a picture {times:.3g} times as large"
            mend = f"give `fx={fx:.6g}` `fy={fy:.6g}` `cx={cx:.6g}` `cy={cy:.6g}`"
            return [Finding("intrinsics-size", "fault", 0.95, what, mend)]
    return []


def _find_swapped(camera: Camera) -> list[Finding]:
    wide, high = camera.wh
    swapped = abs(camera.cx - high / 2) < 0.05 * high and abs(camera.cy - wide / 2) < 0.05 * wide
    if abs(wide / high - 1) < 0.15 or not swapped:
        return []
    what = f"`cx` is {camera.cx:.5g} and `cy` {camera.cy:.5g} in a {wide}x{high} picture: they look swapped"
    return [Finding("principal-point", "fault", 0.95, what, f"give `cx={camera.cy:.6g}` `cy={camera.cx:.6g}`")]
