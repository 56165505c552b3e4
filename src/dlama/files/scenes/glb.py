"""Meshes and their pictures in; the bytes of a GLB file (binary glTF 2.0) out: axes and triangle order are converted here."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
from PIL import Image

from dlama.geometry.camera import Float64Array
from dlama.geometry.cloud import Mesh
from dlama.geometry.rgbd import UInt8Array

GLTF_FROM_OPENCV = np.array([1.0, -1.0, -1.0])
"""glTF: x right, y up, looking along -z. A half turn about x, so nothing is mirrored."""
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
COMPONENTS = {"<u2": 5123, "<u4": 5125, "<f4": 5126}
SHORT_VERTICES = 65535
"""Most vertices that numbers of two bytes name: the last number is none (glTF 2.0 sec. 3.7.2.1)."""
LINEAR, CLAMP_TO_EDGE = 9729, 33071
PARTS = ("accessors", "buffers", "bufferViews", "extensionsUsed", "images", "materials", "meshes", "nodes", "samplers")
"""Lists of a document; one without members is left out."""


def middle_of(mesh: Mesh) -> Float64Array:
    """3, metres, of a mesh's box: positions are stored relative to it, so that float32 keeps their precision."""
    return np.asarray((mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2, np.float64)


class Glb:
    """A document, by the names of glTF 2.0, and its binary chunk: one node with one mesh, to which primitives are added."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {"asset": {"generator": "dlama", "version": "2.0"}, "scene": 0}
        self.document |= {"scenes": [{}], **{name: [] for name in (*PARTS, "textures")}}
        self.bytes = bytearray()

    def pieces(self) -> list[bytes | bytearray]:
        """The file."""
        self.document["buffers"] = [{"byteLength": len(self.bytes)}] if self.bytes else []
        stated = {name: value for name, value in self.document.items() if value != []}
        text = json.dumps(stated, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks: list[bytes | bytearray] = [struct.pack("<I4s", len(text), b"JSON"), text]
        if self.bytes:
            chunks += [struct.pack("<I4s", len(self.bytes), b"BIN\0"), self.bytes]
        return [struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))), *chunks]

    def add_material(self, picture: UInt8Array, kind: str, **options: int) -> None:
        """An unlit material, which the meshes that are added next have; its texture is a picture in a file of that kind."""
        parts = self.document
        parts["extensionsUsed"] = ["KHR_materials_unlit"]
        parts["samplers"] = [{"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE}]
        stream = io.BytesIO()
        Image.fromarray(picture).save(stream, kind, **options)
        parts["images"].append({"bufferView": self._add_view(stream.getbuffer()), "mimeType": f"image/{kind.lower()}"})
        parts["textures"].append({"source": len(parts["images"]) - 1, "sampler": 0})
        surface = {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 1}
        surface["baseColorTexture"] = {"index": len(parts["textures"]) - 1}
        material = {"pbrMetallicRoughness": surface, "doubleSided": True, "extensions": {"KHR_materials_unlit": {}}}
        parts["materials"].append(material | ({"alphaMode": "BLEND"} if picture.shape[2] == 4 else {}))

    def add_mesh(self, mesh: Mesh, uv: Float64Array) -> None:
        """A mesh of the last material; uv: N x 2, 0..1 in its picture."""
        parts = self.document
        vertices = mesh.vertices * GLTF_FROM_OPENCV - parts["nodes"][0]["translation"]
        corners = mesh.triangles.reshape(-1).astype("<u2" if len(vertices) <= SHORT_VERTICES else "<u4")
        attributes = {
            "POSITION": self._add_array(vertices.astype("<f4"), "VEC3"),
            "_ORIGIN": self._add_array(mesh.origin.astype("<f4"), "SCALAR"),  # Blender 5.0 fails on bytes
            "_CONFIDENCE": self._add_array(mesh.confidence.astype("<f4"), "SCALAR"),
            "TEXCOORD_0": self._add_array(uv.astype("<f4"), "VEC2"),
        }
        indices = self._add_array(corners, "SCALAR", ELEMENT_ARRAY_BUFFER)
        primitive = {"attributes": attributes, "indices": indices, "material": len(parts["materials"]) - 1}
        parts["meshes"][0]["primitives"].append(primitive)

    def place(self, mesh: Mesh) -> None:
        """The node and its mesh, without primitives; it stands in the middle of `mesh`."""
        middle = middle_of(mesh) * GLTF_FROM_OPENCV
        self.document["meshes"] = [{"primitives": []}]
        self.document["nodes"] = [{"name": "scene", "mesh": 0, "translation": middle.tolist()}]
        self.document["scenes"][0]["nodes"] = [0]

    def _add_array(self, array: np.ndarray, kind: str, target: int = ARRAY_BUFFER) -> int:
        """The accessor's number. Rows of vertices are multiples of 4 bytes (glTF 2.0 sec. 3.6.2.4); so is where they begin."""
        array = np.ascontiguousarray(array)
        stride = {"byteStride": array.strides[0]} if target == ARRAY_BUFFER else {}
        accessor = {
            "bufferView": self._add_view(array.reshape(-1).view(np.uint8).data, **stride, target=target),
            "byteOffset": 0,
            "componentType": COMPONENTS[array.dtype.str],
            "count": len(array),
            "type": kind,
        }
        if kind == "VEC3":  # positions must say where they end
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.document["accessors"].append(accessor)
        return len(self.document["accessors"]) - 1

    def _add_view(self, data: memoryview, **more: int) -> int:
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data), **more}
        self.document["bufferViews"].append(view)
        self.bytes += data
        self.bytes += bytes(-len(data) % 4)
        return len(self.document["bufferViews"]) - 1
