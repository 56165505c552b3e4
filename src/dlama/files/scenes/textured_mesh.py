"""A scene in; its surfaces as one textured GLB file out (binary glTF 2.0), which every viewer shows in the pictures' own colours.

Colours of vertices are read in different ways: three.js and Blender take COLOR_0 as linear light, as glTF says; Open3D shows the
numbers as they are, which is too dark; trimesh drops them beside a material. A base colour texture is sRGB to all of them.
"""

from __future__ import annotations

import io

import numpy as np
from PIL import Image as Pillow
from pygltflib import BufferView, Image, Sampler, Texture, TextureInfo

from dlama.files.atomic_write import PathLike, new_file
from dlama.files.rasters.pictures import PNG_LEVEL
from dlama.files.scenes.meshes import ARRAY_BUFFER, FLOAT, mesh_document
from dlama.geometry.camera import Float64Array
from dlama.geometry.fusion import mesh_pixels, scene_mesh
from dlama.geometry.holes import with_nearest
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View

LINEAR, CLAMP_TO_EDGE = 9729, 33071
TALLEST = 8192
"""Pixels of a texture's height before its parts go on in a further column (GPUs take 16384)."""


def write_textured_glb(path: PathLike, scene: Scene, objects: bool = False) -> None:
    """Write one unlit, double-sided mesh: POSITION, TEXCOORD_0, _ORIGIN, _CONFIDENCE, and the layers' pictures as its texture.

    objects: with the removed objects. Far pixels (sky) have no vertices, here as in `scene_mesh`; scene.npz has them. Without
    any vertex an empty scene is written. Raises OutputError.
    """
    layers = (*scene.layers, *scene.removals) if objects else scene.layers
    document, blob = mesh_document(scene_mesh(scene, objects), colors=False)
    if document.meshes:
        texture, pixels = atlas(layers)
        uv = pixels / (texture.shape[1], texture.shape[0])  # glTF's v runs down, too
        attributes = document.meshes[0].primitives[0].attributes
        attributes.TEXCOORD_0 = blob.add(uv.astype("<f4"), "VEC2", FLOAT, ARRAY_BUFFER)
        stream = io.BytesIO()
        Pillow.fromarray(texture).save(stream, "PNG", compress_level=PNG_LEVEL)
        png = stream.getvalue()
        document.bufferViews.append(BufferView(buffer=0, byteOffset=len(blob.bytes), byteLength=len(png)))
        blob.bytes += png + bytes(-len(png) % 4)
        document.images = [Image(bufferView=len(document.bufferViews) - 1, mimeType="image/png")]
        document.samplers = [Sampler(magFilter=LINEAR, minFilter=LINEAR, wrapS=CLAMP_TO_EDGE, wrapT=CLAMP_TO_EDGE)]
        document.textures = [Texture(source=0, sampler=0)]
        document.materials[0].pbrMetallicRoughness.baseColorTexture = TextureInfo(index=0)
        blob.close()
    with new_file(path) as draft:
        draft.write_bytes(b"".join(document.save_to_bytes()))


def atlas(layers: tuple[View, ...]) -> tuple[UInt8Array, Float64Array]:
    """One picture that holds what is seen of every layer, and where in it (x, y in px, N x 2) each vertex of their mesh lies.

    A vertex lies at the centre of its own pixel; between vertices the texture is read linearly, as colours of vertices would be.
    Pixels without a vertex take the nearest one's colour, so that nothing bleeds in at edges.
    """
    parts, places, spots = [], [], []
    left = top = width = 0
    for layer in layers:
        chosen = mesh_pixels(layer)
        if not chosen.any():
            continue
        rows, columns = np.nonzero(chosen)
        first, last = (rows.min(), columns.min()), (rows.max() + 1, columns.max() + 1)
        box = slice(first[0], last[0]), slice(first[1], last[1])
        part = with_nearest(layer.color[box], chosen[box])
        if top and top + part.shape[0] > TALLEST:
            left, top, width = left + width, 0, 0
        parts.append(part)
        places.append((top, left))
        spots.append(np.stack([columns - first[1] + left + 0.5, rows - first[0] + top + 0.5], 1))
        top, width = top + part.shape[0], max(width, part.shape[1])
    size = [max(place[axis] + part.shape[axis] for place, part in zip(places, parts)) for axis in (0, 1)]
    texture = np.zeros((*size, 3), np.uint8)
    for (row, column), part in zip(places, parts):
        texture[row : row + part.shape[0], column : column + part.shape[1]] = part
    return texture, np.concatenate(spots)
