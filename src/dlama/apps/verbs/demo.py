"""The street scene that comes with dlama in; all jobs done on it, and one joint preview, out."""

from __future__ import annotations

import shutil
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import dlama
from dlama.apps.options import CompletingOptions, given_options
from dlama.apps.places import check_folder_apart
from dlama.apps.reading import Command
from dlama.apps.terminal.output import Result
from dlama.files.results.contact_sheet import write_contact_sheet
from dlama.files.results.preview import demo_legend, demo_panels
from dlama.files.results.video import write_video
from dlama.geometry.motion.trajectories import interpolate_cameras
from dlama.jobs.early import check_options
from dlama.jobs.parameters import check_parameters
from dlama.jobs.verbs import perform
from dlama.writing.atomic_write import new_directory

ASSETS = dlama.example()
"""Picture, depth, mask, camera and stereo pair; its README names their sources."""
INPUTS = ("street.jpg", "depth.png", "camera.json", "mask.png", "right.jpg", "calib.txt")
"""What the jobs read."""
PICTURE = {"image": ASSETS / "street.jpg", "depth": ASSETS / "depth.png", "camera": ASSETS / "camera.json"}
PAIR = {"left": ASSETS / "street.jpg", "right": ASSETS / "right.jpg", "calib": ASSETS / "calib.txt"}
MASK = {"mask": ASSETS / "mask.png"}
PHOTO: dict[str, Any] = {"image": ASSETS / "street.jpg", "fov": 90, "click": "256,345", "with_shadow": True}
JOBS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "view": ("from 20° further right", "view", {**PICTURE, "yaw": 20}),
    "remove": ("without the barrel", "remove", PICTURE | MASK),
    "stereo": ("stereo, without the barrel", "stereo", PAIR | MASK),
    "photo": ("from the photo alone, the barrel clicked", "remove", PHOTO),
}
"""Sub-directory -> what the joint sheet calls the job, its verb and parameters."""


def demo_video(path: Path, done: dlama.Completion) -> None:
    """The way from the source camera to the view's and back, 256 px wide, as an animated WebP. Raises OutputError."""
    cameras = interpolate_cameras([done.source.camera, done.view.camera], 16)
    small = [one.resized(256, round(256 * one.height / one.width)) for one in cameras]
    pictures = [view.color for view in dlama.render_path(done.scene, small)]
    write_video(path, [*pictures, *pictures[-2:0:-1]], fps=12.0)


def demo(output: Path, completing: CompletingOptions, result: Result) -> None:
    """Each job's results to a folder of `output`, what they read to inputs/, preview.png of all, and video.webp.

    `result` takes a line for each. Raises OutputError, and InputError for options that cannot be; then nothing is left behind.
    """
    check_folder_apart(output, {})
    given, check = given_options(completing), partial(check_options, pair=True)
    jobs = {name: check_parameters(verb, own | given, False, check) for name, (_, verb, own) in JOBS.items()}
    panels, completions = [], []
    with new_directory(output) as folder, warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "the scale of the estimated depth"
        )  # meta.json says it; the demo shows no metres
        for name, (title, verb, _) in JOBS.items():
            this = Command()
            done = perform(this, verb, jobs[name], folder / name)
            assert isinstance(done, dlama.Completion)
            this.report_completion(done, output / name, jobs[name])
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
