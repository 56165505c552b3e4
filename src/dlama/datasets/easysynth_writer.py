"""Frames with depth and semantics in; folders in EasySynth's layout out, whole or not at all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from dlama.geometry.rgbd import RGBD, UInt8Array

RGB = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class SequenceFrame:
    """One frame of a sequence, as the writer wants it."""

    rgbd: RGBD
    """Colour, depth (metres, +inf = far, 0 = missing) and the posed camera (OpenCV axes, metres)."""
    semantic: UInt8Array
    """H x W, uint8: which class a pixel shows, as a number in the order of `classes` (0 = the first)."""


@dataclass(frozen=True, eq=False)
class StereoSequence:
    """A rig's sequence: as many frames left (c0) as right (c1), in step; each pair rectified."""

    left: tuple[SequenceFrame, ...]
    right: tuple[SequenceFrame, ...]


SequenceKey = Literal["with", "without", "stereo_with", "stereo_without"]


def write_sequence(
    folder: Path,
    name: str,
    frames: Iterable[SequenceFrame],
    *,
    depth_range: float,
    classes: Mapping[str, RGB],
    camera: str = "CameraComponent",
    color: Literal["png", "jpeg"] = "png",
) -> None:
    raise NotImplementedError


def write_stereo_sequence(
    folder: Path,
    name: str,
    frames: StereoSequence,
    *,
    depth_range: float,
    classes: Mapping[str, RGB],
    color: Literal["png", "jpeg"] = "png",
) -> None:
    raise NotImplementedError


def write_scene(
    root: Path,
    scene: str,
    sequences: Mapping[SequenceKey, Iterable[SequenceFrame] | StereoSequence],
    *,
    depth_range: float,
    classes: Mapping[str, RGB],
    color: Literal["png", "jpeg"] = "png",
) -> None:
    raise NotImplementedError
