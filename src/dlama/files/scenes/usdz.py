"""The layered mesh of a 3-D photo in; a USDZ file out, which AR Quick Look opens on iPhones.

After the OpenUSD specifications of UsdGeomMesh, UsdPreviewSurface and of the package:
https://openusd.org/release/spec_usdz.html. What a camera saw is lit already, so the picture is the material's emission.
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow

from dlama.errors import MissingExtraError, OutputError
from dlama.files.atomic_write import PathLike, new_file
from dlama.files.scenes.meshes import GLTF_FROM_OPENCV
from dlama.files.scenes.textured_mesh import JPEG_QUALITY, pack_textures
from dlama.geometry.camera import Float64Array
from dlama.geometry.layers.layered_mesh import MeshPart
from dlama.geometry.mesh import Mesh, join_meshes
from dlama.geometry.rgbd import UInt8Array

USD_FROM_OPENCV = GLTF_FROM_OPENCV
"""Both have x right, y up, and look along -z."""
ROOT = "/photo"


def check_usd() -> None:
    """MissingExtraError without the package that writes USDZ."""
    _usd("Usd")


def _usd(name: str) -> Any:
    try:
        return importlib.import_module(f"pxr.{name}")
    except ImportError as error:
        raise MissingExtraError("a USDZ file", "usd-core", "usd") from error


def write_usdz(path: PathLike, parts: Sequence[MeshPart], quality: int = JPEG_QUALITY) -> None:
    """Write meshes with their pictures, in metres, y up; parts whose picture has alpha are meshes of their own.

    quality: of the opaque parts' JPEG, 0 to 100. Raises MissingExtraError, OutputError; nothing half-written is left.
    """
    usd, utils = _usd("Usd"), _usd("UsdUtils")
    opaque = [part for part in parts if not part.soft and len(part.mesh.triangles)]
    with tempfile.TemporaryDirectory() as name, new_file(path) as draft:
        folder = Path(name)
        stage = usd.Stage.CreateNew(str(folder / "photo.usdc"))
        set_up_stage(stage)
        middle = middle_of(parts)
        if opaque:
            texture, places = pack_textures(opaque)
            pixels = np.concatenate([part.pixels + place for part, place in zip(opaque, places)])
            Pillow.fromarray(texture).save(folder / "opaque.jpg", quality=quality)
            add_mesh(
                stage, "opaque", join_meshes([part.mesh for part in opaque]), middle, pixels, texture, "opaque.jpg"
            )
        for number, part in enumerate(part for part in parts if part.soft and len(part.mesh.triangles)):
            file = f"soft{number}.png"
            Pillow.fromarray(part.picture).save(folder / file)
            add_mesh(stage, f"soft{number}", part.mesh, middle, part.pixels, part.picture, file)
        stage.GetRootLayer().Save()
        packed = folder / "photo.usdz"
        if not utils.CreateNewUsdzPackage(str(folder / "photo.usdc"), str(packed)):
            raise OutputError(f"{path}: usd-core could not pack the scene")
        draft.write_bytes(packed.read_bytes())


def set_up_stage(stage: Any) -> None:
    """Metres, y up, one root."""
    geometry = _usd("UsdGeom")
    geometry.SetStageUpAxis(stage, geometry.Tokens.y)
    geometry.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(geometry.Xform.Define(stage, ROOT).GetPrim())


def middle_of(parts: Sequence[MeshPart]) -> Float64Array:
    """3, metres: middle of all vertices, which becomes the origin, so that float32 keeps its precision."""
    vertices = [part.mesh.vertices for part in parts if len(part.mesh.vertices)]
    if not vertices:
        return np.zeros(3)
    lows, highs = np.min([one.min(0) for one in vertices], 0), np.max([one.max(0) for one in vertices], 0)
    return np.asarray((lows + highs) / 2, np.float64)


def add_mesh(
    stage: Any, name: str, mesh: Mesh, middle: Float64Array, pixels: Float64Array, picture: UInt8Array, file: str
) -> None:
    """A mesh (vertices less `middle`, metres) with a picture file as its emission; pixels: N x 2, x and y of vertices in it."""
    geometry, sdf, types = _usd("UsdGeom"), _usd("Sdf"), _usd("Vt")
    shape = geometry.Mesh.Define(stage, f"{ROOT}/{name}")
    points = ((mesh.vertices - middle) * USD_FROM_OPENCV).astype(np.float32)
    shape.CreatePointsAttr(types.Vec3fArray.FromNumpy(np.ascontiguousarray(points)))
    shape.CreateExtentAttr(types.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    shape.CreateFaceVertexCountsAttr(types.IntArray.FromNumpy(np.full(len(mesh.triangles), 3, np.int32)))
    corners = np.ascontiguousarray(mesh.triangles[:, ::-1].reshape(-1), np.int32)  # counter-clockwise in front
    shape.CreateFaceVertexIndicesAttr(types.IntArray.FromNumpy(corners))
    shape.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
    shape.CreateDoubleSidedAttr(True)
    size = np.array([picture.shape[1], picture.shape[0]])
    uv = pixels / size * (1, -1) + (0, 1)  # v runs up
    primvar = geometry.PrimvarsAPI(shape).CreatePrimvar(
        "st", sdf.ValueTypeNames.TexCoord2fArray, geometry.Tokens.vertex
    )
    primvar.Set(types.Vec2fArray.FromNumpy(np.ascontiguousarray(uv.astype(np.float32))))
    material = add_material(stage, f"{ROOT}/{name}_material", file, alpha=picture.shape[2] == 4)
    binding = _usd("UsdShade").MaterialBindingAPI.Apply(shape.GetPrim())
    binding.Bind(material)


def add_material(stage: Any, path: str, file: str, alpha: bool) -> Any:
    """A UsdPreviewSurface that emits a picture; alpha: whether the picture's alpha is its opacity."""
    shade, types = _usd("UsdShade"), _usd("Sdf").ValueTypeNames

    def shader(name: str, kind: str) -> Any:
        made = shade.Shader.Define(stage, f"{path}/{name}")
        made.CreateIdAttr(kind)
        return made

    reader, texture, surface = (
        shader(name, kind)
        for name, kind in (
            ("st", "UsdPrimvarReader_float2"),
            ("picture", "UsdUVTexture"),
            ("surface", "UsdPreviewSurface"),
        )
    )
    reader.CreateInput("varname", types.String).Set("st")
    where = reader.CreateOutput("result", types.Float2)
    texture.CreateInput("file", types.Asset).Set(f"./{file}")
    texture.CreateInput("sourceColorSpace", types.Token).Set("sRGB")
    texture.CreateInput("st", types.Float2).ConnectToSource(where)
    for way in ("wrapS", "wrapT"):
        texture.CreateInput(way, types.Token).Set("clamp")
    surface.CreateInput("diffuseColor", types.Color3f).Set((0, 0, 0))
    surface.CreateInput("roughness", types.Float).Set(1.0)
    surface.CreateInput("emissiveColor", types.Color3f).ConnectToSource(texture.CreateOutput("rgb", types.Float3))
    if alpha:
        surface.CreateInput("opacity", types.Float).ConnectToSource(texture.CreateOutput("a", types.Float))
    material = shade.Material.Define(stage, path)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", types.Token))
    return material
