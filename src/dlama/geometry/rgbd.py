"""RGBD: one colour picture and its depth map from one camera, checked once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlama.arguments import as_array, check
from dlama.errors import DepthError, ShapeError, check_same_size
from dlama.geometry.camera import Camera
from dlama.geometry.figures.false_color import depth_picture
from dlama.geometry.figures.html import Figured, Panel

UInt8Array = NDArray[np.uint8]
UInt16Array = NDArray[np.uint16]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]
PADDING_LEVELS, PADDING_SHARE = 3, 0.99
"""`RGBD.padding` differs from white or black by so many levels at most, in this share of the pixels on each border line."""
PLAUSIBLE_M = (0.05, 500.0)
"""Metres; a median depth outside is no room's and no street's: the scale is wrong."""


@dataclass(frozen=True, eq=False)
class RGBD(Figured):
    """A colour picture with metric depth.

    Both are of one camera, pixel by pixel, without distortion. Of a sensor with a camera for each, depth is registered to the
    colours first (`rs.align` of RealSense, `depth_image_to_color_camera` of Azure Kinect).

    Every depth pixel is in one of three states: *valid* (finite, > 0), *far* (+inf: sky, or beyond the stated limit)
    or *missing* (0; NaN is taken as 0). Depth in whole numbers, whose unit nothing says, is refused. PIL pictures and tensors
    of torch are taken as arrays, here as everywhere. Raises ShapeError or DepthError.
    """

    color: UInt8Array
    """H x W x 3, RGB, sRGB-encoded."""
    depth: Float32Array
    """H x W, planar z in metres; 0 = missing, +inf = far."""
    camera: Camera
    """The camera that took both."""
    estimate: Mapping[str, Any] | None = None
    """How the depth was estimated from the picture (model, scale, field of view), JSON-ready; None: it was measured."""
    padding: BoolArray | None = None
    """H x W, True where the picture shows nothing of the scene: it has no depth there. Not given: a white or black frame round
    it where no depth is measured, as registered pictures of a Kinect have (NYU Depth v2: 5 to 11 px); None: there is none."""
    noise_step: float = 0.0
    """Inverse depth (1/m) by which neighbouring pixels of one surface may differ by noise alone, as in a matched pair."""

    def __post_init__(self) -> None:
        color = check_color(self.color)
        depth = check_depth(self.depth, color.shape[:2])
        check(self.camera, Camera, "camera")
        check(self.estimate, Mapping[str, Any] | None, "estimate")
        check_same_size("the camera", self.camera.hw, "the picture", depth.shape)
        padding = _find_padding(color, depth) if self.padding is None else as_array(self.padding, "padding", "a mask")
        if padding is not None:
            if padding.dtype != np.bool_ or padding.shape != depth.shape:
                raise ShapeError(f"padding is {padding.dtype} {padding.shape}; bool H x W is expected")
            depth = freeze(np.where(padding, np.float32(0), depth))
            padding = make_read_only(padding)
        estimate = None if self.estimate is None else dict(self.estimate)
        vars(self).update(color=make_read_only(color), depth=make_read_only(depth), padding=padding, estimate=estimate)

    def __repr__(self) -> str:
        width, height = self.camera.wh
        missing = percent(self.missing)
        return f"RGBD({width}x{height}, {describe_depth_range(self.depth)}, {missing} missing)"

    def _panels(self) -> list[Panel]:
        return [("picture", self.color), (f"depth, {describe_depth_range(self.depth)}", depth_picture(self.depth))]

    @property
    def valid(self) -> BoolArray:
        """H x W, True where depth was measured: finite and > 0."""
        return is_valid(self.depth)

    @property
    def far(self) -> BoolArray:
        """H x W, True where the scene is known to be far (sky)."""
        return self.depth == np.inf

    @property
    def missing(self) -> BoolArray:
        """H x W, True where the sensor measured nothing."""
        return self.depth == 0

    def clip_depth(self, clip: float | None) -> RGBD:
        """The picture with everything at or beyond `clip` metres, sky too, at `clip`; itself where `clip` is None."""
        return self if clip is None else replace(self, depth=np.minimum(self.depth, np.float32(clip)))


def check_color(color: ArrayLike, name: str = "colour") -> UInt8Array:
    """The picture as an array; ShapeError, which calls it `name`, unless it is uint8 H x W x 3 with a pixel or more."""
    mode = getattr(color, "mode", "RGB")  # of a PIL picture
    if isinstance(mode, str) and mode != "RGB":
        raise ShapeError(f"{name} is a PIL picture of mode {mode}; RGB is expected: picture.convert('RGB')")
    array = as_array(color, name, "a picture")
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or not array.size:
        raise ShapeError(f"{name} is {array.dtype} {array.shape}; uint8 H x W x 3 is expected{_color_advice(array)}")
    return array


def check_depth(depth: ArrayLike, hw: tuple[int, ...]) -> Float32Array:
    """Metres (H x W, as `hw`) in float32, 0 where they are nan or -inf. ShapeError; DepthError unless floats from 0 on."""
    array = as_array(depth, "depth", "an array of metres")
    if array.ndim != 2:
        raise ShapeError(f"depth has shape {array.shape}; H x W is expected")
    check_same_size("depth", array.shape, "the picture", hw)
    if array.dtype.kind in "iu":
        raise DepthError(
            f"depth is {array.dtype}, and nothing says in which unit; metres as floating-point numbers are expected: "
            "depth / 1000 of millimetres, depth.astype(np.float32) of metres"
        )
    if array.dtype.kind != "f":
        raise DepthError(f"depth is {array.dtype}; metres as numbers are expected")
    metres = np.asarray(array, np.float32)
    least = metres.min()
    if not least > -np.inf:
        metres = freeze(np.where(metres > -np.inf, metres, np.float32(0)))
        least = metres.min()
    if least < 0:
        raise DepthError(f"depth holds negative values (smallest {least:.6g}); metres >= 0 are expected")
    return metres


def _color_advice(array: np.ndarray) -> str:
    """What makes a picture of a usual array that is none."""
    if array.ndim == 2:
        return "; of a grey picture: np.stack([color] * 3, axis=-1)"
    if array.ndim != 3:
        return ""
    if array.shape[0] == 3 != array.shape[2]:
        return "; of C x H x W: color.transpose(1, 2, 0)"
    if array.shape[2] == 4:
        return "; of a picture with opacity: color[..., :3]"
    if array.shape[2] == 3 and array.dtype.kind == "f" and array.size:
        return f"; of such numbers: {'(color * 255)' if array.max() <= 1 else 'color'}.round().astype(np.uint8)"
    return ""


def _find_padding(color: UInt8Array, depth: Float32Array) -> BoolArray | None:
    """The frame round a picture that `RGBD.padding` is by default."""
    lines = np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]
    if any((depth[line] != 0).mean() > 1 - PADDING_SHARE for line in lines):
        return None
    for level in (255, 0):
        if all(is_level(color[line], level).mean() >= PADDING_SHARE for line in lines):
            return _frame_of(is_level(color, level) & (depth == 0))
    return None


def is_level(color: UInt8Array, level: int) -> BoolArray:
    """True in the pixels of a picture, or of a line of it (... x 3), that are white (255) or black (0), as padding is."""
    return np.asarray(((level - PADDING_LEVELS <= color) & (color <= level + PADDING_LEVELS)).all(-1))


def _frame_of(blank: BoolArray) -> BoolArray | None:
    """The part of `blank` (H x W bool) that runs along all four borders, with a mixed pixel inside it; None: it is too wide."""
    widest = int(0.05 * min(blank.shape))  # what is wider is a white or black scene
    found = np.zeros_like(blank)
    for turned, out in ((blank, found), (blank[::-1], found[::-1]), (blank.T, found.T), (blank.T[::-1], found.T[::-1])):
        band = turned[: widest + 1]
        width = np.where(band.all(0), len(band), band.argmin(0))
        usual = int(np.median(width))
        if usual > widest:
            return None
        out |= np.arange(len(out))[:, None] <= np.minimum(width, 2 * usual)
    return freeze(found)


def is_valid(depth: np.ndarray) -> BoolArray:
    """True where depth (metres, 0 = missing, +inf = far) is valid: finite and > 0."""
    return np.asarray((depth > 0) & (depth < np.inf))


def percent(where: BoolArray) -> str:
    """Share of the pixels that are True, for people: `100 %`, `2 %`, `0.4 %`, `0 %`."""
    share = 100 * float(np.mean(where))
    return f"{share:.0f} %" if share >= 1 else f"{share:.1g} %"


def describe_depth_range(depth: Float32Array) -> str:
    """Smallest and largest valid depth (H x W metres, 0 = missing, +inf = far), for people: `1.4 to 14 m`, `no depth`."""
    valid = depth[is_valid(depth)]
    ends = [f"{float(f'{end:.3g}'):g}" for end in (valid.min(), valid.max())] if valid.size else []  # .3g gives 1e+03
    return f"{' to '.join(ends)} m" if ends else "no depth"


def make_read_only(array: np.ndarray) -> np.ndarray:
    """A read-only, C-contiguous array: itself where that holds already, else a copy.

    A caller may write to its own buffer (one for all frames of a video): a frozen noun must not change with it.
    """
    if array.flags.c_contiguous and _is_frozen(array):
        return array
    copy = np.array(array, order="C")
    copy.flags.writeable = False
    return copy


def freeze(array: np.ndarray) -> np.ndarray:
    """A new, unshared array made read-only: `make_read_only` then need not copy it."""
    array.flags.writeable = False
    return array


def select(array: np.ndarray, where: BoolArray) -> np.ndarray:
    """The values (H x W or H x W x C) in the pixels of `where` (H x W bool), 0 in all others; read-only and unshared."""
    if array.dtype == np.bool_:
        return freeze(array & where)
    out = np.zeros(array.shape, array.dtype)
    paste(array, where, out)
    return freeze(out)


def paste(array: np.ndarray, where: BoolArray, onto: np.ndarray) -> None:
    """Write the values (H x W or H x W x C) in the pixels of `where` (H x W bool) onto another array of that shape."""
    import cv2  # late: nouns load numpy alone

    cv2.copyTo(array, where.view(np.uint8), onto)


def replace_pixels(array: np.ndarray, where: BoolArray, other: np.ndarray) -> np.ndarray:
    """A copy of the values (H x W or H x W x C) with those of another array of that shape and type in the pixels of `where`
    (H x W bool). `np.where` takes fifteen times as long with a mask for all channels."""
    out = array.copy()
    paste(other, where, out)
    return out


def brighten(color: UInt8Array, gain: ArrayLike) -> UInt8Array:
    """Colours (N x 3 or H x W x 3) with their channels multiplied by the gains (3), rounded and cut to 0..255."""
    levels = np.arange(256) * np.asarray(gain, np.float64)[:, None]
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return np.stack([table[channel][color[..., channel]] for channel in range(3)], -1)


def sampled_pixels(hw: tuple[int, ...], step: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """h x 1 rows and 1 x w columns of every `step`-th pixel of a picture, those in the middle of squares of `step` x `step`; the
    last square may cross the border."""
    rows, columns = (np.minimum(np.arange(step // 2, n + step // 2, step), n - 1) for n in hw)
    return rows[:, None], columns[None]


def _is_frozen(array: np.ndarray) -> bool:
    """Whether the array and its base cannot be written to."""
    base: object = array
    while isinstance(base, np.ndarray):
        if base.flags.writeable:
            return False
        base = base.base
    return base is None or isinstance(base, bytes)


def check_fields(
    given: Mapping[str, Any], called: str, fields: Mapping[str, tuple[tuple[int, ...], type]], purpose: str = ""
) -> dict[str, np.ndarray]:
    """A noun's arrays by name, read-only; ShapeError unless each has its shape and dtype (`called`: the noun; `purpose`: for
    what)."""
    checked = {}
    for name, (shape, dtype) in fields.items():
        array = given[name]
        if not isinstance(array, np.ndarray):
            array = as_array(array, f"{called}.{name}", f"an array of {np.dtype(dtype)}")
        if array.shape != shape or array.dtype != dtype:
            raise ShapeError(
                f"{called}.{name} is {array.dtype} {array.shape}; {np.dtype(dtype)} {shape} is expected{purpose}"
            )
        checked[name] = make_read_only(array)
    return checked


def row_count(array: np.ndarray) -> int:
    """Rows of a noun's array; 0 of anything else, which `check_fields` then refuses."""
    return len(array) if isinstance(array, np.ndarray) and array.ndim else 0


def mark_far(depth: Float32Array, far: float, source: str = "") -> Float32Array:
    """The depth (H x W metres) with all at or beyond `far` metres as +inf.

    Raises DepthError, which begins with `source`: nothing is nearer.
    """
    found = np.where(depth >= far, np.float32(np.inf), depth)
    if not is_valid(found).any():
        raise DepthError(
            f"{source}no depth is nearer than `far`, {far:g} m; the scene has {describe_depth_range(depth)}"
        )
    return found
