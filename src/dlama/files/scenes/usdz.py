"""The layered mesh of a 3-D photo in; a USDZ file out, which AR Quick Look opens on iPhones.

After the OpenUSD specifications of UsdGeomMesh, UsdPreviewSurface and of the package:
https://openusd.org/release/spec_usdz.html. What a camera saw is lit already, so the picture is the material's emission.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image as Pillow

from dlama.errors import OutputError, import_extra
from dlama.files.scenes.glb import GLTF_FROM_OPENCV, middle_of
from dlama.files.scenes.textured_mesh import JPEG_QUALITY, pack_parts
from dlama.geometry.camera import Float64Array
from dlama.geometry.layers.layered_mesh import MeshPart
from dlama.writing.atomic_write import PathLike, new_file

ROOT = "/photo"


def usd_module(name: str) -> Any:
    """A module of OpenUSD. MissingExtraError."""
    return import_extra(f"pxr.{name}", "a USDZ file", "usd-core", "usd")


def write_usdz(path: PathLike, parts: Sequence[MeshPart]) -> None:
    """Write meshes with their pictures, in metres, y up; parts whose picture has alpha are meshes of their own.

    Raises MissingExtraError, OutputError; nothing half-written is left.
    """
    usd, utils = usd_module("Usd"), usd_module("UsdUtils")
    packed = pack_parts(parts)
    with tempfile.TemporaryDirectory() as made, new_file(path) as draft:
        folder = Path(made)
        stage = usd.Stage.CreateNew(str(folder / "photo.usdc"))
        middle = middle_of(packed[0].mesh) if packed else np.zeros(3)
        set_up_stage(stage, middle)
        for number, part in enumerate(packed):
            name, ending = (f"soft{number}", "png") if part.soft else ("opaque", "jpg")
            Pillow.fromarray(part.picture).save(folder / f"{name}.{ending}", quality=JPEG_QUALITY, subsampling=0)
            add_mesh(stage, name, part, middle, f"{name}.{ending}")
        stage.GetRootLayer().Save()
        whole = folder / "photo.usdz"
        if not utils.CreateNewUsdzPackage(str(folder / "photo.usdc"), str(whole)):
            raise OutputError(f"{path}: usd-core could not pack the scene")
        draft.write_bytes(whole.read_bytes())


def set_up_stage(stage: Any, middle: Float64Array) -> None:
    """Metres, y up, axes as glTF has them, one root, which stands where `middle` is (metres)."""
    geometry = usd_module("UsdGeom")
    geometry.SetStageUpAxis(stage, geometry.Tokens.y)
    geometry.SetStageMetersPerUnit(stage, 1.0)
    root = geometry.Xform.Define(stage, ROOT)
    root.AddTranslateOp().Set(tuple((middle * GLTF_FROM_OPENCV).tolist()))
    stage.SetDefaultPrim(root.GetPrim())


def add_mesh(stage: Any, name: str, part: MeshPart, middle: Float64Array, file: str) -> None:
    """A part (vertices less `middle`, metres) with its picture's file as its emission."""
    mesh, picture = part.mesh, part.picture
    geometry, sdf, types = usd_module("UsdGeom"), usd_module("Sdf"), usd_module("Vt")
    shape = geometry.Mesh.Define(stage, f"{ROOT}/{name}")
    points = ((mesh.vertices - middle) * GLTF_FROM_OPENCV).astype(np.float32)
    shape.CreatePointsAttr(types.Vec3fArray.FromNumpy(np.ascontiguousarray(points)))
    shape.CreateExtentAttr(types.Vec3fArray.FromNumpy(np.stack([points.min(0), points.max(0)])))
    shape.CreateFaceVertexCountsAttr(types.IntArray.FromNumpy(np.full(len(mesh.triangles), 3, np.int32)))
    corners = np.ascontiguousarray(mesh.triangles.reshape(-1), np.int32)
    shape.CreateFaceVertexIndicesAttr(types.IntArray.FromNumpy(corners))
    shape.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
    shape.CreateDoubleSidedAttr(True)
    size = np.array([picture.shape[1], picture.shape[0]])
    uv = part.pixels / size * (1, -1) + (0, 1)  # v runs up
    kind = sdf.ValueTypeNames.TexCoord2fArray
    primvar = geometry.PrimvarsAPI(shape).CreatePrimvar("st", kind, geometry.Tokens.vertex)
    primvar.Set(types.Vec2fArray.FromNumpy(np.ascontiguousarray(uv.astype(np.float32))))
    material = add_material(stage, f"{ROOT}/{name}_material", file, alpha=part.soft)
    binding = usd_module("UsdShade").MaterialBindingAPI.Apply(shape.GetPrim())
    binding.Bind(material)


def add_material(stage: Any, path: str, file: str, alpha: bool) -> Any:
    """A UsdPreviewSurface that emits a picture; alpha: whether the picture's alpha is its opacity."""
    shade, types = usd_module("UsdShade"), usd_module("Sdf").ValueTypeNames

    def shader(name: str, kind: str) -> Any:
        made = shade.Shader.Define(stage, f"{path}/{name}")
        made.CreateIdAttr(kind)
        return made

    reader = shader("st", "UsdPrimvarReader_float2")
    texture = shader("picture", "UsdUVTexture")
    surface = shader("surface", "UsdPreviewSurface")
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
