"""A true picture with its regions (the reference) and what a method made of it in; the measures of every region out.

Every method is compared with the same reference: same regions, same pixels, one gain per channel. Pixels that cannot be
compared (no true depth, or excluded by the data set) are copied from the truth into what is scored, so that windows and
features see no difference there, and are left out of every mean; `whole` is then the rest of the picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlama.evaluation.metrics.artifacts import edge_offset, law_broken, leak_share
from dlama.evaluation.metrics.depth import depth_errors
from dlama.evaluation.metrics.lpips import lpips
from dlama.evaluation.metrics.pictures import SETTINGS, depth_8bit, mse_map, psnr, region_mean, ssim_map
from dlama.evaluation.metrics.reliability import by_distance, calibration, sparsification_area
from dlama.evaluation.protocols.methods import Measure, MethodRun, ProtocolSettings, measures_of
from dlama.evaluation.protocols.strips import strip
from dlama.geometry.camera import Float64Array
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array, brighten, replace_pixels
from dlama.geometry.view import View
from dlama.inpainters.confidence import COLOR_WITHIN, DEPTH_WITHIN

REGION, MODALITY = "filled", "confidence"
"""Of measures of confidence: what was a hole of the method's own view and is comparable."""
Gain = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Reference:
    """The truth of one picture, and the regions in which every method is compared with it."""

    color: UInt8Array
    """H x W x 3."""
    depth: Float32Array | None
    """H x W metres, 0 = missing, inf = far; None: not known, or not in metres."""
    regions: Mapping[str, BoolArray]
    """Besides `whole`."""
    settings: ProtocolSettings
    comparable: BoolArray | None = None
    """H x W, True = comparable; None: everywhere."""
    gain: Gain = (1.0, 1.0, 1.0)
    """What brings the source's colours to the truth's exposure."""
    suffix: str = ""
    """Added to every region's name (`-right`)."""
    color_within: float = COLOR_WITHIN
    """Levels within which a filled colour is right (`reliability.color_tolerance`)."""

    def match_exposure(self, color: UInt8Array) -> UInt8Array:
        """A method's colours in the truth's exposure."""
        return brighten(color, self.gain)

    def shares(self) -> list[Measure]:
        """How much of the picture each region is, in %: the same for every method."""
        counted = {name: self.within(region) for name, region in self.regions.items()}
        return [
            Measure(name + self.suffix, "rgb", "share", 100 * float(region.mean())) for name, region in counted.items()
        ]

    def within(self, region: BoolArray) -> BoolArray:
        """The comparable part of a region, H x W."""
        return region if self.comparable is None else region & self.comparable

    def color_measures(self, color: UInt8Array) -> list[Measure]:
        """ssim, lpips, mse and psnr of every region, of colours as the method gave them."""
        return self._picture_measures("rgb", self.color, self.match_exposure(color), self.comparable)

    def depth_measures(self, depth: Float32Array) -> list[Measure]:
        """ssim, lpips and mse of the 8-bit depth picture that the paper shows; missing is black."""
        if self.depth is None:
            return []
        known = self.depth > 0
        counted = known if self.comparable is None else known & self.comparable
        truth, mine = (depth_8bit(one) for one in (self.depth, depth))
        return self._picture_measures("depth", truth, mine, None if counted.all() else counted)

    def metre_measures(self, depth: Float32Array, hole: BoolArray | None = None) -> list[Measure]:
        """mae, absrel, delta1.05 ... in metres.

        `hole`, of the baseline that fills nothing: pixels without depth. They are left out, and so are all regions but
        `whole` and `seen`: elsewhere the baseline shows next to nothing, and that by mistake.
        """
        if self.depth is None:
            return []
        counted = self.within(self.depth > 0 if hole is None else (self.depth > 0) & ~hole)
        found: list[Measure] = []
        for name, region in self.large_regions(counted):
            if hole is None or name in ("whole", "seen"):
                found += measures_of(name + self.suffix, "depth_m", depth_errors(depth, self.depth, region))
        return found

    def large_regions(self, counted: BoolArray | None) -> Iterator[tuple[str, Any]]:
        """The whole and each region that is not too small, of the pixels that are `counted`; None: all, the whole picture."""
        for name, region in {"whole": counted, **self.regions}.items():
            chosen = region if counted is None or region is None else region & counted
            if chosen is None or chosen.sum() >= self.settings.smallest_region:
                yield name, chosen

    def _picture_measures(
        self, modality: str, truth: UInt8Array, mine: UInt8Array, counted: BoolArray | None
    ) -> list[Measure]:
        if counted is not None:
            mine = replace_pixels(truth, counted, mine)
        maps = ssim_map(truth, mine), mse_map(truth, mine)
        found: list[Measure] = []
        for name, region in self.large_regions(counted):
            values = {"ssim": region_ssim(maps[0], region), "mse": region_mean(maps[1], region)}
            if modality == "rgb":
                values["psnr"] = psnr(values["mse"])
            if self.settings.lpips:
                values["lpips"] = lpips(mine, truth, region)
            found += [Measure(name + self.suffix, modality, metric, value) for metric, value in values.items()]
        return found


def view_measures(run: MethodRun, reference: Reference) -> list[Measure]:
    """Of the last view of a run: its holes, colours, depth as a picture and in metres, how large each region is, and seconds."""
    view = run.view()
    return [
        *run.hole_shares(),
        *reference.color_measures(view.color),
        *reference.depth_measures(view.depth),
        *reference.metre_measures(view.depth, None if run.method.fills else run.completion.warped[-1].hole),
        *reference.shares(),
        run.timing(),
    ]


def region_ssim(ssim: Float64Array, region: BoolArray | None) -> float:
    """Mean of an SSIM map over a region; None: the whole picture without its border, as scikit-image has it."""
    edge = (SETTINGS.ssim_window - 1) // 2
    return region_mean(ssim, region) if region is not None else region_mean(ssim[edge:-edge, edge:-edge])


def picture_panel(run: MethodRun, reference: Reference, source: RGBD, truth: RGBD, number: int = -1) -> UInt8Array:
    """The pictures of one view that the report shows; the method's are in the truth's exposure."""
    warped, view = run.completion.warped[number], run.view(number)
    mine = [reference.match_exposure(one.color) for one in (warped, view)]
    depths = source.depth, warped.depth, view.depth, truth.depth
    return strip((source.color, *mine, truth.color), depths, warped.hole)


def artifact_measures(
    run: MethodRun, view: View, reference: Reference, name: str, region: BoolArray, truth: RGBD, source: RGBD | None
) -> list[Measure]:
    """The artifacts of a fill (`dlama.evaluation.metrics.artifacts`); none of the baseline that fills nothing.

    Args:
        view: the completed one.
        region: H x W, the pixels whose edges are compared; `name` is what it is called.
        source: what was measured; None leaves `law_broken` out.
    """
    if not run.method.fills:
        return []
    meta = run.completion.meta
    mine = edge_offset(reference.match_exposure(view.color), view.depth, region)
    offsets = {"edge_offset": mine, "edge_offset_truth": edge_offset(truth.color, truth.depth, region)}
    broken = None if source is None else law_broken(view, source)
    return [
        *measures_of(name, "depth", offsets),
        *measures_of("whole", "depth", {"channel_spread": meta.get("notes", {}).get("depth_channel_spread")}),
        *measures_of("whole", "depth_m", {"law_violations": meta["law_violations"], "law_broken": broken}),
    ]


def leak_measures(run: MethodRun, truth: RGBD, seen: BoolArray) -> list[Measure]:
    """% of the seen pixels that the last view before filling shows although something hides them."""
    return measures_of("seen", "depth_m", {"leaks": leak_share(run.completion.warped[-1], truth, seen, run.clip_m)})


def depth_deviation(z: Float32Array, true_z: Float32Array) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """By how much N depths are off: metres (inf where one of both is far), and as a share of the truth, 0..1 (0: both far)."""
    same_far, finite = np.isinf(z) & np.isinf(true_z), np.isfinite(z) & np.isfinite(true_z)
    off = np.where(finite, np.abs(np.where(finite, z, 1) - np.where(finite, true_z, 1)), np.inf)
    return off, np.where(same_far, 0, np.minimum(off / np.where(finite, true_z, 1), 1))


def reliability_measures(run: MethodRun, reference: Reference, number: int = -1) -> list[Measure]:
    """Of one view of a run; nothing of the baseline that fills nothing, where depth is not known, and of hardly any pixels.

    right, predicted: share that is right, and mean confidence; color_within: levels that count as right; ece; ause_depth,
    ause_color (ordered by expected error), each also by distance from the rim and at random; expected and actual errors of depth
    (m, at most the depth itself) and colour (levels); bin_K_share, bin_K_predicted, bin_K_right: the reliability curve, as shares
    of all filled pixels. What rests on expected errors is left out of a view that has none.
    """
    if not run.method.fills or reference.depth is None:
        return []
    warped, view = run.completion.warped[number], run.view(number)
    where = reference.within(warped.hole & ~view.hole & (reference.depth > 0))
    if where.sum() < reference.settings.smallest_region:
        return []
    clip = np.float32(np.inf if run.clip_m is None else run.clip_m)
    z, true_z = view.depth[where], np.minimum(reference.depth, clip)[where]
    painted = warped.color_hole[where]
    color = reference.match_exposure(view.color)[where].astype(np.float32)
    levels = np.abs(color - reference.color[where]).mean(1) * painted
    off, relative = depth_deviation(z, true_z)
    right = (relative <= DEPTH_WITHIN) & (levels <= reference.color_within)
    predicted = view.confidence[where]
    bins = calibration(predicted, right)
    found = {"right": float(right.mean()), "predicted": float(predicted.mean()), "ece": bins.error}
    found["color_within"] = reference.color_within
    others: dict[str, NDArray[np.floating]] = {
        "_distance": by_distance(warped.hole, warped.color_hole)[where],
        "_random": np.random.default_rng(run.method.seed).random(len(predicted)),
    }
    for name, order in {"": predicted, **others}.items():
        found[f"ause_depth{name}"] = sparsification_area(order, relative)
    judged = view.errors is not None
    if painted.any():
        found["actual_color"] = float(levels[painted].mean())
    if painted.any() and judged:
        expected = view.color_error[where]
        for name, order in {"": -expected, **others}.items():
            found[f"ause_color{name}"] = sparsification_area(order[painted], levels[painted])
        found["expected_color"] = float(expected[painted].mean())
    some = np.isfinite(z)
    if some.any():
        if judged:
            found["expected_depth"] = float(view.depth_error[where][some].mean())
        found["actual_depth"] = float(np.minimum(off[some], z[some]).mean())
    region = REGION + reference.suffix
    return [Measure(region, MODALITY, metric, value) for metric, value in (found | bins.measures).items()]
