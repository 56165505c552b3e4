"""A camera in; whether a camera could have such intrinsics, and the likely correction, out."""

from __future__ import annotations

import math

from dlama.geometry.camera import Camera
from dlama.perception.diagnosis.finding import Finding


def looks_like_radians(fov: float) -> bool:
    """True for a field of view in degrees that no camera but a telescope has, and many in radians."""
    return 0.05 < fov < math.pi


def check_lens(camera: Camera) -> list[Finding]:
    """Findings on focal length, field of view, principal point and pixel shape."""
    for times in (0.25, 1 / 3, 0.5, 2 / 3, 1.5, 2.0, 3.0, 4.0):
        if all(abs(c / (times * n / 2) - 1) < 0.08 for c, n in ((camera.cx, camera.width), (camera.cy, camera.height))):
            fx, fy, cx, cy = (value / times for value in (camera.fx, camera.fy, camera.cx, camera.cy))
            what = f"`cx` and `cy`, {camera.cx:.5g} and {camera.cy:.5g}, are the middle of a picture {times:.3g} times as large"
            mend = f"give `fx={fx:.6g}` `fy={fy:.6g}` `cx={cx:.6g}` `cy={cy:.6g}`"
            return [Finding("intrinsics-size", "fault", 0.95, what, mend)]
    wide, high = camera.wh
    seen = f"`fov` is {camera.fov:.3g} degrees, `fx` {camera.fx:.3g} px"  # either may have been given
    if camera.fx <= 5 < 0.1 * wide:
        what = f"{seen}, wider than any lens; such an `fx` looks like a share of the picture's width"
        return [Finding("focal-length", "fault", 0.95, what, f"give `fx={camera.fx * wide:.5g}`")]
    if camera.fov > 150:  # cameras of so wide a view have no such pictures
        of_film = f"`fx={camera.fx * wide / 36:.5g}` of a sensor 36 mm wide"
        mend = f"give `fx` = millimetres / width of the sensor in millimetres x {wide}, {of_film}"
        return [Finding("focal-length", "fault", 0.95, f"{seen}; such an `fx` looks like a lens in millimetres", mend)]
    swapped = abs(camera.cx - high / 2) < 0.05 * high and abs(camera.cy - wide / 2) < 0.05 * wide
    if swapped and abs(wide / high - 1) >= 0.15:
        what = f"`cx` is {camera.cx:.5g} and `cy` {camera.cy:.5g} in a {wide}x{high} picture: they look swapped"
        return [Finding("principal-point", "fault", 0.95, what, f"give `cx={camera.cy:.6g}` `cy={camera.cx:.6g}`")]
    return [*_check_width(camera), *_check_shape(camera)]


def check_exif(camera: Camera, exif: Camera) -> list[Finding]:
    """Reports a camera that sees much more or less than the EXIF data of its picture say."""
    if 1 / 1.25 < exif.fx / camera.fx < 1.25:
        return []
    seen, recorded = camera.fov, exif.fov
    what = f"the camera sees {seen:.3g} degrees, the picture's EXIF data say {recorded:.3g}"
    return [Finding("field-of-view", "fault", 0.75, what, "leave `fov` away, or keep it if the picture is a crop")]


def _check_width(camera: Camera) -> list[Finding]:
    wide = camera.fov
    if looks_like_radians(wide):
        what = f"the camera sees {wide:.3g} degrees, as narrow as a telescope; that looks like radians"
        return [Finding("fov-radians", "fault", 0.97, what, f"give `fov={math.degrees(wide):.4g}`")]
    if not 8 <= wide <= 125:
        what = f"the camera sees {wide:.3g} degrees, which few do (phones 65, Kinect 57 to 63, EasySynth 90)"
        return [Finding("field-of-view", "fault", 0.8, what, "check `fov`, or `fx` and the size it is for")]
    return []


def _check_shape(camera: Camera) -> list[Finding]:
    found = []
    off = max(abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5))
    if off > 0.12:
        what = f"the principal point ({camera.cx:.5g}, {camera.cy:.5g}) lies {off:.0%} of the size off the middle"
        found.append(Finding("principal-point", "fault", 0.75, what, "right for a crop, else check `cx` and `cy`"))
    if not 1 / 1.1 < camera.fx / camera.fy < 1.1:
        what = f"`fx` is {camera.fx:.5g} and `fy` {camera.fy:.5g}, so pixels are not square"
        mend = "leave `fy` away, or check for what size `fx` and `fy` are"
        found.append(Finding("pixel-shape", "fault", 0.75, what, mend))
    return found
