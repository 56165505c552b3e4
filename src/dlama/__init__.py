"""dlama completes what a camera could not see: new views, removed objects and stereo pairs, in colour and depth.

These names are the public ones. RGBD --lift--> PointCloud --render--> View --fill--> View --fuse--> Scene; `view`, `remove`
and `stereo` do all of it, `complete` does it for several cameras.
"""

__version__ = "0.1.0"

from dlama.completion.pipeline import Completion as Completion
from dlama.completion.pipeline import complete as complete
from dlama.completion.stereo import stereo as stereo
from dlama.completion.verbs import remove as remove
from dlama.completion.verbs import view as view
from dlama.errors import DlamaError as DlamaError
from dlama.files.cameras import read_camera as read_camera
from dlama.files.cameras import read_stereo_calib as read_stereo_calib
from dlama.files.pictures import read_color as read_color
from dlama.files.pictures import read_mask as read_mask
from dlama.files.results import write as write
from dlama.files.rgbd import read_rgbd as read_rgbd
from dlama.geometry.camera import Camera as Camera
from dlama.geometry.cloud import PointCloud as PointCloud
from dlama.geometry.projection import lift as lift
from dlama.geometry.rendering import render as render
from dlama.geometry.rgbd import RGBD as RGBD
from dlama.geometry.scene import Scene as Scene
from dlama.geometry.trajectories import orbit as orbit
from dlama.geometry.view import View as View
