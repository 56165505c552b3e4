"""Time and peak memory of a photo's removal by its size: depth, click, removal and all files, as a table and a figure.

    python benchmarks/by_size.py -o docs/images/by-size.svg

Processor time counts, as other programs may run on the machine. The photo is read from the folder in DLAMA_DATA.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from speed import ROOT, in_checkout

SIZES = {"photo-1mp": 1225, "photo-4mp": 2450, "photo-12mp": 4000, "photo-24mp": 6000}
"""Row of `speed.py` -> width of its photo, px; 3:2."""
STAGES = ("depth", "click", "removal", "write")
INK = "#7a7f87"
"""Grey that is seen on white and on black."""


def main() -> None:
    """Measure each size in a process of its own, and draw the two lines."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    asked = parser.parse_args()
    points: list[tuple[float, float, float]] = []
    for row, width in SIZES.items():
        found = in_checkout(ROOT / "src", row)
        assert found is not None, row
        points.append((width * (2 * width // 3) / 1e6, sum(found[stage] for stage in STAGES), found["peak GB"]))
        print("{:5.1f} MP  {:6.1f} s of processor time  {:5.2f} GB".format(*points[-1]), flush=True)
    plt.rcParams |= {
        "svg.fonttype": "none",
        "svg.hashsalt": "dlama",
        "font.size": 9,
        "grid.color": INK,
        "grid.alpha": 0.3,
    }
    plt.rcParams |= dict.fromkeys(
        ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK
    )
    figure, axes = plt.subplots(1, 2, figsize=(7, 2.6), layout="constrained")
    megapixels = [point[0] for point in points]
    for axis, number, title, color in zip(
        axes, (1, 2), ("processor time, s", "peak memory, GB"), ("#0072b2", "#d55e00")
    ):
        axis.plot(megapixels, [point[number] for point in points], marker="o", color=color)
        axis.set(title=title, xlabel="megapixels", ylim=(0, None), xlim=(0, None))
        axis.grid(visible=True)
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(asked.output, metadata={"Date": None}, transparent=True)


if __name__ == "__main__":
    main()
