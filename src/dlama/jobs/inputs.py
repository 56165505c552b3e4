"""The files of one job in, or what points at an object in them; what was read from them, timed, and written with hashes, out."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dlama.completion.completion import Completion
from dlama.errors import InputError
from dlama.files.cameras import camera_for, read_stereo_calib
from dlama.files.rasters.depth import read_disparity
from dlama.files.rasters.images import picture_hw
from dlama.files.rasters.pictures import read_color, read_mask
from dlama.files.rasters.turned_pairs import check_mask_fits
from dlama.files.results.completion import file_names, write
from dlama.files.rgbd import read_rgbd
from dlama.files.semantic_classes import semantic_picture
from dlama.geometry.camera import StereoRig
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array
from dlama.models.network_file import close_networks
from dlama.progress import begin_stage

if TYPE_CHECKING:
    from dlama.perception.object_masks import ObjectMask


def find_pointed(
    picture: RGBD | UInt8Array, image: Path, settings: Mapping[str, Any], object_class: str | None = None
) -> ObjectMask:
    """The object in a picture, read from `image`: by `settings` of find_mask, or of a semantic class. InputError and its kin."""
    from dlama.perception import object_masks

    if object_class is None:
        close_networks()  # the network of masks and those of fillers need the memory in turn
        found = object_masks.find_mask(picture, **settings)
        close_networks()
        return found
    if settings["clicks"] or settings["not_clicks"] or settings["box"] or settings["masker"]:
        raise InputError("`object_class` and other ways to point at an object contradict each other; give one of them")
    mask = read_mask(semantic_picture(image), mask_class=object_class)
    with_shadow = settings["with_shadow"]
    return object_masks.complete_mask(picture, {"object": mask}, "object", f"class {object_class}", with_shadow)


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
    started: float = field(default_factory=time.perf_counter)
    """By `time.perf_counter`."""

    @property
    def seconds(self) -> float:
        """Since the job began."""
        return time.perf_counter() - self.started

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """What runs inside is added to that stage's seconds."""
        started = time.perf_counter()
        yield
        self.stages[stage] = self.stages.get(stage, 0.0) + time.perf_counter() - started

    @contextmanager
    def reading(self, *names: Path, stage: str = "read") -> Iterator[None]:
        """Files being read: shown in the bar, and timed."""
        begin_stage(f"read {', '.join(name.name for name in names)}")
        with self.timed(stage):
            yield
        begin_stage("complete")

    def read_picture(
        self, image: Path, depth: Path | None, lens: Mapping[str, Any], options: Mapping[str, Any]
    ) -> RGBD:
        """A picture, its depth (estimated, where there is no file) and its camera; lens and options as of `read_rgbd`."""
        camera_file = lens.get("camera")
        self.inputs |= {"image": image} | ({"camera": Path(camera_file)} if camera_file else {})
        if depth is None:
            with self.reading(image, stage="read_and_estimate_depth"):
                rgbd = read_rgbd(image, **lens, **options)
            self.intrinsics_from = (rgbd.estimate or {})["field_of_view"]["from"]
            return rgbd
        self.inputs["depth"] = depth
        with self.reading(image, depth):
            camera, self.intrinsics_from = camera_for(picture_hw(image), image=image, **lens)
            return read_rgbd(image, depth, camera=camera, **options)

    def read_mask_file(
        self, path: Path, options: Mapping[str, Any], picture: Path | None, role: str = "mask"
    ) -> BoolArray:
        """A mask of a picture, True = remove; options as of `read_mask`."""
        self.inputs[role] = path
        with self.reading(path):
            mask = read_mask(path, **options)
            if picture is not None and picture.is_file():
                check_mask_fits(mask, path, picture)
            self.removed = mask if role == "mask" else self.removed
            return mask

    def find_pointed(
        self, rgbd: RGBD, image: Path, settings: Mapping[str, Any], object_class: str | None = None
    ) -> BoolArray:
        """The mask of what is pointed at in a picture, read from `image`; how it was found goes into meta.json."""
        begin_stage("find mask")
        with self.timed("find_mask"):
            found = find_pointed(rgbd, image, settings, object_class)
        self.object_mask, self.removed = {**settings, **found.about}, found.mask
        return found.mask

    def add_shadow(self, rgbd: RGBD, mask: BoolArray, with_shadow: bool) -> BoolArray:
        """The mask of a file, with the shadow that its object casts where that is asked for; how much goes into meta.json."""
        if not with_shadow:
            return mask
        from dlama.perception.object_masks import complete_mask

        begin_stage("find mask")
        with self.timed("find_mask"):
            found = complete_mask(rgbd, {"object": mask}, "object", "a mask file", True)
        self.object_mask, self.removed = {"with_shadow": True, **found.about}, found.mask
        return found.mask

    def optional_disparity(self, path: Path | None, scale: float | None) -> Float32Array | None:
        """A disparity, where one is given."""
        if path is None:
            if scale is not None:
                raise InputError(
                    "`disparity_scale` is given without `disparity`; the file it belongs to is expected too"
                )
            return None
        self.inputs["disparity"] = path
        with self.reading(path):
            return read_disparity(path, scale=scale)

    def pair(self, left: Path, right: Path, calib: Path) -> tuple[UInt8Array, UInt8Array, StereoRig]:
        """The pictures of a rectified pair and the cameras that took them."""
        self.inputs |= {"left": left, "right": right, "calib": calib}
        self.intrinsics_from = f"calib {calib.name}"
        with self.reading(left, right, calib):
            pictures = read_color(left), read_color(right)
            return *pictures, read_stereo_calib(calib, hw=pictures[0].shape[:2])

    def write_completion(
        self, done: Completion, output: Path, only: Sequence[str] | None = None, also: Sequence[str] = ()
    ) -> list[str]:
        """What `only` and `also` name of the result to its directory; the names of its files."""
        if self.object_mask:
            done.meta["object_mask"] = self.object_mask
        addresses: dict[str, Any] = {"input_addresses": self.addresses} if self.addresses else {}
        with self.timed("write"):
            write(
                done,
                output,
                only=only,
                also=also,
                inputs=self.inputs,
                intrinsics_from=self.intrinsics_from,
                seconds=dict(self.stages),
                mask=self.removed,
                **addresses,
            )
        return file_names(done, only, also)
