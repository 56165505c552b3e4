"""The options of the command line, as dataclasses with a docstring per field; every verb is made of these.

Nothing here imports what computes, so that --help is quick; a test holds the names in it to those of the library.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from tyro.conf import arg

from dlama.completion.options import typed_options
from dlama.errors import InputError
from dlama.jobs.inputs import mask_and_pointing
from dlama.jobs.parameters import check_move, check_one_target, known_depths

if TYPE_CHECKING:
    from dlama.geometry.camera import Camera


def option(metavar: str, default: str | None = "none", **others: Any) -> Any:
    """How --help shows one option: what stands for its value, and its default; None: it is required.

    others: of `tyro.conf.arg`: aliases, name; help, in place of a docstring of two lines, whose line break tyro would show.
    """
    hint = "(required)" if default is None else f"(default: {default})"
    return arg(metavar=metavar, help_behavior_hint=hint, **others)


Degrees = Annotated[float | None, option("DEG", "0")]
Metres = Annotated[float | None, option("METRES")]
CameraFile = Annotated[Path | None, option("FILE.json")]
Image = Annotated[Path, option("IMAGE", None)]
Depth = Annotated[Path | None, option("[DEPTH]", "estimated from the picture")]
DepthAndMask = Annotated[tuple[Path, ...], option("[DEPTH] [MASK]", "depth is estimated")]
RESULTS = (
    "image",
    "depth",
    "hole",
    "origin",
    "confidence",
    "disparity",
    "points",
    "mesh",
    "scene",
    "preview",
    "choice",
    "mask",
)
"""Names of what can be written."""
BY_DEFAULT = ("image", "depth", "origin", "confidence", "mesh", "preview")
"""Those that are written where none is named."""
Seed = Annotated[int, option("N", "0")]
Output = Annotated[Path, option("DIR", None, aliases=["-o"])]


def names_in(listed: str | None) -> tuple[str, ...] | None:
    """The names in a list with commas; None: none is given."""
    return None if listed is None else tuple(name.strip() for name in listed.split(",") if name.strip())


@dataclass(frozen=True)
class Results:
    """Which files are written."""

    only: Annotated[
        str | None,
        option(
            "NAME,...",
            ",".join(BY_DEFAULT),
            help=f"What is written next to meta.json, of {', '.join(RESULTS)} (disparity of pairs, mask of a removed object).",
        ),
    ] = None
    also: Annotated[str | None, option("NAME,...")] = None
    """More of these names: scene (scene.npz, which view, video and show read), points, hole ..."""

    def settings(self) -> dict[str, tuple[str, ...]]:
        """As keyword arguments of `write`: those that are given."""
        given = {"only": names_in(self.only), "also": names_in(self.also)}
        return {name: names for name, names in given.items() if names is not None}


@dataclass(frozen=True)
class Report:
    """What the command prints."""

    quiet: Annotated[bool, option("", "off")] = False
    """Print nothing but errors, and what --json prints."""
    json: Annotated[bool, option("", "off")] = False
    """Print one JSON object instead of the summary: what was written, shares of holes, seconds, warnings."""


@dataclass(frozen=True)
class Move:
    """Where the new camera stands: an orbit and a dolly from the source camera, or a camera file."""

    yaw: Degrees = None
    """Degrees about the vertical axis through the pivot. Positive: the camera moves to its right and turns left."""
    pitch: Degrees = None
    """Degrees about the horizontal axis through the pivot. Positive: the camera moves up and looks down."""
    pivot: Annotated[float | Literal["auto"], option("METRES|auto", "auto")] = "auto"
    """What the orbit turns about: a point this far ahead on the optical axis; auto: at the scene's median depth."""
    dolly: Annotated[float | None, option("METRES", "0")] = None
    """Metres along the optical axis, after the orbit. Positive: forward; negative: back, which closes rounding cracks."""
    to: Annotated[Path | None, option("TARGET.json")] = None
    """The target camera, instead of an orbit; its world_from_cam is in the world of the source camera."""

    def required(self) -> Move:
        """The move, if there is one; raises InputError."""
        check_move(to=self.to, yaw=self.yaw, pitch=self.pitch, dolly=self.dolly)
        return self

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of the verbs in Python; raises InputError when --to and an orbit were both given."""
        check_one_target(self.to, yaw=self.yaw, pitch=self.pitch, dolly=self.dolly)
        return {
            "camera": self.target(),
            "yaw": self.yaw or 0.0,
            "pitch": self.pitch or 0.0,
            "pivot": self.pivot,
            "dolly": self.dolly or 0.0,
        }

    def target(self) -> Camera | None:
        """The camera of --to."""
        from dlama.files.cameras import read_camera

        return None if self.to is None else read_camera(self.to)


@dataclass(frozen=True)
class Lens:
    """The camera that took the picture: one of --camera, --fx, --fov, or the EXIF focal length of a JPEG."""

    camera: Annotated[Path | None, option("FILE.json", "--fx, --fov, or the EXIF data of the picture")] = None
    """width, height, fx, fy, cx, cy, pixel_center and (optional) world_from_cam; or a Middlebury calib.txt."""
    fx: Annotated[float | None, option("PX")] = None
    """Horizontal focal length in pixels."""
    fy: Annotated[float | None, option("PX", "as --fx")] = None
    """Vertical focal length in pixels."""
    cx: Annotated[float | None, option("PX", "the middle")] = None
    """Principal point, x, in pixels."""
    cy: Annotated[float | None, option("PX", "the middle")] = None
    """Principal point, y, in pixels."""
    fov: Annotated[float | None, option("DEG")] = None
    """Horizontal field of view in degrees: phone main camera about 65, Kinect 57 to 63, EasySynth 90."""
    pixel_center: Annotated[float, option("0.5|0.0", "0.5")] = 0.5
    """Where --cx and --cy put the centre of the first pixel: 0.5 (COLMAP) or 0.0 (OpenCV, TUM, Open3D, Middlebury)."""

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of read_rgbd."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class Reading:
    """How the depth file is read: 16-bit PNG or TIFF, EXR, PFM, NPY or NPZ; --far goes with estimated depth too."""

    depth_scale: Annotated[float | None, option("UNITS", "1000 for 16-bit files, 1 for float files")] = None
    """Units per metre: 1000 = millimetres, TUM 5000, KITTI 256."""
    depth_range: Metres = None
    """Metres that 1.0 stands for in depth normalised to 0..1 (EasySynth); 1.0 itself is far."""
    channel: Annotated[str | None, option("NAME", "Z, R or Y")] = None
    """Which channel of an EXR file holds depth."""
    far: Metres = None
    """Depth at or beyond this is far (sky): it turns with the camera but never comes nearer."""
    resize_depth: Annotated[Literal["nearest"] | None, option("nearest")] = None
    """Bring a depth map of another size to the picture's, each pixel from the nearest one."""

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of read_rgbd."""
        return dataclasses.asdict(self)


def split_depth_and_mask(files: Sequence[Path], pointed: bool = False) -> tuple[Path | None, Path | None]:
    """The depth file, if there is one, and the mask, which comes last; no mask where the object is pointed at. InputError."""
    if pointed:
        if len(files) > 1:
            raise mask_and_pointing(files[1])
        return (files[0] if files else None), None
    if not files:
        raise InputError("no object to remove is given: give a mask file, --click X,Y on the object, or --box X,Y,W,H")
    if not 1 <= len(files) <= 2:
        raise InputError(f"{len(files)} files follow the picture; a mask, or depth and a mask are expected")
    return (files[0] if len(files) == 2 else None), files[-1]


KnownDepths = Annotated[tuple[str, ...], option("X,Y=D ...", "none")]
"""Depths in metres of pixels, as they are typed; `known_depths` reads them."""


@dataclass(frozen=True)
class Estimating:
    """Depth of a picture that comes without: by which network, and what is known of its scale."""

    depth_model: Annotated[
        str | None,
        option(
            "NAME|FILE|NAME=FILE",
            "tcmonodepth, which ships",
            help="Network that estimates depth: depth-anything-small, or in metres depth-anything-indoor, "
            "depth-anything-outdoor and moge-small (`dlama models pull` gets them); or an ONNX file with a contract; "
            "NAME=FILE: a file with that one's contract.",
        ),
    ] = None
    metres_at: KnownDepths = ()
    """Known depths: the pixel x to the right, y down, and its metres along the optical axis; several fit better."""
    camera_height: Metres = None
    """The camera's height above the ground that the picture shows, instead of --metres-at."""
    sharpen: Annotated[bool, option("", "on")] = True
    """Leave the blurred edges of estimated depth as they are, instead of moving them to the picture's."""

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of read_rgbd."""
        return dataclasses.asdict(self) | {"metres_at": known_depths(self.metres_at)}


@dataclass(frozen=True)
class Masking:
    """How a mask file is read: black and white, 255 = remove."""

    mask_polarity: Annotated[Literal["fill", "known"], option("fill|known", "fill")] = "fill"
    """What white means: fill = remove it, known = keep it."""
    soft_mask: Annotated[bool, option("", "off")] = False
    """Take a grey mask; values above 127 count as white."""
    mask_class: Annotated[str | None, option("NAME|R,G,B")] = None
    """The mask is an EasySynth semantic picture: remove this class. Names stand in SemanticClasses.csv next to it."""

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of read_mask."""
        return dataclasses.asdict(self)


T = TypeVar("T")


def options_as_fields(*names: str) -> Callable[[type[T]], type[T]]:
    """Decorator: the class as a dataclass with these options of the library (all, if none is named) as its fields."""

    def decorate(cls: type[T]) -> type[T]:
        found, annotations = typed_options(), {}
        for name in names or found:
            typed, default, text = found[name]
            kind: Any = Literal[typed.kind] if isinstance(typed.kind, tuple) else typed.kind
            kind = kind | None if default is None else kind
            annotations[name] = Annotated[kind, option(typed.metavar, typed.default, help=text)]
            setattr(cls, name, default)
        cls.__annotations__ = annotations
        return dataclass(frozen=True)(cls)

    return decorate


class LibraryOptions:
    """Options of the library, as they are typed."""

    if TYPE_CHECKING:
        filler: str
        model: str | None

    def settings(self) -> dict[str, Any]:
        """As keyword arguments of the verbs in Python."""
        return vars(self) | {"model": self.network()}

    def network(self) -> Path | None:
        """The ONNX file of --model; a checkpoint is converted once, into the cache."""
        from dlama.apps.model_files import model_for

        return None if self.model is None else model_for(self.model)


@options_as_fields()
class Method(LibraryOptions):
    """How the scene is completed."""


@options_as_fields("filler", "model", "recipe", "dilate", "seed")
class SequenceMethod(LibraryOptions):
    """How a sequence is completed."""


@options_as_fields("filler", "model", "seed")
class Filler(LibraryOptions):
    """What fills what no frame saw."""
