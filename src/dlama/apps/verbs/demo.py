"""The street scene that comes with dlama in; all jobs done on it, and one joint preview, out."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path

import dlama
from dlama.apps.options import Lens, Masking, Method, Pointing, Reading, Results
from dlama.apps.reading import Command
from dlama.apps.terminal.output import Result
from dlama.files.atomic_write import new_directory
from dlama.files.results.contact_sheet import write_contact_sheet
from dlama.files.results.preview import demo_legend, demo_panels
from dlama.files.results.video import write_video
from dlama.geometry.trajectories import interpolate_cameras

ASSETS = dlama.example()
"""Picture, depth, mask, camera and stereo pair; its README names their sources."""
INPUTS = ("street.jpg", "depth.png", "camera.json", "mask.png", "right.jpg", "calib.txt")
"""What the jobs read."""
YAW = 20.0
"""Degrees by which the demo's camera moves to the right."""
BARREL = "256,345"
"""A pixel on the barrel."""
VIDEO_PICTURES, VIDEO_PX, VIDEO_FPS = 16, 256, 12.0
"""Of the demo's video: pictures on the way there, their width, and how many are shown a second."""
FOV = 90.0
"""Degrees, of the street's camera."""


def demo_view(this: Command, method: Method) -> dlama.Completion:
    """The street from 20 degrees further right."""
    rgbd = this.rgbd(ASSETS / "street.jpg", ASSETS / "depth.png", Lens(camera=ASSETS / "camera.json"), Reading())
    return dlama.view(rgbd, yaw=YAW, **method.settings())


def demo_remove(this: Command, method: Method) -> dlama.Completion:
    """The street without the barrel and its shadow."""
    rgbd = this.rgbd(ASSETS / "street.jpg", ASSETS / "depth.png", Lens(camera=ASSETS / "camera.json"), Reading())
    return dlama.remove(rgbd, this.mask(ASSETS / "mask.png", Masking(), ASSETS / "street.jpg"), **method.settings())


def demo_stereo(this: Command, method: Method) -> dlama.Completion:
    """Depth from the stereo pair, and both pictures without the barrel."""
    pair = this.pair(ASSETS / "street.jpg", ASSETS / "right.jpg", ASSETS / "calib.txt")
    return dlama.stereo(
        *pair, mask=this.mask(ASSETS / "mask.png", Masking(), ASSETS / "street.jpg"), **method.settings()
    )


def demo_photo(this: Command, method: Method) -> dlama.Completion:
    """The street from the photo alone: depth is estimated, the barrel clicked, its shadow taken."""
    photo = ASSETS / "street.jpg"
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "the scale of the estimated depth"
        )  # meta.json says it; the demo shows no metres
        rgbd = this.rgbd(photo, None, Lens(fov=FOV), Reading())
    mask = this.pointed(rgbd, Pointing(click=(BARREL,), with_shadow=True), photo)
    return dlama.remove(rgbd, mask, **method.settings())


JOBS = {
    "view": ("from 20° further right", demo_view),
    "remove": ("without the barrel", demo_remove),
    "stereo": ("stereo, without the barrel", demo_stereo),
    "photo": ("from the photo alone, the barrel clicked", demo_photo),
}
"""Sub-directory -> what the joint sheet calls the job, and the job."""


def demo_video(path: Path, done: dlama.Completion) -> None:
    """The way from the source camera to the view's and back, small, as an animated WebP. Raises OutputError."""
    cameras = interpolate_cameras([done.source.camera, done.view.camera], VIDEO_PICTURES)
    small = [one.resized(VIDEO_PX, round(VIDEO_PX * one.height / one.width)) for one in cameras]
    pictures = [view.color for view in dlama.render_path(done.scene, small)]
    write_video(path, [*pictures, *pictures[-2:0:-1]], VIDEO_FPS)


def demo(output: Path, method: Method, result: Result, results: Results) -> None:
    """Each job's results to a folder of `output`, what they read to inputs/, preview.png of all, and video.webp.

    `result` takes a line for each. Raises OutputError, and InputError for options that cannot be; then nothing is left behind.
    """
    Command().check(output, results, {}, None, method.settings(), pair=True)
    panels, completions = [], []
    with new_directory(output) as folder:
        for name, (title, complete) in JOBS.items():
            this = Command()
            done = complete(this, method)
            this.write(done, folder / name, results, shown=output / name)
            result.add(this.result.lines[0], **{name: this.result.values})
            panels += demo_panels(title, done)
            completions.append(done)
        (folder / "inputs").mkdir(exist_ok=True)
        for name in INPUTS:
            shutil.copyfile(ASSETS / name, folder / "inputs" / name)
        title = "dlama completes what a camera could not see"
        write_contact_sheet(folder / "preview.png", title, panels, demo_legend(completions))
        demo_video(folder / "video.webp", completions[0])
    result.add(
        f"{output / 'preview.png'}: all four side by side; video.webp: on the way to the first", output=str(output)
    )
