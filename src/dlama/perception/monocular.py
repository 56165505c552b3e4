"""A single picture in; its depth in metres, estimated by a network, out. ESTIMATORS, at the end, is the closed list of names.

Predict (relative, blurred), sharpen along the picture's edges, scale to metres. Assumptions are warned of and stand in the
estimate's meta data.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dlama.arguments import check, check_arguments, function_name
from dlama.errors import DepthError, FileError, InputError, check_same_size, system_errors, warn
from dlama.geometry.camera import Camera
from dlama.geometry.projection import inverse_depth, round_depth
from dlama.geometry.rgbd import (
    PADDING_SHARE,
    RGBD,
    BoolArray,
    Float32Array,
    UInt8Array,
    check_color,
    is_level,
    is_valid,
)
from dlama.models.cache import locate, user_path
from dlama.models.network_file import ASSETS, NetworkFile, open_kept
from dlama.models.records import CATALOGUE
from dlama.perception.depth_networks import (
    IMAGENET,
    DepthContract,
    DepthPrediction,
    fit_points,
    predict,
)
from dlama.perception.depth_scale import ASSUMED_MEDIAN_M, FARTHEST_M, RULES, check_known, estimate_scale
from dlama.perception.resampling import interpolate
from dlama.perception.sharpening import sharpen_depth

DEFAULT = "tcmonodepth"
SHIPPED = ASSETS / "tcmonodepth" / "tcmonodepth-small.onnx"
"""The network of DEFAULT; those of other names are pulled first."""
ASSUMED_FOV = 60.0
"""Degrees across the longer side, where neither the user nor the picture's EXIF data nor the network says."""
LEAST_CONTRAST = 3.0
"""Grey levels between the darkest and the brightest hundredth of a picture, below which it shows nothing."""

Estimator = Callable[[UInt8Array], DepthPrediction]
"""An estimator: picture (H x W x 3, RGB) -> its prediction."""


@dataclass(frozen=True, eq=False)
class DepthEstimate:
    """Estimated depth of a picture."""

    rgbd: RGBD
    """The picture with its depth in metres and its camera; `rgbd.estimate` says how it was made, so that every verb knows."""

    @property
    def depth(self) -> Float32Array:
        """H x W, planar z in metres; +inf = far."""
        return self.rgbd.depth

    @property
    def camera(self) -> Camera:
        """The given camera, or the assumed one."""
        return self.rgbd.camera

    @property
    def meta(self) -> dict[str, Any]:
        """Model, scale and field of view, and what of them was assumed; JSON-ready."""
        return dict(self.rgbd.estimate or {})


def estimate_depth(
    color: UInt8Array,
    camera: Camera | None = None,
    *,
    depth_model: str | Path | Estimator = DEFAULT,
    metres_at: Sequence[tuple[float, float, float]] = (),
    camera_height: float | None = None,
    sharpen: bool = True,
) -> DepthEstimate:
    """The depth of a single picture, in metres, rounded to 1 part in 100,000; no download for the network that ships.

    Args:
        color: uint8 H x W x 3, RGB.
        camera: The camera that took it; None: the field of view the network finds, or 60 degrees across the longer side.
        depth_model: A name of ESTIMATORS, an ONNX file with a contract, `NAME=FILE` (a file with the contract of that name), or a
            function (picture) -> DepthPrediction.
        metres_at: (x, y, metres): known depths (along the optical axis) of pixels, x right, y down. Relative inverse depth has a
            factor and a shift: both are fitted from two on.
        camera_height: Metres of the camera above the ground that the picture shows, instead.
        sharpen: Move blurred depth edges to the picture's.

    With neither metres_at nor camera_height nor a metric network the median depth is taken to be 3 m. Warns of what is assumed.

    Raises:
        InputError: an unknown name, options that contradict each other or the picture, a picture that shows nothing, or that is
            none (ShapeError).
        FileError: a network file that is missing, or does not keep its contract.
    """
    check_arguments(estimate_depth, locals())
    color = check_color(color)
    if contrast(color) < LEAST_CONTRAST:
        raise DepthError(
            "the picture has nearly one colour all over: there is nothing to estimate depth from; give depth"
        )
    if bars := describe_bars(color):
        warn(f"{bars}: networks take them for surfaces, and the depth of the rest is worse for it: crop them off")
    check_known(metres_at, camera_height, color.shape[:2])
    name, estimator = find_estimator(depth_model)
    prediction = estimator(color)
    check(prediction, DepthPrediction, f"what the function {name} returned")
    camera, fov_notes, shift = resolve_camera(color, camera, prediction)
    values, inverse, far = resize_prediction(prediction, camera, shift)
    moved = sharpen_depth(values, color, inverse) if sharpen else values
    scale = estimate_scale(moved, inverse, prediction.metric, camera, metres_at, camera_height)
    depth = round_depth(scale.metres(moved, far))
    if not is_valid(depth).any():
        raise DepthError(
            f"the network {name} sees nothing but sky in this picture: nothing is nearer than {FARTHEST_M:g} m "
            f"({RULES[scale.rule]}); give depth"
        )
    if scale.rule == "assumed":
        names_network = isinstance(depth_model, (str, Path))
        other = ", `camera_height` or a metric `depth_model`" if names_network else " or `camera_height`"
        warn(f"the scale of the estimated depth is assumed (median {ASSUMED_MEDIAN_M:g} m): give `metres_at`{other}")
    meta = {
        "estimator": name,
        **prediction.notes,
        "gives": f"{'metric' if prediction.metric else 'relative'} {prediction.gives}",
        "scale": scale.notes,
        "field_of_view": fov_notes,
        "sharpened": sharpen,
        "sharpened_pixels": int((moved != values).sum()),
    }
    return DepthEstimate(RGBD(color, depth, camera, meta))


def contrast(color: UInt8Array) -> float:
    """Grey levels between the darkest and the brightest hundredth of a picture (H x W x 3), in the channel where most lie."""
    least, ranges = color[..., 0].size / 100, []
    for channel in range(3):
        up_to = np.cumsum(cv2.calcHist([color], [channel], None, [256], [0, 256]).ravel().astype(np.int64))
        ranges.append(np.searchsorted(up_to, up_to[-1] - least) - np.searchsorted(up_to, least))
    return float(max(ranges))


def describe_bars(color: UInt8Array) -> str:
    """In words, black or white bars of one width along opposite borders of a picture (H x W x 3), as of films and scans; "" where
    there are none."""
    for lines, sides in ((color, ("above", "below")), (color.transpose(1, 0, 2), ("left", "right"))):
        least, widths = max(2, 0.01 * len(lines)), [bar_width(lines), bar_width(lines[::-1])]
        if min(widths) >= least >= abs(widths[0] - widths[1]):
            return "the picture has bars, " + " and ".join(f"{n} px {side}" for n, side in zip(widths, sides))
    return ""


def bar_width(lines: UInt8Array) -> int:
    """How many lines of a picture (L x N x 3) are black or white, from the first on; 0 where most of each of the next eight is,
    too, as round an object on white."""

    def plain(line: UInt8Array) -> float:
        return max(float(is_level(line, level).mean()) for level in (0, 255))

    width = next((n for n, line in enumerate(lines) if plain(line) < PADDING_SHARE), 0)
    return width if min(map(plain, lines[width : width + 8])) < 0.5 else 0


@system_errors(FileError)
def find_estimator(depth_model: str | Path | Estimator) -> tuple[str, Estimator]:
    """The name and the function of an estimator; parameters and errors as `estimate_depth`."""
    if not isinstance(depth_model, (str, Path)):
        return function_name(depth_model), depth_model
    text = str(depth_model)
    before, equals, after = text.partition("=")
    if equals and before in ESTIMATORS:
        return before, _file_estimator(Path(after), ESTIMATORS[before])
    if text in ESTIMATORS and not Path(text).is_file():
        return text, _file_estimator(SHIPPED if text == DEFAULT else locate(text), ESTIMATORS[text])
    if not isinstance(depth_model, Path) and Path(text).suffix.lower() != ".onnx" and not Path(text).is_file():
        raise InputError(
            f"`depth_model` is {text!r}; one of {', '.join(ESTIMATORS)}, an ONNX file, or NAME=FILE is expected"
        )
    path = user_path(text)
    return path.name, _file_estimator(path, _contract_of_file(path))


def _contract_of_file(path: Path) -> DepthContract:
    """The contract that a file carries, or that of the catalogue's network with its bytes. InputError: neither."""
    network = open_kept(NetworkFile, path)
    known = {CATALOGUE[name].sha256: contract for name, contract in ESTIMATORS.items() if name in CATALOGUE}
    contract = DepthContract.of_file(network) or known.get(network.sha256)
    if contract is None:
        raise InputError(
            f"{path}: carries no contract and is none of the catalogue's files; say whose contract it keeps: "
            f"`depth_model=NAME={path.name}`, NAME of {', '.join(ESTIMATORS)}; or give it its own (docs/models.md)"
        )
    return contract


def _file_estimator(path: Path, contract: DepthContract) -> Estimator:
    network = open_kept(NetworkFile, user_path(path))
    return lambda color: predict(network, contract, color)


def resolve_camera(
    color: UInt8Array, camera: Camera | None, prediction: DepthPrediction
) -> tuple[Camera, dict[str, Any], float]:
    """The camera of the picture, its source for meta.json, and the shift of z that its points take."""
    height, width = color.shape[:2]
    if camera is not None:
        check_same_size("the camera", camera.hw, "the picture", color.shape)
    shift, source = 0.0, "given"
    if prediction.gives == "points":
        known = None if camera is None else camera.fx / camera.width
        shift, found = fit_points(prediction.values, prediction.far, known)
        if camera is None:
            camera, source = Camera.from_fov(width, height, found), "the network"
    if camera is None:
        longer = 0.5 * max(width, height) / math.tan(math.radians(ASSUMED_FOV) / 2)
        camera, source = Camera(width, height, longer, longer, width / 2, height / 2), "assumed"
        warn(f"the field of view is assumed ({ASSUMED_FOV:g} degrees across the longer side): give `fov` or `camera`")
    return camera, {"degrees": round(camera.fov, 3), "from": source}, shift


def resize_prediction(
    prediction: DepthPrediction, camera: Camera, shift: float
) -> tuple[Float32Array, bool, BoolArray | None]:
    """(values, whether they are inverse depth, sky), H x W; inverse depth is interpolated between its pixels."""
    values, far = np.asarray(prediction.values, np.float32), prediction.far
    inverse = prediction.gives == "inverse depth"
    if prediction.gives == "points":
        values = values[..., 2] + np.float32(shift)
    if values.shape != camera.hw:
        if not inverse:
            values = inverse_depth(values)
        if far is not None:
            near = cv2.resize(far.astype(np.uint8), camera.wh, interpolation=cv2.INTER_NEAREST)
            values, far = np.where(far, np.float32(0), values), near > 0
        values, inverse = interpolate(values, camera.hw), True
    if inverse:
        values = np.maximum(values, np.float32(0))
    elif not (values > 0).all():
        raise DepthError(
            f"the estimated depth holds values that are not positive (smallest {values.min():.4g}); metres > 0 are expected"
        )
    if float(values.max()) == 0:
        raise DepthError("the network sees no depth in this picture; give depth")
    return values, inverse, far


_RELATIVE = DepthContract("inverse depth", mean=IMAGENET[0], std=IMAGENET[1], side=518, multiple=14)
"""Of Depth Anything V2."""
_METRIC = dataclasses.replace(_RELATIVE, gives="depth", metric=True)

ESTIMATORS: dict[str, DepthContract] = {
    DEFAULT: DepthContract("inverse depth", scale=1.0, side=(128, 192, 256, 320), multiple=16),
    "depth-anything-small": _RELATIVE,
    "depth-anything-indoor": _METRIC,
    "depth-anything-outdoor": _METRIC,
    "moge-small": DepthContract("points", metric=True, tokens=1800, outputs=("points", "mask", "metric_scale|scale")),
}
"""Name -> contract; the default, which ships, comes first. The others are models of the catalogue by the same names."""
