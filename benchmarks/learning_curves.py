"""Run directories of `dlama train` -> one figure of what they learnt, on samples that were never trained on.

python benchmarks/learning_curves.py RUN ... -o learning.svg
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

SHOWN = {
    "held_out_color_psnr": "colour PSNR in the hole, dB",
    "held_out_color_ssim": "colour SSIM in the hole",
    "held_out_depth_l1": "L1 of normalised inverse depth in the hole",
}


def curve(run: Path, column: str) -> tuple[list[int], list[float]]:
    """Steps and values of one column, where it was measured."""
    rows = [row for row in csv.DictReader((run / "metrics.csv").open()) if row.get(column)]
    return [int(row["step"]) for row in rows], [float(row[column]) for row in rows]


def main() -> None:
    """Draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    args = parser.parse_args()
    figure, axes = plt.subplots(1, len(SHOWN), figsize=(4 * len(SHOWN), 3), layout="constrained")
    for axis, (column, title) in zip(axes, SHOWN.items()):
        for run in args.runs:
            steps, values = curve(run, column)
            if steps:
                axis.plot(steps, values, marker=".", label=run.name)
        axis.set(title=title, xlabel="step")
        axis.title.set_fontsize(9)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    figure.savefig(args.output, metadata={"Date": None})


if __name__ == "__main__":
    main()
