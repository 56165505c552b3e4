"""A folder with one camera's frames with and without objects (bin_removal) in; one ORI case out.

Files: `with.color`, `with.depth`, `without.color`, `without.depth`, `object_mask` (255 = remove), optional `compare_region`
(255 = the two takes show the same background) and `shadow_mask` (255 = the object's cast shadow), all PNG; `camera.json`
with `K, width, height, depth_scale` (metres per unit), optional `pixel_center` (default 0.0, as OpenCV calibrates) and
`exposure_varies`. The camera is the world: a published pose is not needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset, RemovalTruth
from dlama.datasets.posed_frames import FrameFiles, Lens, load_rgbd
from dlama.datasets.text_tables import chosen_scenes, read_json, sequences
from dlama.datasets.view_pairs import posed_frame
from dlama.errors import FileError, ShapeError
from dlama.files.pictures import read_mask
from dlama.geometry.rgbd import BoolArray

NEEDED = (
    "camera.json",
    "with.color.png",
    "with.depth.png",
    "without.color.png",
    "without.depth.png",
    "object_mask.png",
)


@dataclass(frozen=True, eq=False)
class RemovalFiles:
    """What `load_removal` reads."""

    source: FrameFiles
    without: FrameFiles
    mask: Path
    compare: Path | None
    shadow: Path | None
    exposure_varies: bool


def looks_like_removal(root: Path) -> bool:
    return (root / "with.color.png").is_file() and (root / "without.color.png").is_file()


def removal_folder(root: Path, *, scenes: list[str] | None = None) -> Dataset:
    """One case per folder; `root` is such a folder or holds several. Raises FileError, CameraError."""
    name = root.resolve().name
    folders = chosen_scenes(sequences(root, looks_like_removal, ", ".join(NEEDED)), scenes)
    frames, cases = [], []
    for scene, folder in folders.items():
        files = _files(folder)
        frames += [posed_frame(scene, each, getattr(files, field)).frame for each, field in _FRAMES.items()]
        cases.append(Case("ori", name, scene, "with", partial(load_removal, files)))
    return Dataset(name, "removal", root, tuple(frames), tuple(cases))


_FRAMES = {"with": "source", "without": "without"}


def _files(folder: Path) -> RemovalFiles:
    for name in NEEDED:
        if not (folder / name).is_file():
            raise FileError(f"{folder / name}: no such file; {', '.join(NEEDED)} are wanted")
    fields = read_json(folder / "camera.json")
    lens = Lens(str(folder / "camera.json"), fields.intrinsics("K"), fields.pixel_center(0.0), fields.size(None))
    scale = fields.number("depth_scale")
    if scale <= 0:
        raise FileError(f"{fields.path}: depth_scale is {scale:g}; metres per unit > 0 are wanted")
    varies = fields.values.get("exposure_varies", False)
    if not isinstance(varies, bool):
        raise FileError(f"{fields.path}: exposure_varies is {varies!r}; true or false is wanted")
    take, empty = (
        FrameFiles(folder / f"{each}.color.png", folder / f"{each}.depth.png", lens, np.eye(4), 1 / scale)
        for each in _FRAMES
    )
    compare, shadow = (
        folder / name if (folder / name).is_file() else None for name in ("compare_region.png", "shadow_mask.png")
    )
    return RemovalFiles(take, empty, folder / "object_mask.png", compare, shadow, varies)


def load_removal(files: RemovalFiles) -> RemovalTruth:
    """Read question and answer; raises FileError, MaskError, DepthError, ShapeError."""
    source, without = load_rgbd(files.source), load_rgbd(files.without)
    mask, compare, shadow = (_mask(path, source.camera.hw) for path in (files.mask, files.compare, files.shadow))
    assert mask is not None
    if shadow is not None:
        shadow = shadow & ~mask  # never part of the mask
    return RemovalTruth(source, without, mask, compare, shadow, files.exposure_varies)


def _mask(path: Path | None, hw: tuple[int, int]) -> BoolArray | None:
    if path is None:
        return None
    mask = read_mask(path)
    if mask.shape != hw:
        raise ShapeError(
            f"{path}: is {mask.shape[1]}x{mask.shape[0]} and the picture {hw[1]}x{hw[0]}; one size is wanted"
        )
    return mask
