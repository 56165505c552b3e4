"""A scene in; its surfaces as one textured GLB file out (binary glTF 2.0), which every viewer shows in the pictures' own colours.

Colours of vertices are read in different ways: three.js and Blender take COLOR_0 as linear light, as glTF says; Open3D shows the
numbers as they are, which is too dark; trimesh drops them if there is a material. A base colour texture is sRGB to all of them.
"""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Sequence

import numpy as np
from PIL import Image as Pillow

from dlama.files.atomic_write import PathLike, new_file
from dlama.files.scenes.gltf import GLTF2, BufferView, Image, Sampler, Texture, TextureInfo
from dlama.files.scenes.meshes import ARRAY_BUFFER, FLOAT, Blob, add_primitive, mesh_document
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.holes import fill_with_nearest
from dlama.geometry.layers.decimation import bounding_box, decimate
from dlama.geometry.layers.layered_mesh import MeshPart
from dlama.geometry.mesh import join_meshes
from dlama.geometry.rgbd import UInt8Array
from dlama.geometry.scene import Scene

LINEAR, CLAMP_TO_EDGE = 9729, 33071
JPEG_QUALITY = 90


def write_textured_glb(path: PathLike, scene: Scene, objects: bool = False) -> None:
    """Write one unlit, double-sided mesh: POSITION, TEXCOORD_0, _ORIGIN, _CONFIDENCE, and the layers' pictures as its texture.

    The loss: flat parts are large triangles (depth within 1 mm or 0.1 %, estimated depth 0.5 %, the picture within half a pixel;
    see `decimate`), and the texture is a JPEG of quality 90. scene.npz has everything without loss, and the far pixels (sky),
    which have no triangles.

    objects: with the removed objects. Without any surface an empty scene is written. Raises OutputError.
    """
    layers = (*scene.layers, *scene.removals) if objects else scene.layers
    found = [(decimate(layer), layer.read()) for layer in layers]
    parts = [MeshPart(part.mesh, part.pixels, layer.color, part.surface) for part, layer in found]
    with new_file(path) as draft, draft.open("wb") as file:
        file.writelines(textured_glb(parts))


def textured_glb(parts: Sequence[MeshPart], quality: int = JPEG_QUALITY) -> list[bytes]:
    """A GLB file, in pieces, of meshes with their pictures: one mesh with one texture, a JPEG of that quality (0..100), and one
    more for each part whose picture has alpha, a PNG."""
    packed = pack_parts(parts)
    document, blob = mesh_document(packed[0].mesh if packed else None)
    if not packed:
        return document.glb(blob.bytes)
    document.samplers = [Sampler(magFilter=LINEAR, minFilter=LINEAR, wrapS=CLAMP_TO_EDGE, wrapT=CLAMP_TO_EDGE)]
    options = {"quality": quality, "subsampling": 0 if quality >= JPEG_QUALITY else 2}
    for number, part in enumerate(packed):
        if number:
            add_primitive(document, blob, part.mesh)
        if part.soft:
            document.materials[-1].alphaMode = "BLEND"
            add_texture(document, blob, part.picture, part.pixels, "PNG")
        else:
            add_texture(document, blob, part.picture, part.pixels, "JPEG", **options)
    blob.close()
    return document.glb(blob.bytes)


def pack_parts(parts: Sequence[MeshPart]) -> list[MeshPart]:
    """The parts as files have them, none empty: all opaque ones as one, with one picture; then each soft one."""
    opaque = [part for part in parts if not part.soft and len(part.mesh.vertices)]
    soft = [part for part in parts if part.soft and len(part.mesh.triangles)]
    if not opaque:
        return soft
    texture, places = pack_textures(opaque)
    pixels = np.concatenate([part.pixels + place for part, place in zip(opaque, places)])
    return [MeshPart(join_meshes([part.mesh for part in opaque]), pixels, texture, None), *soft]


def bring_near(parts: Sequence[MeshPart], camera: Camera, metres: float) -> list[MeshPart]:
    """The parts with what is farther away than so many metres drawn in along the rays of a camera, in order, to at most half as
    far again: viewers that choose their own place look at the whole, of which a far sky would be most."""
    home, found = camera.world_from_cam[:3, 3], []
    for part in parts:
        rays = part.mesh.vertices - home
        share = metres / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), metres)
        vertices = home + rays * np.where(share < 1, share * (1.5 - 0.5 * share), 1)
        found.append(part._replace(mesh=dataclasses.replace(part.mesh, vertices=vertices)))
    return found


def add_texture(
    document: GLTF2, blob: Blob, picture: UInt8Array, pixels: Float64Array, kind: str, **options: int
) -> None:
    """A picture in a file of that kind becomes the texture of the document's last primitive; pixels: N x 2, x and y in it."""
    uv = pixels / (picture.shape[1], picture.shape[0])  # glTF's v runs down, too
    attributes = document.meshes[0].primitives[-1].attributes
    attributes.TEXCOORD_0 = blob.add(uv.astype("<f4"), "VEC2", FLOAT, ARRAY_BUFFER)
    stream = io.BytesIO()
    Pillow.fromarray(picture).save(stream, kind, **options)
    file = stream.getvalue()
    document.bufferViews.append(BufferView(buffer=0, byteOffset=len(blob.bytes), byteLength=len(file)))
    blob.bytes += file + bytes(-len(file) % 4)
    document.images.append(Image(bufferView=len(document.bufferViews) - 1, mimeType=f"image/{kind.lower()}"))
    document.textures.append(Texture(source=len(document.images) - 1, sampler=0))
    document.materials[-1].pbrMetallicRoughness.baseColorTexture = TextureInfo(index=len(document.textures) - 1)


def pack_textures(parts: Sequence[MeshPart]) -> tuple[UInt8Array, list[Float64Array]]:
    """One picture that holds what is seen of every part, in rows from the top; and for each part what takes x, y of its own
    picture to that one's (px). Pixels that are not seen take the nearest one's colour: nothing bleeds in at edges.
    """
    cut: list[UInt8Array] = []
    corners: list[tuple[int, int]] = []
    for part in parts:
        if part.shown is None:
            cut.append(part.picture)
            corners.append((0, 0))
            continue
        box = bounding_box(part.shown)
        picture = part.picture[box]
        cut.append(fill_with_nearest(picture, part.shown[box]) if part.shown.any() else picture)
        corners.append((box[0].start, box[1].start))
    width = max(max(picture.shape[1] for picture in cut), math.ceil(math.sqrt(sum(one[..., 0].size for one in cut))))
    places, left, top, height = [], 0, 0, 0
    for picture in cut:
        if left and left + picture.shape[1] > width:
            left, top, height = 0, top + height, 0
        places.append((top, left))
        left, height = left + picture.shape[1], max(height, picture.shape[0])
    texture = np.zeros((top + height, max(x + one.shape[1] for (_, x), one in zip(places, cut)), 3), np.uint8)
    for (row, column), picture in zip(places, cut):
        texture[row : row + picture.shape[0], column : column + picture.shape[1]] = picture
    return texture, [np.array([x - left, y - top], np.float64) for (y, x), (top, left) in zip(places, corners)]
