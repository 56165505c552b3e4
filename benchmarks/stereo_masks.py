"""Networks for pairs that case one mask and that case two in -> how good they are where the other picture helps, out.

    python benchmarks/stereo_masks.py --one RUN_A/*.onnx --two RUN_B/*.onnx --data pack.dlama [--count 96]

Several files of a kind (runs of other seeds) are averaged. All fill the same held-out pairs through the filler `pair`, and only
the pixels of each picture's own hole are judged, whichever others a network also gave. Where a pixel's truth stands in the other
picture is known from the world's depth, so holes are split by what a network could have seen there:

* `in one hole`, `in both`: whether the other picture has its hole at the same pixel;
* `shown to both`: the other picture shows the very point, outside the union of the holes;
* `shown to two`: it shows the point, but within the union, so a network of one mask is not shown it;
* `shown to none`: the point is in the other picture's hole, hidden by what is there, or out of it.

`blind` is the network of two masks with the other picture hidden in the union while it paints one: it keeps its own picture's
surroundings, and loses what the other picture shows of the holes. `other` is the other picture's own pixel where the point is
in truth: what could be copied, where it is shown.

Means over each pair's pixels, then over the pairs that have at least LEAST of the kind. Differences with 95 % intervals of
the pairs drawn anew; pairs are all they speak of, not what another first state of the weights would have given.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from dlama.inpainters.networks.engine import Engine
from dlama.inpainters.networks.pair import fill_pair
from dlama.training.data.loader import HELD_OUT
from dlama.training.data.samples.worlds import WorldPairs, frame_without, removable_object
from dlama.training.data.sources import source_for
from dlama.training.loop.validation import TELEA_RADIUS, ssim_map
from dlama.training.settings import DataSettings, NetworkSettings, TrainSettings

REGIONS = ("all", "in one hole", "in both", "shown to both", "shown to two", "shown to none")
LEAST = 20
"""Pixels of a kind that a pair must have to count in its mean."""
SAME_POINT = 0.03
"""Relative difference of depth up to which two pictures show one surface."""
DRAWS = 2000


@dataclass(frozen=True, eq=False)
class ViewExample:
    """A held-out pair, left and right, in its own light."""

    target: np.ndarray
    """6 x H x W float32, 0..1: both pictures without the thing."""
    holes: np.ndarray
    """2 x H x W bool."""
    other: np.ndarray
    """6 x H x W float32: at each pixel what the other picture has at the place of the point that is there in truth."""
    regions: dict[str, np.ndarray]
    """Name -> 2 x H x W bool, parts of the holes."""


def example(source: WorldPairs, number: int, seed: int) -> ViewExample:
    """Held-out pair `number`: that of a training of this seed, neither mirrored nor relit."""
    sample = source.pair(number, np.random.default_rng([seed, HELD_OUT, number]))
    holes = sample["mask"] > 0
    views = source.worlds.stereo_views(number)
    ends = views.pairs[number % len(views.pairs)]
    thing = removable_object(views, ends[0], np.random.default_rng([seed, HELD_OUT, number]))
    frames = [views.frame(end) for end in ends]
    truth = frames if thing is None else [frame_without(views, e, thing, h) for e, h in zip(ends, holes)]
    for planes, frame in zip(np.split(sample["target"], 2), truth):  # the same thing was drawn
        assert np.array_equal(np.rint(planes * 255), frame.color.transpose(2, 0, 1))
    cameras = [views.cameras[end] for end in ends]
    baseline = float(np.linalg.norm(cameras[1].world_from_cam[:3, 3] - cameras[0].world_from_cam[:3, 3]))
    regions = {name: np.zeros_like(holes) for name in REGIONS}
    other = np.empty_like(sample["target"])
    for view, towards in ((0, -1), (1, 1)):
        at, inside = places(towards * cameras[view].fx * baseline / truth[view].depth)
        shown = inside & same_depth(frames[1 - view].depth[at], truth[view].depth)
        for name, part in split(holes[view], holes[1 - view], at, shown).items():
            regions[name][view] = part
        other[3 * view : 3 * view + 3] = frames[1 - view].color[at].transpose(2, 0, 1) / np.float32(255)
    return ViewExample(sample["target"], holes, other, regions)


def places(shift: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Rows and columns of the pixels so many to the right (H x W, inf: none), and whether they are in the picture."""
    rows, columns = np.indices(shift.shape)
    there = np.floor(columns + 0.5 + np.where(np.isfinite(shift), shift, 0)).astype(int)
    kept = np.asarray(np.clip(there, 0, shift.shape[1] - 1))
    return (np.asarray(rows), kept), np.asarray(there == kept)


def same_depth(found: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Whether two depths (metres, inf = far) are those of one surface."""
    with np.errstate(invalid="ignore"):
        return (np.isinf(found) & np.isinf(wanted)) | (np.abs(found - wanted) <= SAME_POINT * wanted)


def split(
    hole: np.ndarray, other_hole: np.ndarray, at: tuple[np.ndarray, ...], shown: np.ndarray
) -> dict[str, np.ndarray]:
    """One picture's hole by REGIONS; at: where in the other picture each point is; shown: there it is in sight, H x W all."""
    seen = hole & shown & ~other_hole[at]
    hidden = hole[at]  # the union hides the other picture there, too
    return {
        "all": hole,
        "in one hole": hole & ~other_hole,
        "in both": hole & other_hole,
        "shown to both": seen & ~hidden,
        "shown to two": seen & hidden,
        "shown to none": hole & ~seen,
    }


def telea(ask: ViewExample) -> np.ndarray:
    """6 x H x W: each picture alone by OpenCV's Telea."""
    made = []
    for planes, hole in zip(np.split(ask.target, 2), ask.holes):
        shown = np.where(hole[..., None], 0, np.rint(planes.transpose(1, 2, 0) * 255)).astype(np.uint8)
        made.append(cv2.inpaint(shown, hole.astype(np.uint8), TELEA_RADIUS, cv2.INPAINT_TELEA).transpose(2, 0, 1))
    return np.concatenate(made).astype(np.float32) / np.float32(255)


def scores(filled: np.ndarray, ask: ViewExample) -> np.ndarray:
    """len(REGIONS) x 3: colour L1, PSNR (dB) and SSIM; NaN where there are too few pixels."""
    own = np.repeat(ask.holes, 3, 0)
    mine = np.where(own, np.clip(filled, 0, 1), ask.target).astype(np.float32)
    ssim = ssim_map(torch.from_numpy(mine[None]), torch.from_numpy(ask.target[None]))[0].numpy()
    found = np.full((len(REGIONS), 3), np.nan)
    for row, name in enumerate(REGIONS):
        part = np.repeat(ask.regions[name], 3, 0)
        if part.sum() >= 3 * LEAST:
            wrong = (mine - ask.target)[part]
            found[row] = np.abs(wrong).mean(), -10 * np.log10(max(float((wrong**2).mean()), 1e-10)), ssim[part].mean()
    return found


def filled_by(network: Engine, ask: ViewExample) -> np.ndarray:
    """6 x H x W: both pictures as the filler `pair` paints them; what is hidden is not handed over."""
    return fill_pair(network, np.where(np.repeat(ask.holes, 3, 0), 0, ask.target), ask.holes)


def filled_half_blind(network: Engine, ask: ViewExample) -> np.ndarray:
    """The same by a network of two masks, but while it paints one picture the other is hidden in the union of the holes, as it
    is from a network of one mask: what is then missing is what the other picture's mask of its own gave."""
    made, union = [], ask.holes[0] | ask.holes[1]
    for view in (0, 1):
        holes = np.stack([ask.holes[each] if each == view else union for each in (0, 1)])
        filled = fill_pair(network, np.where(np.repeat(holes, 3, 0), 0, ask.target), holes)
        made.append(filled[3 * view : 3 * view + 3])
    return np.concatenate(made)


def measured(
    fill: Callable[[Engine, ViewExample], np.ndarray], group: Sequence[Engine], asked: Sequence[ViewExample]
) -> np.ndarray:
    """Networks x pairs x regions x 3."""
    return np.array([[scores(fill(network, ask), ask) for ask in asked] for network in group])


def interval(differences: np.ndarray) -> tuple[float, float]:
    """95 % of the means of the pairs (1-D, no NaN) drawn anew."""
    drawn = np.random.default_rng(0).integers(len(differences), size=(DRAWS, len(differences)))
    low, high = np.percentile(differences[drawn].mean(1), [2.5, 97.5])
    return float(low), float(high)


def print_table(columns: dict[str, np.ndarray], asked: Sequence[ViewExample]) -> None:
    """One row for each measure and region; columns: head -> networks x pairs x regions x 3."""
    pixels = {name: sum(int(ask.regions[name].sum()) for ask in asked) for name in REGIONS}
    heads = "".join(f"{head:>9}" for head in columns)
    for measure, name in enumerate(("colour L1 (0..1)", "colour PSNR, dB", "colour SSIM")):
        digits = 2 if measure == 1 else 4
        print(f"\n{name:<18}{'pairs':>6}{'pixels':>8}{heads}   {'two - one':<31}two - blind")
        for row, region in enumerate(REGIONS):
            found = {head: values[..., row, measure].mean(0) for head, values in columns.items()}
            there = ~np.isnan(found["two"])
            if there.sum() < 2:
                continue
            gains = [gain((found["two"] - found[base])[there], digits) for base in ("one", "blind")]
            print(
                f"{region:<18}{there.sum():>6}{pixels[region] / pixels['all']:>8.1%}"
                + "".join(f"{values[there].mean():>9.{digits}f}" for values in found.values())
                + f"   {gains[0]:<28}   {gains[1]}"
            )


def gain(differences: np.ndarray, digits: int) -> str:
    """Mean and interval."""
    low, high = interval(differences)
    return f"{differences.mean():+.{digits}f} ({low:+.{digits}f} to {high:+.{digits}f})"


def print_runs(one: np.ndarray, two: np.ndarray, files: Sequence[Path]) -> None:
    """One row for each network: PSNR by region."""
    print(f"\n{'PSNR of each file':<40}" + "".join(f"{name:>15}" for name in REGIONS))
    for path, values in zip(files, [*one, *two]):
        means = np.nanmean(values[..., 1], 0)
        print(f"{'/'.join(path.parts[-2:]):<40}" + "".join(f"{value:>15.2f}" for value in means))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--one", nargs="+", type=Path, required=True, help="ONNX files of one mask (7 -> 6)")
    parser.add_argument("--two", nargs="+", type=Path, required=True, help="ONNX files of two masks (8 -> 6)")
    parser.add_argument("--data", nargs="*", type=Path, default=[], help="photos or packs for the worlds' surfaces")
    parser.add_argument("--count", type=int, default=96)
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    engines = [[Engine(path) for path in paths] for paths in (chosen.one, chosen.two)]
    for masks, group in enumerate(engines, 1):
        for network in group:
            if network.contract.masks != masks or len(network.contract.out_planes) != 6:
                parser.error(
                    f"{network.path}: cases {list(network.contract.in_planes)}; a pair and {masks} mask(s) wanted"
                )
    data = DataSettings(size=chosen.size, mixture={"stereo": 1.0})
    source = source_for(
        TrainSettings("masks", network=NetworkSettings("stereo-two-masks"), data=data), chosen.data, "held_out"
    )
    assert isinstance(source, WorldPairs)
    asked = [example(source, number, chosen.seed) for number in range(chosen.count)]
    one, two = (measured(filled_by, group, asked) for group in engines)
    blind = measured(filled_half_blind, engines[1], asked)
    alone, other = (np.array([[scores(make(ask), ask) for ask in asked]]) for make in (telea, lambda ask: ask.other))
    print(
        f"{chosen.count} held-out pairs of {chosen.size} px; {len(chosen.one)} networks of one mask, {len(chosen.two)} of two"
    )
    print_table({"Telea": alone, "one": one, "two": two, "blind": blind, "other": other}, asked)
    if len(chosen.one) + len(chosen.two) > 2:
        print_runs(one, two, [*chosen.one, *chosen.two])


if __name__ == "__main__":
    main()
