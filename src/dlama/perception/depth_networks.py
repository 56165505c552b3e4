"""A picture and a depth network in; the network's prediction (depth, inverse depth or points) out.

How a network expects its picture and what its numbers mean is data, a DepthContract; only `predict` reads it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import cv2
import numpy as np

from dlama.arguments import as_array, check
from dlama.errors import DepthError, FileError, InputError
from dlama.geometry.rgbd import BoolArray, Float32Array, UInt8Array, check_fields
from dlama.models.contracts import ColorContract
from dlama.models.network_file import NetworkFile

Gives = Literal["depth", "inverse depth", "points"]
KINDS: tuple[Gives, ...] = ("depth", "inverse depth", "points")
IMAGENET = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Mean and standard deviation of ImageNet's colours (0..1), by which most networks expect their pictures normalised."""
STEPS = 60
"""Of either search of a shift."""
GOLDEN = (math.sqrt(5) - 1) / 2


@dataclass(frozen=True)
class DepthContract(ColorContract):
    """What a network of monocular depth takes and gives. InputError for contradictions."""

    network = "monocular depth"

    gives: Gives
    """depth: planar z; inverse depth: larger is nearer; points: x, y, z in the camera, z known up to a shift."""
    metric: bool = False
    """Whether that is in metres; else it is known up to a factor, relative inverse depth up to a factor and a shift."""
    side: int | tuple[int, ...] = 518
    """Pixels of the shorter side; of several the predictions are averaged (relative ones over their means). Without meaning for a
    graph whose own height and width are fixed: the picture is stretched to those."""
    multiple: int = 14
    """Height and width are rounded to a multiple of this."""
    tokens: int | None = None
    """The number that its second input (int64) expects: its resolution in tokens."""
    outputs: tuple[str, ...] = ()
    """Names of the outputs that are used, each as `first|or this`: the map; of points also their mask and their metric scale.
    Empty: the first output."""

    def __post_init__(self) -> None:
        if self.gives not in KINDS:
            raise InputError(f"contract: gives is {self.gives!r}; one of {', '.join(KINDS)} is expected")
        self.check_colors()
        if not self.sides or min(*self.sides, self.multiple) < 1:
            raise InputError("contract: side and multiple of 1 or more are expected")
        if len(self.sides) > 1 and (self.gives == "points" or len(self.outputs) > 1):
            raise InputError(f"contract: {len(self.sides)} sides are for one map of depth or inverse depth")

    @property
    def sides(self) -> tuple[int, ...]:
        """`side` as a tuple."""
        return self.side if isinstance(self.side, tuple) else (self.side,)

    def input_sizes(self, hw: tuple[int, int]) -> list[tuple[int, int]]:
        """The heights and widths at which a picture of that size is shown, each once."""
        return list(dict.fromkeys(self.input_size(hw, side) for side in self.sides))

    def input_size(self, hw: tuple[int, int], side: int) -> tuple[int, int]:
        """Height and width of a picture of that size whose shorter side is shown at `side`, and the longer one at four times that
        at most: what a network takes grows with their product."""
        factor = side / max(min(hw), max(hw) / 4)
        height, width = (max(1, round(one * factor / self.multiple)) * self.multiple for one in hw)
        return height, width

    def tensor(self, color: UInt8Array, hw: tuple[int, int]) -> Float32Array:
        """1 x 3 x h x w: the picture (H x W x 3, RGB) at height and width `hw` as the network takes it."""
        smaller = math.prod(hw) < color.shape[0] * color.shape[1]
        how = cv2.INTER_AREA if smaller else cv2.INTER_CUBIC
        normal = self.normalize(cv2.resize(color, hw[::-1], interpolation=how))
        return np.ascontiguousarray(normal.transpose(2, 0, 1))[None]


@dataclass(frozen=True, eq=False)
class DepthPrediction:
    """An estimator's prediction for a picture, at any size of the same proportions."""

    values: Float32Array = field(repr=False)
    """h x w: planar z, or inverse depth (larger is nearer, 0 is far); of points h x w x 3 (x, y, z; z up to a shift). Infinite
    depth and points are far."""
    gives: Gives = "depth"
    metric: bool = False
    """Whether it is in metres (1/m)."""
    far: BoolArray | None = field(default=None, repr=False)
    """h x w, True on predicted sky; None: the network predicts none."""
    notes: dict[str, Any] = field(default_factory=dict)
    """What ran, for meta.json."""

    def __post_init__(self) -> None:
        if self.gives not in KINDS:
            raise InputError(f"prediction gives {self.gives!r}; one of {', '.join(KINDS)} is expected")
        values = as_array(self.values, f"the estimated {self.gives}")
        shape, dimensions = ("h x w x 3", 3) if self.gives == "points" else ("h x w", 2)
        if values.ndim != dimensions or values.shape[2:] not in ((), (3,)) or not values.size:
            raise DepthError(f"the estimated {self.gives} has shape {values.shape}; {shape} is expected")
        if values.dtype.kind not in "iuf" or np.isnan(values).any():
            raise DepthError(f"the estimated {self.gives} holds values that are not numbers")
        if self.gives == "inverse depth" and values.max() == np.inf:
            raise DepthError("the estimated inverse depth holds infinity, as of depth 0; 0 for what is far is expected")
        if self.far is not None:
            check_fields(vars(self), "prediction", {"far": (values.shape[:2], np.bool_)})
        if dimensions == 3 and not (there := np.isfinite(values).all(2)).all():
            object.__setattr__(self, "far", ~there if self.far is None else self.far | ~there)
        check(self.notes, dict[str, Any], "prediction.notes")
        object.__setattr__(self, "values", values)


def outputs_of_contract(
    network: NetworkFile, contract: DepthContract, outputs: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """The outputs that the contract names, in its order. FileError where one is missing."""
    named = dict(zip(network.outputs, outputs))
    there = [next((name for name in names.split("|") if name in named), None) for names in contract.outputs]
    missing = [names for names, name in zip(contract.outputs, there) if name is None]
    if missing:
        raise FileError(f"{network.path}: gives {', '.join(named)}; {' and '.join(missing)} is expected")
    return [named[name] for name in there if name is not None]


def predict(network: NetworkFile, contract: DepthContract, color: UInt8Array) -> DepthPrediction:
    """The network's prediction for a picture (H x W x 3, RGB). FileError where the file does not keep its contract."""
    sizes = contract.input_sizes(color.shape[:2])
    fixed = next(iter(network.inputs.values()))[1][2:]
    if len(fixed) == 2 and all(isinstance(side, int) for side in fixed):  # a graph for pictures of one size alone
        sizes = [(fixed[0], fixed[1])]
    found = [predict_at(network, contract, color, hw) for hw in sizes]
    if len(found) == 1:
        return found[0]
    return dataclasses.replace(found[0], values=mean_map([one.values for one in found], contract.metric))


def mean_map(maps: Sequence[Float32Array], metric: bool) -> Float32Array:
    """The mean of maps of several sizes, at the largest size; maps that are not metric are divided by their own means first."""
    height, width = max((one.shape for one in maps), key=math.prod)
    total = np.zeros((height, width), np.float32)
    for one in maps:
        larger = np.asarray(cv2.resize(one, (width, height), interpolation=cv2.INTER_LINEAR))
        mean = float(one.mean(dtype=np.float64))
        total += larger if metric or mean <= 0 else larger / np.float32(mean)
    return total / np.float32(len(maps))


def predict_at(
    network: NetworkFile, contract: DepthContract, color: UInt8Array, hw: tuple[int, int]
) -> DepthPrediction:
    """The network's prediction for a picture shown at height and width `hw`; errors as `predict`."""
    outputs = network.run_all(make_feed(network, contract, contract.tensor(color, hw)))
    found = outputs_of_contract(network, contract, outputs) or outputs[:1]
    values = squeeze_output(network, found[0], contract.gives)
    far = squeeze_output(network, found[1], "depth") <= 0.5 if len(found) > 1 else None
    if len(found) > 2:
        values = values * np.float32(np.asarray(found[2]).ravel()[0])
    if not np.isfinite(values[~far] if far is not None else values).all():
        raise FileError(f"{network.path}: the network gave values that are not finite")
    values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    return DepthPrediction(values, contract.gives, contract.metric, far, network.notes)


def make_feed(network: NetworkFile, contract: DepthContract, shown: Float32Array) -> dict[str, np.ndarray]:
    """The inputs by name; FileError where the graph takes others."""
    inputs = network.inputs
    expected = 1 if contract.tokens is None else 2
    (name, (kind, shape)), *others = inputs.items()
    fits = len(shape) == 4 and all(
        not isinstance(have, int) or have == given for have, given in zip(shape, shown.shape)
    )
    if len(inputs) != expected or kind != "tensor(float)" or not fits:
        sizes = " x ".join(map(str, shown.shape))
        more = "" if expected == 1 else " and a number of tokens"
        raise FileError(
            f"{network.path}: takes {describe_tensors(inputs)}; a float picture of {sizes}{more} is expected"
        )
    return {name: shown} | {other: np.array(contract.tokens, np.int64) for other, _ in others}


def describe_tensors(ends: Mapping[str, tuple[str, list[Any]]]) -> str:
    """Inputs of a graph in words."""
    return ", ".join(
        f"{name} ({kind} {' x '.join(map(str, shape)) or 'scalar'})" for name, (kind, shape) in ends.items()
    )


def squeeze_output(network: NetworkFile, out: np.ndarray, gives: Gives) -> Float32Array:
    """An output without its batch and channel axes: h x w, of points h x w x 3. FileError for any other shape."""
    values = np.asarray(out, np.float32)
    shape = values.shape
    if gives == "points":
        expected, fits = "1 x h x w x 3", len(shape) == 4 and shape[0] == 1 and shape[3] == 3
    else:
        expected, fits = "1 x h x w", 2 <= len(shape) <= 4 and math.prod(shape[:-2]) == 1 and min(shape[-2:]) > 1
    if not fits:
        raise FileError(f"{network.path}: gave an output of {' x '.join(map(str, shape))}; {expected} is expected")
    return values[0] if gives == "points" else values.reshape(shape[-2:])


def fit_points(points: Float32Array, far: BoolArray | None, focal: float | None) -> tuple[float, float]:
    """(the shift of z, horizontal field of view in degrees) of points h x w x 3 whose z is known up to a shift, as those of MoGe
    (Wang et al. 2025): so that each point lies on the ray of its pixel.

    far: h x w, True where points mean nothing. focal: in picture widths, where it is known. The shift minimises the distance, in
    the image plane, between points and the rays of their pixels; the best focal length for each shift has a closed form.
    DepthError where no shift puts all points in front.
    """
    height, width = points.shape[:2]
    good = np.ones((height, width), np.bool_) if far is None else ~far
    rows, columns = np.nonzero(good)
    if len(rows) < 3:
        raise DepthError("the network sees nothing but sky in this picture; give depth")
    chosen = np.linspace(0, len(rows) - 1, min(4096, len(rows))).astype(np.intp)
    rows, columns = rows[chosen], columns[chosen]
    image = np.stack([(columns + 0.5) / width - 0.5, ((rows + 0.5) - height / 2) / width], 1)
    cloud = points[rows, columns].astype(np.float64)
    shift = best_shift(cloud, image, focal)
    focal = focal or best_focal(cloud, image, shift)
    return shift, math.degrees(2 * math.atan(0.5 / focal))


def best_shift(cloud: np.ndarray, image: np.ndarray, focal: float | None) -> float:
    """The shift by a search over the nearest point's depth from 1/100 to 100 times the depth range, then golden section."""
    nearest, span = float(cloud[:, 2].min()), float(np.ptp(cloud[:, 2])) or 1.0

    def error(log_depth: float) -> float:
        shift = math.exp(log_depth) * span - nearest
        flat = cloud[:, :2] / (cloud[:, 2:] + shift)
        return float(np.square(flat * (focal or best_focal(cloud, image, shift)) - image).sum())

    grid = np.linspace(math.log(0.01), math.log(100), STEPS)
    place = int(np.argmin([error(one) for one in grid]))
    low, high = grid[max(0, place - 1)], grid[min(STEPS - 1, place + 1)]
    for _ in range(STEPS):
        one, two = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        low, high = (low, two) if error(one) < error(two) else (one, high)
    return math.exp((low + high) / 2) * span - nearest


def best_focal(cloud: np.ndarray, image: np.ndarray, shift: float) -> float:
    """The focal length in picture widths, by least squares. DepthError where the points are mirrored or of no extent."""
    flat = cloud[:, :2] / (cloud[:, 2:] + shift)
    spread = float(np.square(flat).sum())
    focal = float((flat * image).sum()) / spread if spread > 0 else 0.0
    if focal <= 0:
        raise DepthError("the estimated points do not lie on the rays of a camera; give depth")
    return focal
