"""A picture, its depth and a mask in; whether they are registered (not shifted, mirrored or turned), by their edges, out."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from dlama.geometry.rgbd import UInt8Array
from dlama.perception.diagnosis.finding import Finding, Observed, certainty

Floats = NDArray[np.float32]
REACH = 0.12
"""Largest tested shift, as a share of the width."""
ALIGNED = 0.012
"""Tolerated shift of depth, as a share of the width: calibrations and splatted depth are that inexact."""
LEAST_Z = 5.2
"""Least height of a correlation peak, in standard deviations, for a finding."""
LEAST_LEAD = 1.25
"""Least factor over the correlation at no shift."""
FLIPS: dict[str, tuple[Any, str]] = {
    "as it is": (np.s_[...], ""),
    "mirrored left to right": (np.s_[..., ::-1], "mirror it back, left to right"),
    "upside down": (np.s_[..., ::-1, :], "mirror it back, top to bottom"),
    "turned by 180 degrees": (np.s_[..., ::-1, ::-1], "turn it back by 180 degrees"),
}
"""How depth may lie -> what turns it so, and what undoes it."""


class Peak(NamedTuple):
    """Where two maps of edges fit best."""

    z: float
    """Its height in standard deviations of the correlation over all shifts."""
    here: float
    """The height within ALIGNED of no shift."""
    shift: tuple[int, int]
    """(right, down) offset of the second map in px."""


def check_registration(seen: Observed) -> list[Finding]:
    """Reports depth that is mirrored, turned or shifted against the picture."""
    return _compare_edges(
        seen, depth_edges(seen.depth), f"{seen.names[1]}: depth", "depth", "register depth to the picture"
    )


def check_mask_registration(seen: Observed) -> list[Finding]:
    """Reports a mask that is mirrored, turned or shifted against the picture."""
    if seen.mask is None:
        return []
    small = cv2.GaussianBlur(seen.mask.astype(np.float32), (0, 0), 0.8)
    outline = [np.abs(cv2.Sobel(small, cv2.CV_32F, *by)) for by in ((1, 0), (0, 1))]
    return _compare_edges(seen, outline, f"{seen.names[2]}: the mask", "mask", "draw it anew")


def correlate_edges(color: UInt8Array, depth: NDArray[np.floating]) -> float:
    """How well the edges of picture and depth fit, of one size: standard deviations of the correlation over shifts."""
    step = _step(depth)
    return find_peak(picture_edges(color, step), _shrink_edges(depth_edges(depth), step)).here


def _compare_edges(seen: Observed, edges: list[Floats], what: str, kind: str, mend: str) -> list[Finding]:
    step = _step(seen.depth)
    image, other = picture_edges(seen.color, step), _shrink_edges(edges, step)
    peaks = {name: find_peak(image, other[flip]) for name, (flip, _) in FLIPS.items()}
    plain, best = peaks["as it is"], max(peaks, key=lambda name: peaks[name].here)
    lead = peaks[best].here / max(plain.z, 1.0)
    if best != "as it is" and peaks[best].here > LEAST_Z and lead > LEAST_LEAD:
        what = f"{what} is {best} against the picture"
        return [Finding(f"mirrored-{kind}", "fault", certainty(lead - 1, 0.25), what, FLIPS[best][1])]
    far, lead = np.hypot(*plain.shift) > ALIGNED * image.shape[2], plain.z / max(plain.here, 1.0)
    if not (far and plain.z > LEAST_Z and lead > LEAST_LEAD):
        return []
    what = f"{what} lies {describe_shift(*(round(each * step) for each in plain.shift))}"
    return [Finding(f"shifted-{kind}", "fault", certainty(lead - 1, 0.25), what, mend)]


def describe_shift(right: int, down: int) -> str:
    """A shift (px) in words."""
    words = (right, "right" if right > 0 else "left"), (down, "down" if down > 0 else "up")
    return " and ".join(f"{abs(by)} px too far {word}" for by, word in words if by)


def find_peak(image: Floats, other: Floats) -> Peak:
    """The correlation of two maps of edges (2 x H x W) over all shifts within REACH, by Fourier transform, borders padded.

    Edges across rows and across columns are compared on their own: long parallel edges then hide no others.
    """
    width = image.shape[2]
    reach, near = max(4, round(REACH * width)), max(1, round(ALIGNED * width))
    # a strip may be less high than the shifts that are looked for
    hw = [cv2.getOptimalDFTSize(max(n + reach, 2 * reach + 1)) for n in image.shape[1:]]
    total = np.zeros((2 * reach + 1, 2 * reach + 1))
    for one, two in zip(image, other):
        # less their local mean: broad differences of brightness or edge density do not localise
        first, second = (np.fft.rfft2(edges - cv2.blur(edges, (31, 31)), hw) for edges in (one, two))
        field = np.roll(np.fft.irfft2(first * np.conj(second), hw), (reach, reach), (0, 1))
        around = field[: 2 * reach + 1, : 2 * reach + 1]
        total += (around - np.median(around)) / (around.std() + 1e-12)
    total /= total.std() + 1e-12
    down, right = np.unravel_index(int(total.argmax()), total.shape)
    here = total[reach - near : reach + near + 1, reach - near : reach + near + 1].max()
    return Peak(float(total.max()), float(here), (int(reach - right), int(reach - down)))


def picture_edges(color: UInt8Array, step: int) -> Floats:
    """2 x H x W colour gradients along rows and columns, 0..1, relative to their surroundings; shrunk by `step`."""
    small = cv2.GaussianBlur(_shrink(color.astype(np.float32), step), (0, 0), 0.8)
    along = [np.abs(cv2.Sobel(small, cv2.CV_32F, *by)).max(axis=2) for by in ((1, 0), (0, 1))]
    around = 3 * cv2.blur(np.hypot(*along), (25, 25)) + 8
    return np.stack([np.minimum(change / around, 1) for change in along]).astype(np.float32)


def depth_edges(depth: NDArray[np.floating]) -> list[Floats]:
    """Two H x W: bends and jumps of inverse depth between known neighbours along rows and columns, 0..1; far is known."""
    known, found = depth > 0, []
    w = np.where(known, 1 / np.where(known, depth, 1), 0).astype(np.float32)
    for axis in (1, 0):
        a, b, c = (np.roll(w, by, axis) for by in (1, 0, -1))
        there = np.roll(known, 1, axis) & known & np.roll(known, -1, axis)
        bend = np.abs(a - 2 * b + c) / np.maximum(np.maximum(np.maximum(a, b), c), 1e-6)
        # a relative bend of .06 between neighbours is an edge
        found.append(np.where(there, np.clip(bend / 0.06 - 0.5, 0, 1), 0).astype(np.float32))
    return found


def _step(depth: NDArray[np.floating]) -> int:
    return max(1, round(max(depth.shape) / 320))  # px in which edges are compared


def _shrink_edges(edges: list[Floats], step: int) -> Floats:
    """2 x H x W, without the picture's border."""
    for each in edges:
        each[:2], each[-2:], each[:, :2], each[:, -2:] = 0, 0, 0, 0
    return np.stack([_shrink(each, step) for each in edges])


def _shrink(picture: Floats, step: int) -> Floats:
    size = max(1, picture.shape[1] // step), max(1, picture.shape[0] // step)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)
