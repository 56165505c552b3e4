"""Hedging: painted colours in; colours drawn towards a blind guess out, where nobody knows what is there.

Outside the source's view, far things are a guess: does the wall end, does the sky begin? The guess keeps its shapes but
loses contrast with its distance from what was seen. Near planes (ground, table) are sure to go on and stay as they are.
"""

from __future__ import annotations

import numpy as np

from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array
from dlama.geometry.view import HoleType, View
from dlama.inpainters.opencv import telea

STRENGTH = 0.7
"""Largest share of the blind guess, itself the mean of two: guesses with errors alike err least when they count alike."""
REACH = 0.04
"""Share of the picture's longer side over which a guess becomes unsure."""
GRID = 512
"""Longer side of the picture that colours are carried on in."""


def hedged(view: View, color: UInt8Array, hole: BoolArray, w: Float32Array) -> UInt8Array:
    """H x W x 3 colours of `color`, less sure in the hole pixels out of view.

    hole: pixels whose colour was painted; w: inverse depth, filled everywhere.
    """
    import cv2

    beyond = hole & (view.hole_type == HoleType.OUT_OF_VIEW)
    known = w[~view.hole]
    if not beyond.any() or not known.size:
        return color
    distance = cv2.distanceTransform(view.hole.astype(np.uint8), cv2.DIST_L2, 5)[beyond]
    middle = max(float(np.median(known)), 1e-6)
    share = STRENGTH * (1 - np.exp(-distance / (REACH * max(w.shape)))) * np.clip(2 * (1 - w[beyond] / middle), 0, 1)
    out = color.copy()
    out[beyond] = np.round(color[beyond] * (1 - share[:, None]) + blind_guess(view)[beyond] * share[:, None])
    return out


def blind_guess(view: View) -> Float32Array:
    """H x W x 3: the mean of two guesses that know nothing of surfaces, one that spreads colours (pull-push) and one that
    carries them straight on (Telea). Street dev scenes, +-10 to +-60 degrees: against pull-push alone at a share of 0.55 the
    squared error falls by 8 to 13 %, LPIPS by up to 1 %."""
    return np.asarray((blind_mean(view) + carried_on(view)) / 2, np.float32)


def carried_on(view: View) -> Float32Array:
    """H x W x 3: known colours carried into the holes by Telea, at GRID pixels at most: it is a blur in any case."""
    import cv2

    height, width = view.hole.shape
    by = min(1.0, GRID / max(height, width))
    size = max(1, round(width * by)), max(1, round(height * by))
    known = cv2.resize((~view.hole).astype(np.float32), size, interpolation=cv2.INTER_AREA)[..., None]
    small = cv2.resize(view.color * np.float32(~view.hole[..., None]), size, interpolation=cv2.INTER_AREA)
    picture = np.round(small.reshape(*known.shape[:2], 3) / np.maximum(known, 1e-6)).astype(np.uint8)
    filled = telea.paint(picture, known[..., 0] < 0.5)
    return np.asarray(cv2.resize(filled, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


def blind_mean(view: View) -> Float32Array:
    """H x W x 3 colours of the known pixels spread into the holes, coarser the farther off (pull-push, Gortler 1996)."""
    import cv2

    weight = (~view.hole).astype(np.float32)
    levels: list[tuple[np.ndarray, np.ndarray]] = [(view.color * weight[..., None], weight)]
    while max(levels[-1][1].shape) > 2:
        levels.append((cv2.pyrDown(levels[-1][0]), cv2.pyrDown(levels[-1][1])))
    color, weight = levels[-1]
    mean = color / np.maximum(weight, 1e-6)[..., None]
    for color, weight in reversed(levels[:-1]):
        coarser = cv2.pyrUp(mean, dstsize=(weight.shape[1], weight.shape[0])).reshape(color.shape)
        known = np.minimum(weight, 1)[..., None]
        mean = color / np.maximum(weight, 1e-6)[..., None] * known + coarser * (1 - known)
    return mean.astype(np.float32)
