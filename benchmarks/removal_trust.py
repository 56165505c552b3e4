"""Depth behind really removed objects: how far confidence and expected error are met, by bins of each.

    python benchmarks/removal_trust.py ../shared

Pairs recorded with and without objects (bin, tables, a room), completed by `remove` as it is by default. Pixels of the masks
where the second take has depth, pooled. `within`: share within 5 % of the truth. A minute.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import dlama
from dlama.datasets.frames import RemovalTruth
from dlama.datasets.layouts import open_dataset

CONFIDENCES = (0.0, 0.5, 0.7, 0.9, 1.0)
ERRORS = (0.0, 0.02, 0.05, 0.2, np.inf)
"""Metres."""


def judge(truth: RemovalTruth) -> np.ndarray:
    """4 x N, of filled pixels: confidence, expected and true error of depth (metres), true depth."""
    view = dlama.remove(truth.source, truth.mask).view
    compared = view.filled & truth.without.valid & np.isfinite(view.depth)
    compared &= True if truth.compare is None else truth.compare
    error = np.abs(view.depth - truth.without.depth)
    return np.stack([view.confidence, view.depth_error, error, truth.without.depth])[:, compared]


def main(argv: Sequence[str] | None = None) -> None:
    """Print one line a bin."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path, help="the folder that has data/*removal*")
    folders = sorted(parser.parse_args(argv).shared.glob("data/*removal*"))
    truths = [case.load() for folder in folders for case in open_dataset(folder).cases if case.protocol == "ori"]
    found = np.concatenate([judge(truth) for truth in truths if isinstance(truth, RemovalTruth)], axis=1)
    print(f"{len(truths)} pairs, {found.shape[1]} pixels")
    for name, values, bins in (("confidence", found[0], CONFIDENCES), ("expected error, m", found[1], ERRORS)):
        for low, high in itertools.pairwise(bins):
            _, expected, error, depth = found[:, (values >= low) & (values < high)]
            print(
                f"{name} {low:g} to {high:g}: {len(error) / found.shape[1]:.2f} of the pixels, within "
                f"{(error < 0.05 * depth).mean():.3f}, error {error.mean():.4f} m on average, expected {expected.mean():.4f} m"
            )


if __name__ == "__main__":
    main()
