"""A mesh in; a document of glTF 2.0 and its binary chunk out: axes and triangle order are converted here."""

from __future__ import annotations

import numpy as np

from dlama.files.scenes.gltf import (
    GLTF2,
    Accessor,
    Asset,
    Attributes,
    Buffer,
    BufferView,
    Material,
    Node,
    PbrMetallicRoughness,
    Primitive,
    Scene,
)
from dlama.files.scenes.gltf import Mesh as GltfMesh
from dlama.geometry.mesh import Mesh

GLTF_FROM_OPENCV = np.array([1.0, -1.0, -1.0])
"""glTF: x right, y up, looking along -z. A half turn about x, so nothing is mirrored."""
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
UNSIGNED_SHORT, UNSIGNED_INT, FLOAT = 5123, 5125, 5126
SHORT_VERTICES = 65535
"""Most vertices that numbers of two bytes name: the last number is none (glTF 2.0 sec. 3.7.2.1)."""
POINTS, TRIANGLES = 0, 4


class Blob:
    """Collects arrays into one binary chunk; each becomes a view and an accessor of the document."""

    def __init__(self, document: GLTF2) -> None:
        self.document = document
        self.bytes = bytearray()

    def add(self, array: np.ndarray, kind: str, component: int, target: int) -> int:
        """The accessor's number. Rows of vertices are multiples of 4 bytes (glTF 2.0 sec. 3.6.2.4); so is where they begin."""
        rows = np.ascontiguousarray(array).reshape(len(array), -1)
        view = BufferView(buffer=0, byteOffset=len(self.bytes), byteLength=rows.nbytes, target=target)
        if target == ARRAY_BUFFER:
            view.byteStride = rows.strides[0]
        accessor = Accessor(
            bufferView=len(self.document.bufferViews),
            byteOffset=0,
            componentType=component,
            count=len(rows),
            type=kind,
        )
        if kind == "VEC3":  # positions must say where they end
            accessor.min, accessor.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        self.bytes += rows.data
        self.bytes += bytes(-rows.nbytes % 4)
        self.document.bufferViews.append(view)
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1

    def close(self) -> None:
        """The document says how long the chunk is now."""
        self.document.buffers = [Buffer(byteLength=len(self.bytes))]


def mesh_document(mesh: Mesh | None) -> tuple[GLTF2, Blob]:
    """The document of a mesh, and its binary chunk, to which primitives are to be added (then `Blob.close`); positions are
    relative to the middle of this one.

    No mesh, or one without vertices, gives an empty scene.
    """
    document = GLTF2(asset=Asset(generator="dlama"), scene=0, scenes=[Scene(nodes=[])])
    blob = Blob(document)
    if mesh is None or not len(mesh.vertices):
        return document, blob
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2 * GLTF_FROM_OPENCV
    document.extensionsUsed = ["KHR_materials_unlit"]
    document.meshes = [GltfMesh(primitives=[])]
    document.nodes = [Node(name="scene", mesh=0, translation=middle.tolist())]
    document.scenes[0].nodes = [0]
    return document, blob


def add_material(document: GLTF2) -> Material:
    """An unlit material, which the primitives that are added next have."""
    unlit: dict[str, dict[str, object]] = {"KHR_materials_unlit": {}}
    surface = PbrMetallicRoughness(baseColorFactor=[1, 1, 1, 1], metallicFactor=0, roughnessFactor=1)
    document.materials.append(
        Material(pbrMetallicRoughness=surface, doubleSided=True, extensions=unlit, alphaCutoff=None)
    )
    return document.materials[-1]


def add_primitive(document: GLTF2, blob: Blob, mesh: Mesh) -> Primitive:
    """A mesh, of the document's last material, added to the document's mesh."""
    vertices = mesh.vertices * GLTF_FROM_OPENCV - document.nodes[0].translation
    attributes = Attributes(
        POSITION=blob.add(vertices.astype("<f4"), "VEC3", FLOAT, ARRAY_BUFFER),
        _ORIGIN=blob.add(mesh.origin.astype("<f4"), "SCALAR", FLOAT, ARRAY_BUFFER),  # Blender 5.0 fails on bytes
        _CONFIDENCE=blob.add(mesh.confidence.astype("<f4"), "SCALAR", FLOAT, ARRAY_BUFFER),
    )
    primitive = Primitive(attributes=attributes, material=len(document.materials) - 1, mode=POINTS)
    if len(mesh.triangles):
        # ours run clockwise as seen, glTF's fronts counter-clockwise
        corners = mesh.triangles[:, ::-1].reshape(-1)
        kind, component = ("<u2", UNSIGNED_SHORT) if len(vertices) <= SHORT_VERTICES else ("<u4", UNSIGNED_INT)
        primitive.indices = blob.add(corners.astype(kind), "SCALAR", component, ELEMENT_ARRAY_BUFFER)
        primitive.mode = TRIANGLES
    document.meshes[0].primitives.append(primitive)
    return primitive
