"""The judge's verdict in; the verdict with priors on fillers and a penalty on invented detail out.

The judge does not know which filler made a guess. Two rules add that, settled on street s03 and s05.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np

from dlama.geometry.holes import gaussian_mean
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.choice.judge import STRIDE, Verdict
from dlama.inpainters.choice.planes import CONTEXT, JudgePlanes

PRIORS = {"layered": 2.0}
"""Name of a guess -> its prior in the logits of colour; 0 for the others. Surfaces with their own texture are never an
invention."""
DEPTH_PRIORS = {"layered": 20.0}
"""The same for depth: continued surfaces win wherever they are among the guesses. Squared error on street s06 and s08 was 8 %
higher without it and 6 % higher at 4."""
INVENTED_PENALTY = 3.0
"""Penalty in the logits of colour per factor e of detail above that known round the hole. It applies inside the source's
picture only: out of view, objects unlike the known ones are expected."""
FINE, ROUND = 3.0, 4.0
"""Sigmas in pixels: a picture less its blur is its detail; the neighbourhood over which the detail of a guess is averaged."""
AROUND = 0.05
"""Sigma, as a share of the diagonal, of the surroundings that give the known detail."""
LEAST = 1 / 255
"""Detail (0..1) below which guesses are equally plain."""


def with_priors(verdict: Verdict, names: Sequence[str], planes: JudgePlanes) -> Verdict:
    """The verdict with other logits; names: of the K guesses, planes: padded, as the judge saw them."""
    prior, depth_prior = (
        np.array([known.get(name, 0.0) for name in names], np.float32)[:, None, None]
        for known in (PRIORS, DEPTH_PRIORS)
    )
    change = prior - np.float32(INVENTED_PENALTY) * measure_invented_detail(planes)
    depth = verdict.depth + depth_prior
    return dataclasses.replace(verdict, base=verdict.base + change, detail=verdict.detail + change, depth=depth)


def measure_invented_detail(planes: JudgePlanes) -> Float32Array:
    """K x h x w (STRIDE times smaller than the planes): log ratio of a guess's detail to that of known pixels round it, at
    least 0; 0 out of the source's view."""
    known = planes.context[CONTEXT.index("hole")] == 0
    inside = 1 - planes.context[CONTEXT.index("out of view")]
    greys = [one[:3].mean(0) for one in planes.guesses]
    details = [local_detail(one, np.ones_like(known)) for one in greys]
    there = known_mean(local_detail(greys[0], known), known)
    size = known.shape[1] // STRIDE, known.shape[0] // STRIDE
    found = []
    for detail in details:
        times = np.log((cv2.GaussianBlur(detail, (0, 0), ROUND) + LEAST) / (there + LEAST))
        found.append(cv2.resize(np.maximum(times, 0) * inside, size, interpolation=cv2.INTER_AREA))
    return np.stack(found).astype(np.float32)


def local_detail(grey: Float32Array, known: BoolArray) -> Float32Array:
    """H x W magnitudes of the difference to a blur of the known pixels."""
    return np.abs(grey - gaussian_mean(grey, known.astype(np.float32), FINE))


def known_mean(values: Float32Array, known: BoolArray) -> Float32Array:
    """H x W: mean of the known values round each pixel; 0 where none are near."""
    return gaussian_mean(values, known.astype(np.float32), AROUND * float(np.hypot(*known.shape)))
