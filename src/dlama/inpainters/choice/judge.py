"""The judge's network file and the planes of a view's guesses in; the weight of each guess, and the expected errors, out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from dlama.errors import FileError
from dlama.geometry.rgbd import BoolArray, Float32Array
from dlama.inpainters.choice.planes import CONTEXT, GUESS, MULTIPLE, JudgePlanes
from dlama.models.contracts import CONTRACT_KEY
from dlama.models.network_file import NetworkFile, cores, default_provider, file_stamp
from dlama.models.verify import sha256_of

NETWORK = "judge"
"""Kind of network in its contract."""
VERSION = 1
STRIDE = 4
"""The judge's maps are so many times smaller than its planes."""
MARGIN = 96
"""Pixels round the hole that the judge sees."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """The judge's output for the guesses of a view; maps are STRIDE times smaller than its padded planes."""

    base: Float32Array
    """K x h x w logits: weights of base colours."""
    detail: Float32Array
    """K x h x w logits: weights of detail."""
    depth: Float32Array
    """K x h x w logits: choice of depth."""
    color_error: Float32Array
    """h x w: expected absolute error of colour, mean over channels, 0..1."""
    depth_error: Float32Array
    """h x w: expected absolute error of depth, relative, 1 at most."""


def judge_metadata(weights: Path, licence: str) -> dict[str, str]:
    """The metadata of a judge's ONNX file: its contract and origin; weights: the file it was made of."""
    about = {
        "version": VERSION,
        "network": NETWORK,
        "context": CONTEXT,
        "guess": GUESS,
        "multiple": MULTIPLE,
        "licence": licence,
        "sha256": sha256_of(weights),
    }
    return {CONTRACT_KEY: json.dumps(about)}


def is_judge(metadata: Mapping[str, str]) -> bool:
    """Whether a network file's metadata is that of a judge."""
    try:
        return json.loads(metadata.get(CONTRACT_KEY, "{}")).get("network") == NETWORK
    except (ValueError, AttributeError):
        return False


def open_judge(path: Path) -> NetworkFile:
    """The judge of a file, kept open. FileError where it is none, or one of other planes."""
    return _open_judge(path, file_stamp(path), default_provider(), cores())


@lru_cache(maxsize=2)
def _open_judge(path: Path, stamp: tuple[int, int], provider: str | None, threads: int) -> NetworkFile:
    network = NetworkFile(path, provider, threads)
    if not is_judge(network.metadata):
        raise FileError(f"{path}: is no judge of guesses by its contract ({CONTRACT_KEY})")
    about = json.loads(network.metadata[CONTRACT_KEY])
    if about.get("version") != VERSION or [about.get("context"), about.get("guess")] != [list(CONTEXT), list(GUESS)]:
        raise FileError(
            f"{path}: judges planes of another version of dlama; {list(CONTEXT)} and {list(GUESS)} are expected"
        )
    return network


def run_judge(network: NetworkFile, planes: JudgePlanes) -> Verdict:
    """The judge's verdict on padded planes (`JudgePlanes.pad`). It sees the hole and MARGIN pixels round it; elsewhere, where
    all guesses are what is known, logits and errors are 0."""
    rows, columns = hole_box(planes.context[-1] > 0)
    seen = {"context": planes.context[None], "guesses": planes.guesses}
    logits, errors = network.run_all(
        {name: np.ascontiguousarray(part[..., rows, columns]) for name, part in seen.items()}
    )
    if not (np.isfinite(logits).all() and np.isfinite(errors).all()):
        raise FileError(f"{network.path}: the judge gave values that are not finite")
    count, (height, width) = len(planes.guesses), planes.context.shape[1:]
    maps = np.zeros((3 * count + 2, height // STRIDE, width // STRIDE), np.float32)
    at = [slice(part.start // STRIDE, part.stop // STRIDE) for part in (rows, columns)]
    maps[: 3 * count, at[0], at[1]] = logits.transpose(1, 0, 2, 3).reshape(3 * count, *logits.shape[2:])
    maps[3 * count :, at[0], at[1]] = np.minimum(np.exp(errors[0]), np.array([np.inf, 1], np.float32)[:, None, None])
    return Verdict(maps[:count], maps[count : 2 * count], maps[2 * count : -2], maps[-2], maps[-1])


def hole_box(hole: BoolArray) -> tuple[slice, slice]:
    """Rows and columns of the hole (H x W, sides multiples of MULTIPLE) with MARGIN pixels round it, in steps of MULTIPLE; all
    of the picture where there is no hole."""
    found = []
    for axis, length in enumerate(hole.shape):
        where = np.flatnonzero(hole.any(1 - axis))
        first, last = (int(where[0]), int(where[-1])) if where.size else (0, length - 1)
        start = max(0, first - MARGIN) // MULTIPLE * MULTIPLE
        found.append(slice(start, min(length, -(-(last + 1 + MARGIN) // MULTIPLE) * MULTIPLE)))
    return found[0], found[1]
