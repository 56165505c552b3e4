"""A scene in; its surfaces as one textured GLB file out (binary glTF 2.0), which every viewer shows in the pictures' own colours.

Colours of vertices are read in different ways: three.js and Blender take COLOR_0 as linear light, as glTF says; Open3D shows the
numbers as they are, which is too dark; trimesh drops them if there is a material. A base colour texture is sRGB to all of them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from dlama.files.scenes.glb import SHORT_VERTICES, Glb
from dlama.geometry.camera import Camera, Float64Array
from dlama.geometry.cloud import Mesh, join_meshes
from dlama.geometry.holes import Box, box_around, fill_with_nearest, sides_of
from dlama.geometry.layers.decimation import decimate
from dlama.geometry.layers.layered_mesh import MeshPart
from dlama.geometry.rgbd import BoolArray, UInt8Array
from dlama.geometry.scene import Scene
from dlama.geometry.view import View
from dlama.writing.atomic_write import PathLike, new_file

JPEG_QUALITY = 90
ROWS, NEAR_ROWS = 512, 64
"""Rows of a texture whose unseen pixels are filled at a time, and rows on either side that they may take colours from."""


def write_textured_glb(path: PathLike, scene: Scene) -> None:
    """Write one unlit, double-sided mesh: POSITION, TEXCOORD_0, _ORIGIN, _CONFIDENCE, and the layers' pictures as its texture.

    The loss: flat parts are large triangles (depth within 1 mm, 0.1 % or its noise, estimated depth 0.5 %, the picture within
    half a pixel; see `decimate`), and the texture is a JPEG of quality 90. scene.npz has everything without loss, and the far
    pixels (sky), which have no triangles.

    Without any surface an empty scene is written. Raises OutputError.
    """
    packed = pack_parts([decimated_part(layer.load_part()) for layer in scene.layers])
    with new_file(path) as draft, draft.open("wb") as file:
        file.writelines(textured_glb(packed))


def decimated_part(view: View) -> MeshPart:
    """The surface of a layer (`decimate`) with its picture."""
    part = decimate(view)
    return MeshPart(part.mesh, part.pixels, view.color, part.surface)


def textured_glb(packed: Sequence[MeshPart], quality: int = JPEG_QUALITY) -> list[bytes | bytearray]:
    """A GLB file, in pieces, of meshes with their pictures, as `pack_parts` gives them: one mesh, with a texture for each part, a
    JPEG of that quality (0..100), or a PNG where the picture has alpha."""
    glb = Glb()
    if packed:
        glb.place(packed[0].mesh)
    jpeg = {"quality": quality, "subsampling": 0 if quality >= JPEG_QUALITY else 2}
    for part in packed:
        kind, options = ("PNG", {}) if part.soft else ("JPEG", jpeg)
        glb.add_material(part.picture, kind, **options)
        for mesh, pixels in split_mesh(part.mesh, part.pixels):
            glb.add_mesh(mesh, pixels / (part.picture.shape[1], part.picture.shape[0]))  # glTF's v runs down, too
    return glb.pieces()


def split_mesh(mesh: Mesh, pixels: Float64Array) -> Iterator[tuple[Mesh, Float64Array]]:
    """A mesh and the places of its vertices in the picture (N x 2, px), in pieces of so few vertices that two bytes number them;
    vertices at their seams are in both."""
    if len(mesh.vertices) <= SHORT_VERTICES:
        yield mesh, pixels
        return
    parts = [mesh.triangles[np.argsort(mesh.triangles.min(1), kind="stable")]]  # by rows of the picture
    while parts:
        triangles = parts.pop()
        used = np.zeros(len(mesh.vertices), bool)
        used[triangles] = True
        if np.count_nonzero(used) > SHORT_VERTICES:
            parts += np.array_split(triangles, 2)[::-1]
            continue
        number = np.cumsum(used, dtype=np.int32) - 1
        color, origin, confidence = mesh.color[used], mesh.origin[used], mesh.confidence[used]
        yield Mesh(mesh.vertices[used], number[triangles], color, origin, confidence), pixels[used]


def pack_parts(parts: Sequence[MeshPart]) -> list[MeshPart]:
    """The parts as files have them, none empty: all opaque ones as one, with one picture; then each soft one."""
    shown = [part for part in parts if len(part.mesh.triangles)]
    soft, opaque = [part for part in shown if part.soft], [part for part in shown if not part.soft]
    if not opaque:
        return soft
    texture, places = pack_textures(opaque)
    pixels = np.concatenate([part.pixels + place for part, place in zip(opaque, places)])
    return [MeshPart(join_meshes([part.mesh for part in opaque]), pixels, texture, None), *soft]


def shrink_picture(part: MeshPart, step: int) -> MeshPart:
    """A part whose picture has alpha with that picture a step-th as wide and high; colours count by their alpha."""
    if step == 1:
        return part
    rows, columns = (max(side // step, 1) for side in part.picture.shape[:2])
    color, share = average_visible(part.picture, (columns, rows))
    picture = np.rint(np.dstack([color, share * 255])).astype(np.uint8)
    scale = np.array([columns / part.picture.shape[1], rows / part.picture.shape[0]])
    return part._replace(pixels=part.pixels * scale, picture=picture)


def average_visible(picture: np.ndarray, wh: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A picture (H x W x 3, or with alpha 4) averaged down to a size: h x w x 3 levels, each counted by its alpha, and the mean
    alpha, h x w in 0..1."""
    opacity = picture[..., 3:] if picture.shape[2] == 4 else np.full_like(picture[..., :1], 255)
    alpha = opacity / np.float32(255)
    small = cv2.resize(np.concatenate([picture[..., :3] * alpha, alpha], 2), wh, interpolation=cv2.INTER_AREA)
    return small[..., :3] / np.maximum(small[..., 3:], np.float32(1e-6)), small[..., 3]


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


def pack_textures(parts: Sequence[MeshPart]) -> tuple[UInt8Array, list[Float64Array]]:
    """One picture that holds what is seen of every part, in rows from the top; and for each part what takes x, y of its own
    picture to that one's (px). Pixels that are not seen take the nearest one's colour: nothing bleeds in at edges.
    """
    boxes = [textured_box(one) for one in parts]
    sizes = [sides_of(box) for box in boxes]
    places, hw = place_in_rows(sizes)
    texture = np.zeros((*hw, 3), np.uint8)
    for part, box, (row, column), (rows, columns) in zip(parts, boxes, places, sizes):
        place = texture[row : row + rows, column : column + columns]
        if part.shown is None:
            place[...] = part.picture[box]
        else:
            fill_unseen(part.picture[box], part.shown[box], place)
    return texture, [np.array([x - box[1].start, y - box[0].start], float) for (y, x), box in zip(places, boxes)]


def textured_box(part: MeshPart) -> Box:
    """Rows and columns of a part's picture that hold what is seen of it, and its vertices: rims reach over what is seen."""
    if part.shown is None:
        return np.s_[0 : len(part.picture), 0 : part.picture.shape[1]]
    columns, rows = part.pixels.astype(int).T
    used = part.shown.copy()
    used[rows, columns] = True
    return box_around(used, 0)


def place_in_rows(sizes: Sequence[tuple[int, int]]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Row and column of the upper left corner of boxes (rows, columns) that lie next to each other, and the size of them all."""
    width = max(max(columns for _, columns in sizes), math.ceil(math.sqrt(sum(map(math.prod, sizes)))))
    places, left, top, height = list[tuple[int, int]](), 0, 0, 0
    for rows, columns in sizes:
        if left and left + columns > width:
            left, top, height = 0, top + height, 0
        places.append((top, left))
        left, height = left + columns, max(height, rows)
    return places, (top + height, max(x + columns for (_, x), (_, columns) in zip(places, sizes)))


def fill_unseen(picture: UInt8Array, shown: BoolArray, out: UInt8Array) -> None:
    """Write a picture (H x W x 3) to `out`, what is not shown (H x W) in the colour of the nearest pixel that is.

    Of those at most NEAR_ROWS above or below the rows that are filled at a time: distances of a large picture take more memory
    than itself.
    """
    for first in range(0, len(picture), ROWS):
        begin, end = max(first - NEAR_ROWS, 0), first + ROWS + NEAR_ROWS
        filled = fill_with_nearest(picture[begin:end], shown[begin:end])
        out[first : first + ROWS] = filled[first - begin :][:ROWS]
