"""A view and its scene in, one lossless NPZ file out, and back.

Keys (FIELD.md's interchange, extended): `rgb depth valid K world_from_cam origin confidence hole hole_type` of the view, where
something was filled `depth_error` (metres) and `color_error` (levels) that are expected,
and the same with the prefixes `layer0_ layer1_ ...` of the scene's frames and fills and `object0_ ...` of its removals; `frame`,
where a view comes from many frames; `numbers gains noise names` of the frames, the first layers.

Of layers and removals `rgb` is stored as differences of rows (uint8, modulo 256), and `depth` as differences of rows and columns
of the bits of its float32 numbers (modulo 2^32), their four bytes apart: uint8 4 x H x W. Both come back bit for bit, a quarter
to half as large. Files that hold them as they are can be read, too.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count, pairwise, takewhile
from pathlib import Path

import cv2
import numpy as np

from dlama.arguments import check_arguments
from dlama.errors import DlamaError, FileError, system_errors
from dlama.files.rasters.float_files import read_npy
from dlama.files.rasters.images import existing_file
from dlama.files.schema import SCHEMA, check_schema
from dlama.geometry.camera import Camera
from dlama.geometry.frames.stored import CACHE_BYTES, BoxedView, Layer, PixelCache, StoredView
from dlama.geometry.rgbd import Float32Array, UInt8Array, freeze
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike, new_file, printable_name
from dlama.writing.unchanged import stamp_of

OF_LAYER = re.compile(r"(layer|object)\d+_")
"""How the name of a layer's array begins."""
FRAMES = ("numbers", "gains", "noise", "names")
"""Of the scene's frames, its first layers."""
ERRORS = ("depth_error", "color_error")
"""Planes of `View.errors`, where there are any: metres, levels."""
HOW_WRITTEN = "a result has a scene.npz where it was asked for: --also scene, in Python also=['scene']"


def write_npz(path: PathLike, view: View, scene: Scene) -> None:
    """Write everything that is known, without loss; `numpy.load` opens it. Layer by layer. Raises OutputError."""
    with (
        new_file(path) as draft,
        # level 1: as small as 6 within a few percent on depth, and five times as fast
        zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for key, array in _all_arrays(view, scene):
            with archive.open(f"{key}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)


def _all_arrays(view: View, scene: Scene) -> Iterator[tuple[str, np.ndarray]]:
    yield from _arrays("", view).items()
    for name, layers in (("layer", scene.layers), ("object", scene.removals)):
        for number, layer in enumerate(layers):
            yield from _differences(_arrays(f"{name}{number}_", layer.load())).items()
            if isinstance(layer, BoxedView):
                yield f"{name}{number}_box", np.array([(side.start, side.stop) for side in layer.box])
    yield from {name: np.array(getattr(scene, name)) for name in FRAMES}.items()
    yield "schema", np.array(SCHEMA)


def _differences(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of a layer, colour and depth as they are stored."""
    (rgb,), (depth,) = ([name for name in arrays if name.endswith(f"_{plane}")] for plane in ("rgb", "depth"))
    return arrays | {rgb: np.diff(arrays[rgb], axis=0, prepend=np.uint8(0)), depth: depth_differences(arrays[depth])}


def depth_differences(depth: Float32Array) -> UInt8Array:
    """uint8 4 x H x W of float32 H x W; where depth is smooth most bytes are 0. Signs are folded into the lowest bit."""
    bits = np.ascontiguousarray(depth, "<f4").view("<u4")
    found = np.diff(np.diff(bits, axis=0, prepend=np.uint32(0)), axis=1, prepend=np.uint32(0))
    folded = (found << 1) ^ -(found >> 31)
    return np.ascontiguousarray(np.moveaxis(folded.astype("<u4")[..., None].view(np.uint8), -1, 0))


def depth_of_differences(stored: UInt8Array) -> Float32Array:
    """What `depth_differences` was given, bit for bit."""
    folded = cv2.merge(tuple(stored)).view("<u4")[..., 0]
    bits = (folded >> 1) ^ -(folded & np.uint32(1))
    np.cumsum(bits, axis=1, dtype=np.uint32, out=bits)
    return np.asarray(sum_rows(bits).view("<f4"), np.float32)


def sum_rows(differences: np.ndarray) -> np.ndarray:
    """Each row the sum of all up to it; read-only. `numpy.cumsum` along columns takes 70 times as long."""
    out = differences.copy()
    for above, row in pairwise(out):
        row += above
    return freeze(out)


def read_scene(path: PathLike) -> Scene:
    """The scene in a scene.npz, as `write` and `dlama sequence` make it. It renders; `complete` continues from it. FileError."""
    check_arguments(read_scene, locals())
    return read_npz(path)[1]


@system_errors(FileError)
def read_npz(path: PathLike, cache: PixelCache | None = None) -> tuple[View, Scene]:
    """What `write_npz` wrote. All of it is read and checked; layers that together exceed CACHE_BYTES, and all with a `cache`, are
    read again when they are needed, so that the file has to stay. Raises FileError.
    """
    if not Path(path).exists():
        raise FileError(f"{printable_name(path)}: no such file; {HOW_WRITTEN}")
    file = existing_file(path)
    stamp = stamp_of(file)
    try:
        with zipfile.ZipFile(file) as archive:
            total = _check_claims(archive, file)
            held = None if cache is None and total <= CACHE_BYTES else (cache or PixelCache())
            prefixes = [_prefixes(name, archive) for name in ("layer", "object")]
            layers, objects = (
                [_layer(archive, one, partial(read_layer, file, one, stamp), held) for one in each] for each in prefixes
            )
            whole = _arrays_of(archive, "")
            check_schema(whole.get("schema"))
            return _view("", whole), _scene(layers, objects, whole)
    except KeyError as error:
        raise FileError(f"{file}: has no array called {error}; a scene.npz of dlama is expected") from error
    except DlamaError as error:
        raise FileError(f"{file}: {error}") from error
    except MemoryError:
        raise
    except Exception as error:  # BadZipFile, zlib.error, EOFError, ValueError, ...
        raise FileError(f"{file}: is damaged, truncated or no NPZ file ({error})") from error


def _check_claims(archive: zipfile.ZipFile, file: Path) -> int:
    """Bytes of all arrays. FileError: far more than such a file holds, which a small file can claim."""
    total = sum(part.file_size for part in archive.infolist())
    if total > max(256_000_000, 300 * file.stat().st_size):  # scenes reach 100 times
        raise FileError(f"says it holds {total / 1e6:.0f} MB in {file.stat().st_size / 1e6:.1f} MB; that is no scene")
    return total


def _layer(archive: zipfile.ZipFile, prefix: str, read_again: Callable[[], View], cache: PixelCache | None) -> Layer:
    camera, view = _camera_and_view(prefix, _arrays_of(archive, prefix))
    layer = view if cache is None else StoredView(view.camera, read_again, cache, view)
    return layer if camera is None else BoxedView(camera, layer)


@system_errors(FileError)
def read_layer(file: Path, prefix: str, stamp: tuple[int, int] | None = None) -> View:
    """One layer of a scene.npz, whose arrays have names that begin like that: layer0_, object0_; of a boxed one its part. Raises
    FileError, also where the file has another `stamp_of` than the one that is given: its layers are others."""
    if stamp is not None and stamp != stamp_of(file):
        raise FileError(
            f"{file}: was written again after its scene was read, whose pixels are read when they are needed; "
            "read it again, and give results another place"
        )
    with zipfile.ZipFile(file) as archive:
        return _camera_and_view(prefix, _arrays_of(archive, prefix))[1]


def _camera_and_view(prefix: str, arrays: Mapping[str, np.ndarray]) -> tuple[Camera | None, View]:
    """A layer; of a boxed one the camera of the whole picture, and the part that is in its box."""
    view, box = _view(prefix, arrays), arrays.get(f"{prefix}box")
    if box is None:
        return None, view
    rows, columns = (slice(int(first), int(last)) for first, last in box)
    return view.camera, view.cropped(rows, columns)


def _arrays_of(archive: zipfile.ZipFile, prefix: str) -> dict[str, np.ndarray]:
    """The arrays of one layer by name; with prefix "" those that belong to none."""
    arrays = {}
    for part in archive.infolist():
        name = part.filename.removesuffix(".npy")
        if name.startswith(prefix) if prefix else not OF_LAYER.match(name):
            with archive.open(part) as stream:
                arrays[name] = read_npy(stream, part.file_size, name)
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
    if view.noise_step:
        fields["noise_step"] = np.array([view.noise_step])
    return {prefix + name: array for name, array in fields.items()}


def _scene(layers: Sequence[Layer], removals: Sequence[Layer], arrays: Mapping[str, np.ndarray]) -> Scene:
    """The scene of its layers, frames first; a file without numbers, as earlier versions wrote of one picture, has one. No name
    has a separator, as files of its frame will be called so."""
    numbers, gains, noise, names = (arrays.get(name, np.zeros(0)).tolist() for name in FRAMES)
    frames = len(numbers) or 1
    return Scene(
        tuple(layers[:frames]),
        tuple(removals),
        tuple(layers[frames:]),
        tuple(numbers),
        tuple((r, g, b) for r, g, b in gains),
        (noise[0], noise[1]) if noise else (0.0, 0.0),
        tuple(re.sub(r"[/\\]", "_", name) for name in names),
    )


def _view(prefix: str, arrays: Mapping[str, np.ndarray]) -> View:
    color, K = arrays[f"{prefix}rgb"], arrays[f"{prefix}K"]
    if (stored := arrays[f"{prefix}depth"]).dtype == np.uint8:
        color = sum_rows(color)
        arrays = {**arrays, f"{prefix}depth": depth_of_differences(stored)}
    camera = Camera.from_K(K, color.shape[1], color.shape[0], world_from_cam=arrays[f"{prefix}world_from_cam"])
    names = ("depth", "hole", "hole_type", "origin", "confidence")
    depth, hole, types, origin, confidence = (arrays[prefix + name] for name in names)
    planes = [arrays[prefix + name] for name in ERRORS if prefix + name in arrays]
    errors = np.stack(planes, -1) if len(planes) == len(ERRORS) else None
    frame, step = arrays.get(f"{prefix}frame"), arrays.get(f"{prefix}noise_step")
    noise_step = 0.0 if step is None else float(step[0])
    return View(camera, color, depth, hole, types, origin, confidence, frame, errors, noise_step)


def _prefixes(name: str, archive: zipfile.ZipFile) -> list[str]:
    """layer0_, layer1_, ... as far as they go."""
    there, prefixes = set(archive.namelist()), (f"{name}{number}_" for number in count())
    return list(takewhile(lambda prefix: f"{prefix}rgb.npy" in there, prefixes))
