"""A completion and what it was made of in; its meta.json out."""

from __future__ import annotations

import json
import platform
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from dlama import __version__
from dlama.completion.completion import Completion
from dlama.errors import InputTypeError
from dlama.files.cameras import camera_as_json
from dlama.files.rasters.images import has_16_bits
from dlama.files.schema import SCHEMA
from dlama.geometry.camera import Camera
from dlama.geometry.codes import HoleType, Origin
from dlama.geometry.figures.false_color import HOLE_PALETTE, ORIGIN_PALETTE
from dlama.models.verify import sha256_of
from dlama.writing.atomic_write import PathLike, write_file


def describe_completion(completion: Completion, intrinsics_from: str) -> dict[str, Any]:
    """The head of meta.json: where the views stand, what their codes mean, which versions made them."""
    return {
        **describe_source(completion.source.camera, intrinsics_from),
        "cameras": [camera_as_json(view.camera) for view in completion.views],
        **completion.meta,
        "legends": legends(),
        "versions": versions(),
    }


def describe_source(camera: Camera, intrinsics_from: str) -> dict[str, Any]:
    """The first entries of every meta.json: the version, the format's, and the source camera."""
    return {
        "dlama": __version__,
        "schema": SCHEMA,
        "source_camera": {**camera_as_json(camera), "intrinsics_from": intrinsics_from},
    }


def legends() -> dict[str, dict[str, Any]]:
    """What the codes of the code pictures mean and how they are coloured."""
    return {
        "hole_type.png": {str(int(code)): [code.name.lower(), list(HOLE_PALETTE[code])] for code in HoleType},
        "origin.png": {str(int(code)): [code.name.lower(), list(ORIGIN_PALETTE[code])] for code in Origin},
        "hole.png": {"0": "known", "255": "unknown before filling, after dilation: every pixel that was written"},
        "depth.png": {"0": "missing", "1..65534": "millimetres", "65535": "far (sky)"},
        "scene.glb": {"colour": "texture, sRGB, unlit", "far": "sky has no triangles; scene.npz has it"},
        "depth.exr": {"0": "missing", "inf": "far (sky)", "else": "metres"},
    }


def versions() -> dict[str, str]:
    """Versions of what computes the result; a package that is not installed is left out."""
    names = ("numpy", "numba", "opencv-python-headless", "opencv-python", "pillow", "OpenEXR")
    packages = {name.split("-python")[0]: number for name, number in package_versions(names).items()}
    return {"dlama": __version__, "python": platform.python_version(), **packages}


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Name -> version of those packages that are installed."""
    found = {}
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def hash_inputs(
    inputs: Mapping[str, PathLike], addresses: Mapping[str, str] | None = None
) -> dict[str, dict[str, Any]]:
    """Role -> path (or its address) and SHA-256 of each input file; `bits` of a picture with 16 a channel. Raises FileError."""
    found: dict[str, dict[str, Any]] = {}
    for role, path in inputs.items():
        found[role] = {"path": (addresses or {}).get(role, str(path)), "sha256": sha256_of(Path(path))}
        if role in ("image", "left", "right") and has_16_bits(path):
            found[role]["bits"] = 16
    return found


def as_json(meta: Mapping[str, Any]) -> str:
    """Indented JSON with rows of numbers on one line each."""
    text = json.dumps(to_json_types(dict(meta)), indent=2, allow_nan=False, default=refuse_value)
    rows = re.compile(r"\[\n\s+([^\[\]{}]*?)\n\s+\]")
    return rows.sub(lambda row: "[" + re.sub(r"\s*\n\s*", " ", row[1]) + "]", text) + "\n"


def refuse_value(value: object) -> None:
    """Raise InputTypeError for a value that JSON does not have."""
    raise InputTypeError(
        f"meta data hold {value!r}, of type {type(value).__name__}; numbers, strings, lists and dicts are expected, in the notes "
        "of a filler or an estimator, too"
    )


def to_json_types(value: Any) -> Any:
    """NumPy numbers and arrays, and not-a-numbers, as JSON can hold them."""
    if isinstance(value, dict):
        return {str(key): to_json_types(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_types(one) for one in value]
    if isinstance(value, np.ndarray):
        return to_json_types(value.tolist())
    if isinstance(value, np.generic):
        return to_json_types(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write a JSON file (`as_json`). Raises OutputError."""
    write_file(path, as_json(values))


def write_meta(folder: Path, meta: Mapping[str, Any], before: Mapping[str, float], writing: float) -> None:
    """Write meta.json; its seconds by stage, after those of stages `before`, and those that `writing` took. OutputError."""
    seconds = {**before, **meta["seconds"], "write": writing}
    rounded = {stage: round(value, 4) for stage, value in seconds.items()}
    write_json(folder / "meta.json", {**meta, "seconds": rounded})
