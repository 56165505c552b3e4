"""A view and its scene in, one lossless NPZ file out, and back.

Keys (FIELD.md's interchange, extended): `rgb depth valid K world_from_cam origin confidence hole hole_type` of the view, where
something was filled `depth_error` (metres) and `color_error` (levels) that are expected,
and the same with the prefixes `layer0_ layer1_ ...` and `object0_ ...` of the scene's layers; `frame`, where a view comes from
many frames; `numbers gains noise` of a scene of many.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dlama.errors import DlamaError, FileError, system_errors
from dlama.files.atomic_write import PathLike, new_file
from dlama.files.rasters.float_files import read_npy
from dlama.files.rasters.images import existing
from dlama.geometry.camera import Camera
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

Gains = tuple[float, float, float]
ERRORS = ("depth_error", "color_error")
"""Planes of `View.errors`, where there are any: metres, levels."""
ZIP_LEVEL = 1
"""As small as 6 within a few percent on depth, and five times as fast."""


SMALL_SCENE, LARGEST_RATIO = 256_000_000, 100
"""Bytes that the arrays of a scene may hold in any case; beyond, so many times the bytes of the file (scenes reach 30)."""


def write_npz(path: PathLike, view: View, scene: Scene) -> None:
    """Write everything that is known, without loss; `numpy.load` opens it. Raises OutputError."""
    arrays = _arrays("", view)
    for name, layers in (("layer", scene.layers), ("object", scene.objects)):
        for number, layer in enumerate(layers):
            arrays |= _arrays(f"{name}{number}_", layer)
    if scene.numbers:
        arrays |= {"numbers": np.array(scene.numbers), "gains": np.array(scene.gains), "noise": np.array(scene.noise)}
    with (
        new_file(path) as draft,
        zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED, compresslevel=ZIP_LEVEL) as archive,
    ):
        for key, array in arrays.items():
            with archive.open(f"{key}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)


def read_scene(path: PathLike) -> Scene:
    """The scene in a scene.npz, as `write` and `dlama sequence` make it. It renders; `complete` goes on with it. FileError."""
    return read_npz(path)[1]


@system_errors(FileError)
def read_npz(path: PathLike) -> tuple[View, Scene]:
    """What `write_npz` wrote. Raises FileError."""
    file = existing(path)
    try:
        arrays = _loaded(file)
        layers, objects = (
            [_view(prefix, arrays) for prefix in _prefixes(name, arrays)] for name in ("layer", "object")
        )
        return _view("", arrays), Scene(tuple(layers), tuple(objects), *_frames(arrays))
    except KeyError as error:
        raise FileError(f"{file}: has no array called {error}; a scene.npz of dlama is wanted") from error
    except DlamaError as error:
        raise FileError(f"{file}: {error}") from error
    except Exception as error:  # BadZipFile, zlib.error, EOFError, ValueError, ...
        raise FileError(f"{file}: is damaged, truncated or no NPZ file ({error})") from error


def _loaded(file: Path) -> dict[str, np.ndarray]:
    """The arrays of an NPZ by name. FileError: far more bytes than such a file holds, which a small file can claim."""
    with zipfile.ZipFile(file) as archive:
        parts = archive.infolist()
        total = sum(part.file_size for part in parts)
        if total > max(SMALL_SCENE, LARGEST_RATIO * file.stat().st_size):
            raise FileError(
                f"says it holds {total / 1e6:.0f} MB in {file.stat().st_size / 1e6:.1f} MB; that is no scene"
            )
        arrays = {}
        for part in parts:
            with archive.open(part) as stream:
                arrays[part.filename.removesuffix(".npy")] = read_npy(stream, part.file_size)
        return arrays


def _arrays(prefix: str, view: View) -> dict[str, np.ndarray]:
    fields: dict[str, np.ndarray] = {
        "rgb": view.color,
        "depth": view.depth,
        "valid": view.valid,
        "K": view.camera.K,
        "world_from_cam": view.camera.world_from_cam,
        "origin": view.origin,
        "confidence": view.confidence,
        "hole": view.hole,
        "hole_type": view.hole_type,
    }
    if view.frame is not None:
        fields["frame"] = view.frame
    if view.errors is not None:
        fields |= {"depth_error": view.depth_error, "color_error": view.color_error}
    return {prefix + name: array for name, array in fields.items()}


def _frames(arrays: Mapping[str, np.ndarray]) -> tuple[tuple[int, ...], tuple[Gains, ...], tuple[float, float]]:
    """Numbers, gains and noise of a scene of many frames; of one picture empty."""
    if "numbers" not in arrays:
        return (), (), (0.0, 0.0)
    a, b = (float(one) for one in arrays["noise"])
    gains = tuple((float(r), float(g), float(b)) for r, g, b in arrays["gains"])
    return tuple(int(one) for one in arrays["numbers"]), gains, (a, b)


def _view(prefix: str, arrays: Mapping[str, np.ndarray]) -> View:
    color, K = arrays[f"{prefix}rgb"], arrays[f"{prefix}K"]
    camera = Camera.from_K(K, color.shape[1], color.shape[0], world_from_cam=arrays[f"{prefix}world_from_cam"])
    depth, hole, types, origin, confidence = (
        arrays[prefix + name] for name in ("depth", "hole", "hole_type", "origin", "confidence")
    )
    planes = [arrays[prefix + name] for name in ERRORS if prefix + name in arrays]
    errors = np.stack(planes, -1) if len(planes) == len(ERRORS) else None
    return View(camera, color, depth, hole, types, origin, confidence, arrays.get(f"{prefix}frame"), errors)


def _prefixes(name: str, arrays: Mapping[str, np.ndarray]) -> list[str]:
    """layer0_, layer1_, ... as far as they go."""
    found: list[str] = []
    while f"{name}{len(found)}_rgb" in arrays:
        found.append(f"{name}{len(found)}_")
    return found
