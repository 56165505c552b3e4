"""The parameters of one job in; what its files hold, read and timed, and at last its result, written with hashes, out."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from dlama.completion.completion import Completion
from dlama.completion.meta_data import MetaData
from dlama.errors import InputError
from dlama.files.cameras import camera_for, read_stereo_calib
from dlama.files.rasters.depth import read_disparity
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.masks import read_mask
from dlama.files.rasters.pictures import read_color
from dlama.files.rasters.turned_pairs import check_mask_fits
from dlama.files.results.completion import write
from dlama.files.rgbd import read_rgbd
from dlama.files.scenes.scene_npz import read_scene
from dlama.files.semantic_classes import semantic_picture
from dlama.geometry.camera import StereoRig
from dlama.geometry.rendering import render
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.geometry.scene import Scene
from dlama.jobs.parameters import (
    ESTIMATING,
    LENS,
    MASKING,
    NETWORKS,
    POINTING,
    READING,
    RESULTS,
    is_pointed,
    mask_settings,
)
from dlama.models.network_file import close_networks
from dlama.progress import begin_stage

if TYPE_CHECKING:
    from dlama.perception.object_masks import ObjectMask

Parameters = Mapping[str, Any]
"""Of a job, by name, as `jobs.parameters` reads them; those that are given."""
FoundMask: TypeAlias = "tuple[ObjectMask, dict[str, Any]]"
"""An object in a picture, and how it was looked for."""
Mask = BoolArray | Callable[[RGBD], BoolArray]
"""H x W, True = remove; or what finds it in a picture with its depth."""


def select(p: Parameters, names: Collection[str]) -> dict[str, Any]:
    """Those of these parameters that are given; network files as paths."""
    found = {name: p[name] for name in names if name in p}
    return {name: Path(value) if name in NETWORKS and Path(value).is_file() else value for name, value in found.items()}


def path_of(p: Parameters, name: str) -> Path | None:
    """A file, where it is given."""
    return Path(p[name]) if name in p else None


def is_scene(image: str | Path) -> bool:
    """Whether what is given in place of a picture is called like a scene."""
    return Path(image).suffix.lower() == ".npz"


def picture_of(source: RGBD | Scene) -> RGBD:
    """The picture that clicks and masks are of: of a scene what its middle frame's camera sees, fills included."""
    if isinstance(source, RGBD):
        return source
    view = render(source, source.middle_frame.camera)
    return RGBD(view.color, view.depth, view.camera, estimate={} if source.has_estimated_depth else None)


def refuse_of_pictures(p: Parameters, kind: str, taken: Collection[str] = ()) -> None:
    """InputError: a depth file, or parameters (but those `taken`) that say how a picture is read, with an image that is none but
    `kind`."""
    image = Path(p["image"])
    if "depth" in p:
        raise InputError(f"{image}: is {kind}, which has its depth; {p['depth']} does not apply to it")
    for name in p:
        if name in {**LENS, **READING, **ESTIMATING} and name not in taken:
            raise InputError(f"`{name}` does not apply to {kind} ({image.name or image}); it is for pictures")


def add_shadow(picture: RGBD, mask: BoolArray) -> FoundMask:
    """The object of a mask file with the shadow that it casts in the picture."""
    from dlama.perception.object_masks import complete_mask

    return complete_mask(picture, {"object": mask}, "object", "a mask file", True), {"with_shadow": True}


def find_pointed(picture: RGBD | UInt8Array, image: Path, p: Parameters) -> FoundMask:
    """The object in a picture, read from `image`, that the parameters point at, or of a semantic class; and how it was looked
    for. InputError and its kin."""
    from dlama.perception import object_masks

    given = select(p, POINTING)
    object_class = given.pop("object_class", None)
    settings = mask_settings(given)
    if object_class is None:
        close_networks()  # the network of masks and those of fillers need the memory in turn
        found = object_masks.find_mask(picture, **settings)
        close_networks()
        return found, settings
    if settings != mask_settings(select(given, ("with_shadow",))):
        raise InputError("`object_class` and other ways to point at an object contradict each other; give one of them")
    path = semantic_picture(image)
    mask = read_mask(path, mask_class=object_class)
    check_mask_fits(mask, path, image)
    with_shadow = settings["with_shadow"]
    found = object_masks.complete_mask(picture, {"object": mask}, "object", f"class {object_class}", with_shadow)
    return found, settings


@dataclass
class JobInputs:
    """What one job has read so far, of which files."""

    inputs: dict[str, Path] = field(default_factory=dict)
    """Role (image, depth, mask, ...) -> the file that was read."""
    addresses: dict[str, str] = field(default_factory=dict)
    """Role -> where an input came from, of those that were fetched from elsewhere."""
    intrinsics_from: str = ""
    """In words, where the source camera's intrinsics come from."""
    stages: dict[str, float] = field(default_factory=dict)
    """Seconds by stage, of what runs before the verb: read, read_and_estimate_depth, find_mask; and, at last, write."""
    removed: BoolArray | None = None
    """Of the object, in the picture or the left one of a pair; True = remove."""
    object_mask: dict[str, Any] = field(default_factory=dict)
    """How the mask was found, where it was pointed at."""
    depth_reading: dict[str, Any] = field(default_factory=dict)
    """Options that depth, or the disparity of a pair, was read with; those that were given."""

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """What runs inside is added to that stage's seconds."""
        started = time.perf_counter()
        yield
        self.stages[stage] = self.stages.get(stage, 0.0) + time.perf_counter() - started

    @contextmanager
    def reading(self, files: Mapping[str, Path | None], stage: str = "read") -> Iterator[None]:
        """Files being read, by their roles: those that are given become inputs, are shown in the bar, and timed."""
        given = {role: path for role, path in files.items() if path is not None}
        self.inputs |= given
        begin_stage(f"read {', '.join(path.name for path in given.values())}")
        with self.timed(stage):
            yield
        begin_stage("complete")

    def read_source(self, p: Parameters) -> RGBD | Scene:
        """The picture with its depth (estimated, where there is no file) and its camera; or a scene. InputError and its kin."""
        if not is_scene(p["image"]):
            return self.read_picture(p)
        refuse_of_pictures(p, "a scene")
        with self.reading({"scene": Path(p["image"])}):
            return read_scene(self.inputs["scene"])

    def read_picture(self, p: Parameters) -> RGBD:
        """As `read_source`, of a picture."""
        image, depth = Path(p["image"]), path_of(p, "depth")
        files = {"image": image, "camera": path_of(p, "camera"), "depth": depth}
        self.depth_reading = select(p, READING)
        lens, options = select(p, LENS), self.depth_reading | select(p, ESTIMATING)
        if depth is None or (options.get("inverse_depth") and not options.get("depth_scale")):
            with self.reading(files, "read_and_estimate_depth"):
                rgbd = read_rgbd(image, depth, **lens, **options)
            self.intrinsics_from = (rgbd.estimate or {})["field_of_view"]["from"]
            return rgbd
        with self.reading(files):
            camera, self.intrinsics_from = camera_for(picture_hw(image), image=image, **lens)
            return read_rgbd(image, depth, camera=camera, **options)

    def read_color(self, p: Parameters) -> UInt8Array:
        """The picture alone, H x W x 3."""
        with self.reading({"image": Path(p["image"])}):
            return read_color(p["image"])

    def read_removed(self, p: Parameters, picture: str, mask: BoolArray | None = None) -> Mask | None:
        """The mask of the object to remove from a picture (image, left): of its file, or `mask`, or what finds it, and its
        shadow, in the picture with its depth; None: no object is named."""
        if is_pointed(p):
            if "object_class" in p:
                self.inputs["semantic"] = semantic_picture(p.get(picture, ""))
            return partial(self._find, partial(find_pointed, image=Path(p.get(picture, "")), p=p))
        if mask is None and "mask" in p:
            mask = self.read_mask_file(p, "mask", picture)
        self.removed = mask
        return mask if mask is None or not p.get("with_shadow") else partial(self._find, partial(add_shadow, mask=mask))

    def read_mask_file(self, p: Parameters, role: str, picture: str) -> BoolArray:
        """The mask file of that role, which is of a picture (image, left, right), True = remove."""
        path = Path(p[role])
        with self.reading({role: path}):
            mask = read_mask(path, **select(p, MASKING))
            if picture in p and Path(p[picture]).is_file() and not is_scene(p[picture]):
                check_mask_fits(mask, path, Path(p[picture]))
            return mask

    def _find(self, find: Callable[[RGBD], FoundMask], rgbd: RGBD) -> BoolArray:
        """The mask of the object in a picture; how it was found goes into meta.json."""
        begin_stage("find mask")
        with self.timed("find_mask"):
            found, settings = find(rgbd)
        self.object_mask, self.removed = {**settings, **found.about}, found.mask
        return found.mask

    def read_disparity_file(self, p: Parameters) -> Float32Array | None:
        """The disparity, where one is given."""
        if "disparity" not in p:
            if "disparity_scale" in p:
                raise InputError(
                    "`disparity_scale` is given without `disparity`; the file it belongs to is expected too"
                )
            return None
        self.depth_reading = select(p, ("disparity_scale",))
        with self.reading({"disparity": Path(p["disparity"])}):
            return read_disparity(self.inputs["disparity"], scale=p.get("disparity_scale"))

    def read_pair(self, p: Parameters) -> tuple[UInt8Array, UInt8Array, StereoRig]:
        """The pictures of a rectified pair and the cameras that took them."""
        left, right, calib = (Path(p[role]) for role in ("left", "right", "calib"))
        self.intrinsics_from = f"calib {calib.name}"
        with self.reading({"left": left, "right": right, "calib": calib}):
            pictures = read_color(left), read_color(right)
            return *pictures, read_stereo_calib(calib, hw=pictures[0].shape[:2])

    def about_inputs(self) -> MetaData:
        """For meta.json: the options that depth was read with and how the object's mask was found, where there are any."""
        depth: MetaData = {"depth_reading": self.depth_reading} if self.depth_reading else {}
        return depth | ({"object_mask": self.object_mask} if self.object_mask else {})

    def write_completion(self, done: Completion, output: Path, p: Parameters) -> None:
        """The result to its directory."""
        with self.timed("write"):
            write(
                done,
                output,
                **select(p, RESULTS),
                inputs=self.inputs,
                intrinsics_from=self.intrinsics_from,
                seconds=dict(self.stages),
                mask=self.removed,
                input_addresses=self.addresses,
            )
