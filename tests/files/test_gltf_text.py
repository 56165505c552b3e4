"""GLB files read literally as the text of glTF 2.0 says (chunks, accessors, texture coordinates, colour), by nobody's library.

Oracles: the specification's sections 3.6 (accessors), 3.8 (texture coordinates: (0, 0) is the upper left corner), 3.9
(base colour textures are sRGB) and 4.4 (chunks). Open3D and trimesh beside it, where they are installed.
"""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from box_frame import CAMERA, WORLD
from dlama.completion.verbs import remove
from dlama.files.scenes.textured_mesh import write_textured_glb
from dlama.geometry.cloud import Mesh, join_meshes
from dlama.geometry.layers.decimation import decimate

SCENE = remove(WORLD.rgbd(CAMERA), WORLD.trace(CAMERA)[1] == 1, yaw=15, filler="telea").scene
COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
VERTICES = 34962
"""Target of a buffer view that holds vertex attributes."""
LENGTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk of a GLB (sec. 4.4)."""
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    document = json.loads(data[20 : 20 + size])
    rest = data[20 + size :]
    if not rest:
        return document, b""
    size, kind = struct.unpack_from("<I4s", rest)
    assert kind == b"BIN\0" and size % 4 == 0 and len(rest) == 8 + size
    return document, rest[8:]


def values(document: dict[str, Any], blob: bytes, number: int) -> np.ndarray:
    """What an accessor says, normalised integers as 0..1 (sec. 3.6.2)."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(COMPONENTS[accessor["componentType"]]), LENGTHS[accessor["type"]]
    start, packed = view.get("byteOffset", 0) + accessor.get("byteOffset", 0), kind.itemsize * width
    stride = view.get("byteStride") or packed
    assert accessor["count"] * stride - (stride - packed) <= view["byteLength"] and start % kind.itemsize == 0
    if view.get("target") == VERTICES:
        assert stride % 4 == 0, "an element of a vertex attribute is aligned to 4 bytes (sec. 3.6.2.4)"
    found = np.ndarray((accessor["count"], width), kind, blob, start, (stride, kind.itemsize))
    return found / np.iinfo(kind).max if accessor.get("normalized") else found


def primitive(document: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any], np.ndarray]:
    """The one primitive, its material, and by how much its node moves it (nothing turns or scales it)."""
    (node,) = (document["nodes"][n] for n in document["scenes"][document["scene"]]["nodes"])
    assert not {"matrix", "rotation", "scale"} & set(node)
    (one,) = document["meshes"][node["mesh"]]["primitives"]
    return one, document["materials"][one["material"]], np.array(node.get("translation", (0, 0, 0)))


def on_axes(mesh: Mesh) -> np.ndarray:
    """Positions with glTF's axes: y up, z towards the viewer."""
    return np.asarray(mesh.vertices) * [1, -1, -1]


def test_the_texture_is_the_picture(tmp_path: Path) -> None:
    """Each vertex reads its own colour, as JPEG keeps it, in the middle of a texel; all else is the decimated mesh's."""
    write_textured_glb(tmp_path / "scene.glb", SCENE)
    document, blob = chunks(tmp_path / "scene.glb")
    mesh = join_meshes([decimate(layer).mesh for layer in SCENE.layers])
    one, material, moved = primitive(document)
    assert material["extensions"] == {"KHR_materials_unlit": {}} and "KHR_materials_unlit" in document["extensionsUsed"]
    texture = document["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    view = document["bufferViews"][document["images"][texture["source"]]["bufferView"]]
    jpeg = blob[view.get("byteOffset", 0) :][: view["byteLength"]]
    picture = np.asarray(Image.open(io.BytesIO(jpeg)).convert("RGB"))
    at = values(document, blob, one["attributes"]["TEXCOORD_0"]).astype(np.float64) * picture.shape[1::-1]
    assert np.abs(at % 1 - 0.5).max() < 0.01
    off = np.abs(picture[at[:, 1].astype(int), at[:, 0].astype(int)].astype(int) - mesh.color)
    assert off.mean() < 3 and off.max() <= 40
    assert "COLOR_0" not in one["attributes"]
    assert material["pbrMetallicRoughness"].get("baseColorFactor", [1, 1, 1, 1]) == [1, 1, 1, 1]
    np.testing.assert_allclose(values(document, blob, one["attributes"]["POSITION"]) + moved, on_axes(mesh), atol=1e-5)
    for name in ("_ORIGIN", "_CONFIDENCE"):  # Blender 5.0's importer takes single numbers as floats only
        assert document["accessors"][one["attributes"][name]]["componentType"] == 5126
    np.testing.assert_array_equal(values(document, blob, one["attributes"]["_ORIGIN"])[:, 0], mesh.origin)
    np.testing.assert_array_equal(values(document, blob, one["attributes"]["_CONFIDENCE"])[:, 0], mesh.confidence)
    indices = values(document, blob, one["indices"])[:, 0].reshape(-1, 3)
    np.testing.assert_array_equal(np.sort(indices, 1), np.sort(mesh.triangles, 1))
