"""dlama completes what a camera could not see: new views, removed objects and stereo pairs, in colour and depth.

The names in `__all__` are the public ones: every function, and every type that one of them takes or gives.
RGBD --lift--> PointCloud --render--> View --inpaint--> View --fuse--> Scene; `view`, `remove` and `stereo` do all of it,
`complete` does it for several cameras. A name is imported when it is first used (PEP 562), so `import dlama` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what type checkers and editors read; a test holds it equal to MODULES
    from dlama.completion.completion import Completion as Completion
    from dlama.completion.completion import StereoCompletion as StereoCompletion
    from dlama.completion.options import Options as Options
    from dlama.completion.photo3d import Photo3D as Photo3D
    from dlama.completion.photo3d import photo3d as photo3d
    from dlama.completion.pipeline import complete as complete
    from dlama.completion.pipeline import render_path as render_path
    from dlama.completion.recipes import Recipe as Recipe
    from dlama.completion.stereo.stereo import stereo as stereo
    from dlama.completion.verbs import remove as remove
    from dlama.completion.verbs import view as view
    from dlama.datasets.diagnosis import diagnose as diagnose
    from dlama.datasets.sequences.sequence import sequence as sequence
    from dlama.errors import CameraError as CameraError
    from dlama.errors import DepthError as DepthError
    from dlama.errors import DlamaError as DlamaError
    from dlama.errors import FileError as FileError
    from dlama.errors import InputError as InputError
    from dlama.errors import InputTypeError as InputTypeError
    from dlama.errors import MaskError as MaskError
    from dlama.errors import MissingExtraError as MissingExtraError
    from dlama.errors import OutputError as OutputError
    from dlama.errors import ShapeError as ShapeError
    from dlama.files.cameras import read_camera as read_camera
    from dlama.files.cameras import read_stereo_calib as read_stereo_calib
    from dlama.files.rasters.pictures import read_color as read_color
    from dlama.files.rasters.pictures import read_mask as read_mask
    from dlama.files.results.completion import write as write
    from dlama.files.results.estimated_depth import write_depth as write_depth
    from dlama.files.results.photo3d import write_photo3d as write_photo3d
    from dlama.files.rgbd import read_rgbd as read_rgbd
    from dlama.files.scenes.scene_npz import read_scene as read_scene
    from dlama.geometry.camera import Camera as Camera
    from dlama.geometry.camera import StereoRig as StereoRig
    from dlama.geometry.cloud import Mesh as Mesh
    from dlama.geometry.cloud import PointCloud as PointCloud
    from dlama.geometry.codes import HoleType as HoleType
    from dlama.geometry.codes import Origin as Origin
    from dlama.geometry.frames.alignment import align_frames as align_frames
    from dlama.geometry.frames.gathering import scene as scene
    from dlama.geometry.frames.stored import StoredView as StoredView
    from dlama.geometry.fusion import fuse as fuse
    from dlama.geometry.layers.head_box import HeadBox as HeadBox
    from dlama.geometry.projection import lift as lift
    from dlama.geometry.rendering import render as render
    from dlama.geometry.rgbd import RGBD as RGBD
    from dlama.geometry.scene import Scene as Scene
    from dlama.geometry.trajectories import orbit as orbit
    from dlama.geometry.view import View as View
    from dlama.geometry.visibility import Law as Law
    from dlama.inpainters.context import FillContext as FillContext
    from dlama.inpainters.filling import Fill as Fill
    from dlama.inpainters.filling import FillReport as FillReport
    from dlama.inpainters.filling import Inpainter as Inpainter
    from dlama.inpainters.filling import inpaint as inpaint
    from dlama.inpainters.sky import Sky as Sky
    from dlama.jobs.batch import batch as batch
    from dlama.jobs.results.result import JobResult as JobResult
    from dlama.perception.depth_networks import DepthPrediction as DepthPrediction
    from dlama.perception.diagnosis.finding import Finding as Finding
    from dlama.perception.monocular import DepthEstimate as DepthEstimate
    from dlama.perception.monocular import estimate_depth as estimate_depth
    from dlama.perception.object_masks import MaskSession as MaskSession
    from dlama.perception.object_masks import ObjectMask as ObjectMask
    from dlama.perception.object_masks import find_mask as find_mask
    from dlama.perception.stereo.agreement import StereoConsistency as StereoConsistency

__version__ = "0.1.0"

MODULES = {
    "Camera": "geometry.camera",
    "CameraError": "errors",
    "Completion": "completion.completion",
    "DepthError": "errors",
    "DepthEstimate": "perception.monocular",
    "DepthPrediction": "perception.depth_networks",
    "DlamaError": "errors",
    "FileError": "errors",
    "Fill": "inpainters.filling",
    "FillContext": "inpainters.context",
    "FillReport": "inpainters.filling",
    "Finding": "perception.diagnosis.finding",
    "HeadBox": "geometry.layers.head_box",
    "HoleType": "geometry.codes",
    "Inpainter": "inpainters.filling",
    "InputError": "errors",
    "InputTypeError": "errors",
    "JobResult": "jobs.results.result",
    "Law": "geometry.visibility",
    "MaskError": "errors",
    "MaskSession": "perception.object_masks",
    "Mesh": "geometry.cloud",
    "MissingExtraError": "errors",
    "ObjectMask": "perception.object_masks",
    "Options": "completion.options",
    "Origin": "geometry.codes",
    "OutputError": "errors",
    "Photo3D": "completion.photo3d",
    "PointCloud": "geometry.cloud",
    "RGBD": "geometry.rgbd",
    "Recipe": "completion.recipes",
    "Scene": "geometry.scene",
    "Sky": "inpainters.sky",
    "ShapeError": "errors",
    "StereoCompletion": "completion.completion",
    "StereoConsistency": "perception.stereo.agreement",
    "StereoRig": "geometry.camera",
    "StoredView": "geometry.frames.stored",
    "View": "geometry.view",
    "batch": "jobs.batch",
    "align_frames": "geometry.frames.alignment",
    "complete": "completion.pipeline",
    "diagnose": "datasets.diagnosis",
    "estimate_depth": "perception.monocular",
    "find_mask": "perception.object_masks",
    "fuse": "geometry.fusion",
    "inpaint": "inpainters.filling",
    "lift": "geometry.projection",
    "orbit": "geometry.trajectories",
    "photo3d": "completion.photo3d",
    "read_camera": "files.cameras",
    "read_color": "files.rasters.pictures",
    "read_mask": "files.rasters.pictures",
    "read_rgbd": "files.rgbd",
    "read_stereo_calib": "files.cameras",
    "read_scene": "files.scenes.scene_npz",
    "remove": "completion.verbs",
    "render_path": "completion.pipeline",
    "render": "geometry.rendering",
    "sequence": "datasets.sequences.sequence",
    "scene": "geometry.frames.gathering",
    "stereo": "completion.stereo.stereo",
    "view": "completion.verbs",
    "write": "files.results.completion",
    "write_photo3d": "files.results.photo3d",
    "write_depth": "files.results.estimated_depth",
}
"""Public name -> the module of dlama that defines it."""

__all__ = [*MODULES, "example"]  # noqa: PLE0604  (the names of a dict are strings)


def __getattr__(name: str) -> Any:
    """A public name, imported when it is first asked for. AttributeError: any other name."""
    if name not in MODULES:
        raise AttributeError(f"module 'dlama' has no attribute {name!r}")
    found = getattr(import_module(f"dlama.{MODULES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """The public names; editors and `dir` show these."""
    return [*__all__, "__version__"]


def example() -> Path:
    """The folder of the street scene that comes with dlama: street.jpg, depth.png (millimetres), mask.png (a barrel),
    camera.json, and for a stereo pair right.jpg and calib.txt."""
    return Path(__file__).parent / "assets" / "demo"
