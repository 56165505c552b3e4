"""The parts of a glTF 2.0 document that dlama writes, by its names, and a binary chunk in; a GLB file's bytes out.

What is None, and a list without members, is left out: the specification's default holds.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from typing import Any

HEAD, JSON, BINARY = 0x46546C67, 0x4E4F534A, 0x004E4942
"""`glTF`, and the kinds of chunks."""


@dataclass
class BufferView:
    """A part of the binary chunk."""

    buffer: int
    byteOffset: int
    byteLength: int
    byteStride: int | None = None
    target: int | None = None


@dataclass
class Accessor:
    """Numbers in a view of the buffer."""

    bufferView: int
    byteOffset: int
    componentType: int
    count: int
    type: str
    normalized: bool = False
    min: list[float] | None = None
    max: list[float] | None = None


@dataclass
class Attributes:
    """Accessors of a primitive's vertices."""

    POSITION: int
    _ORIGIN: int
    _CONFIDENCE: int
    TEXCOORD_0: int | None = None


@dataclass
class Primitive:
    """Triangles or points of one material."""

    attributes: Attributes
    material: int
    mode: int
    indices: int | None = None


@dataclass
class TextureInfo:
    """A texture, by number."""

    index: int


@dataclass
class PbrMetallicRoughness:
    """How a surface looks."""

    baseColorFactor: list[float]
    metallicFactor: float
    roughnessFactor: float
    baseColorTexture: TextureInfo | None = None


@dataclass
class Material:
    """A surface."""

    pbrMetallicRoughness: PbrMetallicRoughness
    doubleSided: bool
    extensions: dict[str, dict[str, object]]
    alphaMode: str | None = None
    alphaCutoff: float | None = None


@dataclass
class Mesh:
    """Primitives."""

    primitives: list[Primitive]


@dataclass
class Node:
    """A mesh, and where it stands."""

    name: str
    mesh: int
    translation: list[float]


@dataclass
class Scene:
    """Nodes, by number."""

    nodes: list[int]


@dataclass
class Image:
    """A picture file in a view of the buffer."""

    bufferView: int
    mimeType: str


@dataclass
class Sampler:
    """How a texture is read."""

    magFilter: int
    minFilter: int
    wrapS: int
    wrapT: int


@dataclass
class Texture:
    """A picture and its sampler, by number."""

    source: int
    sampler: int


@dataclass
class Asset:
    """What wrote the document, and its version of glTF."""

    generator: str
    version: str = "2.0"


@dataclass
class Buffer:
    """The binary chunk."""

    byteLength: int


@dataclass
class GLTF2:
    """The document."""

    asset: Asset
    scene: int
    scenes: list[Scene]
    accessors: list[Accessor] = field(default_factory=list)
    buffers: list[Buffer] = field(default_factory=list)
    bufferViews: list[BufferView] = field(default_factory=list)
    extensionsUsed: list[str] = field(default_factory=list)
    images: list[Image] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    meshes: list[Mesh] = field(default_factory=list)
    nodes: list[Node] = field(default_factory=list)
    samplers: list[Sampler] = field(default_factory=list)
    textures: list[Texture] = field(default_factory=list)

    def glb(self, binary: bytearray) -> list[bytes | bytearray]:
        """The file, in pieces; binary: the buffer's bytes, a multiple of 4, or none."""
        text = json.dumps(_stated(self), separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks: list[bytes | bytearray] = [struct.pack("<II", len(text), JSON), text]
        if binary:
            chunks += [struct.pack("<II", len(binary), BINARY), binary]
        return [struct.pack("<III", HEAD, 2, 12 + sum(map(len, chunks))), *chunks]


def _stated(part: Any) -> Any:
    """A part as JSON has it."""
    if isinstance(part, list):
        return [_stated(one) for one in part]
    if not hasattr(part, "__dict__"):
        return part
    return {name: _stated(value) for name, value in vars(part).items() if value is not None and value != []}
