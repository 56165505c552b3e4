"""A picture file, a depth file (or none: depth is estimated) and a camera in; an RGBD out."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import DepthError, FileError, InputError, ShapeError, format_size, system_errors, warn
from dlama.files.cameras import camera_for
from dlama.files.photos.depth import PhotoDepth, read_photo_depth
from dlama.files.rasters.depth import check_depth_options, read_depth, read_inverse_depth
from dlama.files.rasters.depth_checks import warn_of_far_plane, warn_of_inverse, warn_of_missing_code, warn_of_unit
from dlama.files.rasters.images import picture_hw, read_stored
from dlama.files.rasters.pictures import read_color
from dlama.files.rasters.turned_pairs import refuse_turned, same_proportions, warn_of_turn
from dlama.geometry.camera import Camera
from dlama.geometry.drawing.picture_edges import MapGrid
from dlama.geometry.projection import depth_from_inverse, ray_lengths
from dlama.geometry.rgbd import RGBD, Float32Array, UInt8Array, freeze, mark_far
from dlama.perception.depth_networks import DepthPrediction
from dlama.perception.monocular import DEFAULT, Estimator, estimate_depth
from dlama.perception.resampling import nearest_pixels, upsample_depth
from dlama.writing.atomic_write import PathLike


@system_errors(FileError)
def read_rgbd(
    image: PathLike,
    depth: PathLike | None = None,
    *,
    camera: PathLike | Camera | None = None,
    fx: float | None = None,
    fy: float | None = None,
    cx: float | None = None,
    cy: float | None = None,
    fov: float | None = None,
    pixel_center: float = 0.5,
    depth_scale: float | None = None,
    depth_range: float | None = None,
    channel: str | None = None,
    far: float | None = None,
    resize_depth: Literal["guided", "nearest"] | None = None,
    radial_depth: bool = False,
    depth_model: str | Path | Estimator | None = None,
    metres_at: Sequence[tuple[float, float, float]] = (),
    camera_height: float | None = None,
    sharpen: bool = True,
    inverse_depth: bool = False,
) -> RGBD:
    """Colour and metric depth of one camera; of a picture without depth, depth estimated from it.

    Args:
        image: PNG, JPEG, WebP, TIFF, BMP, PPM, AVIF or HEIC; comes back as uint8 H x W x 3 RGB.
        depth: 16-bit PNG, TIFF or PGM, EXR, PFM, NPY or NPZ; comes back as float32 H x W metres, 0 = missing, +inf = far.
            None: what the photo's file carries (`dlama.files.photos`), unless a depth_model is given, else it is estimated; the
            result's `estimate` says which.
        camera: A Camera, or its file; else fx, fy, cx, cy, fov and pixel_center as in `camera_for`, or the picture's EXIF.
        depth_scale, depth_range, channel: As in `read_depth`, of a depth file.
        far: What lies at or beyond so many metres is far (sky).
        resize_depth: Brings depth of another size to the picture's. "guided": interpolated on each surface, with edges where the
            picture has them (`upsample_depth`), also a map that was enlarged by the nearest pixel before; "nearest": from the
            nearest pixel. Depth larger than the picture is taken from the nearest pixel.
        radial_depth: The depth file holds distances along the ray of each pixel (Hypersim, AirSim's DepthPerspective, ray
            tracers); `far` counts along the ray, too.
        depth_model, metres_at, camera_height, sharpen: As in `estimate_depth`, of a picture without depth.
        inverse_depth: The depth file is what a network gave (`read_inverse_depth`): it is used as estimated depth is, with
            metres_at, camera_height and sharpen. Its size may be another. With depth_scale it holds 1 / depth, measured (Nuke).

    Raises:
        InputError: options of a depth file without one, or of estimated depth with one.
        FileError: a file is missing, damaged or of another kind.
        DepthError: depth that cannot be metres.
        CameraError: no camera, two cameras, or one that cannot be.
        ShapeError: picture, depth and camera are of different sizes.
    """
    check_arguments(read_rgbd, locals())
    check_depth_options(depth_scale, depth_range, far)
    lens: dict[str, Any] = {"camera": camera, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "fov": fov}
    lens["pixel_center"] = pixel_center
    values: dict[str, Any] = {"depth_scale": depth_scale, "depth_range": depth_range, "channel": channel}
    of_file = {**values, "resize_depth": resize_depth, "radial_depth": radial_depth or None}
    options: dict[str, Any] = {"metres_at": metres_at, "camera_height": camera_height, "sharpen": sharpen}
    if depth is None:
        why = "is given without a depth file; it says how one is read"
        _refuse(of_file | {"inverse_depth": inverse_depth or None}, why)
        own = None
        try:
            own = read_photo_depth(image) if depth_model is None else None
        except DepthError as error:
            warn(f"{error.marked}; depth is estimated instead")
        return _estimate_rgbd(image, lens, own, depth_model, far, options)
    if inverse_depth and depth_scale is None:
        given = of_file | {"channel": None, "depth_model": depth_model}
        _refuse(given, "and `inverse_depth` contradict each other; give one of them")
        return _estimate_rgbd(image, lens, _read_network_depth(image, depth, channel), None, far, options)
    given = {**options, "metres_at": len(metres_at) or None, "sharpen": None if sharpen else False}
    why = "and a depth file contradict each other: it is for pictures without depth; give one of them"
    _refuse({**given, "depth_model": depth_model}, why)
    color = read_color(image)
    metres = _read_measured(image, depth, color, {**values, "far": far, "inverse": inverse_depth}, resize_depth)
    used = camera_for(color.shape[:2], image=image, **lens)[0]
    rgbd = RGBD(freeze(color), freeze(metres / ray_lengths(used) if radial_depth else metres), used)
    if (depth_scale or depth_range) is None:
        warn_of_unit(depth, rgbd)
    return rgbd


def _refuse(options: Mapping[str, object], why: str) -> None:
    """InputError for the first option that is given (is not None)."""
    for name, value in options.items():
        if value is not None:
            raise InputError(f"`{name}` {why}")


def _read_measured(
    image: PathLike, depth: PathLike, color: UInt8Array, reading: Mapping[str, Any], how: str | None
) -> Float32Array:
    """Depth of a file at its picture's size; reading: the options of `read_depth`, how: `resize_depth`."""
    metres = read_depth(depth, **reading)
    if reading["far"] is None:
        warn_of_far_plane(depth, metres)
        warn_of_missing_code(depth, metres)
    _check_same_view(image, depth, color.shape[:2], (metres.shape[0], metres.shape[1]))
    return fit_depth(image, depth, metres, color, how)


def _estimate_rgbd(
    image: PathLike,
    lens: Mapping[str, Any],
    own: PhotoDepth | None,
    depth_model: str | Path | Estimator | None,
    far: float | None,
    options: Mapping[str, Any],
) -> RGBD:
    """A picture file with its own depth, that it carries or that a network gave; None: with estimated depth.

    lens: the options of `camera_for`; options: the others of `estimate_depth`.
    """
    color = read_color(image)
    camera, source = _find_camera(image, color.shape[:2], lens, own)
    if own is not None:
        rgbd = _use_photo_depth(image, color, camera, own, far, options)
    else:
        rgbd = estimate_depth(color, camera, depth_model=depth_model or DEFAULT, **options).rgbd
    about = dict(rgbd.estimate or {})
    if source:
        about["field_of_view"] = {**about["field_of_view"], "from": source}
    depth = rgbd.depth if far is None else mark_far(rgbd.depth, far, f"{image}: estimated: ")
    return dataclasses.replace(rgbd, depth=depth, estimate=about)


def _find_camera(
    image: PathLike, hw: tuple[int, ...], lens: Mapping[str, Any], own: PhotoDepth | None
) -> tuple[Camera | None, str]:
    """The camera that is given, that the photo's depth is calibrated for, or of the EXIF data, and where it comes from; None, "":
    nothing says."""
    given = any(value is not None for name, value in lens.items() if name != "pixel_center")
    if own is not None and own.camera is not None and not given:
        return own.camera, "the photo's calibration"
    if given or read_stored(image).focal_35mm is not None:
        return camera_for((hw[0], hw[1]), image=image, **lens)
    return None, ""


def _read_network_depth(image: PathLike, depth: PathLike, channel: str | None) -> PhotoDepth:
    """A file of inverse depth that shows what the picture shows. ShapeError: it does not."""
    hw, values = picture_hw(image), read_inverse_depth(depth, channel=channel)
    _check_same_view(image, depth, hw, (values.shape[0], values.shape[1]))
    warn_of_inverse(depth, depth_from_inverse(values), inverted=True)
    name = Path(depth).name
    about = {"file": name, "size": list(values.shape[::-1])}
    return PhotoDepth(values, metric=False, by=f"a network, read from {name}", about=about)


def _use_photo_depth(
    image: PathLike,
    color: UInt8Array,
    camera: Camera | None,
    own: PhotoDepth,
    far: float | None,
    options: Mapping[str, Any],
) -> RGBD:
    """The picture with the depth of its file at the picture's size, edges moved to the picture's as those of estimates are.

    Metres are the file's, unless something in metres is known: then a factor is fitted, and to relative depth a shift too.
    """
    is_known = len(options.get("metres_at", ())) > 0 or options.get("camera_height") is not None
    values = own.values
    if own.along_ray and camera is not None:
        values = values * ray_lengths(camera.resized(values.shape[1], values.shape[0]))
    metric = own.metric if not is_known else own.absolute
    prediction = DepthPrediction(np.maximum(values, np.float32(0)), "inverse depth", metric, notes=dict(own.about))
    rgbd = estimate_depth(color, camera, depth_model=lambda _: prediction, **options).rgbd
    about = {**(rgbd.estimate or {}), "estimator": own.by}
    if about["scale"]["rule"] == "metric model":
        about["scale"] = {**about["scale"], "rule": "photo"}
        if not own.absolute:
            warn(
                f"{image}: its depth is relative ({own.about['source']}): its metres are the phone's guess, "
                "give `metres_at` or `camera_height`"
            )
    limit = own.about.get("at_far_limit_share", 0.0)
    if limit > 0.05 and far is None:
        farthest = float(rgbd.depth[np.isfinite(rgbd.depth)].max())
        warn(
            f"{image}: {limit:.0%} of its depth lie at the farthest that it can say, {farthest:.3g} m, and may be farther; "
            f"`far={0.99 * farthest:.3g}` takes them as far"
        )
    return dataclasses.replace(rgbd, estimate=about)


def _smooth_terraces(depth: PathLike, metres: Float32Array, color: UInt8Array, how: str | None) -> Float32Array:
    """A map at the picture's size, interpolated on each surface where it was enlarged before and `how` is guided; else warns."""
    grid = MapGrid.of(metres)
    if grid.enlarged and how == "guided":
        return upsample_depth(grid.sample_map(metres), color)
    if grid.enlarged and how is None:
        warn(
            f"{depth}: looks like a map of {grid.wh[0]}x{grid.wh[1]} pixels that was enlarged by the nearest pixel, so "
            "surfaces are terraced; `resize_depth=guided` interpolates on each surface"
        )
    return metres


def fit_depth(
    image: PathLike, depth: PathLike, metres: Float32Array, color: UInt8Array, how: str | None
) -> Float32Array:
    """Depth at its picture's size, `how` as `resize_depth` of `read_rgbd`. ShapeError: of another size. Warns of a map that was
    enlarged before."""
    if how not in (None, "guided", "nearest"):
        raise ShapeError(f"`resize_depth` is {how!r}; 'guided' or 'nearest' is expected")
    hw = color.shape[:2]
    if metres.shape == hw:
        return _smooth_terraces(depth, metres, color, how)
    if how is None:
        sizes = _sizes_in_words(image, depth, hw, metres.shape)
        raise ShapeError(f"{sizes}; both must have the same size, or give `resize_depth=guided`")
    smaller = metres.size < hw[0] * hw[1]
    return upsample_depth(metres, color) if how == "guided" and smaller else nearest_pixels(metres, hw)


def _check_same_view(image: PathLike, depth: PathLike, hw: tuple[int, int], depth_hw: tuple[int, int]) -> None:
    """ShapeError where depth cannot show what the picture shows: turned by its tag, or of other proportions. Warns of a tag that
    one of them has alone."""
    refuse_turned(image, depth, hw, depth_hw)
    warn_of_turn(image, depth)
    if not same_proportions(depth_hw, hw):
        turned = same_proportions(depth_hw[::-1], hw)
        mend = "one is turned by 90 degrees, turn it back" if turned else "crop one of them to what both show"
        sizes = _sizes_in_words(image, depth, hw, depth_hw)
        raise ShapeError(f"{sizes}; they cannot show the same field of view: {mend}")


def _sizes_in_words(image: PathLike, depth: PathLike, hw: tuple[int, ...], depth_hw: tuple[int, ...]) -> str:
    return f"{depth} is {format_size(depth_hw)} and {image} {format_size(hw)}"
