"""The options of jobs besides those of the method, defined once: flags of the command line, columns of a job list, fields of the
page.

A group is a dataclass; a field has the type of its flag, how it is typed in text, and what it does as its docstring.
"""

# ruff: noqa: RUF009  (`option` makes a field, as `dataclasses.field` does)

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dlama.completion.options import option


@dataclass(frozen=True)
class Results:
    """Which files are written."""

    only: str | None = option("NAME,...", "image,depth,origin,confidence,mesh,preview")
    """What is written next to meta.json, of image, depth, hole, origin, confidence, disparity, points, mesh, scene, preview,
    mask (disparity of pairs, mask of a removed object)."""
    also: str | None = option("NAME,...")
    """More of these names: scene (scene.npz, which view, video and show read), points, hole ..."""


@dataclass(frozen=True)
class Move:
    """Where the new camera stands: an orbit and a dolly from the source camera, or a camera file."""

    yaw: float | None = option("DEG", "0")
    """Degrees about the vertical axis through the pivot. Positive: the camera moves to its right and turns left."""
    pitch: float | None = option("DEG", "0")
    """Degrees about the horizontal axis through the pivot. Positive: the camera moves up and looks down."""
    pivot: float | Literal["auto"] = option("METRES|auto", "auto", "auto")
    """What the orbit turns about: a point this far ahead on the optical axis; auto: at the scene's median depth."""
    dolly: float | None = option("METRES", "0")
    """Metres along the optical axis, after the orbit. Positive: forward; negative: back, which closes rounding cracks."""
    to: Path | None = option("TARGET.json")
    """The target camera, instead of an orbit; its world_from_cam is in the world of the source camera."""


@dataclass(frozen=True)
class Lens:
    """The camera that took the picture: one of --camera, --fx, --fov, or the EXIF focal length of a JPEG."""

    camera: Path | None = option("FILE.json", "--fx, --fov, or the EXIF data of the picture")
    """width, height, fx, fy, cx, cy, pixel_center and (optional) world_from_cam; or a calib.txt, a text of K
    alone, or the YAML of ROS or OpenCV, or its XML."""
    fx: float | None = option("PX")
    """Horizontal focal length in pixels: that of the lens / width of the sensor (both in mm) x width of the picture."""
    fy: float | None = option("PX", "as --fx")
    """Vertical focal length in pixels."""
    cx: float | None = option("PX", "the middle")
    """Principal point, x, in pixels."""
    cy: float | None = option("PX", "the middle")
    """Principal point, y, in pixels."""
    fov: float | None = option("DEG", label="Field of view")
    """Horizontal field of view in degrees: phone main camera about 65, Kinect 57 to 63, EasySynth 90."""
    pixel_center: float = option("0.5|0.0", "0.5", 0.5)
    """Where --cx and --cy put the centre of the first pixel: 0.5 (COLMAP) or 0.0 (OpenCV, TUM, Open3D, Middlebury)."""


@dataclass(frozen=True)
class Reading:
    """How the depth file is read: 16-bit PNG, TIFF or PGM, EXR, PFM, NPY or NPZ; --far goes with estimated depth too."""

    depth_scale: float | None = option("UNITS", "1000 for 16-bit files, 1 for float files", label="Units per metre")
    """Units per metre: 1000 = millimetres, TUM 5000, KITTI 256."""
    depth_range: float | None = option("METRES", label="1.0 means")
    """Metres that 1.0 stands for in depth normalised to 0..1 (EasySynth); 1.0 itself is far."""
    channel: str | None = option("NAME", "Z, R or Y")
    """Which channel of an EXR file holds depth."""
    far: float | None = option("METRES", label="Sky from")
    """Depth at or beyond this is far (sky): it turns with the camera but never comes nearer."""
    resize_depth: Literal["guided", "nearest"] | None = option(
        "guided|nearest", label="Bring depth to the picture's size"
    )
    """Bring a depth map of another size to the picture's. guided: interpolated on each surface, with edges where the picture has
    them, also a map that was enlarged by the nearest pixel before. nearest: each pixel from the nearest one."""
    radial_depth: bool = option("", "off", False, label="Depth along the ray")
    """The depth file holds distances along the ray of each pixel, not along the optical axis (Hypersim, ray tracers, AirSim's
    DepthPerspective)."""
    inverse_depth: bool = option("", "off", False, label="Inverse depth of a network")
    """The depth file is what a network such as Depth Anything or MiDaS gave: inverse depth, larger is nearer, in no unit. It is
    used as estimated depth is. With --depth-scale it is 1 / depth, as Nuke renders it."""


@dataclass(frozen=True)
class Estimating:
    """Depth of a picture that comes without: by which network, and what is known of its scale."""

    depth_model: str | None = option("NAME|FILE|NAME=FILE", "tcmonodepth, which ships")
    """Network that estimates depth: depth-anything-small, or in metres depth-anything-indoor, depth-anything-outdoor and
    moge-small (`dlama models pull` gets them); or an ONNX file with a contract; NAME=FILE: a file with that one's contract."""
    metres_at: tuple[str, ...] = option("X,Y=D ...", "none", (), label="Known depths")
    """Known depths: the pixel x to the right, y down, and its metres along the optical axis; several fit better."""
    camera_height: float | None = option("METRES", label="Camera above the ground")
    """The camera's height above the ground that the picture shows, instead of known depths."""
    sharpen: bool = option("", "they are moved", True)
    """Leave the blurred edges of estimated depth as they are, instead of moving them to the picture's."""


@dataclass(frozen=True)
class Masking:
    """How a mask file is read: black and white, 255 = remove."""

    mask_polarity: Literal["fill", "known"] = option("fill|known", "fill", "fill")
    """What white means: fill = remove it, known = keep it."""
    soft_mask: bool = option("", "off", False)
    """Take a grey mask; values above 127 count as white."""
    mask_class: str | None = option("NAME|R,G,B|N")
    """The mask is an EasySynth semantic picture or a map of labels: remove this class. Names stand in SemanticClasses.csv."""


@dataclass(frozen=True)
class Pointing:
    """Points at the object, in place of a mask file. Pixels as in the picture: x to the right, y down."""

    click: tuple[str, ...] = option("X,Y ...", "none", ())
    """Pixels on the object."""
    not_click: tuple[str, ...] = option("X,Y ...", "none", (), flag="not")
    """Pixels next to it, which the mask must not hold."""
    box: str | None = option("X,Y,W,H")
    """A box around the object: its upper left corner, width and height."""
    salient: bool = option("", "off", False)
    """What stands out in the picture, by a network that ships with dlama; needs no click. Short for --masker salient."""
    object_class: str | None = option("NAME|R,G,B", flag="class")
    """The class of this name in the EasySynth semantic picture that belongs to IMAGE (in SemanticImage/, next to its folder)."""
    masker: str | None = option("rgbd|salient|segment-anything", "rgbd")
    """What finds the object: rgbd by depth and colour, salient by a network that ships, segment-anything by two networks."""
    mask_model: str | None = option("NAME|NAME=ENCODER,DECODER")
    """Networks of --masker segment-anything: sam-vit-b, mobile-sam or efficient-sam (`dlama models pull` gets NAME-encoder and
    NAME-decoder), or two ONNX files."""
    candidate: str = option("part|object|group", "object", "object")
    """Which reading of an ambiguous click; `dlama mask` prints which there are."""
    with_shadow: bool = option("", "off", False)
    """Add the shadow that the object casts on the surface it stands on, where it is clear; to a mask file, too."""


@dataclass(frozen=True)
class Pair:
    """Of stereo pairs."""

    calib: Path | None = option("CALIB")
    """calib.txt of Middlebury or KITTI, or JSON with left_K, right_K, baseline_m, doffs, pixel_center."""
    right_view: Literal["given", "synthesised"] | None = option("given|synthesised", "the recipe's")
    """given (dlama): the right picture stays as it is and gets depth; synthesised (paper): it is made from the left."""
    disparity_scale: float | None = option("UNITS", "256 for 16-bit files, 1 for float files")
    """Units of the disparity file that make a pixel."""
    matcher: Path | None = option("FILE.onnx", "semi-global matching")
    """A network that finds the disparity: left and right picture in, disparity out, as its contract says."""
    max_disparity: float | None = option("PX", "found")
    """The largest disparity looked for."""
