"""A folder with one camera's frames with and without objects (bin_removal) in; one ORI case out.

Files: `with.color`, `with.depth`, `without.color`, `without.depth`, `object_mask` (255 = remove), optional `compare_region`
(255 = both pictures show the same background) and `shadow_mask` (255 = the object's cast shadow), all PNG; `camera.json`
with `K, width, height, depth_scale` (metres per unit), optional `pixel_center` (default 0.0, as OpenCV calibrates) and
`exposure_varies`. The camera is the world: a published pose is not needed.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from dlama.datasets.frames import Case, Dataset, RemovalTruth
from dlama.datasets.posed.lenses import json_lens, units_per_metre
from dlama.datasets.posed.posed_frames import FrameFiles, files_of, load_rgbd, posed_frame
from dlama.datasets.text_tables import holds, scene_folders
from dlama.errors import FileError, check_same_size
from dlama.files.fields import read_json_fields
from dlama.files.rasters.masks import read_mask, read_region

NEEDED = (
    "camera.json",
    "with.color.png",
    "with.depth.png",
    "without.color.png",
    "without.depth.png",
    "object_mask.png",
)


looks_like_removal = holds("with.color.png", "without.color.png")


def removal_folder(root: Path) -> Dataset:
    """One case per folder; `root` is such a folder or holds several. Raises FileError, CameraError."""
    name = root.resolve().name
    folders = scene_folders(root, looks_like_removal, ", ".join(NEEDED))
    frames, cases = [], []
    for scene, folder in folders.items():
        files = _files(folder)
        frames += [posed_frame(scene, which, one) for which, one in zip(("with", "without"), files[:2])]
        cases.append(Case("ori", name, scene, "with", partial(load_removal, *files)))
    return Dataset(name, "removal", root, tuple(frames), tuple(cases))


def _files(folder: Path) -> tuple[FrameFiles, FrameFiles, Path, Path | None, Path | None, bool]:
    """The arguments of `load_removal`."""
    for name in NEEDED:
        if not (folder / name).is_file():
            raise FileError(f"{folder / name}: no such file; {', '.join(NEEDED)} are expected")
    fields = read_json_fields(folder / "camera.json")
    lens, units = json_lens(fields), units_per_metre(fields, "depth_scale")
    varies = fields.values.get("exposure_varies", False)
    if not isinstance(varies, bool):
        raise FileError(f"{fields.path}: exposure_varies is {varies!r}; true or false is expected")
    source, without = (
        files_of(folder / f"{each}.color.png", folder / f"{each}.depth.png", lens, np.eye(4), units)
        for each in ("with", "without")
    )
    regions = folder / "compare_region.png", folder / "shadow_mask.png"
    compare, shadow = (path if path.is_file() else None for path in regions)
    return source, without, folder / "object_mask.png", compare, shadow, varies


def load_removal(
    source: FrameFiles,
    without: FrameFiles,
    mask: Path,
    compare: Path | None,
    shadow: Path | None,
    exposure_varies: bool,
) -> RemovalTruth:
    """Read the frame with the object, the one without it and the masks; raises FileError, MaskError, DepthError, ShapeError."""
    frame, truth, removed = load_rgbd(source), load_rgbd(without), read_mask(mask)
    region, cast = (None if path is None else read_region(path) for path in (compare, shadow))
    for path, found in ((mask, removed), (compare, region), (shadow, cast)):
        if path is not None and found is not None:
            check_same_size(f"{path}:", found.shape, "the picture", frame.camera.hw)
    if cast is not None:
        cast = cast & ~removed  # never part of the mask
    return RemovalTruth(frame, truth, removed, region, cast, exposure_varies)
