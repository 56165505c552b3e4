"""Corrections by further clicks on objects whose mask is known: how much better each click makes the mask, by domain.

    python benchmarks/click_corrections.py ../shared --split tune
    python benchmarks/click_corrections.py ../shared --split validate --clicks 4 -o corrections.json

The pictures, objects and first clicks of `clicks.py`. Each further click lies amid the largest region that is wrong: a click
where the object is missing, a negative click where something else is in the mask. Objects on which nothing is left to click on
(VISIBLE) keep their mask. Printed: mean IoU after each click, the number of further clicks, and the share of them that made the
mask worse. Ten minutes on one core.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from click_photos import innermost_pixel, largest_region
from clicks import FIRST, Click, cases_of, interval
from dlama.errors import MaskError
from dlama.geometry.rgbd import BoolArray
from dlama.perception.object_masks import MaskSession

VISIBLE = 0.02, 3
"""Least area of an error over the object's, and least radius in px of the largest disc in it, that a user sees and clicks on."""
WORSE = 0.02
"""Loss of IoU of a click that made the mask worse."""
DOMAINS = "world", "stand", "street", "real", "photo"


def largest_error(click: Click, found: BoolArray) -> tuple[BoolArray, bool] | None:
    """H x W, the largest region that is wrong, and whether it belongs to the object; None where none is VISIBLE."""
    errors = ((click.true & ~found & ~click.ignored, True), (found & ~click.true & ~click.ignored, False))
    regions = [(largest_region(error), belongs) for error, belongs in errors if error.any()]
    if not regions:
        return None
    region, belongs = max(regions, key=lambda each: int(each[0].sum()))
    inner = float(cv2.distanceTransform(np.pad(region.astype(np.uint8), 1), cv2.DIST_L2, 5).max())
    seen = region.sum() >= VISIBLE[0] * click.true.sum() and inner >= VISIBLE[1]
    return (region, belongs) if seen else None


def scores_of_clicks(session: MaskSession, click: Click, most: int) -> tuple[list[float], int]:
    """IoU after each of `most` clicks, the last one repeated where nothing is left to click on; and how many were clicked."""
    clicks: dict[bool, list[tuple[int, int]]] = {True: [click.at], False: []}
    scores = list[float]()
    for number in range(most):
        try:
            found = session.find(clicks=clicks[True], not_clicks=clicks[False]).mask
        except MaskError:
            found = np.zeros_like(click.true)
        scores.append(click.score(found))
        error = largest_error(click, found)
        if error is None or number == most - 1:
            break
        clicks[error[1]].append(innermost_pixel(error[0]))
    return scores + scores[-1:] * (most - len(scores)), len(scores)


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--split", choices=tuple(FIRST), default="tune")
    parser.add_argument("--domains", nargs="+", choices=DOMAINS, default=DOMAINS)
    parser.add_argument("--clicks", type=int, default=4, help="the first one counts")
    parser.add_argument("-o", "--output", type=Path, help="IoU after each click of each object as JSON")
    args = parser.parse_args(argv)
    scores: dict[str, dict[str, list[tuple[list[float], int]]]] = {}
    for case in cases_of(args.split, args.shared, args.domains):
        session = MaskSession(case.frame)
        found = [scores_of_clicks(session, click, args.clicks) for click in case.clicks if click.true.any()]
        scores.setdefault(case.domain, {}).setdefault(case.name, []).extend(found)
    numbers = [f"{number} click{'s' * (number > 1)}" for number in range(1, args.clicks + 1)]
    print(f"| domain | objects | {' | '.join(numbers)} | gain, 95 % | further clicks | worse |")
    print("|" + "---|" * (args.clicks + 5))
    means = []
    for domain, by_picture in scores.items():
        every = [each for picture in by_picture.values() for each in picture]
        if not every:
            continue
        table, clicked = np.array([values for values, _ in every]), np.array([count for _, count in every]) - 1
        low, high = interval([[values[-1] - values[0] for values, _ in picture] for picture in by_picture.values()])
        means.append(table.mean(0))
        worse = (np.diff(table, axis=1) < -WORSE).sum() / max(clicked.sum(), 1)
        cells = " | ".join(f"{value:.3f}" for value in means[-1])
        gain = f"{low:+.3f} to {high:+.3f}"
        print(f"| {domain} | {len(every)} | {cells} | {gain} | {clicked.mean():.1f} | {100 * worse:.0f} % |")
    print(f"| mean | | {' | '.join(f'{value:.3f}' for value in np.mean(means, 0))} | | | |")
    if args.output:
        args.output.write_text(json.dumps(scores))


if __name__ == "__main__":
    main()
