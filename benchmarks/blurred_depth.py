"""Views from true depth that is blurred as an estimate is, and sharpened: what edges of estimated depth cost, without its errors.

    python benchmarks/blurred_depth.py ../shared -o now.jsonl [--split tune] [--against before.jsonl]

`--against` prints the change of each measure from the figures of an earlier run, in % as `bench.py compare` does.
Streets of the split and 24 procedural worlds. An estimate that is off everywhere moves all pixels of a view, and no measure
then sees a torn edge; here only edges are wrong. `torn`: pixels of the sharpened depth that differ from three neighbours of four.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from bench import SETTINGS, BenchCase, cases_of, change_in_words, lpips_map, paired, rows_of, table_of
from dlama.datasets.frames import Truth, ViewTruth
from dlama.evaluation.metrics.pictures import mse_map
from dlama.evaluation.protocols.methods import Method, run_method
from dlama.evaluation.protocols.vpi import target_reference
from dlama.geometry.drawing.picture_edges import JUMP
from dlama.geometry.projection import inverse_depth
from dlama.geometry.rgbd import RGBD, Float32Array
from dlama.perception.sharpening import sharpen_depth
from world_cases import world_case

COARSE = 80
"""Longer side of the map that the true depth is reduced to."""
WORLDS = {"tune": 1400, "validate": 2400}
"""First number of the worlds of a split."""
FAR_M = 5000.0
METHOD = Method("dlama", "auto")
MEASURES = (
    "torn", "band depth", "whole lpips", "whole mse", "seen lpips", "seen mse", "unseen lpips", "unseen mse",
)  # fmt: skip


def cases(split: str, shared: Path) -> Iterator[BenchCase]:
    """The views of a split."""
    yield from (case for case in cases_of(split, shared) if case.name.startswith("street") and "/vpi/" in case.name)
    for number in range(WORLDS[split], WORLDS[split] + 24):
        yield BenchCase(f"world/{number}", "world", partial(world_case, number, "view", "exact"))


def sharpened(frame: RGBD) -> tuple[RGBD, Float32Array, Float32Array]:
    """The frame with blurred and sharpened depth, and H x W inverse depth, blurred and sharpened."""
    w = inverse_depth(frame.depth)
    height, width = w.shape
    factor = COARSE / max(height, width)
    small = cv2.resize(w, (round(width * factor), round(height * factor)), interpolation=cv2.INTER_AREA)
    blurred = np.maximum(cv2.resize(small, (width, height), interpolation=cv2.INTER_CUBIC), 0).astype(np.float32)
    sharp = sharpen_depth(blurred, frame.color)
    depth = np.where(sharp < 1 / FAR_M, np.inf, 1 / np.maximum(sharp, 1e-6)).astype(np.float32)
    return dataclasses.replace(frame, depth=depth, estimate={"estimator": "blurred"}), blurred, sharp


def measure(truth: Truth) -> dict[str, float]:
    """The numbers of one view."""
    assert isinstance(truth, ViewTruth)
    reference = target_reference(truth, SETTINGS)
    shown = reference.within(np.ones(truth.target.color.shape[:2], np.bool_))
    source, blurred, sharp = sharpened(truth.source)
    view = run_method(METHOD, source, truth.target.camera, None).view()
    mine = np.where(shown[..., None], view.color, reference.color)
    squared, distance = mse_map(reference.color, mine), lpips_map(reference.color, mine, shown)
    w = inverse_depth(truth.source.depth)
    band = np.abs(blurred - w) > 0.03 * np.maximum(blurred, w)
    around = np.stack([np.roll(sharp, by, axis) for by in (1, -1) for axis in (0, 1)])
    torn = (np.abs(around - sharp) > JUMP * np.maximum(around, sharp)).sum(0) >= 3
    off = np.abs(sharp - w) / np.maximum(np.maximum(sharp, w), 1e-6)
    found = {"torn": float(torn.sum()), "band depth": float(off[band].mean())}
    for name in ("seen", "unseen"):
        region = reference.regions[name] & shown
        if region.any():
            found |= {f"{name} lpips": float(distance[region].mean()), f"{name} mse": float(squared[region].mean())}
    return found | {"whole lpips": float(distance[shown].mean()), "whole mse": float(squared[shown].mean())}


def compare(before: Path, now: Path) -> None:
    """Print the change of each measure, from one file to the other."""
    (base, domains), (mine, _) = (table_of(rows_of(path)) for path in (before, now))
    for name in MEASURES:
        pairs = paired(base[METHOD.label], mine[METHOD.label], name, list(mine[METHOD.label]), domains)
        print(f"{name:14} {change_in_words(pairs)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--split", choices=tuple(WORLDS), default="tune")
    parser.add_argument("--against", type=Path, help="output of an earlier run on the same split")
    asked = parser.parse_args()
    with asked.output.open("w", encoding="utf-8") as stream:
        for case in cases(asked.split, asked.shared):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = measure(dataclasses.replace(case.load(), exposure_varies=False))
            row = {"case": case.name, "domain": case.domain, "method": METHOD.label, "measures": found}
            stream.write(json.dumps(row) + "\n")
            stream.flush()
    if asked.against:
        compare(asked.against, asked.output)


if __name__ == "__main__":
    main()
