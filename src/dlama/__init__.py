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
    from dlama.completion.meta_data import MetaData as MetaData
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
    from dlama.datasets.sequences.completion import SequenceCompletion as SequenceCompletion
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
    from dlama.files.rasters.masks import read_mask as read_mask
    from dlama.files.rasters.pictures import read_color as read_color
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
    from dlama.geometry.motion.trajectories import orbit as orbit
    from dlama.geometry.projection import lift as lift
    from dlama.geometry.rendering import render as render
    from dlama.geometry.rgbd import RGBD as RGBD
    from dlama.geometry.scene import Scene as Scene
    from dlama.geometry.view import View as View
    from dlama.geometry.visibility import Law as Law
    from dlama.inpainters.context import FillContext as FillContext
    from dlama.inpainters.filling import Fill as Fill
    from dlama.inpainters.filling import FillReport as FillReport
    from dlama.inpainters.filling import Inpainter as Inpainter
    from dlama.inpainters.filling import Painter as Painter
    from dlama.inpainters.filling import inpaint as inpaint
    from dlama.jobs.batch import batch as batch
    from dlama.jobs.results.result import JobResult as JobResult
    from dlama.perception.depth_networks import DepthPrediction as DepthPrediction
    from dlama.perception.diagnosis.finding import Finding as Finding
    from dlama.perception.missing_depth import densify as densify
    from dlama.perception.monocular import DepthEstimate as DepthEstimate
    from dlama.perception.monocular import estimate_depth as estimate_depth
    from dlama.perception.object_masks import MaskSession as MaskSession
    from dlama.perception.object_masks import ObjectMask as ObjectMask
    from dlama.perception.object_masks import find_mask as find_mask
    from dlama.perception.stereo.agreement import StereoConsistency as StereoConsistency

__version__ = "0.1.0"

NAMES = {
    "completion.completion": ("Completion", "StereoCompletion"),
    "completion.meta_data": ("MetaData",),
    "completion.options": ("Options",),
    "completion.photo3d": ("Photo3D", "photo3d"),
    "completion.pipeline": ("complete", "render_path"),
    "completion.recipes": ("Recipe",),
    "completion.stereo.stereo": ("stereo",),
    "completion.verbs": ("remove", "view"),
    "datasets.diagnosis": ("diagnose",),
    "datasets.sequences.completion": ("SequenceCompletion",),
    "datasets.sequences.sequence": ("sequence",),
    "errors": (
        "CameraError",
        "DepthError",
        "DlamaError",
        "FileError",
        "InputError",
        "InputTypeError",
        "MaskError",
        "MissingExtraError",
        "OutputError",
        "ShapeError",
    ),
    "files.cameras": ("read_camera", "read_stereo_calib"),
    "files.rasters.masks": ("read_mask",),
    "files.rasters.pictures": ("read_color",),
    "files.results.completion": ("write",),
    "files.results.estimated_depth": ("write_depth",),
    "files.results.photo3d": ("write_photo3d",),
    "files.rgbd": ("read_rgbd",),
    "files.scenes.scene_npz": ("read_scene",),
    "geometry.camera": ("Camera", "StereoRig"),
    "geometry.cloud": ("Mesh", "PointCloud"),
    "geometry.codes": ("HoleType", "Origin"),
    "geometry.frames.alignment": ("align_frames",),
    "geometry.frames.gathering": ("scene",),
    "geometry.frames.stored": ("StoredView",),
    "geometry.fusion": ("fuse",),
    "geometry.layers.head_box": ("HeadBox",),
    "geometry.projection": ("lift",),
    "geometry.rendering": ("render",),
    "geometry.rgbd": ("RGBD",),
    "geometry.scene": ("Scene",),
    "geometry.motion.trajectories": ("orbit",),
    "geometry.view": ("View",),
    "geometry.visibility": ("Law",),
    "inpainters.context": ("FillContext",),
    "inpainters.filling": ("Fill", "FillReport", "Inpainter", "Painter", "inpaint"),
    "jobs.batch": ("batch",),
    "jobs.results.result": ("JobResult",),
    "perception.depth_networks": ("DepthPrediction",),
    "perception.diagnosis.finding": ("Finding",),
    "perception.missing_depth": ("densify",),
    "perception.monocular": ("DepthEstimate", "estimate_depth"),
    "perception.object_masks": ("MaskSession", "ObjectMask", "find_mask"),
    "perception.stereo.agreement": ("StereoConsistency",),
}
"""Module of dlama -> the public names that it defines."""
MODULES = {name: module for module, names in NAMES.items() for name in names}

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
