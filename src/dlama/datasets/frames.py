"""The nouns of data sets: frames with ground truth, and the cases that an evaluation runs the method on.

A reader turns a folder into a `Dataset`: its frames, and its cases of each protocol. Both are descriptions; pictures are
read when `load` is called, so that a long listing costs nothing and a case can be sent to another process.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from dlama.errors import FileError
from dlama.geometry.camera import StereoRig
from dlama.geometry.projection import disparity_from_depth
from dlama.geometry.rgbd import RGBD, BoolArray, Float32Array, UInt8Array

Protocol = Literal["vpi", "ori", "sii"]
"""View change, object removal, stereo: the three experiments of the paper."""


@dataclass(frozen=True)
class Frame:
    """One posed picture with depth, not yet read."""

    scene: str
    name: str
    load: Callable[[], RGBD]
    """Reads it; picklable (functools.partial of a module's function)."""
    yaw: float | None = None
    """Degrees of orbit from the scene's first frame, > 0 to the right, where the data set has an orbit."""


@dataclass(frozen=True, eq=False)
class ViewTruth:
    """VPI (view change): a source frame, and the true frame at the target camera."""

    source: RGBD
    target: RGBD
    """The true frame; its camera is the one to complete the source at."""
    object_mask: BoolArray | None = None
    """H x W in the source, True = the object of the paper's second experiment."""
    target_without: RGBD | None = None
    """The true frame at the target camera without that object."""
    exposure_varies: bool = False
    """The frames differ in exposure: one gain per channel is undone before colours are compared."""


@dataclass(frozen=True, eq=False)
class RemovalTruth:
    """ORI (object removal): a frame with an object, and the same camera's frame without it."""

    source: RGBD
    without: RGBD
    mask: BoolArray
    """H x W, True = remove."""
    compare: BoolArray | None = None
    """H x W, True = the two frames show the same background here; None: everywhere."""
    shadow: BoolArray | None = None
    """H x W, True = the object's cast shadow (never part of the mask); None: not known."""
    exposure_varies: bool = False


@dataclass(frozen=True, eq=False)
class StereoTruth:
    """SII (stereo): a rectified pair with truth. With masks an object is removed in both views, else the right view is made."""

    left: UInt8Array
    """H x W x 3."""
    right: UInt8Array
    rig: StereoRig
    disparity_left: Float32Array
    """H x W px of the pair as given, 0 = unknown, in the left view: right column = left column - disparity."""
    disparity_right: Float32Array | None = None
    """H x W px in the right view: left column = right column + disparity."""
    mask_left: BoolArray | None = None
    """H x W, True = remove; both masks or neither."""
    mask_right: BoolArray | None = None
    without_left: RGBD | None = None
    """The true left frame without the object, where there are masks."""
    without_right: RGBD | None = None
    metric: bool = True
    """The rig's focal length and baseline are true; False: nominal, so depth in metres means nothing."""


def true_disparity(rig: StereoRig, depth: Float32Array) -> Float32Array:
    """H x W px, as StereoTruth has it, of true depth (m); 0 where depth is missing, or disparity is not > 0."""
    return np.maximum(disparity_from_depth(depth, rig), 0)


Truth = ViewTruth | RemovalTruth | StereoTruth


@dataclass(frozen=True)
class Case:
    """One input of the method with its ground truth, not yet read."""

    protocol: Protocol
    dataset: str
    scene: str
    frame: str
    """Unique within the scene and the protocol."""
    load: Callable[[], Truth]
    """Reads it; picklable (functools.partial of a module's function)."""
    yaw: float | None = None
    """Signed degrees of orbit (VPI), or the angle between the two frames of a posed pair."""

    @property
    def key(self) -> str:
        """What distinguishes this case from every other of a data set; safe as a file name."""
        return "__".join((self.protocol, self.dataset, self.scene, self.frame))


@dataclass(frozen=True)
class Dataset:
    """A data set as a listing: nothing is read yet."""

    name: str
    layout: str
    """The key in `LAYOUTS` of the reader that listed it."""
    root: Path | None
    """Its folder; None for generated worlds."""
    frames: tuple[Frame, ...]
    cases: tuple[Case, ...]

    def __post_init__(self) -> None:
        """FileError where a name is no text: results, reports and hashes are made of them."""
        for name in dict.fromkeys([self.name, *(part for one in self.frames for part in (one.scene, one.name))]):
            try:
                name.encode()
            except UnicodeEncodeError as error:
                raise FileError(
                    f"{self.root}: the name {os.fsencode(name)!r} in it is no UTF-8 text; rename it"
                ) from error

    def of(self, protocol: Protocol) -> tuple[Case, ...]:
        """The cases of one protocol, in the data set's order."""
        return tuple(case for case in self.cases if case.protocol == protocol)
