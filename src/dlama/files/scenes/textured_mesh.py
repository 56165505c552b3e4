"""A scene in; its surfaces as one textured GLB file out (binary glTF 2.0), which every viewer shows in the pictures' own colours.

Colours of vertices are read in different ways: three.js and Blender take COLOR_0 as linear light, as glTF says; Open3D shows the
numbers as they are, which is too dark; trimesh drops them if there is a material. A base colour texture is sRGB to all of them.
"""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from PIL import Image as Pillow
from pygltflib import BufferView, Image, Sampler, Texture, TextureInfo

from dlama.files.atomic_write import PathLike, new_file
from dlama.files.scenes.meshes import ARRAY_BUFFER, FLOAT, mesh_document
from dlama.geometry.camera import Float64Array
from dlama.geometry.decimation import bounding_box, decimate
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.mesh import join_meshes
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

LINEAR, CLAMP_TO_EDGE = 9729, 33071
TALLEST = 8192
"""Pixels of a texture's height before its parts continue in a further column (GPUs take 16384)."""
JPEG = {"quality": 90, "subsampling": 0}


def write_textured_glb(path: PathLike, scene: Scene, objects: bool = False) -> None:
    """Write one unlit, double-sided mesh: POSITION, TEXCOORD_0, _ORIGIN, _CONFIDENCE, and the layers' pictures as its texture.

    The loss: flat parts are large triangles (depth within 1 mm or 0.1 %, estimated depth 0.5 %, the picture within half a pixel;
    see `decimate`), and the texture is a JPEG of quality 90. scene.npz has everything without loss, and the far pixels (sky),
    which have no triangles.

    objects: with the removed objects. Without any surface an empty scene is written. Raises OutputError.
    """
    layers = (*scene.layers, *scene.removals) if objects else scene.layers
    parts = [decimate(layer) for layer in layers]
    document, blob = mesh_document(join_meshes([part.mesh for part in parts]), colors=False)
    if document.meshes:
        texture, places = atlas(layers, [part.surface for part in parts])
        pixels = np.concatenate([part.pixels + place for part, place in zip(parts, places)])
        uv = pixels / (texture.shape[1], texture.shape[0])  # glTF's v runs down, too
        attributes = document.meshes[0].primitives[0].attributes
        attributes.TEXCOORD_0 = blob.add(uv.astype("<f4"), "VEC2", FLOAT, ARRAY_BUFFER)
        stream = io.BytesIO()
        Pillow.fromarray(texture).save(stream, "JPEG", **JPEG)
        jpeg = stream.getvalue()
        document.bufferViews.append(BufferView(buffer=0, byteOffset=len(blob.bytes), byteLength=len(jpeg)))
        blob.bytes += jpeg + bytes(-len(jpeg) % 4)
        document.images = [Image(bufferView=len(document.bufferViews) - 1, mimeType="image/jpeg")]
        document.samplers = [Sampler(magFilter=LINEAR, minFilter=LINEAR, wrapS=CLAMP_TO_EDGE, wrapT=CLAMP_TO_EDGE)]
        document.textures = [Texture(source=0, sampler=0)]
        document.materials[0].pbrMetallicRoughness.baseColorTexture = TextureInfo(index=0)
        blob.close()
    with new_file(path) as draft, draft.open("wb") as file:
        file.writelines(document.save_to_bytes())


def atlas(layers: Sequence[View], surfaces: Sequence[BoolArray]) -> tuple[UInt8Array, list[Float64Array]]:
    """One picture that holds what is seen of every layer, and for each layer what takes its own x, y to the picture's (px).

    surfaces: H x W of each layer, which pixels are seen. The others take the nearest one's colour: nothing bleeds in at edges.
    """
    parts, places, shifts = [], [], []
    left = top = width = 0
    for layer, chosen in zip(layers, surfaces):
        box = bounding_box(chosen)
        part = fill_with_nearest(layer.color[box], chosen[box]) if chosen.any() else layer.color[box]
        if top and top + part.shape[0] > TALLEST:
            left, top, width = left + width, 0, 0
        parts.append(part)
        places.append((top, left))
        shifts.append(np.array([left - box[1].start, top - box[0].start], np.float64))
        top, width = top + part.shape[0], max(width, part.shape[1])
    size = [max(place[axis] + part.shape[axis] for place, part in zip(places, parts)) for axis in (0, 1)]
    texture = np.zeros((*size, 3), np.uint8)
    for (row, column), part in zip(places, parts):
        texture[row : row + part.shape[0], column : column + part.shape[1]] = part
    return texture, shifts
