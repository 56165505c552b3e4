"""A data set of posed frames in; its completion, frame by frame or along a path of cameras, out."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

from dlama.arguments import check_arguments
from dlama.completion.memory import check_memory
from dlama.completion.options import OptionKeywords, Unpack, options_of, take_options
from dlama.completion.report import warn_of_scale
from dlama.completion.start import plan_for
from dlama.datasets.posed.lenses import CameraOption
from dlama.datasets.sequences.camera_paths import cameras_for
from dlama.datasets.sequences.completion import SequenceCompletion
from dlama.datasets.sequences.loading import masks_of_frames, read_scene_of
from dlama.errors import InputError
from dlama.geometry.camera import Camera
from dlama.geometry.frames.choosing import MOST_FRAMES
from dlama.geometry.rgbd import BoolArray
from dlama.progress import Progress, take_progress
from dlama.writing.atomic_write import PathLike


@take_options
@take_progress
def sequence(
    dataset: PathLike,
    *,
    frames: str | None = None,
    masks: Mapping[str, BoolArray] | None = None,
    with_shadow: bool = False,
    views: str | Mapping[str, Camera] = "frames",
    layout: str | None = None,
    scene: str | None = None,
    camera: CameraOption = None,
    depth_range: float | None = None,
    depth_scale: float | None = None,
    max_depth: float | None = None,
    resize_depth: Literal["guided", "nearest"] | None = None,
    keep_poses: bool = False,
    progress: Progress | None = None,
    **options: Unpack[OptionKeywords],
) -> SequenceCompletion:
    """Complete a data set of posed frames: what one frame lacks comes from the others, only the rest is filled, once.

    A frame that cannot be read, comes twice or contradicts all others is warned of and left out. Views are completed when they
    are asked for (`SequenceCompletion.views`) or written (`write`). Memory hardly grows with the number of frames.

    Args:
        dataset: The folder of posed frames, in any layout that `dlama evaluate` reads; or a scene.npz.
        frames: Which frames: `FIRST:END:STEP`, places from 0.
        masks: A frame's name, or its place from 0 of those in `frames` -> H x W bool, True = remove: an object that is removed
            from all frames. Those of larger pictures are shrunk, as the frames are, empty ones and those of frames that are not
            chosen passed over.
        with_shadow: Remove the shadow that the object casts in each frame, too.
        views: "frames": at the frames' own cameras; "orbit", "spiral" or "dolly": a path of 24 cameras from the middle frame; a
            JSON file with a list of cameras; or cameras by name.
        layout, scene, camera, depth_range, depth_scale: Of the data set, as in `dlama evaluate`; `scene` of several.
        max_depth: Metres beyond which depth is missing; None: 5 in recordings of a phone's LIDAR, which guesses beyond.
        resize_depth: Depth smaller than the pictures is enlarged to their size, as in `read_rgbd`; None: pictures are shrunk to
            its size, or, in recordings of phones and depth cameras, to up to four times that.
        keep_poses: Else poses are made to agree with the pictures first, where they are off by a pixel or more, as those of
            hand-held cameras are (`align_frames`); the results then have the new poses.
        progress: Called with the name of each stage as it begins; what it raises ends the work.
        options: How the scene is completed (`Options`).
    Raises:
        InputError: what `scene` and `complete` refuse, a mask for a frame that is not there; FileError.
    """
    check_arguments(sequence, locals())
    method = options_of(options)
    reading: dict[str, Any] = {"layout": layout, "scene": scene, "camera": camera, "resize_depth": resize_depth}
    reading |= {"depth_range": depth_range, "depth_scale": depth_scale, "max_depth": max_depth}
    loaded = read_scene_of(dataset, frames, clip=method.settings.clip, keep_poses=keep_poses, **reading)
    cameras = cameras_for(views, loaded.scene)
    first = loaded.scene.frames[0]
    check_memory([first.camera] * (2 * MOST_FRAMES))
    if (depth := first.load().depth).any():
        warn_of_scale(depth)
    numbered = masks_of_frames(masks or {}, loaded, frames)
    if with_shadow and not numbered:
        raise InputError("`with_shadow` is for a removed object; give its `masks`")
    plan, _, start, *_ = plan_for(loaded.scene, method, numbered or None, with_shadow=with_shadow)
    settings = {
        "filler": plan.filler,
        "model": None if method.model is None else str(method.model),
        "recipe": dataclasses.asdict(plan.recipe),
        "seed": method.seed,
        "min_confidence": method.min_confidence,
        "with_shadow": with_shadow,
    }
    return SequenceCompletion(str(dataset), loaded, plan, start, cameras, numbered, settings)
